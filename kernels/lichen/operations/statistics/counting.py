"""Moments and counts of an image's channels, on the host and on a device, in one order.

Sums are taken in doubles over runs of `SHARE` pixels and the runs' sums are added exactly (`math.fsum`), so the result
depends on nothing but the image: one run's error is at most SHARE roundings of doubles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lichen.image import Image
from lichen.memory import Array, aligned, aligned_empty

if TYPE_CHECKING:
    from lichen.opencl.device import Device

SHARE = 1 << 14
"""Pixels of a run."""
PARTS = 16
"""Histograms that are counted beside each other."""
SOURCE = "statistics/counting.cl"


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Of every channel, float64 (channels,); NaN where nothing is finite."""

    share: Array
    low: Array
    high: Array
    mean: Array
    deviation: Array


def placed(x: Array, bins: int, low: float, high: float) -> Array:
    """The bin of each value, int64; one that lies outside is counted at the end. All values alike are in the first."""
    scale = bins / (high - low) if high > low else 0.0
    made: Array = np.clip((x.astype(np.float64) - low) * scale, 0, bins - 1).astype(np.int64)
    return made


def moments(counts: Array, low: Array, high: Array, sums: Array, second: tuple[Array, Array], pixels: int) -> Moments:
    """From the finite values' numbers, extremes and exact sums, and the sums of differences to `sums / counts` and of
    their squares; float64 (channels,)."""
    with np.errstate(all="ignore"):
        off, squares = second
        variance = (squares - off * off / counts) / counts
        empty = counts == 0
        made = (low, high, sums / counts, np.sqrt(np.maximum(variance, 0)))
        return Moments(counts / pixels, *(np.where(empty, math.nan, each) for each in made))


def _exact(parts: Array) -> Array:
    """Sums over the first axis."""
    return np.array([math.fsum(column) for column in parts.T])


@dataclass(frozen=True, slots=True, eq=False)
class OnHost:
    """By NumPy."""

    image: Image

    @property
    def _runs(self) -> list[Array]:
        flat = self.image.pixels.reshape(-1, self.image.channels)
        return [flat[start : start + SHARE] for start in range(0, len(flat), SHARE)]

    def moments(self) -> Moments:
        first = [self._first(run) for run in self._runs]
        counts, sums = (_exact(np.stack([each[k] for each in first])) for k in (0, 3))
        low, high = (pick([each[k] for each in first], axis=0) for k, pick in ((1, np.min), (2, np.max)))
        with np.errstate(all="ignore"):
            mean = sums / counts
        second = [self._second(run, mean) for run in self._runs]
        off, squares = (_exact(np.stack([each[k] for each in second])) for k in (0, 1))
        return moments(counts, low, high, sums, (off, squares), self.image.height * self.image.width)

    def _first(self, run: Array) -> tuple[Array, Array, Array, Array]:
        finite = np.isfinite(run)
        low, high = np.where(finite, run, math.inf).min(axis=0), np.where(finite, run, -math.inf).max(axis=0)
        total = np.where(finite, run, 0).sum(axis=0, dtype=np.float64)
        return finite.sum(axis=0, dtype=np.float64), low.astype(np.float64), high.astype(np.float64), total

    def _second(self, run: Array, mean: Array) -> tuple[Array, Array]:
        with np.errstate(invalid="ignore"):
            apart = np.where(np.isfinite(run), run.astype(np.float64) - mean, 0)
        return apart.sum(axis=0), np.square(apart).sum(axis=0)

    def counts(self, bins: int, low: Array, high: Array) -> Array:
        """How many finite values of each channel lie in each of `bins` bins between its ends; (channels, bins)."""
        made = np.zeros((self.image.channels, bins), np.int64)
        for channel in range(self.image.channels):
            if not math.isnan(low[channel]):
                x = self.image.pixels[..., channel].reshape(-1)
                x = x[np.isfinite(x)] if self.image.extent.nonfinite else x
                made[channel] = np.bincount(placed(x, bins, low[channel], high[channel]), minlength=bins)
        return made


@dataclass(frozen=True, slots=True, eq=False)
class OnDevice:
    """By counting.cl."""

    device: Device
    image: Image

    @staticmethod
    def of(device: Device, image: Image) -> OnDevice | OnHost:
        """The device, if it has double precision; else the host."""
        return OnDevice(device, image) if device.has_fp64 else OnHost(image)

    @property
    def _pixels(self) -> int:
        return self.image.height * self.image.width

    def moments(self) -> Moments:
        channels, parts = self.image.channels, -(-self._pixels // SHARE)
        first = self._reduced("first", (parts, 4, channels), np.zeros(channels))
        counts, sums = _exact(first[:, 0]), _exact(first[:, 3])
        low, high = first[:, 1].min(axis=0), first[:, 2].max(axis=0)
        with np.errstate(all="ignore"):
            mean = sums / counts
        second = self._reduced("second", (parts, 2, channels), mean)
        return moments(counts, low, high, sums, (_exact(second[:, 0]), _exact(second[:, 1])), self._pixels)

    def _reduced(self, kernel: str, shape: tuple[int, ...], mean: Array) -> Array:
        out = aligned_empty(shape, np.float64)
        with self.device.session() as session:
            session.launch(
                SOURCE, kernel, (shape[0],),
                aligned(self.image.pixels), session.write(out), aligned(mean, np.float64),
                np.uint64(SHARE), np.uint64(self._pixels),
                local=(1,), defines={"CHANNELS": self.image.channels},
            )  # fmt: skip
        return out

    def counts(self, bins: int, low: Array, high: Array) -> Array:
        """As OnHost's."""
        channels = self.image.channels
        parts = min(PARTS, -(-self._pixels // SHARE))
        made = aligned_empty((parts, channels, bins), np.uint32)
        made[...] = 0
        with np.errstate(all="ignore"):
            scale = np.where(high > low, bins / (high - low), 0.0)
        with self.device.session() as session:
            session.launch(
                SOURCE, "count", (parts,),
                aligned(self.image.pixels), session.readwrite(made), aligned(np.stack([low, scale]), np.float64),
                np.int32(bins), np.uint64(-(-self._pixels // parts)), np.uint64(self._pixels),
                local=(1,), defines={"CHANNELS": channels},
            )  # fmt: skip
        total: Array = made.sum(axis=0, dtype=np.int64)
        return total
