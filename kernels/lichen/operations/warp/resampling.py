"""What makes an operation of a map: its truth, its methods with their errors, and all that follows from them.

The filters are the methods, from the cheapest to the most accurate:

* `nearest`, `bilinear`, `bicubic` (Catmull-Rom), `mitchell`, `bspline` (interpolating: prefiltered), `lanczos2` and
  `lanczos3` take one value for each pixel, by 1, 2, 4, 4, 4, 4 and 6 samples along each axis. They are right where the
  map shrinks nothing, and alias where it does. `lanczos3` is truth itself there.
* `mip` takes two levels of a pyramid of box means, bilinear in each: nothing aliases, but a slanted footprint is
  blurred along its shorter axis as much as along its longer.
* `supersampled` takes points x points bilinear samples where the map shrinks, over the ellipse that truth averages:
  enough where it shrinks by less than points / 3, and an alias of it beyond.
* `ewa` takes all samples in the ellipse, of the level of a pyramid of box means on which the shorter half axis is
  `samples` to twice as many samples long, up to a radius of 2 + log2(samples) / 2; one that would hold more than
  448 samples^4 there is taken from a coarser level. So work depends on how slanted a footprint is, not on how large,
  and is bounded.

Their errors stand in `prediction`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha
from lichen.memory import Array, aligned
from lichen.once import latest
from lichen.opencl.device import Device
from lichen.operation import (
    WHOLE,
    Border,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.warp import effort, kernels
from lichen.operations.warp.composition import Link
from lichen.operations.warp.kernels import Kernel
from lichen.operations.warp.launch import averaged, sampled, samples_of
from lichen.operations.warp.levels import pyramid, spline
from lichen.operations.warp.maps import Doubles, Map, Projective, Windowed
from lichen.operations.warp.prediction import (
    LARGEST,
    POINTS,
    SAMPLES,
    TRUTH_GAIN,
    Size,
    check_size,
    error_of,
    least_of,
    most_of,
    reach_of,
    result_facts,
)
from lichen.operations.warp.reference import (
    Closed,
    Sampler,
    Source,
    ellipse_average,
    filtered,
    interpolate,
    mipmapped,
    resample,
    supersampled,
    truth_sampler,
)
from lichen.operations.warp.shown import part_shown
from lichen.part import Part, Place, Rectangle, place_of, placed


class Resampled(OperationParameters):
    """What every warp takes whose size another input gives."""

    border: Border = Field(Border.CONSTANT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="the background, and what lies beyond a constant border, in every channel")


class WarpParameters(Resampled):
    """What the others take, too."""

    width: int | None = Field(None, ge=1, le=LARGEST, description="columns of the result; the image's if left out")
    height: int | None = Field(None, ge=1, le=LARGEST, description="rows of the result; the image's if left out")


P = TypeVar("P", bound=Resampled)


def own_size(p: Resampled, facts: InputFacts) -> Size:
    """As asked for, or that of the image."""
    if not isinstance(p, WarpParameters):
        return facts["image"].width, facts["image"].height
    return p.width or facts["image"].width, p.height or facts["image"].height


@dataclass(frozen=True)
class Warp(Generic[P]):
    """How an operation of this family makes its map."""

    map: Callable[[P, Inputs], Map]
    size: Callable[[P, InputFacts], Size] = lambda p, facts: own_size(p, facts)
    closed: Callable[[P], Closed | None] = lambda p: None
    """how the image continues where that is no choice"""
    largest: Callable[[P, InputFacts], float | None] = lambda p, facts: None
    """the most that the map shrinks the source by, where that is known without pixels"""
    projective: Callable[[P, Size, Size], Projective] | None = None
    """the map by the sizes of the whole source and of the whole result, where it is projective"""
    _told: list[tuple[P, InputFacts, bool]] = field(default_factory=list, repr=False, compare=False)
    """what `shrinks` said last: all methods of a request ask it"""

    def source(self, inputs: Inputs, p: P) -> Source:
        return Source(inputs["image"].pixels, self.closed(p) or p.border, p.value)

    def preparing(self, p: P, facts: InputFacts) -> float:
        """What it takes to make the source ready, in pixels of the result."""
        return 0.0

    def extent_of(self, inputs: Inputs, p: P) -> Size:
        """Of the whole result."""
        place = place_of(p)
        return place.result_size if place else self.size(p, {key: Facts.sized(image) for key, image in inputs.items()})

    def made(self, p: P, facts: InputFacts) -> Size:
        """Of what is made, which may be a part."""
        place = place_of(p)
        return place.result[2:] if place else self.size(p, facts)

    def made_of(self, inputs: Inputs, p: P) -> Size:
        return self.made(p, {name: Facts.sized(image) for name, image in inputs.items()})

    def looks(self, p: P, inputs: Inputs) -> Map:
        """The map of what is made, to what there is of the source."""
        return Windowed.by(self.map(p, inputs), place_of(p))

    def shrinks(self, p: P, facts: InputFacts) -> bool:
        for parameters, known, said in self._told:
            if parameters is p and known is facts:
                return said
        largest = self.largest(p, facts)
        said = largest is None or largest > 1
        self._told[:] = [(p, facts, said), *self._told[:2]]  # an operation may warp three channels in turn
        return said

    def by(self, inputs: Inputs, p: P, sampler: Sampler, source: Source | None = None) -> Doubles:
        """The result in NumPy."""
        width, height = self.made_of(inputs, p)
        return resample(source or self.source(inputs, p), self.looks(p, inputs), width, height, sampler)


def part_of(warp: Warp[P], p: P, facts: InputFacts, wanted: Rectangle) -> Part | None:
    """A rectangle of the result, of the part of the source that it shows where the map is known to be projective, and
    of the whole source where it is not."""
    image = facts["image"]
    whole, made = (image.width, image.height), warp.size(p, facts)
    shown: Rectangle | None = (0, 0, *whole)
    if warp.projective is not None:
        shown = part_shown(warp.projective(p, whole, made), p.border, whole, wanted)
    if shown is None:
        return None
    place = Place(source=shown, result=wanted, source_size=whole, result_size=made)
    return Part(placed(p, place), {"image": shown}, wanted)


def link(warp: Warp[P], p: P, facts: InputFacts) -> Link | None:
    """What a projective warp is for its neighbours."""
    image, size = facts["image"], warp.size(p, facts)
    if warp.projective is None:
        return None
    return Link(warp.projective(p, (image.width, image.height), size), size, p.border, p.value)


# ------------------------------------------------------------------------------------------------------- declaration


def declare(
    warp: Warp[P],
    *,
    name: str,
    summary: str,
    description: str,
    parameters: type[P],
    examples: tuple[Mapping[str, Any], ...],
    hard_cases: tuple[HardCase, ...],
    inputs: tuple[Input, ...] = (Input("image", "a picture or data, any number of channels"),),
    identity: Callable[[P, InputFacts], str | None] = lambda p, facts: None,
    check: Callable[[P, InputFacts], list[Flaw]] = lambda p, facts: [],
) -> Operation[P]:
    """The operation of a warp, with truth and methods."""
    operation = Operation(
        name=name,
        family="warp",
        summary=summary,
        description=description,
        parameters=parameters,
        inputs=inputs,
        light=Light.LINEAR,
        wants_alpha=Alpha.ASSOCIATED,
        footprint=lambda p, facts: WHOLE,
        result=lambda p, facts: result_facts(p, facts, warp.made(p, facts)),
        propagate=lambda p, facts, error: error * TRUTH_GAIN,
        implied=lambda p, facts: "which part of the image a tile shows is known by its map alone",
        part=(lambda p, facts, wanted: part_of(warp, p, facts, wanted)) if len(inputs) == 1 else None,
        link=lambda p, facts: link(warp, p, facts),
        identity=identity,
        check=lambda p, facts: check(p, facts) or check_size(facts["image"], warp.size(p, facts)),
        customary=("ewa", 1.0),
        examples=examples,
        hard_cases=hard_cases,
    )

    @operation.truth
    def truth(inputs: Inputs, p: P) -> Array:
        return warp.by(inputs, p, truth_sampler)

    for kernel, start, step in (
        (kernels.NEAREST, 3e-4, 3.2e-9),
        (kernels.BILINEAR, 3e-4, 4.0e-9),
        (kernels.CATMULL_ROM, 3e-4, 4.1e-9),
        (kernels.MITCHELL, 3e-4, 4.1e-9),
        (kernels.BSPLINE, 1e-3, 4.5e-8),
        (kernels.LANCZOS2, 3e-4, 4.3e-9),
        (kernels.LANCZOS3, 3e-4, 5.9e-9),
    ):
        _add_kernel(operation, warp, kernel, Rate(start, step))
    _add_mip(operation, warp)
    _add_supersampled(operation, warp)
    _add_ewa(operation, warp)
    return operation


@latest
def _work(warp: Warp[P], p: P, facts: InputFacts) -> float:
    """Pixels of the result, in blocks of four channels."""
    width, height = warp.made(p, facts)
    return width * height * -(-facts["image"].channels // 4)


AVERAGED = 8
"""Steps that a pixel takes beside the samples of its ellipse, where steps are samples."""
SHAPED, TAKEN = 104, 2 / 3
"""Of maps of which it is not known how they shrink, as found for the examples: steps that shaping an ellipse takes, and
the share of its samples. Most pixels lie where little shrinks, and take few, whatever the knob says."""


def _ellipse(warp: Warp[P], p: P, samples: float, facts: InputFacts) -> float:
    """Steps of a pixel, on average."""
    if not warp.shrinks(p, facts):
        return AVERAGED
    if warp.projective is None:
        return SHAPED + TAKEN * 8 * samples * reach_of(samples) ** 2
    image, made = facts["image"], warp.size(p, facts)
    place = place_of(p) or Place(
        source=(0, 0, image.width, image.height), result=(0, 0, *made),
        source_size=(image.width, image.height), result_size=made,
    )  # fmt: skip
    view = warp.projective(p, place.source_size, place.result_size)
    return AVERAGED + effort.steps(view, place.source_size, place.result, samples)


def _add_kernel(operation: Operation[P], warp: Warp[P], kernel: Kernel, rate: Rate) -> None:
    prefiltered = kernel is kernels.BSPLINE

    class ByKernel:
        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: P, knob: float) -> Array:
            if not device.has_fp64:
                return ByKernel.numpy(inputs, p, knob)
            source, around = warp.source(inputs, p), 0
            if prefiltered:
                source, around = spline(source)
            name = {1: "nearest", 2: "linear", 4: "four", 6: "six"}[kernel.taps]
            further = (np.int32(kernel.code),) if kernel.taps == 4 else ()
            size = warp.made_of(inputs, p)
            return sampled(device, source, warp.looks(p, inputs), size, name, *further, around=around)

        @staticmethod
        def numpy(inputs: Inputs, p: P, knob: float) -> Array:
            source, around = warp.source(inputs, p), 0
            if prefiltered:
                source, around = spline(source)
            return aligned(
                warp.by(inputs, p, lambda s, at: interpolate(s, at.x + around, at.y + around, kernel), source)
            )

    ByKernel.__doc__ = TOLD[kernel.name]
    operation.method(
        kernel.name,
        error=lambda p, knob, facts: error_of(kernel.name, p, knob, facts, shrinks=warp.shrinks(p, facts)),
        least=lambda p, knob, facts: least_of(kernel.name, p, knob, facts, shrinks=warp.shrinks(p, facts)),
        work=lambda p, knob, facts: _work(warp, p, facts) + warp.preparing(p, facts),
        rates={"opencl": rate, "numpy": Rate(3e-4, 1e-7 * kernel.taps**2)},
        scratch=8.3 if prefiltered else 0.1,
    )(ByKernel)


TOLD = {
    "nearest": "The sample that the place lies in.",
    "bilinear": "Between the four nearest samples.",
    "bicubic": "The Catmull-Rom spline: 4 x 4 samples, right for quadratics.",
    "mitchell": "Mitchell and Netravali's cubic, 4 x 4 samples: no rings, but a little blur, even where nothing moves.",
    "bspline": "The interpolating cubic B-spline: coefficients are found first, by 33 samples along each axis.",
    "lanczos2": "The Lanczos kernel of radius 2, 4 x 4 samples.",
    "lanczos3": "The Lanczos kernel of radius 3, 6 x 6 samples: truth where nothing shrinks.",
}


def _add_mip(operation: Operation[P], warp: Warp[P]) -> None:
    @operation.method(
        "mip",
        scratch=0.4,
        error=lambda p, knob, facts: error_of("mip", p, knob, facts, shrinks=warp.shrinks(p, facts)),
        least=lambda p, knob, facts: least_of("mip", p, knob, facts, shrinks=warp.shrinks(p, facts)),
        work=lambda p, knob, facts: _work(warp, p, facts) + warp.preparing(p, facts) + facts["image"].samples / 4,
        rates={"opencl": Rate(1.5e-3, 1.4e-8), "numpy": Rate(2e-3, 6e-7)},
    )
    class Mip:
        """Two levels of a pyramid, bilinear in each, by the longer axis of the footprint."""

        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: P, knob: float) -> Array:
            if not device.has_fp64:
                return Mip.numpy(inputs, p, knob)
            source, size = warp.source(inputs, p), warp.made_of(inputs, p)
            return averaged(device, source, warp.looks(p, inputs), size, "mip", shallow=1.0)

        @staticmethod
        def numpy(inputs: Inputs, p: P, knob: float) -> Array:
            return aligned(warp.by(inputs, p, mipmapped(pyramid(warp.source(inputs, p)))))


def _add_supersampled(operation: Operation[P], warp: Warp[P]) -> None:
    @operation.method(
        "supersampled",
        scratch=0.1,
        knob=POINTS,
        orderly=True,
        error=lambda p, knob, facts: error_of("supersampled", p, knob, facts, shrinks=warp.shrinks(p, facts)),
        work=lambda p, knob, facts: (
            _work(warp, p, facts) * (AVERAGED + (knob**2 if warp.shrinks(p, facts) else 0))
            + AVERAGED * warp.preparing(p, facts)
        ),
        rates={"opencl": Rate(6e-4, 3.7e-9), "numpy": Rate(2e-3, 2.5e-7)},
    )
    class Supersampled:
        """A grid of bilinear samples over the ellipse of each pixel."""

        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: P, knob: float) -> Array:
            if not device.has_fp64:
                return Supersampled.numpy(inputs, p, knob)
            source, size, grid = warp.source(inputs, p), warp.made_of(inputs, p), samples_of(round(knob))
            return averaged(device, source, warp.looks(p, inputs), size, "super", *grid, shallow=math.inf)

        @staticmethod
        def numpy(inputs: Inputs, p: P, knob: float) -> Array:
            return aligned(warp.by(inputs, p, supersampled(round(knob))))


def _add_ewa(operation: Operation[P], warp: Warp[P]) -> None:
    @operation.method(
        "ewa",
        scratch=0.4,
        knob=SAMPLES,
        orderly=True,
        error=lambda p, knob, facts: error_of("ewa", p, knob, facts, shrinks=warp.shrinks(p, facts)),
        least=lambda p, knob, facts: least_of("ewa", p, knob, facts, shrinks=warp.shrinks(p, facts)),
        work=lambda p, knob, facts: (
            _work(warp, p, facts) * _ellipse(warp, p, knob, facts)
            + AVERAGED * warp.preparing(p, facts)
            + (facts["image"].samples / 2 if warp.shrinks(p, facts) else 0)
        ),
        rates={"opencl": Rate(1.5e-3, 6.5e-10), "numpy": Rate(3e-3, 2e-7)},
    )
    class Ewa:
        """The elliptical weighted average, of the level of a pyramid that fits the shorter axis."""

        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: P, knob: float) -> Array:
            if not device.has_fp64:
                return Ewa.numpy(inputs, p, knob)
            cut = (np.float32(each) for each in (knob, reach_of(knob), most_of(knob)))
            source, size = warp.source(inputs, p), warp.made_of(inputs, p)
            return averaged(device, source, warp.looks(p, inputs), size, "ewa", *cut, shallow=2 * knob)

        @staticmethod
        def numpy(inputs: Inputs, p: P, knob: float) -> Array:
            source = warp.source(inputs, p)
            average = ellipse_average(pyramid(source), source, reach_of(knob), knob, most_of(knob))
            return aligned(warp.by(inputs, p, lambda s, at: filtered(s, at, average)))
