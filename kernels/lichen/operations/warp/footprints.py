"""The ellipse that a pixel's footprint stands for.

With J the derivative of the map, the pixel's unit circle becomes an ellipse in the source whose half axes are the
singular values of J: its shape matrix is J J^T. No axis is taken shorter than one sample of the source: what the map
magnifies is interpolated, not averaged. So the shape is V = U max(L, 1) U^T for J J^T = U L U^T, and a sample at
distance d from the place has the squared radius q = d^T V^-1 d.

An eigenvalue of a thin footprint is the small difference of large numbers; it is found from the determinant instead.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lichen.memory import Array
from lichen.operations.warp.maps import Doubles, Places

HUGE = 1e150
"""Beyond this, squares leave float64: an axis without end."""


class Ellipses(NamedTuple):
    """Eigenvalues of V and the direction of its longer axis; all float64 of one shape. Every entry of V, of its root
    and of its inverse but xy is then a sum of positive terms: nothing cancels, however thin the ellipse."""

    major: Doubles
    """larger eigenvalue of V, at least 1"""
    minor: Doubles
    cc: Doubles
    """squared cosine of the longer axis's direction"""
    ss: Doubles
    cs: Doubles
    """cosine times sine"""
    rho: Doubles
    """half the longer axis before it was limited: the larger singular value of J"""

    @classmethod
    def of(cls, at: Places) -> Ellipses:
        with np.errstate(all="ignore"):
            xu, yu, xv, yv = (np.where(np.abs(each) < HUGE, each, HUGE) for each in (at.xu, at.yu, at.xv, at.yv))
            both, b = (xu * xu + xv * xv) + (yu * yu + yv * yv), xu * yu + xv * yv
            half = ((xu - yu) * (xu + yu) + (xv - yv) * (xv + yv)) / 2
            along = np.hypot(half, b)
            largest = both / 2 + along
            determinant = xu * yv - xv * yu
            smallest = np.where(largest > 0, np.square(determinant / np.sqrt(largest)), 0.0)
            c, s = np.where(along == 0, 1.0, half / along), np.where(along == 0, 0.0, b / along)
        big = (1 + np.abs(c)) / 2
        small = s * s / (4 * big)
        cc, ss = np.where(c >= 0, big, small), np.where(c >= 0, small, big)
        return cls(np.maximum(largest, 1), np.maximum(smallest, 1), cc, ss, s / 2, np.sqrt(largest))

    def take(self, which: npt.NDArray[Any]) -> Ellipses:
        return Ellipses(*(each[which] for each in self))

    @property
    def xx(self) -> Doubles:
        """The squared half width of the ellipse."""
        made: Doubles = self.cc * self.major + self.ss * self.minor
        return made

    @property
    def yy(self) -> Doubles:
        made: Doubles = self.ss * self.major + self.cc * self.minor
        return made

    def at_level(self, level: int) -> Ellipses:
        """In samples of a pyramid's level, less what its boxes of 2^level samples have averaged already: a Gaussian of
        shape V has the variance V / 4, a box that of its width squared over 12. No axis is taken shorter than one
        sample there either."""
        share, done = 4.0**-level, (1 - 4.0**-level) / 3
        major, minor = (np.maximum(each * share - done, 1) for each in (self.major, self.minor))
        return self._replace(major=major, minor=minor)

    def inverse(self) -> tuple[Doubles, Doubles, Doubles]:
        """V^-1 as its xx, xy and yy."""
        big, small = 1 / self.major, 1 / self.minor
        return self.cc * big + self.ss * small, self.cs * (big - small), self.ss * big + self.cc * small

    def root(self) -> tuple[Doubles, Doubles, Doubles]:
        """V^(1/2) as its xx, xy and yy."""
        big, small = np.sqrt(self.major), np.sqrt(self.minor)
        return self.cc * big + self.ss * small, self.cs * (big - small), self.ss * big + self.cc * small

    def blend(self) -> Doubles:
        """How far the average replaces the interpolated value: 0 where nothing shrinks, 1 from half size on. What
        shrinks by a millionth is a rounded 1, and counts as none."""
        share = np.clip(self.rho - 1, 0, 1)
        return np.where(share < 1e-6, 0.0, share * share * (3 - 2 * share))

    def beyond(self, height: int, width: int) -> Array:
        """Where twice the ellipse, which holds all of the weight but 3e-4, is wider or taller than four sources."""
        made: Array = (self.xx > float(width) ** 2) | (self.yy > float(height) ** 2)
        return made
