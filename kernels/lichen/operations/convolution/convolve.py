"""Convolution with any kernel, given as a matrix or by name.

Truth: with k[i, j] the kernel, (a, b) its anchor and f the image continued by `border`,

    convolution   out[y, x] = bias + sum of k[i, j] f[y - i + a, x - j + b]
    correlation   out[y, x] = bias + sum of k[i, j] f[y + i - a, x + j - b]

where k is first divided by its sum if `normalise` is set, and multiplied by `scale`. Kernels by name are masks: they
are laid on the image as they are written, whatever the mode. `kernels` gives every channel its own. Where pixels are
left out (`mask`, `missing`), the result is the bias plus the kernel's sum times the weighted mean of the others.

Methods:

* `direct` multiplies and adds for every tap that is not zero.
* `separable` writes the kernel as a sum of columns times rows by its singular values, as many as leave at most
  `tolerance` of its l1 norm, each two passes. The taps left out, d, change a result by at most
  |sum d| |m| + sum |d| (range / 2) about the middle m of the input's range, which is proved.
* `fft` multiplies spectra in doubles: for kernels whose size forbids anything else. It leaves images with NaN or
  infinity to the others where they can take the kernel, and else sets them apart (see `transform`).

Sources: McReynolds and Blythe, Advanced Graphics Programming Techniques Using OpenGL (1998), 12.3; Treitel and Shanks,
The design of multistage separable planar filters, IEEE Trans. Geoscience Electronics 9 (1971).
"""

from __future__ import annotations

from collections.abc import Callable

from lichen.image import Alpha, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import Border, Input, InputFacts, Inputs, Knob, Light, Operation, Rate
from lichen.operations.convolution import convolve_base as base
from lichen.operations.convolution import lowrank
from lichen.operations.convolution.convolve_base import Parameters, mean_stencil, stencil
from lichen.operations.convolution.convolve_cases import CASES
from lichen.operations.convolution.kernels import separated
from lichen.operations.convolution.missing import MASK, leaves_out, renormalised, renormalised_opencl
from lichen.operations.convolution.stencil import (
    SOURCE,
    TAILED,
    correlate_numpy,
    correlate_opencl,
    kept_coverage,
    sum_of_taps,
)
from lichen.operations.convolution.transform import correlated_by_transform
from lichen.stage import Head, Tail

# -------------------------------------------------------------------------------------------------------- operation


convolve = Operation(
    name="convolve",
    family="convolution",
    summary="Convolution or correlation with any kernel, given as a matrix or by name.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"), MASK),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=base.footprint,
    identity=base.identity,
    result=base.result,
    propagate=base.propagate,
    check=base.check,
    examples=(
        {"kernel": [[1, 2, 3], [0, -4, 1.5], [2, 0.5, -1]], "scale": 0.25},
        {"name": "disc", "radius": 4.5, "border": "reflect101"},
        {"kernels": [[[1, 2, 1]], [[1], [2]], [[0, 1, 0], [1, -4, 1], [0, 1, 0]]], "scale": 0.25, "border": "wrap"},
        {"name": "line", "length": 9, "angle": 30, "border": "clamp"},
        {"name": "emboss", "coverage": "kept", "border": "constant", "value": 0.25},
        {"kernel": [[1, 2], [3, 4], [5, 6]], "mode": "correlation", "anchor": [0, 2], "normalise": True, "bias": 0.5},
        {"name": "disc", "radius": 2.5, "missing": "inside"},
    ),
    hard_cases=CASES,
    description=__doc__ or "",
)


def _finish(inputs: Inputs, p: Parameters, out: Array) -> Array:
    return kept_coverage(inputs["image"], out) if p.coverage == "kept" else out


Body = Callable[[Inputs, Parameters], Array]


def _by_channel(inputs: Inputs, p: Parameters, body: Body) -> Array:
    """All channels at once, or each by its own kernel; then the image's own coverage, where that is wanted."""
    image = inputs["image"]
    if p.kernels is None:
        out = body(inputs, p)
    else:
        out = aligned_empty(image.pixels.shape, image.pixels.dtype)
        for channel, kernel in enumerate(p.kernels):
            plane = Image(aligned(image.pixels[..., channel : channel + 1], image.pixels.dtype))
            single = p.model_copy(update={"kernel": kernel, "kernels": None})
            out[..., channel : channel + 1] = body({**inputs, "image": plane}, single)
    return kept_coverage(image, out) if p.coverage == "kept" else out


@convolve.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    def body(inputs: Inputs, p: Parameters) -> Array:
        if not leaves_out(p.missing, inputs):
            return sum_of_taps(inputs["image"].pixels, stencil(p), p.border, p.value)
        whole, total = mean_stencil(p)

        def mean(pixels: Array, border: Border, value: float) -> Array:
            return sum_of_taps(pixels, whole, border, value)

        return total * renormalised(inputs, p.missing, p.border, p.value, mean) + p.bias

    return _by_channel(inputs, p, body)


def _head(p: Parameters, knob: float, facts: InputFacts) -> Head | None:
    if p.kernels is not None or p.coverage == "kept" or leaves_out(p.missing, facts):
        return None
    taps = stencil(p)
    if max(taps.taps.shape) > TAILED:
        return None

    def run(device: Device, inputs: Inputs, tail: Tail) -> Array:
        return correlate_opencl(device, inputs["image"], taps, p.border, p.value, tail)

    return Head(SOURCE, run)


@convolve.method(
    "direct",
    head=_head,
    scratch=0.1,
    error=base.worst(base.direct_error),
    work=base.total(base.direct_work),
    rates={"opencl": Rate(4e-4, 1.4e-11), "numpy": Rate(2e-4, 1.2e-10)},
    unfit=base.none_of(base.direct_unfit),
)
class Direct:
    """One multiply-add for every tap that is not zero."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        def body(inputs: Inputs, p: Parameters) -> Array:
            if not leaves_out(p.missing, inputs):
                return correlate_opencl(device, inputs["image"], stencil(p), p.border, p.value)
            whole, total = mean_stencil(p)

            def mean(pixels: Array, border: Border, value: float) -> Array:
                return correlate_opencl(device, Image(pixels), whole, border, value)

            return _scaled(renormalised_opencl(device, inputs, p.missing, p.border, p.value, mean), total, p.bias)

        return _by_channel(inputs, p, body)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        def body(inputs: Inputs, p: Parameters) -> Array:
            if not leaves_out(p.missing, inputs):
                return correlate_numpy(inputs["image"], stencil(p), p.border, p.value)
            whole, total = mean_stencil(p)

            def mean(pixels: Array, border: Border, value: float) -> Array:
                return correlate_numpy(Image(pixels), whole, border, value)

            return _scaled(renormalised(inputs, p.missing, p.border, p.value, mean), total, p.bias)

        return _by_channel(inputs, p, body)


def _scaled(means: Array, total: float, bias: float) -> Array:
    """The kernel's sum times the means, plus the bias, in place."""
    if total != 1:
        means *= means.dtype.type(total)
    if bias:
        means += means.dtype.type(bias)
    return means


@convolve.method(
    "separable",
    scratch=1.1,
    knob=Knob("tolerance", (0.1, 0.03, 1e-2, 1e-3, 1e-6), "share of the kernel's l1 norm that is left out", 0.0, 0.5),
    error=base.worst(base.separable_error),
    work=base.total(base.separable_work),
    lightest=base.total(base.separable_lightest),
    rates={"opencl": Rate(6e-4, 1.4e-11), "numpy": Rate(3e-4, 1e-10)},
    unfit=base.none_of(base.separable_unfit),
)
class Separable:
    """Two passes for each of the few columns times rows that make up the kernel."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, tolerance: float) -> Array:
        def body(inputs: Inputs, p: Parameters) -> Array:
            passes = _passes(p, tolerance)
            return lowrank.summed_opencl(device, inputs["image"].pixels, passes, p.border, p.value)

        return _by_channel(inputs, p, body)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, tolerance: float) -> Array:
        def body(inputs: Inputs, p: Parameters) -> Array:
            return lowrank.summed_numpy(inputs["image"].pixels, _passes(p, tolerance), p.border, p.value)

        return _by_channel(inputs, p, body)


def _passes(p: Parameters, tolerance: float) -> lowrank.Passes:
    whole = stencil(p)
    return lowrank.passes(separated(whole.taps, tolerance)[0], whole.top, whole.left, p.bias, p.value)


@convolve.method(
    "fft",
    scratch=4.3,
    error=base.worst(base.fft_error),
    work=base.total(base.fft_work),
    rates={"opencl": Rate(1e-3, 1.1e-8), "numpy": Rate(1e-3, 1.1e-8)},
    unfit=base.none_of(base.fft_unfit),
)
class Fft:
    """The product of spectra in doubles, on the processor; its time hardly depends on the kernel."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return Fft.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        def body(inputs: Inputs, p: Parameters) -> Array:
            return correlated_by_transform(inputs["image"].pixels, stencil(p), p.border, p.value)

        return _by_channel(inputs, p, body)
