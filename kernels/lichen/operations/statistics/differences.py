"""The figures of two pictures' differences by differences.cl: those of `lichen.accuracy.metrics`, in one pass,
which can write the map, too: it waits for memory anyway, and two kernels read both pictures twice.

Sums are taken in doubles over runs of `RUN` samples and the runs' sums are added exactly, so they depend on nothing
but the pictures. Of the largest thousandth the kernel keeps what exceeds a bound from a sample of the pixels; where
that was too high, or more exceed it than there is room for, all differences are ranked on the host.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lichen.accuracy.metrics import Totals, high_bound, quantile, whole_quantile
from lichen.image import Alpha, Image
from lichen.memory import Array, aligned, aligned_empty

if TYPE_CHECKING:
    from lichen.opencl.device import Device

FEWEST = 1 << 18
"""Samples from which on it is quicker than NumPy, and its bound is one."""
RUN = 1 << 14
"""Samples of a run."""
ROOM = 16
"""Of so many differences one may exceed the bound."""
FIGURES = 16
"""What an item writes: sum, sum of squares, largest and number in the border and inside; the most codes apart in 8 and
in 16 bits, and how many are apart at all; mismatches as they show and as they are; how many are the bound; ULPs."""


@dataclass(frozen=True, slots=True)
class Figures:
    """What was found; `border` and `inside` hold largest and RMS, None where there are no pixels, and `codes` those of
    8 and of 16 bits: the most apart, the share that is, mismatches."""

    totals: Totals
    border: dict[str, float] | None
    inside: dict[str, float] | None
    codes: dict[str, dict[str, Any]]
    ulps: float


def worthwhile(device: Device, *pictures: Image) -> bool:
    """Whether the kernel can take them, and is quicker."""
    single = all(each.pixels.dtype == np.float32 for each in pictures)
    return single and device.has_fp64 and pictures[0].pixels.size >= FEWEST


def figures(
    device: Device, image: Image, reference: Array, margin: int, *, codes: bool, ulps: bool,
    out: Array | None = None, signed: bool = False,
) -> Figures:  # fmt: skip
    """Of float32 pictures of one shape, whose differences `out` gets meanwhile: signed, or how large they are."""
    height, width, channels = image.pixels.shape
    made, exact = (each.reshape(-1, channels) for each in (image.pixels, reference))
    bound = high_bound(made, exact, image.alpha)
    parts = aligned_empty((-(-made.size // RUN), FIGURES), np.float64)
    high, kept = aligned_empty((made.size // ROOM,), np.float64), np.zeros(1, np.uint32)
    with device.session() as session:
        session.launch(
            "statistics/differences.cl", "differences", (len(parts),),
            aligned(image.pixels), aligned(reference), None if out is None else session.write(out),
            session.write(parts), session.write(high), session.readwrite(kept), np.uint32(high.size),
            np.float64(bound), np.uint64(RUN), np.uint64(made.size), np.uint64(width * channels),
            np.uint64(min(margin, width) * channels), np.uint64(margin),
            local=(1,),
            defines={
                "COVERAGE": channels if image.alpha is Alpha.STRAIGHT else 0, "CODES": int(codes), "ULPS": int(ulps),
                "MAP": 0 if out is None else 1 + signed,
            },
        )  # fmt: skip
    sums, largest, taken = parts.sum(axis=0), parts.max(axis=0), int(kept[0])
    counts = sums[3], sums[7]
    added, squares = ([math.fsum(parts[:, first].tolist()) for first in (at, at + 4)] for at in (0, 1))
    inner = max(height - 2 * margin, 0) * max(width - 2 * margin, 0)
    border, inside = (
        {"largest": float(largest[4 * k + 2]), "rms": _rms(squares[k], counts[k])} if pixels else None
        for k, pixels in enumerate((height * width - inner, inner))
    )
    count, p999 = int(sum(counts)), None
    if count and taken <= high.size:
        p999 = quantile(high[:taken], count, bound, int(sums[14]) if bound else count - taken)
    if count and p999 is None:
        p999 = whole_quantile(made, exact, image.alpha)
    return Figures(
        Totals(
            float(max(largest[2], largest[6])), p999 or 0.0, _rms(sum(squares), count),
            sum(added) / count if count else 0.0, int(sums[12]),
        ),
        border,
        inside,
        {
            name: {"largest": int(largest[8 + k]), "differing": float(sums[10 + k]) / made.size,
                   "mismatched": int(sums[13])}
            for k, name in enumerate(("uint8", "uint16"))
        },
        float(largest[15]),
    )  # fmt: skip


def _rms(squares: float, count: float) -> float:
    return math.sqrt(squares / count) if count else 0.0
