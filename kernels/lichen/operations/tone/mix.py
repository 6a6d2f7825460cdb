"""Mix: interpolation between two pictures, and extrapolation beyond them.

Truth: y = (1 - a) base + a image, for an amount a; 0 gives the base and 1 the image, values between them blend and
values outside exaggerate. A weight of zero takes nothing, not even NaN.

The base is a second picture, or made of the first (Haeberli and Voorhies), in scene-linear light:

* brightness: black; above 1 is brighter.
* contrast: the grey of the image's average luminance; above 1 is more contrast, below 1 less.
* saturation: each pixel's luminance; 0 is black and white, above 1 more colour, -1 the complement at equal luminance.
* sharpen: the image blurred by a Gaussian of `sigma`; above 1 is an unsharp mask, below 1 a blur.

Brightness, contrast and saturation leave coverage as it is: black and grey are multiplied by it, and the average is
that of the light over the coverage, limited to sixteen times the largest value. Two pictures, and sharpening, take
coverage as a channel like the others, so that the result over any plain ground is what the same mixing makes of the
pictures over that ground.

Range. With s = max(|1 - a|, |a|) the weights divided by s lie in [-1, 1], so s ((1 - a)/s base + a/s image) overflows
only where the result does. The average is taken over finite pixels; one that is not would make all of the image so.

Source: P. Haeberli and D. Voorhies, Image Processing by Linear Interpolation and Extrapolation, IRIS Universe 28, 1994;
McReynolds and Blythe, Advanced Graphics Programming Using OpenGL, 2005, section 12.2.1, whose sentence that moving
towards grey raises contrast is the wrong way round.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from lichen.errors import Flaw
from lichen.image import Alpha, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    WHOLE,
    Border,
    Error,
    Facts,
    Footprint,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    Rate,
)
from lichen.operations.convolution import gaussian as blur
from lichen.operations.tone.mix_base import MOST, Parameters, Preset, average, made
from lichen.operations.tone.mix_cases import CASES
from lichen.operations.tone.pointwise import FLOAT_MAX, blockwise, launch_flat, spanned

if TYPE_CHECKING:
    from lichen.opencl.device import Device


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, base = facts["image"], facts.get("base")
    flaws = []
    if p.preset is None and base is None:
        flaws.append(Flaw("/inputs/base", "is needed where no preset makes one of the image"))
    if p.preset is not None and base is not None:
        flaws.append(Flaw("/inputs/base", f"has no part in preset={p.preset}"))
    if base is not None and (base.height, base.width, base.channels) != (image.height, image.width, image.channels):
        shapes = [f"{each.width}x{each.height}, {each.channels} channel(s)" for each in (base, image)]
        flaws.append(Flaw("/inputs/base", f"is {shapes[0]}; the image is {shapes[1]}"))
    if min(p.weights) < 0 or abs(sum(p.weights) - 1) > 1e-3:
        flaws.append(Flaw("/parameters/weights", "must not be negative and must sum to 1"))
    colours = image.channels - (image.alpha is not Alpha.NONE)
    if p.preset in (Preset.CONTRAST, Preset.SATURATION) and colours not in (1, 3):
        flaws.append(Flaw("/parameters/preset", f"{p.preset} needs 1 or 3 colour channels; the image has {colours}"))
    return flaws


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    colours = facts["image"].channels - (facts["image"].alpha is not Alpha.NONE)
    if p.amount == 1:
        return "the amount is 1"
    plain = colours == 1 and not facts["image"].extent.nonfinite and p.amount in (0.0, 1.0)
    return "one channel has no colour" if p.preset is Preset.SATURATION and plain else None


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    if p.preset is Preset.CONTRAST and p.of_base:
        return WHOLE
    if p.preset is Preset.SHARPEN:
        return blur.gaussian.footprint(p.blur, facts)
    return POINTWISE


def _base(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    """Range of the base, by channel values; luminance is a mean of what it is made of."""
    # Facts are asked for before the inputs are checked, so a base that is needed may not be there yet.
    extent = (facts.get("base", facts["image"]) if p.preset is None else facts["image"]).extent
    low, high = extent.low, extent.high
    if p.preset is Preset.BRIGHTNESS:
        return 0.0, 0.0
    if p.preset is Preset.CONTRAST and facts["image"].alpha is not Alpha.NONE:
        most = min(MOST * extent.magnitude * max(extent.magnitude, 1.0), FLOAT_MAX)
        return -most, most
    if p.preset is Preset.SHARPEN and p.border is Border.CONSTANT:
        low, high = min(low, 0.0), max(high, 0.0)
    return low, high


def _terms(p: Parameters, facts: InputFacts) -> float:
    """|1 - a| |base| + |a| |image| at most: what roundings are relative to."""
    base = max(map(abs, _base(p, facts))) if p.of_base else 0.0
    return min(abs(p.of_base) * base + abs(p.amount) * facts["image"].extent.magnitude, FLOAT_MAX)


def _rounding(p: Parameters, facts: InputFacts) -> float:
    return 8 * ROUNDING * _terms(p, facts)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = _rounding(p, facts)
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    if _identity(p, facts):
        return image
    low, high = _base(p, facts)
    if not p.of_base:
        low = high = 0.0
    from_image = sorted((p.amount * image.extent.low, p.amount * image.extent.high))
    from_base = sorted((p.of_base * low, p.of_base * high))
    bad = image.extent.nonfinite + (facts["base"].extent.nonfinite if "base" in facts else 0)
    if bad and p.preset is not Preset.BRIGHTNESS:
        bad = image.samples
    slack = _rounding(p, facts)
    extent = spanned(image, from_image[0] + from_base[0], from_image[1] + from_base[1], slack, nonfinite=bad)
    return dataclasses.replace(image, extent=extent)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """Every base but the average of an image with coverage is a mean of the image, or another picture."""
    if p.preset is Preset.BRIGHTNESS:
        return max(abs(p.amount), 1.0) * error
    if p.preset is Preset.CONTRAST and p.of_base and facts["image"].alpha is not Alpha.NONE:
        return _result(p, facts).extent.spread
    return max(abs(p.of_base) + abs(p.amount), 1.0) * error


def _departure(p: Parameters, facts: InputFacts) -> dict[str, float]:
    """(1 - a) (base - image) from the image, a (image - base) from a base that is a picture."""
    (low, high), extent = _base(p, facts), facts["image"].extent
    apart = max(high - extent.low, extent.high - low)
    found = {"image": abs(p.of_base) * apart}
    return {**found, "base": abs(p.amount) * apart} if "base" in facts else found


# -------------------------------------------------------------------------------------------------------- operation

mix = Operation(
    name="mix",
    family="tone",
    summary="Blends two pictures or exaggerates their difference: brightness, contrast, saturation and sharpness.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "the picture at amount 1"),
        Input("base", "the picture at amount 0, of the same size and channels", required=False),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=_footprint,
    identity=_identity,
    departure=_departure,
    result=_result,
    propagate=_propagate,
    check=_check,
    examples=(
        {"preset": "brightness", "amount": 1.3},
        {"preset": "contrast", "amount": 1.5},
        {"preset": "saturation", "amount": 1.8},
        {"preset": "sharpen", "amount": 2.0, "sigma": 1.5},
        {"preset": "saturation", "amount": -1.0},
        {"preset": "contrast", "amount": 0.25},
        {"preset": "sharpen", "amount": 0.5, "sigma": 12.0},
        {"preset": "saturation", "amount": 0.0},
    ),
    hard_cases=CASES,
)


# ------------------------------------------------------------------------------------------------------------ truth


@mix.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    result = image.pixels.copy()
    if p.amount == 1:
        return result
    if p.preset is None:
        base = inputs["base"].pixels
    elif p.preset is Preset.SHARPEN:
        base = blur.truth({"image": image}, p.blur)
    else:
        base = made(image, p)
    mixed = result[..., : base.shape[2]]
    with np.errstate(all="ignore"):
        mixed[...] = p.of_base * base + (p.amount * mixed if p.amount else 0.0)
    return result


# ---------------------------------------------------------------------------------------------------------- methods


def _weights(p: Parameters) -> Array:
    return aligned(np.array([p.of_base / p.scale, p.amount / p.scale, p.scale, *p.weights], dtype=np.float32))


def _defines(p: Parameters) -> dict[str, int]:
    return {"NONE_OF_BASE": int(p.of_base == 0), "NONE_OF_IMAGE": int(p.amount == 0)}


def _pictures_opencl(device: Device, image: Image, base: Array, p: Parameters) -> Array:
    plain = image.replace(alpha=Alpha.NONE)
    return launch_flat(device, "tone/mix.cl", "pictures", plain, aligned(base), _weights(p), defines=_both(p))


def _both(p: Parameters) -> dict[str, int]:
    return {**_defines(p), "CHANNELS": 3}


def _mixed(p: Parameters, base: Array, image: Array) -> Array:
    b, a, s = (np.float32(w) for w in (p.of_base / p.scale, p.amount / p.scale, p.scale))
    if not p.of_base:
        return image
    if not p.amount:
        return base
    result: Array = (base * b + image * a) * s
    return result


def _pictures_numpy(image: Image, base: Array, p: Parameters) -> Array:
    out = aligned_empty(image.pixels.shape)
    with np.errstate(all="ignore"):
        out[...] = _mixed(p, base, image.pixels)
    return out


def _unfit(p: Parameters, facts: InputFacts) -> str | None:
    return "sharpening needs a blur" if p.preset is Preset.SHARPEN else None


@mix.method(
    "direct",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples * (3.0 if p.preset is Preset.CONTRAST else 1.0),
    rates={"opencl": Rate(2e-4, 2.2e-10), "numpy": Rate(1e-4, 1.2e-9)},
    unfit=_unfit,
)
class Direct:
    """Two products and a sum for each sample, in the order that cannot overflow."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        if p.preset is None:
            return _pictures_opencl(device, image, inputs["base"].pixels, p)
        if p.preset is Preset.SATURATION and image.colours == 3:
            return _luminance_opencl(device, image, p)
        if p.preset is Preset.SATURATION:
            return _pictures_opencl(device, image, image.pixels, p)
        value = average(image, p.weights) if p.preset is Preset.CONTRAST else 0.0
        covered = p.preset is Preset.CONTRAST and image.alpha is not Alpha.NONE
        defines = {**_both(p), "COVERED": int(covered)}
        return launch_flat(device, "tone/mix.cl", "grey", image, _weights(p), np.float32(value), defines=defines)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        if p.preset is None:
            return _pictures_numpy(image, inputs["base"].pixels, p)
        if p.preset is Preset.CONTRAST:
            value = np.float32(average(image, p.weights))
            if image.alpha is Alpha.NONE:
                return blockwise(image, lambda x: _mixed(p, np.broadcast_to(value, x.shape), x))
            out = image.pixels.copy()
            colour, coverage = image.pixels[..., :-1], image.pixels[..., -1:]
            out[..., :-1] = _mixed(p, np.broadcast_to(value * coverage, colour.shape), colour)
            return aligned(out)
        if p.preset is Preset.BRIGHTNESS:
            return blockwise(image, lambda x: _mixed(p, np.zeros_like(x), x))
        weights = np.array(p.weights if image.colours == 3 else [1.0], dtype=np.float32)
        return blockwise(image, lambda x: _mixed(p, np.broadcast_to((x @ weights)[..., None], x.shape), x))


def _luminance_opencl(device: Device, image: Image, p: Parameters) -> Array:
    pixels = aligned(image.pixels)
    out, count = aligned_empty(pixels.shape), image.height * image.width
    with device.session() as session:
        session.launch(
            "tone/mix.cl", "luminance", (-(-count // 64),),
            pixels, session.write(out), _weights(p), np.uint64(count),
            defines={**_defines(p), "CHANNELS": image.channels},
        )  # fmt: skip
    return out


def _with_blur(method: str) -> type:
    """Register a method that sharpens with one of the blur's."""
    blurred = blur.gaussian.methods[method]

    def error(p: Parameters, tail: float, facts: InputFacts) -> Error:
        own, made = _rounding(p, facts), blurred.error(p.blur, tail, facts)
        weight = abs(p.of_base)
        return Error(weight * made.value + own, made.kind, weight * made.rounding + own)

    def unfit(p: Parameters, facts: InputFacts) -> str | None:
        if p.preset is not Preset.SHARPEN:
            return "nothing is blurred"
        return blurred.unfit(p.blur, facts)

    @mix.method(
        method,
        error=error,
        work=lambda p, tail, facts: blurred.work(p.blur, tail, facts),
        rates={name: Rate(rate.start * 1.5, rate.step * 1.15) for name, rate in blurred.rates.items()},
        knob=Knob("tail", (1e-2, 1e-4, 1e-6, 1e-7), "weight that the blur cuts off", 1e-9, 0.5, rising=False),
        unfit=unfit,
    )
    class Sharpen:
        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: Parameters, tail: float) -> Array:
            base = blurred.implementation.opencl(device, inputs, p.blur, tail)
            return _pictures_opencl(device, inputs["image"], base, p)

        @staticmethod
        def numpy(inputs: Inputs, p: Parameters, tail: float) -> Array:
            base = blurred.implementation.numpy(inputs, p.blur, tail)
            return _pictures_numpy(inputs["image"], base, p)

    mix.methods[method] = dataclasses.replace(
        mix.methods[method], description=f"Sharpens with the Gaussian blur's {method}: {blurred.description}"
    )
    return Sharpen


FIR, DCT = _with_blur("fir"), _with_blur("dct")
