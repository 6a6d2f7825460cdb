"""Compare: how far a picture is from another, as a map and in figures.

Truth, pixel by pixel, by `map`:

* absolute: |image - reference| of every channel; signed: image - reference. Colour of straight pictures counts as it
  shows, each side multiplied by its own coverage.
* ciede2000: the colour difference, of which 1 is about what can just be noticed; one channel.
* flip: the difference seen when the pictures alternate before the eye, 0 to 1, at `pixels_per_degree`; one channel.

The findings are figures of the accuracy engine for the whole pictures. Always there are `largest`, `p999` (exceeded by
one sample in a thousand), `rms` and `mean` of the absolute differences, the samples that are non-finite on one side
alone (`mismatched`), and the peak signal-to-noise ratio for a `peak` of one's choice; of the others, those that
`metrics` names:

* regions: `border`, `inside`: largest and RMS within `margin` pixels of the edge, and elsewhere;
* codes: how many code values apart samples are once stored in 8 and in 16 bits, and the share that differs;
* ulps: the largest distance in units in the last place of float32, before coverage counts;
* ciede2000, flip: mean and largest, or `refused` with the reason why the pictures have no colour to compare. Either
  takes longer than all others together, so it is not there unless it is named, or is the map.

Colours are what a display shows of them: clipped to [0, 1]. Data has none, nor has anything that is not finite.

Sources: see accuracy/metrics.py and accuracy/colour.py.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.accuracy import colour, metrics
from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space, Storage
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    Footprint,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
    halo,
)
from lichen.operations.statistics.differences import figures, worthwhile

if TYPE_CHECKING:
    from lichen.opencl.device import Device

FLOAT_MAX = float(np.finfo(np.float32).max)


class Map(StrEnum):
    """What the pixels of the result are."""

    ABSOLUTE = "absolute"
    SIGNED = "signed"
    CIEDE2000 = "ciede2000"
    FLIP = "flip"


class Metric(StrEnum):
    """A figure beside those of the differences themselves."""

    REGIONS = "regions"
    CODES = "codes"
    ULPS = "ulps"
    CIEDE2000 = "ciede2000"
    FLIP = "flip"


class Parameters(OperationParameters):
    map: Map = Map.ABSOLUTE
    """absolute or signed differences of every channel, or the difference seen: ciede2000, flip"""
    peak: float = Field(1.0, gt=0, le=1e6)
    """the largest value that the signal can have, for the peak signal-to-noise ratio"""
    margin: int = Field(1, ge=0, le=4096, json_schema_extra={"unit": "px"})
    """width of the border whose differences are stated apart"""
    metrics: tuple[Metric, ...] = Field((Metric.REGIONS, Metric.CODES, Metric.ULPS), max_length=len(Metric))
    """the figures that are found beside the differences: regions, codes, ulps, ciede2000, flip"""
    pixels_per_degree: float = Field(colour.PIXELS_PER_DEGREE, ge=1, le=200)
    """of visual angle, for flip: 67 is a screen of 3840 pixels over 0.7 m, seen from 0.7 m"""

    @property
    def seen(self) -> bool:
        return self.map in (Map.CIEDE2000, Map.FLIP)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, reference = facts["image"], facts["reference"]
    flaws = []
    for name, own, other in (
        ("size", f"{reference.width}x{reference.height}", f"{image.width}x{image.height}"),
        ("channels", str(reference.channels), str(image.channels)),
        ("alpha", str(reference.alpha), str(image.alpha)),
        ("space", str(reference.space), str(image.space)),
    ):
        if own != other:
            flaws.append(Flaw("/inputs/reference", f"has {name} {own}; the image has {other}"))
    if p.seen and image.space is Space.DATA:
        flaws.append(Flaw("/parameters/map", f"{p.map} needs colour, and data has none; name its space"))
    elif p.seen and image.channels - (image.alpha is not Alpha.NONE) not in (1, 3):
        flaws.append(Flaw("/parameters/map", f"{p.map} needs 1 or 3 colours"))
    return flaws


def _largest(facts: InputFacts) -> float:
    """Of either side, as it shows."""
    most = max(each.extent.magnitude for each in facts.values())
    return min(most * max(most, 1.0) if facts["image"].alpha is Alpha.STRAIGHT else most, FLOAT_MAX / 2)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """A rounding of each side's product and of the difference; maps of what is seen come from doubles."""
    value = ROUNDING * 160 if p.seen else 4 * ROUNDING * _largest(facts)
    return Error(value, "estimate" if p.seen else "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, reference = facts["image"], facts.get("reference", facts["image"])
    bad = image.samples if any(each.extent.nonfinite for each in facts.values()) else 0
    if p.seen:
        extent = Extent(0.0, 160.0 if p.map is Map.CIEDE2000 else 1.001, bad)
        return Facts(image.height, image.width, 1, Space.DATA, Alpha.NONE, extent)
    far = max(image.extent.high - reference.extent.low, reference.extent.high - image.extent.low, 0.0)
    far = (2 * _largest(facts) if image.alpha is Alpha.STRAIGHT else far) + _error(p, 0.0, facts).value
    far = min(far, FLOAT_MAX)
    extent = Extent(-far if p.map is Map.SIGNED else 0.0, far, bad if far < FLOAT_MAX else image.samples)
    return Facts(image.height, image.width, image.channels, Space.DATA, Alpha.NONE, extent)


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    """FLIP's filters for colour, and for edges and points, at three deviations."""
    if p.map is not Map.FLIP:
        return POINTWISE
    widest = max(width for terms in colour.CSF.values() for _, width in terms)
    sight = math.sqrt(widest / (2 * math.pi**2)) * p.pixels_per_degree
    return halo(math.ceil(3 * max(sight, 0.5 * colour.WIDTH * p.pixels_per_degree)))


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    if p.seen:
        return 160.0 if error else 0.0
    shown = 2 * max(each.extent.magnitude for each in facts.values()) + error
    return 2 * error * max(1.0, shown if facts["image"].alpha is Alpha.STRAIGHT else 1.0)


def _spoilt() -> Mapping[str, Any]:
    first, second = np.full((2, 3, 1), 0.5, np.float32), np.full((2, 3, 1), 0.25, np.float32)
    first[0, 1], second[1, 2] = np.nan, np.inf
    return {"image": first, "reference": second}


def _kept(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    expected = [[0.25, np.nan, 0.25], [0.25, 0.25, np.inf]]
    return None if np.array_equal(pixels[..., 0], expected, equal_nan=True) else f"got {pixels[..., 0].tolist()}"


compare = Operation(
    name="compare",
    family="statistics",
    summary="Compares two pictures: a map of their differences, and every figure of the accuracy engine.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "the picture"),
        Input("reference", "what it is compared with: of its size, channels, alpha and space"),
    ),
    light=Light.STORED,
    footprint=_footprint,
    result=_result,
    propagate=_propagate,
    check=_check,
    examples=({}, {"map": "signed", "metrics": ["ulps"]}),
    hard_cases=(
        HardCase(
            name="what is not finite",
            why="a comparison that drops NaN finds a spoilt picture perfect",
            inputs=_spoilt,
            parameters={},
            holds=_kept,
        ),
    ),
)


def _mapped(inputs: Inputs, p: Parameters) -> Array:
    """The map in float64."""
    image, reference = inputs["image"], inputs["reference"]
    with np.errstate(all="ignore"):
        if p.seen:
            first, second = (colour.emitted(image, each.pixels) for each in (image, reference))
            if p.map is Map.CIEDE2000:
                return colour.delta_e(colour.lab(first), colour.lab(second))[..., np.newaxis]
            return colour.flip_map(first, second, p.pixels_per_degree)[..., np.newaxis]
        apart = metrics.visible(image.pixels, image.alpha) - metrics.visible(reference.pixels, image.alpha)
        return apart if p.map is Map.SIGNED else np.abs(apart)


@compare.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _mapped(inputs, p)


def _at_once(
    device: Device, inputs: Inputs, p: Parameters, knob: float = 0.0
) -> tuple[Array, Mapping[str, Any]] | None:
    """Map and figures in one pass; None of what is seen, and of few pixels."""
    image, reference = inputs["image"], inputs["reference"]
    if p.seen or not worthwhile(device, image, reference):
        return None
    out = aligned_empty(image.pixels.shape)
    return out, _figures_on(device, inputs, p, out, out)


@compare.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples * {Map.CIEDE2000: 300.0, Map.FLIP: 800.0}.get(p.map, 1.0),
    rates={"opencl": Rate(3e-4, 1e-9), "numpy": Rate(1e-4, 1.1e-8)},
    finding=_at_once,
)
class Exact:
    """Differences in float32; what is seen in doubles, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if p.seen:
            return Exact.numpy(inputs, p, knob)
        both = _at_once(device, inputs, p)
        if both is not None:
            return both[0]
        image, reference = inputs["image"], inputs["reference"]
        out = aligned_empty(image.pixels.shape)
        defines: dict[str, int | float | str] = {
            "COVERAGE": image.channels if image.alpha is Alpha.STRAIGHT else 0,
            "SIGNED": int(p.map is Map.SIGNED),
        }
        with device.session() as session:
            session.launch(
                "statistics/compare.cl", "compare", (-(-image.pixels.size // 16),),
                aligned(image.pixels), aligned(reference.pixels), session.write(out), np.uint64(image.pixels.size),
                defines=defines,
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_mapped(inputs, p).astype(np.float32))


@compare.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    """The figures of the accuracy engine that are asked for."""
    image = inputs["image"]
    return _found(metrics.totals(image.pixels, inputs["reference"].pixels, image.alpha), {}, inputs, p, pixels)


def _found(
    totals: metrics.Totals, known: Mapping[Metric, Figures], inputs: Inputs, p: Parameters, pixels: Array
) -> Mapping[str, Any]:
    """All of them, of which some are known."""
    return {
        **totals._asdict(),
        "psnr_db": metrics.psnr_of(totals, p.peak),
        **{
            name: value
            for each in sorted({*p.metrics, *_MAPPED[p.map]})
            for name, value in (known[each] if each in known else _FIGURES[each](inputs, p, pixels))
        },
    }


def _find_on(device: Device, inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    if not worthwhile(device, inputs["image"], inputs["reference"]):
        return findings(inputs, p, pixels)
    return _figures_on(device, inputs, p, pixels)


def _figures_on(
    device: Device, inputs: Inputs, p: Parameters, pixels: Array, out: Array | None = None
) -> Mapping[str, Any]:
    """The same by a device, which fills `out` with the map meanwhile."""
    found = figures(
        device, inputs["image"], inputs["reference"].pixels, p.margin if Metric.REGIONS in p.metrics else 0,
        codes=Metric.CODES in p.metrics, ulps=Metric.ULPS in p.metrics, out=out, signed=p.map is Map.SIGNED,
    )  # fmt: skip
    known: dict[Metric, Figures] = {
        Metric.REGIONS: (("border", found.border), ("inside", found.inside)),
        Metric.CODES: (("codes", found.codes),),
        Metric.ULPS: (("ulps", found.ulps),),
    }
    return _found(found.totals, known, inputs, p, pixels)


compare.find_on = _find_on
Figures = Iterable[tuple[str, Any]]


def _regions(inputs: Inputs, p: Parameters, pixels: Array) -> Figures:
    image = inputs["image"]
    parts = metrics.regions(image.pixels, inputs["reference"].pixels, halo(p.margin), image.alpha)
    return zip(("border", "inside"), map(_part, parts), strict=True)


def _codes(inputs: Inputs, p: Parameters, pixels: Array) -> Figures:
    image, reference = (inputs[name].pixels for name in ("image", "reference"))
    yield (
        "codes",
        {
            str(each): dataclasses.asdict(metrics.steps(image, reference, each))
            for each in (Storage.UINT8, Storage.UINT16)
        },
    )


def _ulps(inputs: Inputs, p: Parameters, pixels: Array) -> Figures:
    yield "ulps", metrics.ulps(inputs["image"].pixels, inputs["reference"].pixels)


def _ciede2000(inputs: Inputs, p: Parameters, pixels: Array) -> Figures:
    image, reference = inputs["image"], inputs["reference"]
    done = p.map is Map.CIEDE2000 and not (image.extent.nonfinite or reference.extent.nonfinite)
    yield "ciede2000", _mapped_figures(pixels) if done else _seen(colour.ciede2000(image, reference.pixels))


def _flip(inputs: Inputs, p: Parameters, pixels: Array) -> Figures:
    image, reference = inputs["image"], inputs["reference"]
    done = p.map is Map.FLIP and not (image.extent.nonfinite or reference.extent.nonfinite)
    yield "flip", _mapped_figures(pixels) if done else _seen(colour.flip(image, reference.pixels, p.pixels_per_degree))


_FIGURES: Mapping[Metric, Callable[[Inputs, Parameters, Array], Figures]] = {
    Metric.REGIONS: _regions,
    Metric.CODES: _codes,
    Metric.ULPS: _ulps,
    Metric.CIEDE2000: _ciede2000,
    Metric.FLIP: _flip,
}
_MAPPED: Mapping[Map, tuple[Metric, ...]] = {
    Map.ABSOLUTE: (),
    Map.SIGNED: (),
    Map.CIEDE2000: (Metric.CIEDE2000,),
    Map.FLIP: (Metric.FLIP,),
}
"""Whose map is made anyway."""


def _mapped_figures(pixels: Array) -> dict[str, float]:
    return {"mean": float(pixels.mean(dtype=np.float64)), "largest": float(pixels.max())}


def _part(found: metrics.Difference | None) -> dict[str, float] | None:
    return None if found is None else {"largest": found.largest, "rms": found.rms}


def _seen(found: colour.Seen) -> dict[str, Any]:
    return {"refused": found.refused} if found.refused else {"mean": found.mean, "largest": found.largest}
