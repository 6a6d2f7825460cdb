"""Statistics: what the values of every channel are, as a small table and as findings.

Truth: over the finite values x of a channel, n of them, each channel by itself and coverage like any other:

    column 0         the share of the values that is finite
    columns 1, 2     the least and the largest
    column 3         the mean, sum x / n
    column 4         the standard deviation, the root of sum (x - mean)^2 / n
    then             the percentiles, one column each: linear between the two nearest of the sorted values
    then             the histogram, one column for each bin: the share of the finite values that falls into it

The table has one row for each channel of the image and one channel. Bins are equal parts of [low, high], of which the
last holds its upper end; unless given they are the least and largest value of all channels. What lies outside is
counted at the ends. A channel without finite values has NaN for all but its share.

The mean is summed in doubles in a stated order, whatever the number of threads, and the deviation in a second pass from
the differences to that mean, whose own sum corrects it: the mean of squares less the square of the mean loses all
digits where the values lie close together.

Methods differ in percentiles alone. `exact` selects them; `binned` counts equal bins between the extremes of a channel
and takes the middle of the bin that a sorted value falls into, so it is off by at most half a bin.

Source: T. Chan, G. Golub and R. LeVeque, Algorithms for computing the sample variance, The American Statistician 37,
1983; for percentiles, R. Hyndman and Y. Fan, Sample quantiles in statistical packages, 1996, definition 7.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Image, Space
from lichen.memory import Array, aligned
from lichen.operation import (
    ROUNDING,
    WHOLE,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.statistics.counting import OnDevice, OnHost, placed

if TYPE_CHECKING:
    from lichen.opencl.device import Device

FLOAT_MAX = float(np.finfo(np.float32).max)
PLAIN = ("finite", "low", "high", "mean", "deviation")
Percentile = Annotated[float, Field(ge=0, le=100)]
Edge = Annotated[float, Field(ge=-1e30, le=1e30)]


class Parameters(OperationParameters):
    percentiles: Annotated[tuple[Percentile, ...], Field(max_length=64)] = (
        1,
        25,
        50,
        75,
        99,
    )
    """percentiles to find, 0 to 100"""
    bins: int = Field(0, ge=0, le=4096)
    """how many equal ranges are counted; none unless given"""
    low: Edge | None = None
    """where the first bin begins; the least value unless given"""
    high: Edge | None = None
    """where the last bin ends; the largest value unless given"""

    def ends(self, extent: Extent) -> tuple[float, float]:
        return (extent.low if self.low is None else self.low), (extent.high if self.high is None else self.high)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    low, high = p.ends(facts["image"].extent)
    given = p.low is not None or p.high is not None
    if p.bins and given and not high > low:
        return [Flaw("/parameters/high", f"must be above low ({low:g} to {high:g})")]
    return []


def _rounding(facts: InputFacts) -> float:
    """One rounding to float32, and sums of doubles."""
    return min((1.01 * ROUNDING + 1e-9) * max(1.0, facts["image"].extent.magnitude), FLOAT_MAX)


def _exact_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = _rounding(facts)
    return Error(value, "bound", value)


def _binned_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    rounding = _rounding(facts)
    half = 0.501 * facts["image"].extent.spread / round(knob) if p.percentiles else 0.0
    return Error(min(half + rounding, FLOAT_MAX), "bound", rounding)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, slack = facts["image"], _rounding(facts)
    width = len(PLAIN) + len(p.percentiles) + p.bins
    low, high = min(image.extent.low, 0.0) - slack, max(image.extent.high, 1.0, image.extent.spread) + slack
    extent = Extent(max(low, -FLOAT_MAX), min(high, FLOAT_MAX), image.channels * width if image.extent.nonfinite else 0)
    return Facts(image.channels, width, 1, Space.DATA, Alpha.NONE, extent)


def _bunch() -> Mapping[str, Any]:
    return {"image": (10000 + np.arange(64, dtype=np.float32).reshape(8, 8, 1) % 2 * 2.0**-8).astype(np.float32)}


def _spread(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    got = float(pixels[0, 4, 0])
    return None if abs(got - 2.0**-9) < 1e-9 else f"the deviation is {got}, not {2.0**-9}"


def _gaps() -> Mapping[str, Any]:
    pixels = np.full((2, 2, 2), np.nan, np.float32)
    pixels[:, :, 0] = [[np.nan, 1], [np.inf, 3]]
    return {"image": pixels}


def _counted(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    expected = [[0.5, 1, 3, 2, 1, 2], [0, *[np.nan] * 5]]
    fine = np.allclose(pixels[:, :, 0], expected, equal_nan=True)
    return None if fine else f"expected {expected}, got {pixels[:, :, 0].tolist()}"


statistics = Operation(
    name="statistics",
    family="statistics",
    summary="Finds extremes, mean, deviation, percentiles and histogram of every channel.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, taken as it is stored"),),
    light=Light.STORED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    propagate=lambda p, facts, error: max(error, 1.0) if p.bins else error,
    check=_check,
    examples=(
        {},
        {"percentiles": [50], "bins": 16, "low": 0, "high": 1},
        {"percentiles": [], "bins": 64},
        {"percentiles": [0, 0.1, 99.9, 100]},
    ),
    hard_cases=(
        HardCase(
            name="values close together and far from zero",
            why="the mean of squares less the square of the mean is all rounding",
            inputs=_bunch,
            parameters={},
            holds=_spread,
        ),
        HardCase(
            name="what is not finite",
            why="one NaN spoils every figure, and a channel of them has none",
            inputs=_gaps,
            parameters={"percentiles": [50]},
            holds=_counted,
            methods=("exact",),
        ),
    ),
)


@statistics.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """Channel by channel, sums exact."""
    image, rows = inputs["image"], []
    low, high = p.ends(image.extent)
    for channel in range(image.channels):
        every = image.pixels[..., channel].reshape(-1)
        x = every[np.isfinite(every)]
        if not x.size:
            rows.append([0.0] + [math.nan] * (len(PLAIN) - 1 + len(p.percentiles) + p.bins))
            continue
        mean = math.fsum(x) / x.size
        deviation = math.sqrt(math.fsum((x - mean) ** 2) / x.size)
        counts = np.bincount(placed(x, p.bins, low, high), minlength=p.bins) / x.size if p.bins else np.empty(0)
        found = np.percentile(x, p.percentiles) if p.percentiles else np.empty(0)
        rows.append([x.size / every.size, float(x.min()), float(x.max()), mean, deviation, *found, *counts])
    return np.array(rows)[:, :, np.newaxis]


def _selected(image: Image, p: Parameters) -> Array:
    """Percentiles by sorting, float64 (channels, percentiles)."""
    rows = []
    for channel in range(image.channels):
        x = image.pixels[..., channel].reshape(-1)
        x = x[np.isfinite(x)] if image.extent.nonfinite else x
        rows.append(_between(np.sort(x), p) if x.size else np.full(len(p.percentiles), math.nan))
    return np.stack(rows)


def _between(ordered: Array, p: Parameters) -> Array:
    place = np.array(p.percentiles) / 100 * (ordered.size - 1)
    at = np.minimum(place.astype(np.int64), ordered.size - 1)
    lower, upper = (ordered[np.minimum(at + step, ordered.size - 1)].astype(np.float64) for step in (0, 1))
    made: Array = lower + (place - at) * (upper - lower)
    return made


def _by_bins(machine: OnDevice | OnHost, p: Parameters, bins: int, low: Array, high: Array) -> Array:
    """Percentiles from counts between each channel's extremes, float64 (channels, percentiles)."""
    counts = machine.counts(bins, low, high)
    made = np.full((len(counts), len(p.percentiles)), math.nan)
    for channel, each in enumerate(counts):
        if not each.any():
            continue
        cumulative, place = np.cumsum(each), np.array(p.percentiles) / 100 * (each.sum() - 1)
        at = place.astype(np.int64)
        width = (high[channel] - low[channel]) / bins
        # The sorted value of index k lies in the first bin whose cumulative count exceeds k.
        lower, upper = (
            low[channel] + (np.searchsorted(cumulative, np.minimum(at + step, each.sum() - 1), "right") + 0.5) * width
            for step in (0, 1)
        )
        made[channel] = lower + (place - at) * (upper - lower)
    return made


def _table(machine: OnDevice | OnHost, p: Parameters, bins: int) -> Array:
    """The result; percentiles by `bins` bins, or by sorting where that is 0."""
    image = machine.image
    found = machine.moments()
    columns = [found.share, found.low, found.high, found.mean, found.deviation]
    if p.percentiles:
        wanted = _by_bins(machine, p, bins, found.low, found.high) if bins else _selected(image, p)
        columns += list(wanted.T)
    if p.bins:
        low, high = p.ends(image.extent)
        edges = (np.full(image.channels, low), np.full(image.channels, high))
        counts = machine.counts(p.bins, *edges)
        with np.errstate(invalid="ignore"):
            columns += list((counts / counts.sum(axis=1, keepdims=True)).T)
    return aligned(np.stack(columns, axis=1)[:, :, np.newaxis].astype(np.float32))


@statistics.method(
    "exact",
    error=_exact_error,
    work=lambda p, knob, facts: facts["image"].samples * (4.0 if p.percentiles else 1.0),
    rates={"opencl": Rate(5e-4, 4e-9), "numpy": Rate(2e-4, 3e-8)},
)
class Exact:
    """Sums in doubles, in two passes; percentiles by sorting, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _table(OnDevice.of(device, inputs["image"]), p, 0)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _table(OnHost(inputs["image"]), p, 0)


@statistics.method(
    "binned",
    error=_binned_error,
    work=lambda p, knob, facts: (
        facts["image"].samples * (2.0 if p.percentiles else 1.0) + 0.1 * knob * facts["image"].channels
    ),
    rates={"opencl": Rate(5e-4, 2.5e-9), "numpy": Rate(2e-4, 4e-8)},
    knob=Knob("resolution", (256, 4096, 65536), "bins in which percentiles are looked for", 16, 1 << 20, order=-1),
    unfit=lambda p, facts: None if p.percentiles else "there are no percentiles to find",
)
class Binned:
    """Sums in doubles, in two passes; percentiles by counting."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _table(OnDevice.of(device, inputs["image"]), p, round(knob))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _table(OnHost(inputs["image"]), p, round(knob))


@statistics.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    """The table by names, and how many values there are."""
    image = inputs["image"]
    described = []
    for channel, row in enumerate(pixels[:, :, 0].tolist()):
        first = len(PLAIN) + len(p.percentiles)
        finite = int(np.count_nonzero(np.isfinite(image.pixels[..., channel])))
        described.append(
            {
                "finite": finite,
                "nonfinite": image.height * image.width - finite,
                **dict(zip(PLAIN[1:], row[1:], strict=False)),
                "variance": row[4] * row[4],
                "percentiles": {f"{q:g}": v for q, v in zip(p.percentiles, row[len(PLAIN) : first], strict=True)},
                "histogram": row[first:],
            }
        )
    low, high = p.ends(image.extent)
    return {"channels": described, "histogram_low": low, "histogram_high": high}
