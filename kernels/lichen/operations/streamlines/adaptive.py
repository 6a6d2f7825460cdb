"""Lines in steps as long as their error allows: Dormand and Prince's pair of orders 5 and 4, in NumPy.

A step is kept where the pair's difference is within the tolerance, else it is halved; after a step with a 64th of the
tolerance, and no sooner, the next one is doubled: lengths are powers of two, so that rounding seldom tips a decision.
Where the field is not smooth no step would do: the shortest one is made whatever its error, by Euler's rule where the
field ends within it. Between the ends of a step the
line is the cubic that has its slopes there (Hermite's), and the texture is read at equal distances along it.

Sources: J. R. Dormand and P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comp. Appl. Math. 6, 1980;
D. Stalling and H.-C. Hege, SIGGRAPH 1995, section 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lichen.memory import Array
from lichen.operations.streamlines.following import Lines, Reader
from lichen.operations.streamlines.lines import Cells, Index, border_share, critical_share, displacements
from lichen.operations.streamlines.task import Task

STAGES: tuple[tuple[float, ...], ...] = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
"""The last row is the solution of order 5: the last stage is the next step's first."""
NODES = (1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
DIFFERENCE = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
SHORTEST = 1 / 4
"""Of a step, over the distance between samples."""


def spacing(tolerance: float) -> float:
    """Between samples of the texture, px: halved for each tenth of the tolerance."""
    return float(min(max(2.0 * tolerance ** math.log10(2.0), 1 / 16), 1.0))


@dataclass(eq=False)
class Knots:
    """The last step of each line, from `start` to `end`, and whether the line goes on."""

    s: Array
    """at the end of the step"""
    ended: Array
    """where the line ends; infinity while it does not"""
    step: Array
    """to try next"""
    at: Array
    slope: Array
    vector: Array
    before_s: Array
    before_at: Array
    before_slope: Array


class AdaptiveLines(Lines):
    """The lines of a task with `tolerance` px a step."""

    def __init__(self, task: Task, tolerance: float, dtype: npt.DTypeLike) -> None:
        super().__init__(task, spacing(tolerance), dtype)
        self.tolerance = tolerance

    def adapted(self) -> Array:
        """The result, (height, width, channels)."""
        pixels = np.arange(self.field.height * self.field.width)
        blocks = np.split(pixels, range(self.block, len(pixels), self.block))
        with np.errstate(all="ignore"):
            rows = [self._adapt(block) for block in blocks]
        return np.concatenate(rows).reshape(self.field.height, self.field.width, -1)

    def _adapt(self, pixels: Index) -> Array:
        cells = (pixels % self.field.width, pixels // self.field.width)
        read = Reader(self.texture, self.field, cells, self.dtype)
        own = read.own
        total, weight = np.zeros_like(own), np.zeros_like(own[:, :1])
        for sign, k in zip((1.0, -1.0), self.weights, strict=True):
            knots = self._begin(cells, sign)
            last = own - own
            for j in range(1, self.count + 1):
                target = self.dtype.type(self.task.p.length if j == self.count else j * self.step)
                while (wanting := np.flatnonzero((knots.s < target) & np.isinf(knots.ended))).size:
                    self._try(knots, cells, wanting, sign)
                share = 1 - (target - np.minimum(knots.ended, target)) / self.dtype.type(self.step)
                share = np.maximum(share, 0)[:, None].astype(self.dtype)
                if not share.any():
                    break
                sample = read(_between(knots, target)) - own
                end = k[j - 1] + share * (k[j] - k[j - 1])
                total += np.where(share > 0, share / 2 * (k[j - 1] * last + end * sample), 0)
                weight += share / 2 * (k[j - 1] + end)
                last = sample
        return np.where(weight > 0, own + total / weight, own)

    def _begin(self, cells: Cells, sign: float) -> Knots:
        count, kind = len(cells[0]), self.dtype
        at, zero = np.zeros((count, 2), kind), np.zeros(count, kind)
        vector = self.flow.at(cells, at, 0.0)
        slope = displacements(vector, sign, self.arc)
        step, ended = np.full(count, self.step, kind), np.full(count, np.inf, kind)
        return Knots(zero, ended, step, at, slope, vector, zero.copy(), at.copy(), slope.copy())

    def _try(self, knots: Knots, all_cells: Cells, lines: Index, sign: float) -> None:
        """One step of those lines, kept or not."""
        cells = (all_cells[0][lines], all_cells[1][lines])
        s, at, here, first = knots.s[lines], knots.at[lines], knots.vector[lines], knots.slope[lines]
        left = self.dtype.type(self.task.p.length) - s
        step = np.minimum(knots.step[lines], left)
        by = step[:, None]
        stages = [first]
        for row, node in zip(STAGES, NODES, strict=True):
            moves = by * _weighted(row, stages)
            there = self.flow.at(cells, at + moves, sign * (s + self.dtype.type(node) * step))
            stages.append(displacements(there, sign, self.arc))
        error = np.abs(by * _weighted(DIFFERENCE, stages)).max(axis=1)
        good = error <= self.tolerance
        shortest = step <= self.dtype.type(self.step * SHORTEST)
        astray = np.isnan(error)
        if (astray & shortest).any():
            moves = np.where(astray[:, None], by * first, moves)
            there = np.where(astray[:, None], self.flow.at(cells, at + moves, sign * (s + step)), there)
        grown = np.where(error <= self.tolerance / 64, 2 * step, step)
        knots.step[lines] = np.where(good, np.maximum(grown, self.step * SHORTEST), np.where(shortest, step, step / 2))

        share = np.minimum(border_share(self.field, cells, at, moves), critical_share(here, there, moves, sign))
        share = np.maximum(share, 0)
        kept = good | shortest
        lines, share, step, moves = lines[kept], share[kept], step[kept], moves[kept]
        knots.before_s[lines], knots.before_at[lines] = s[kept], at[kept]
        whole = (share == 1) & ~astray[kept]
        slope = displacements(there[kept], sign, self.arc)
        straight = np.where(share > 0, moves.T / step, 0).T  # of a step that was cut or led astray
        knots.before_slope[lines] = np.where(whole[:, None], first[kept], straight)
        knots.at[lines] = np.where(share[:, None] > 0, at[kept] + share[:, None] * moves, at[kept])
        knots.slope[lines], knots.vector[lines] = slope, there[kept]
        reached = np.where(step == left[kept], self.dtype.type(self.task.p.length), s[kept] + step)
        knots.s[lines] = reached
        knots.ended[lines] = np.where(share < 1, s[kept] + share * step, np.inf)


def _weighted(row: tuple[float, ...], stages: list[Array]) -> Array:
    kind = stages[0].dtype.type
    total = np.zeros_like(stages[0])
    for weight, stage in zip(row, stages, strict=False):
        if weight:
            total = total + kind(weight) * stage
    return total


def _between(knots: Knots, target: Array) -> Array:
    """Places of the lines at `target`, or where they ended: on the cubic through the ends of the step, on its chord
    where the step was cut."""
    step: Array = (np.minimum(knots.s, knots.ended) - knots.before_s)[:, None]
    u = np.where(step > 0, np.minimum((target - knots.before_s)[:, None] / step, 1), 1).astype(step.dtype)
    left = 1 - u
    a, b, m, n = knots.before_at, knots.at, knots.before_slope * step, knots.slope * step
    straight = a + u * (b - a)
    cubic = a + (3 - 2 * u) * u * u * (b - a) + u * left * (left * m - u * n)
    placed: Array = np.where(np.isinf(knots.ended)[:, None] & ~np.isnan(cubic), cubic, straight)
    return placed
