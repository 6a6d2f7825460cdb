"""Gaussian blur.

Truth: the image, continued by `border`, convolved along rows and along columns with the sampled Gaussian
exp(-k^2 / 2 sigma^2), normalised so that its sum over all integers k is 1. `sigma_x` and `sigma_y` set the two widths
apart. With `angle` the axes they belong to are turned, and the image is convolved with the sampled
exp(-u^2 / 2 sigma_x^2 - v^2 / 2 sigma_y^2), u and v being the turned coordinates, normalised alike. Where pixels are
left out (`mask`, `missing`), the kernel ends at 4 sigma and the weights of the others make up for theirs (`missing`).

Methods, cheapest first where the blur is wide:

* `box3` runs three means in a row over each line; of whole pixels, or `extended` by parts of pixels, which gives
  exactly the variance wanted. Nobody would call the result accurate; it is what many programs give.
* `deriche` and `vliet-young` run recursions along each line from both ends, in time that hardly depends on sigma. Their
  response is compared with the Gaussian sample by sample, which proves a bound; it holds at the edges too, since the
  states that a line begins with are what they would be, had they run over the continued image for ever. `order` and
  `poles` say of how many damped waves the response is made.
* `fir` cuts the kernel where the weight left outside is at most `tail` and normalises what remains. Both kernels sum
  to 1, so one pass is wrong by at most the weight cut off times the spread of the input, and two passes by twice that.
  Where the kernel is longer than the image the taps are folded onto the image by the border rule, which is exact and
  bounds the work. A kernel with turned axes becomes a sum of columns times rows that leaves at most `tail` of it.
* `fft`, for turned axes, multiplies spectra, so that its time hardly depends on the kernel.
* `multirate` is two narrower Gaussians down the image, of the first of which every s-th row is kept, and `fir` along
  those few rows. The wider the blur, the fewer there are; the work hardly depends on it.
* `dct`, for the reflecting border: the cosine transform diagonalises a symmetric kernel there, and a wide Gaussian
  passes only low frequencies. The transform is computed for those K modes alone, as two thin matrix products, so the
  work *falls* as sigma grows and any image size is as good as another. Its eigenvalues are sums of Gaussians by
  Poisson's formula, so nothing is truncated but the modes; each mode dropped costs at most its eigenvalue times the
  spread of the input.

Sources: Getreuer, A Survey of Gaussian Convolution Algorithms, IPOL 3 (2013); Martucci, Symmetric convolution and the
discrete sine and cosine transforms, IEEE Trans. Signal Processing 42 (1994) for the symmetries; those of the modules
`recursive_filters`, `boxes`, `multirate`, `gaussian_turned` and `missing`.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from lichen.image import Alpha, Extent, Image
from lichen.memory import Array
from lichen.opencl.device import Device
from lichen.operation import Border, Facts, Footprint, Input, InputFacts, Inputs, Knob, Light, Operation, Rate
from lichen.operations.convolution import gaussian_base as base
from lichen.operations.convolution import gaussian_recursions as recursions
from lichen.operations.convolution import gaussian_turned, missing, multirate
from lichen.operations.convolution.boxes import boxes_numpy, boxes_opencl
from lichen.operations.convolution.gaussian_base import Parameters, masked_radius
from lichen.operations.convolution.gaussian_cases import CASES
from lichen.operations.convolution.gaussian_dct import dct_numpy, dct_opencl
from lichen.operations.convolution.gaussian_weights import (
    MOST_TAIL,
    fir_radius,
    fir_weights,
    half_kernel,
    middle,
    reach_of,
)
from lichen.operations.convolution.passes import (
    SOURCE,
    Vector,
    folded,
    rows_laid_out,
    separable_numpy,
    separable_opencl,
)
from lichen.operations.convolution.recursive import recursive_numpy, recursive_opencl
from lichen.stage import Head, Tail

__all__ = ["Parameters", "gaussian"]


def _result(p: Parameters, facts: InputFacts) -> Facts:
    """A mean of the input's values and of what lies beyond a constant border."""
    image = facts["image"]
    extent = image.extent
    if p.border is Border.CONSTANT:
        extent = Extent(min(extent.low, p.value), max(extent.high, p.value), extent.nonfinite)
    return dataclasses.replace(image, extent=missing.extent_without(facts, extent))


def _departure(p: Parameters, facts: InputFacts) -> dict[str, float]:
    """All but the weight of the pixel itself goes to others, which differ from it by the spread at most. Nothing is
    said where pixels are left out: where none remains there is no mean."""
    if missing.leaves_out(p.missing, facts):
        return {}
    own = 0.0 if p.turned else math.prod(map(middle, p.deviations))
    return {"image": (1 - own) * base.spread(p, facts)[0]}


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    """As far as the kernel changes anything in float64."""
    image, turned = facts["image"], p.turned
    if turned is not None:
        rows, columns = turned.radii
    elif missing.leaves_out(p.missing, facts):
        rows, columns = (masked_radius(sigma) for sigma in p.deviations)
    else:
        rows, columns = map(reach_of, p.deviations)
    return Footprint(min(rows, image.height), min(columns, image.width), wraps=p.border is Border.WRAP)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    plain = max(p.deviations) == 0 and not missing.leaves_out(p.missing, facts)
    return "sigma is 0" if plain else None


def _weights(p: Parameters) -> tuple[Vector, Vector]:
    """Down and across, where pixels are left out."""
    halves = [half_kernel(sigma)[: masked_radius(sigma) + 1] for sigma in p.deviations]
    down, across = (np.concatenate([half[:0:-1], half]) for half in halves)
    return down / down.sum(), across / across.sum()


# -------------------------------------------------------------------------------------------------------- operation


gaussian = Operation(
    name="gaussian",
    family="convolution",
    summary="Gaussian blur of any width, with a stated error.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"), missing.MASK),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=_footprint,
    departure=_departure,
    result=_result,
    identity=_identity,
    check=base.check,
    examples=(
        {"sigma": 1.5},
        {"sigma": 6.0, "border": "reflect101"},
        {"sigma": 2.5, "border": "constant", "value": 0.25},
        {"sigma": 3.0, "border": "wrap"},
        {"sigma": 40.0, "border": "clamp"},
        {"sigma": 40.0},
        {"sigma": 4.0, "sigma_y": 1.0, "angle": 30},
        {"sigma": 2.0, "sigma_x": 5.0, "missing": "inside"},
    ),
    hard_cases=CASES,
    description=__doc__ or "",
)


@gaussian.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    pixels, turned = inputs["image"].pixels, p.turned
    if turned is not None:
        return gaussian_turned.blurred(pixels, turned, p.border, p.value)
    if missing.leaves_out(p.missing, inputs):

        def mean(pixels: Array, border: Border, value: float) -> Array:
            return _by_matrices(pixels, _weights(p), border, value)

        return missing.renormalised(inputs, p.missing, p.border, p.value, mean)
    down, across = (np.concatenate([half[:0:-1], half]) for half in map(half_kernel, p.deviations))
    return _by_matrices(pixels, (down, across), p.border, p.value)


def _by_matrices(pixels: Array, weights: tuple[Vector, Vector], border: Border, value: float) -> Array:
    for axis in (0, 1):
        matrix, constant = folded(weights[axis], pixels.shape[axis], border)
        lines = np.moveaxis(pixels, axis, 0)
        pixels = np.moveaxis(np.tensordot(matrix, lines, 1) + value * constant[:, None, None], 0, axis)
    return pixels


def _fir_head(p: Parameters, tail: float, facts: InputFacts) -> Head | None:
    """Where both passes are one."""
    image = facts["image"]
    if p.turned is not None or missing.leaves_out(p.missing, facts):
        return None
    tall, wide = (2 * fir_radius(sigma, tail)[0] + 1 for sigma in p.deviations)
    if tall > image.height or wide > image.width or rows_laid_out(tall, wide, image.channels) is None:
        return None

    def run(device: Device, inputs: Inputs, then: Tail) -> Array:
        down, across = (fir_weights(sigma, tail) for sigma in p.deviations)
        return separable_opencl(device, inputs["image"], down, across, p.border, p.value, then)

    return Head(SOURCE, run)


@gaussian.method(
    "fir",
    head=_fir_head,
    coded=True,
    scratch=2.1,
    knob=Knob("tail", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7), "weight cut off", 1e-9, MOST_TAIL, order=1, rising=False),
    error=base.fir_error,
    orderly=True,
    work=base.fir_work,
    rates={"opencl": Rate(5e-4, 2.2e-11), "numpy": Rate(2e-4, 7e-11)},
)
class Fir:
    """The kernel, cut where little weight is left and normalised, as two passes of multiply-adds."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, tail: float) -> Array:
        image, turned = inputs["image"], p.turned
        if turned is not None:
            return gaussian_turned.summed_opencl(device, image, turned, tail, p.border, p.value)
        if missing.leaves_out(p.missing, inputs):

            def mean(pixels: Array, border: Border, value: float) -> Array:
                return separable_opencl(device, Image(pixels), *_weights(p), border, value)

            return missing.renormalised_opencl(device, inputs, p.missing, p.border, p.value, mean)
        down, across = (fir_weights(sigma, tail) for sigma in p.deviations)
        return separable_opencl(device, image, down, across, p.border, p.value)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, tail: float) -> Array:
        image, turned = inputs["image"], p.turned
        if turned is not None:
            return gaussian_turned.summed_numpy(image, turned, tail, p.border, p.value)
        if missing.leaves_out(p.missing, inputs):

            def mean(pixels: Array, border: Border, value: float) -> Array:
                return separable_numpy(Image(pixels), *_weights(p), border, value)

            return missing.renormalised(inputs, p.missing, p.border, p.value, mean)
        down, across = (fir_weights(sigma, tail) for sigma in p.deviations)
        return separable_numpy(image, down, across, p.border, p.value)


@gaussian.method(
    "fft",
    scratch=4.3,
    knob=Knob("bits", (24.0, 53.0), "precision of the transforms: float32 or float64", 24, 53),
    error=base.spectral_error,
    work=base.spectral_work,
    rates={"opencl": Rate(1e-3, 1.1e-8), "numpy": Rate(1e-3, 1.1e-8)},
    unfit=base.spectral_unfit,
)
class Fft:
    """The product of spectra, on the processor, where the axes are turned."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, bits: float) -> Array:
        return Fft.numpy(inputs, p, bits)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, bits: float) -> Array:
        assert p.turned is not None, "the planner takes other methods where axes are not turned"
        return gaussian_turned.by_spectra(inputs["image"], p.turned, bits, p.border, p.value)


def _few_rows(p: Parameters, tail: float) -> tuple[multirate.Filters, Vector]:
    down, across = p.deviations
    return multirate.filters(down, tail), fir_weights(across, tail)


def _multirate_head(p: Parameters, tail: float, facts: InputFacts) -> Head | None:
    def run(device: Device, inputs: Inputs, then: Tail) -> Array:
        return multirate.multirate_opencl(device, inputs["image"], *_few_rows(p, tail), p.border, p.value, then)

    return Head(multirate.SOURCE, run)


@gaussian.method(
    "multirate",
    head=_multirate_head,
    scratch=1.2,
    knob=Knob("tail", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7), "weight that is cut off or misplaced", 1e-9, MOST_TAIL),
    error=base.multirate_error,
    orderly=True,
    work=base.multirate_work,
    lightest=base.multirate_lightest,
    rates={"opencl": Rate(1.1e-3, 1.65e-11), "numpy": Rate(5e-4, 2e-10)},
    unfit=base.multirate_unfit,
    coded=True,
)
class Multirate:
    """A narrower Gaussian down the image of which a few rows are kept, which another one is summed over."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, tail: float) -> Array:
        return multirate.multirate_opencl(device, inputs["image"], *_few_rows(p, tail), p.border, p.value)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, tail: float) -> Array:
        return multirate.multirate_numpy(inputs["image"].pixels, *_few_rows(p, tail), p.border, p.value)


@gaussian.method(
    "dct",
    scratch=6.1,
    knob=Knob("tail", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7), "weight of the modes that are dropped", 1e-9, MOST_TAIL),
    error=base.dct_error,
    orderly=True,
    work=base.dct_work,
    lightest=base.dct_work,
    rates={"opencl": Rate(1e-3, 2.9e-11), "numpy": Rate(1e-4, 1.8e-11)},
    unfit=base.dct_unfit,
)
class Dct:
    """The few low frequencies that a wide Gaussian passes, as thin matrix products; cheaper the wider it is."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, tail: float) -> Array:
        return dct_opencl(device, inputs["image"].pixels, p.deviations, p.border, tail)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, tail: float) -> Array:
        return dct_numpy(inputs["image"].pixels, p.deviations, tail)


@gaussian.method(
    "deriche",
    scratch=2.1,
    knob=Knob("order", (2, 4, 6, 8), "exponentials in the response", 2, 8),
    error=recursions.recursive_error(recursions.deriche_filters),
    least=recursions.least_error("deriche"),
    work=recursions.deriche_work,
    body="recursive",
    rates={"opencl": Rate(7e-4, 1e-11), "numpy": Rate(7e-4, 8e-11)},
    unfit=recursions.recursive_unfit,
)
class Deriche:
    """Sums of damped waves, fitted to the Gaussian, run along each line from both ends."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, order: float) -> Array:
        return recursive_opencl(
            device, inputs["image"].pixels, *recursions.deriche_filters(p, order), p.border, p.value
        )

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, order: float) -> Array:
        return recursive_numpy(inputs["image"].pixels, *recursions.deriche_filters(p, order), p.border, p.value)


@gaussian.method(
    "vliet-young",
    scratch=2.1,
    knob=Knob("poles", (3, 4, 5), "poles of the all-pole filter", 3, 5),
    error=recursions.recursive_error(recursions.vliet_young_filters),
    least=recursions.least_error("vliet-young"),
    work=recursions.vliet_young_work,
    body="recursive",
    rates={"opencl": Rate(7e-4, 1e-11), "numpy": Rate(7e-4, 8e-11)},
    unfit=recursions.vliet_young_unfit,
)
class VlietYoung:
    """The all-pole filter of exactly the variance wanted, run along each line from both ends."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, order: float) -> Array:
        return recursive_opencl(
            device, inputs["image"].pixels, *recursions.vliet_young_filters(p, order), p.border, p.value
        )

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, order: float) -> Array:
        return recursive_numpy(inputs["image"].pixels, *recursions.vliet_young_filters(p, order), p.border, p.value)


@gaussian.method(
    "box3",
    scratch=3.2,
    knob=Knob("extended", (0, 1), "1: boxes with parts of pixels at their ends", 0, 1, rising=False),
    error=recursions.boxes_error,
    least=recursions.least_error("box3"),
    work=recursions.boxes_work,
    rates={"opencl": Rate(6e-4, 1e-11), "numpy": Rate(2.5e-4, 1.4e-10)},
    unfit=recursions.recursive_unfit,
)
class Box3:
    """Three running means along each line, of whole pixels or with parts of pixels at their ends."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, extended: float) -> Array:
        down, across = recursions.both_boxes(p, extended)
        return boxes_opencl(device, inputs["image"].pixels, down, across, p.border, p.value)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, extended: float) -> Array:
        return boxes_numpy(inputs["image"].pixels, *recursions.both_boxes(p, extended), p.border, p.value)
