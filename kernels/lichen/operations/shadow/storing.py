"""Depth in few bits: what a map's depths become when they are stored as whole numbers.

Codes are 0 to 2^bits - 1: of depth itself between near and far, or of a window's depth (1 / near - 1 / z) / (1 / near -
1 / far), which spends nearly all of them close to the light. Depths beyond the ends take the end's code. The step is
the distance of neighbouring codes, at that depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lichen.memory import Array
from lichen.operations.shadow.parameters import Parameters


@dataclass(frozen=True, slots=True)
class Stored:
    """How a map is stored: as it is (no bits), linear, or as a window's depth."""

    bits: int = 0
    window: bool = False

    def of(self, m: Array, p: Parameters) -> tuple[Array, Array]:
        """Depths after storing, and the step there. Infinite ones take the end's code, and are nothing all the same."""
        if not self.bits or p.light_far is None:
            return m, np.zeros_like(m)
        near, far, levels = p.light_near, p.light_far, float(2**self.bits - 1)
        inside = np.where(m < near, near, np.where(m > far, far, m))
        if not self.window:
            step = (far - near) / levels
            code = np.rint((inside - near) / step)
            made, steps = code * step + near, np.full_like(m, step)
        else:
            per = (1 / near - 1 / far) / levels
            code = np.rint((1 / near - 1 / inside) / per)
            made = 1 / (1 / near - code * per)
            steps = made * made * per
        return np.where(np.isinf(m), m, made), steps


WHOLE = Stored()
