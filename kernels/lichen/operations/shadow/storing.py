"""Depth in few bits: what a map's depths become when they are stored as whole numbers or short floats.

Whole numbers are codes 0 to 2^bits - 1: of depth itself between near and far, or of a window's depth (1 / near - 1 / z)
/ (1 / near - 1 / far), which spends nearly all of them close to the light. Depths beyond the ends take the end's code.
The step is the distance of neighbouring codes, at that depth.

Floats have so many significant bits, and no ends. Of depth itself their step is the same share of it everywhere. Of a
reversed window's depth it is, too, and less near the far end: 1 / z makes depths coarse where they are far and floats
make numbers fine where they are small, so that the two cancel.

Source: E. Lengyel, Mathematics for 3D game programming and computer graphics, 2011, section 5.5; B. Lindstrom, Depth
precision visualized, 2015 (reversed floats); G. Veltkamp's splitting as in T. Dekker, A floating-point technique for
extending the available precision, Numerische Mathematik 18, 1971.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from lichen.memory import Array
from lichen.operations.shadow.parameters import Parameters


class Store(StrEnum):
    """What the numbers of a map are."""

    WHOLE = "whole"
    LINEAR = "linear"
    WINDOW = "window"
    FLOAT = "float"
    REVERSED = "reversed"


@dataclass(frozen=True, slots=True)
class Stored:
    """How a map is stored: as it is, or in so many bits."""

    kind: Store = Store.WHOLE
    bits: int = 0

    def of(self, m: Array, p: Parameters) -> tuple[Array, Array]:
        """Depths after storing, and the step there. Infinite ones take the end's code, and are nothing all the same."""
        if self.kind is Store.WHOLE:
            return m, np.zeros_like(m)
        made, steps = self._floating(m, p) if self.floating else self._coded(m, p)
        return np.where(np.isinf(m), m, made), steps

    @property
    def floating(self) -> bool:
        return self.kind in (Store.FLOAT, Store.REVERSED)

    @property
    def splitter(self) -> float:
        """A double times this, less what it grew by, keeps so many bits."""
        return 2.0 ** (53 - self.bits) + 1

    @property
    def spacing(self) -> float:
        """The largest relative distance of neighbouring floats."""
        return 2.0 ** (1 - self.bits)

    def _coded(self, m: Array, p: Parameters) -> tuple[Array, Array]:
        assert p.light_far is not None, "whole numbers have ends"
        near, far, levels = p.light_near, p.light_far, float(2**self.bits - 1)
        inside = np.where(m < near, near, np.where(m > far, far, m))
        if self.kind is Store.LINEAR:
            step = (far - near) / levels
            code = np.rint((inside - near) / step)
            return code * step + near, np.full_like(m, step)
        per = (1 / near - 1 / far) / levels
        code = np.rint((1 / near - 1 / inside) / per)
        made = 1 / (1 / near - code * per)
        return made, made * made * per

    def _floating(self, m: Array, p: Parameters) -> tuple[Array, Array]:
        if self.kind is Store.FLOAT:
            made = change = self._rounded(m)
        else:
            s, a, b = reversed_terms(p)
            made = s / (a + b * self._rounded((s / m - a) / b))
            change = made - made * made * (a / s)  # d times the slope of depth over d, finite at depth 0 too
        return made, np.where(np.isinf(made), 0.0, np.abs(change) * self.spacing)

    def _rounded(self, x: Array) -> Array:
        large = x * self.splitter
        return np.asarray(np.where(np.isinf(x), x, large - (large - x)))


def reversed_terms(p: Parameters) -> tuple[float, float, float]:
    """s, a and b of the depth z = s / (a + b d) that a reversed window's d stands for."""
    if p.light_far is None:
        return p.light_near, 0.0, 1.0
    return p.light_near * p.light_far, p.light_near, p.light_far - p.light_near


WHOLE = Stored()
