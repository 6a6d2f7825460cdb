"""Convert: from any colour space to any other.

Truth: the definitions of the two spaces in float64, by way of what they are both defined by, XYZ at the latest.
`source` is what the picture's numbers mean: unless given, what the picture says (sRGB, or linear light with BT.709
primaries). The first channels are the colour (one for luminance, four for CMYK); those that follow pass unchanged.

Scales: RGB, XYZ, CMY(K) and luminance have 1 at white; L* 100; Oklab 1; hues are degrees in [0, 360). YCbCr and YIQ
have colour differences about 0, and `narrow` the 8-bit codes 16 to 235 (240) over 255. HSV, HSL, CMY, CMYK, YIQ and
YCbCr of BT.601 and BT.709 are of sRGB's values, as files hold them; YCbCr of BT.2020 of that standard's. CMYK is the
simple model: black is what the three inks have in common. XYZ, xyY, L*a*b*, L*u*v*, LCh and luminance are relative to
`white`; RGB spaces and Oklab have their own. Luminance is Y, what cones see; luminance_scotopic what rods see, a
weighted sum of X, Y and Z that is 1 at white, too. bt2100_pq is BT.2020's light as a signal of SMPTE ST 2084, with
linear 1 at 203 cd/m2. Between whites colours are adapted, unless `adaptation` is none.

Beyond the standards' domains nothing is clipped. Curves are mirrored for negative values (f(-x) = -f(x)); the line of
lightness near black goes on. Grey has hue 0, and so has what is as good as grey (a range of 2^-20 in HSV and HSL, a
chroma of 1e-5 of lightness, or of white's if that is more): below that, hue is noise. Black has the chromaticity of
white, saturation 0 and no ink but black. NaN makes every channel NaN that depends on it.

Oklab's matrices are moved by less than 2e-4 so that white and grey are achromatic.

Methods: `single` takes all steps in float32 in one pass, `fitted` does so with polynomials for curves; `double`
evaluates the definitions in float64.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Image, Space
from lichen.memory import Array, aligned, aligned_empty
from lichen.once import latest
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    Rate,
)
from lichen.operations.colour.convert_cases import CASES, EXAMPLES
from lichen.operations.colour.convert_walk import (
    DEGREES,
    MEANT,
    STATED,
    Parameters,
    held,
    inside,
    models_of,
    steps_of,
    walked,
)
from lichen.operations.colour.fitted_steps import Fitted
from lichen.operations.colour.spaces import Model
from lichen.operations.colour.stages import FLOAT_MAX, TINY, Linear, Mixed, Planes, Scalar

if TYPE_CHECKING:
    from lichen.opencl.device import Device

BLOCK = 1 << 13
"""Pixels of a block of NumPy's work: its planes stay in cache."""


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image = facts["image"]
    if p.source is None and image.space not in STATED:
        return [Flaw("/parameters/source", "is required: the image does not say what its numbers mean")]
    source = models_of(p, image.space)[0]
    colours = image.channels - (image.alpha is not Alpha.NONE)
    if colours < source.channels:
        return [Flaw("/inputs/image", f"has {colours} colour channel(s), and {source} has {source.channels}")]
    if source.channels == 1 and colours > 2:
        return [Flaw("/inputs/image", f"has {colours} colour channels, and {source} has 1")]
    return []


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    return None if steps_of(p, facts["image"].space) else "source and target are the same"


_exactly = latest(walked)


def _passing(p: Parameters, facts: Facts) -> bool:
    return facts.channels > models_of(p, facts.space)[0].channels


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    space = MEANT.get(p.target, Space.DATA)
    if _identity(p, facts):
        return Facts(image.height, image.width, image.channels, space, image.alpha, image.extent)
    source, target = models_of(p, image.space)
    walk = _exactly(p, image)
    passing = [(image.extent.low, image.extent.high)] if _passing(p, image) else []
    intervals, slack = [*walk.intervals, *passing], walk.error
    low, high = min(low for low, _ in intervals) - slack, max(high for _, high in intervals) + slack
    if target.polar:
        low = min(low, 0.0)
    channels = image.channels - source.channels + target.channels
    known = inside(p, image) and max(abs(low), abs(high)) < FLOAT_MAX and not image.extent.nonfinite
    extent = Extent(max(low, -FLOAT_MAX), min(high, FLOAT_MAX), 0 if known else image.pixels * channels)
    return Facts(image.height, image.width, channels, space, image.alpha, extent)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """With coverage a, colours count multiplied by it: |c' - c| a' is at most (1 + |c|) times the error, and so on
    through the conversion, whose result is weighted again."""
    image = facts["image"]
    if image.alpha is Alpha.NONE:
        return max(walked(p, image, error).error, error * _passing(p, image))
    far = min(_result(p, facts).extent.magnitude, FLOAT_MAX)
    return max(walked(p, image, (1 + image.extent.magnitude) * error).error + far * error, error)


convert = Operation(
    name="convert",
    family="colour",
    summary="Converts pictures from one colour space to another.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "the picture; channels after its colours pass unchanged"),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    result=_result,
    propagate=_propagate,
    wants_alpha=Alpha.STRAIGHT,
    check=_check,
    customary=("single", None),
    examples=EXAMPLES,
    hard_cases=CASES,
)

# ------------------------------------------------------------------------------------------------------------ bodies


def evaluate(image: Image, p: Parameters, dtype: type[np.floating], degree: int = 0) -> Array:
    """Every step in `dtype`, in blocks whose planes stay in cache; the result has the same precision."""
    source, target = models_of(p, image.space)
    steps = steps_of(p, image.space, degree)
    shape = (image.height, image.width, image.channels - source.channels + target.channels)
    out = aligned_empty(shape, dtype)
    flat, result = image.pixels.reshape(-1, image.channels), out.reshape(-1, shape[2])
    with np.errstate(all="ignore"):
        for start in range(0, len(flat), BLOCK):
            block, made = flat[start : start + BLOCK], result[start : start + BLOCK]
            planes: Planes = [block[:, c].astype(dtype) for c in range(source.channels)]
            for step in steps:
                planes = step.run(planes)
            for c, plane in enumerate(planes):
                made[:, c] = plane
            made[:, target.channels :] = block[:, source.channels :]
    return out


@convert.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """The steps of stages.py and coordinates.py, which print the definitions."""
    return evaluate(inputs["image"], p, np.float64)


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Steps per pixel, a power for three channels counting as four."""
    costs = {Scalar: 4.0, Linear: 1.0, Mixed: 4.0}
    return facts["image"].pixels * (3 + sum(costs[type(step)] for step in steps_of(p, facts["image"].space)))


def _single_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = _exactly(p, facts["image"]).error
    nominal = 360.0 if p.target.polar else 100.0 if p.target in (Model.LAB, Model.LUV) else 1.0
    vague = value > 1e-3 * nominal
    return Error(value, "estimate", rounding=value, typical=4e-7 * nominal if vague else None)


def _single_unfit(p: Parameters, facts: InputFacts) -> str | None:
    if inside(p, facts["image"]):
        return None
    return "values this large leave the range of float32 on the way"


def launch(device: Device, image: Image, p: Parameters, degree: int = 0) -> Array:
    """The conversion by convert.cl, its steps written out as calls. Planes that are alike, as those of grey light are,
    go through curves as one."""
    source, target = models_of(p, image.space)
    numbers: list[float] = []
    calls, planes, alike = [], source.channels, 1
    for step in steps_of(p, image.space, degree):
        if alike > 1 and isinstance(step, Linear | Mixed):
            calls.append(_repeated(alike))
            planes, alike = alike, 1
        if isinstance(step, Linear):
            rows = np.array(step.numbers, np.float32).reshape(-1, 5)[: len(step.matrix)]
            alike = len(rows) if (rows == rows[0]).all() else 1
            calls.append(f"linear(v, k + {len(numbers)}, {planes}, {len(rows) // alike}, {step.present});")
            planes = len(rows) // alike
        elif isinstance(step, Fitted):
            layout = f"{step.found.roots}, {step.found.shift}, {step.found.degree}"
            calls.append(f"FITTED({step.exact.name}, (k + {len(numbers)}), {planes}, {layout})")
        else:
            calls.append(f"{step.name}(v, k + {len(numbers)}, {planes});")
        numbers += step.numbers
    calls.append(_repeated(alike))
    pixels = image.height * image.width
    origin = aligned(image.pixels)
    out = aligned_empty((image.height, image.width, image.channels - source.channels + target.channels))
    defines: dict[str, int | float | str] = {
        "IN": image.channels, "OUT": out.shape[2], "READ": source.channels, "MADE": target.channels,
        "PATH": " ".join(calls),
    }  # fmt: skip
    with device.session() as session:
        session.sweep(
            "colour/convert.cl", "convert", -(-pixels // 16),
            origin, session.write(out), aligned(np.array([*numbers, 0.0], np.float32)), np.int32(pixels),
            defines=defines,
        )  # fmt: skip
    return out


def _repeated(planes: int) -> str:
    """As many planes like the first, as the kernel says it."""
    return " ".join(f"v[{c}] = v[0];" for c in range(1, planes))


@convert.method(
    "single",
    error=_single_error,
    work=_work,
    rates={"opencl": Rate(3e-4, 3e-10), "numpy": Rate(1e-4, 2.2e-9)},
    unfit=_single_unfit,
)
class Single:
    """All steps in float32 in one pass over the picture. Where a coordinate can jump, as a hue can next to grey, the
    error stated is the jump, and the typical one beside it what is to be expected."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return launch(device, inputs["image"], parameters)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return evaluate(inputs["image"], parameters, np.float32)


def _fitted_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value, rounding = (walked(p, facts["image"], degree=round(knob), bare=bare).error for bare in (False, True))
    alone = _single_error(p, 0.0, facts).typical
    return Error(value, "estimate", rounding, None if alone is None else alone + (value - rounding))


def _fitted_unfit(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    if not any(isinstance(step, Fitted) for step in steps_of(p, image.space, DEGREES[0])):
        return "no curve on the way is quicker as polynomials"
    if not held(p, image):
        return "what lies beyond 1 before a curve is computed"
    return _single_unfit(p, facts)


def _fitted_work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Of `single`, a power as polynomials counting as a third."""
    steps = steps_of(p, facts["image"].space, DEGREES[0])
    saved = sum(isinstance(step, Fitted) for step in steps)
    return _work(p, 0.0, facts) - facts["image"].pixels * saved * (3.2 - 0.1 * knob)


@convert.method(
    "fitted",
    error=_fitted_error,
    work=_fitted_work,
    rates={"opencl": Rate(3e-4, 3e-10), "numpy": Rate(1e-4, 8e-9)},
    knob=Knob("degree", DEGREES, "degree of the polynomials", DEGREES[0], DEGREES[-1]),
    orderly=True,
    unfit=_fitted_unfit,
)
class ByPolynomials:
    """As `single`, the curves of sRGB, BT.2020 and PQ's signal as four polynomials each, for values up to 1."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return launch(device, inputs["image"], parameters, round(knob))

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return evaluate(inputs["image"], parameters, np.float32, round(knob))


def _double_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    far = _result(p, facts).extent.magnitude
    value = min(1.001 * ROUNDING * far, FLOAT_MAX) + TINY
    return Error(value, "bound", rounding=value)


@convert.method(
    "double",
    error=_double_error,
    work=_work,
    rates={"opencl": Rate(1e-4, 4.2e-9), "numpy": Rate(1e-4, 4.2e-9)},
)
class Double:
    """The definitions in float64 on the host, rounded once: for what float32 cannot hold on the way, and for hues and
    quotients that must be right to the last place."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return Double.numpy(inputs, parameters, knob)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        with np.errstate(over="ignore"):
            return aligned(evaluate(inputs["image"], parameters, np.float64), np.float32)
