"""Octaves become one: the sums of `Fractal`, with their derivatives by the chain rule.

An octave that fades, or that its mean stands for, goes in as kept n + (1 - kept) mean, with the mean of |n| where its
magnitude counts. Where it is not computed, kept is 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lichen.memory import Array
from lichen.operations.noise.basis import Values
from lichen.operations.noise.octaves import Cut, Octave
from lichen.operations.noise.parameters import Fractal


@dataclass(frozen=True, slots=True)
class Terms:
    """How one octave enters: the sum gets `factor` n (or |n|), a ridge `amplitude` s."""

    factor: float
    amplitude: float
    kept: float


@dataclass(frozen=True, slots=True)
class Shape:
    """The sum of one picture's octaves."""

    fractal: Fractal
    start: float
    """what the sum begins with: the means, and what the definition adds"""
    terms: tuple[Terms, ...]
    """of the octaves that are computed"""
    left: tuple[float, ...]
    """amplitudes of the others; a ridge goes on through them"""
    mean: float
    """that stands for an octave, of n or |n|"""


def shaped(fractal: Fractal, cut: Cut, mean: float, mean_magnitude: float) -> Shape:
    """The sum of these octaves of a basis of these means."""
    folds = fractal in (Fractal.TURBULENCE, Fractal.BILLOW, Fractal.RIDGED)
    mean = mean_magnitude if folds else mean
    scale = 2.0 if fractal is Fractal.BILLOW else 1.0
    terms = tuple(Terms(scale * o.amplitude * o.kept, o.amplitude, o.kept) for o in cut.computed)
    computed = len(cut.computed)
    means = [o.amplitude * (1 - o.kept if k < computed else 1.0) for k, o in enumerate(cut.asked)]
    start = scale * mean * float(np.sum(means)) if fractal is not Fractal.RIDGED else 0.0
    if fractal in (Fractal.BILLOW, Fractal.RIDGED):
        start -= 1.0 if cut.asked else 0.0
    return Shape(fractal, start, terms, tuple(o.amplitude for o in cut.left), mean)


class Summing:
    """A sum under way. Derivatives are per px, so that octaves of every frequency add."""

    def __init__(self, shape: Shape, size: tuple[int, int], dtype: np.dtype[np.floating], derivatives: bool) -> None:
        self._shape = shape
        self._total = np.full(size, shape.start, dtype)
        self._weight = np.ones(size, dtype)
        self._slopes = [np.zeros(size, dtype) for _ in range(2 * derivatives)]
        self._weight_slopes = [np.zeros(size, dtype) for _ in range(2 * derivatives)]

    def add(self, values: Values, octave: Octave, number: int) -> None:
        """The computed octave `number`; derivatives as the basis gives them, per cell."""
        n = values[0]
        steps = [v * f for v, f in zip(values[1:], octave.frequency, strict=True) if v is not None]
        terms = self._shape.terms[number]
        if self._shape.fractal in (Fractal.NONE, Fractal.FBM):
            self._total += terms.factor * n
            for slope, step in zip(self._slopes, steps, strict=True):
                slope += terms.factor * step
            return
        steps = [np.sign(n) * step for step in steps]
        n = np.abs(n)
        if self._shape.fractal is Fractal.RIDGED:
            q = terms.kept * n + (1 - terms.kept) * self._shape.mean
            self._ridge(q, [terms.kept * step for step in steps], terms.amplitude)
            return
        self._total += terms.factor * n
        for slope, step in zip(self._slopes, steps, strict=True):
            slope += terms.factor * step

    def _ridge(self, q: Array, steps: list[Array], amplitude: float) -> None:
        ridge = (1 - q) * (1 - q)
        signal = self._weight * ridge
        self._total += 2 * amplitude * signal
        rises = 2 * signal < 1
        for slope, carried, step in zip(self._slopes, self._weight_slopes, steps, strict=True):
            turned = carried * ridge - 2 * self._weight * (1 - q) * step
            slope += 2 * amplitude * turned
            carried[...] = np.where(rises, 2 * turned, 0)
        self._weight = np.where(rises, 2 * signal, 1).astype(self._total.dtype)

    def finish(self) -> list[Array]:
        """The noise in [-1, 1], and its derivatives."""
        if self._shape.fractal is Fractal.RIDGED:
            still = np.zeros((), self._total.dtype)
            for amplitude in self._shape.left:
                mean = still + self._total.dtype.type(self._shape.mean)
                self._ridge(mean, [still for _ in self._slopes], amplitude)
        return [self._total, *self._slopes]
