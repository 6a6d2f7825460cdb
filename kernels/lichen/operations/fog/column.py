"""Fog whose density depends on height alone: its mean between the eye's height and another, in a stable form.

A profile is a list of heights with a density at each: linear between them, constant beyond both ends. Along a ray of
length d that rises by x, the optical depth is

    d / x  integral of density from the eye's height to x above it   =   d mean(x)

which is equation 5 of Heidrich et al. As it stands it is 0 / 0 for a level ray, and where x is small it divides the
difference of two nearly equal integrals. Here heights are counted from the eye, and the profile has a knot there, so
the integral begins at 0 and only grows: with segments that begin at b and are w long, of density s + m (. - b),

    mean(x) = sum over segments of  t / |x|  (s + m t / 2),    t = |x| - b, within [0, w]

where t / |x| is 1 while x has not left the first segment. No difference is taken of anything that was summed, nothing
is divided by 0, and at x = 0 the mean is the density at the eye.

Source: W. Heidrich et al., Applications of pixel textures in visualization and realistic image synthesis, I3D 1999,
section 5.2; J. Legakis, Fast multi-layer fog, SIGGRAPH 1998.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lichen.memory import Array


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """The profile above and below the eye; each an array (segments, 4) of b, w, s and m, the last w infinite."""

    above: Array
    below: Array

    @classmethod
    def around(cls, eye: float, heights: Sequence[float], densities: Sequence[float]) -> Column:
        """The profile of rising heights, seen from the eye's height."""
        at = np.array(heights, np.float64) - eye
        of = np.array(densities, np.float64)
        here = float(np.interp(0.0, at, of))
        return cls(_segments(at[at > 0], of[at > 0], here), _segments(-at[at < 0][::-1], of[at < 0][::-1], here))

    @property
    def sides(self) -> tuple[Array, Array]:
        return self.above, self.below

    @property
    def densest(self) -> float:
        return float(max(side[:, 2].max() for side in self.sides))

    @property
    def steepest(self) -> float:
        """The largest change of density for a unit of height."""
        return float(max(np.abs(side[:, 3]).max() for side in self.sides))

    @property
    def reach(self) -> float:
        """How far from the eye's height the density changes at most."""
        return float(max(side[-1, 0] for side in self.sides))

    def ends(self, side: int) -> tuple[float, float]:
        """The density beyond the last height of a side, and the integral up to it."""
        _, w, s, m = self.sides[side][:-1].T
        return float(self.sides[side][-1, 2]), float(np.sum(w * (s + m * w / 2)))

    def mean(self, rise: Array, dtype: npt.DTypeLike = np.float64) -> Array:
        """The mean density between the eye's height and `rise` above it (below where negative); finite rises."""
        kind: Any = np.dtype(dtype).type
        far, total = np.abs(rise), np.zeros(rise.shape, dtype)
        for number, segments in enumerate(self.sides):
            here = (rise < 0) == bool(number)
            for first, (b, w, s, m) in enumerate(segments.astype(dtype)):
                t = np.minimum(np.maximum(far - b, kind(0)), w)
                share = np.divide(t, far, out=np.zeros_like(total), where=(t > 0) & (far > 0))
                if first == 0:
                    share = np.where(far <= w, kind(1), share)
                total += np.where(here, share * (s + kind(0.5) * m * t), kind(0))
        return total


def _segments(at: Array, of: Array, here: float) -> Array:
    """Of one side, from the eye: knots at rising distances, after the eye's own."""
    base, density = np.concatenate([[0.0], at]), np.concatenate([[here], of])
    wide = np.append(np.diff(base), np.inf)
    slope = np.append(np.diff(density) / np.diff(base), 0.0)
    return np.stack([base, wide, density, slope], axis=1)
