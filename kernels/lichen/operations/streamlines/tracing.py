"""Streamlines as polylines, and where to begin them.

Lines go through the bilinear field by classical Runge-Kutta steps of equal arc length, in double precision; they end as
those of line integral convolution do. Places are in pixels, y down, centres of pixels at +0.5.

Evenly spaced lines are those of Jobard and Lefer: from a line that is kept, the next ones begin at its points, one
`spacing` to either side; a line is kept as far as it stays half a spacing away from all others, and begins only where
it is a whole spacing away. Lines that do not depend on each other are followed all at once.

Source: B. Jobard and W. Lefer, Creating evenly-spaced streamlines of arbitrary density, Visualization in Scientific
Computing '97.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from lichen.memory import Array
from lichen.operations.streamlines.lines import (
    Grid,
    border_share,
    critical_share,
    displacements,
    runge_kutta_4,
)
from lichen.operations.streamlines.walker import Walker

NEAREST = 0.5
"""Of the spacing: how near lines come to one another before they are cut."""
FEWEST = 5
"""Steps; shorter pieces are not kept."""


@dataclass(frozen=True, slots=True)
class Tracer:
    """What follows lines: at most `length` px each way, in steps of `step` px."""

    grid: Grid
    length: float
    step: float

    def lines(self, seeds: Array) -> list[Array]:
        """A polyline (n, 2) through each of the `seeds` (m, 2), in the direction of the field."""
        ahead, behind = self.halves(seeds, 1.0), self.halves(seeds, -1.0)
        return [np.concatenate([back[:0:-1], on]) for back, on in zip(behind, ahead, strict=True)]

    def halves(self, seeds: Array, sign: float) -> list[Array]:
        """Forwards (1) or backwards (-1) from each seed, which is the first point."""
        count = max(int(np.ceil(self.length / self.step)), 1)
        step = sign * self.length / count
        origin = (np.zeros(len(seeds), np.int64),) * 2
        grid = self.grid
        at = seeds - 0.5
        here = grid.at(origin, at[:, 0], at[:, 1])
        alive = np.ones(len(seeds), bool)
        path, kept = [at], [np.ones(len(seeds), bool)]

        def slope(at: Array, part: float) -> Array:
            return displacements(grid.at(origin, at[:, 0], at[:, 1]), step, True)

        with np.errstate(all="ignore"):
            for _ in range(count):
                moves = runge_kutta_4(slope, at, displacements(here, step, True))
                there = grid.at(origin, at[:, 0] + moves[:, 0], at[:, 1] + moves[:, 1])
                share = np.minimum(border_share(grid, origin, at, moves), critical_share(here, there, moves, sign))
                share = np.where(alive & (share > 0), share, 0.0)
                at = np.where(share[:, None] > 0, at + share[:, None] * moves, at)
                alive, here = share == 1, there
                path.append(at)
                kept.append(share > 0)
                if not alive.any():
                    break
        points, counts = np.stack(path, axis=1) + 0.5, np.stack(kept, axis=1).sum(axis=1)
        return [line[:size] for line, size in zip(points, counts, strict=True)]


@dataclass(slots=True)
class Crowd:
    """Points in cells of one spacing, to ask whether any is near."""

    spacing: float
    cells: dict[tuple[int, int], list[Array]] = field(default_factory=dict)

    def add(self, points: Array) -> None:
        keys = np.floor(points / self.spacing).astype(int)
        order = np.lexsort(keys.T)
        keys, points = keys[order], points[order]
        cuts = np.flatnonzero((np.diff(keys, axis=0) != 0).any(axis=1)) + 1
        for part, key in zip(np.split(points, cuts), keys[np.concatenate([[0], cuts])], strict=True):
            self.cells.setdefault((int(key[0]), int(key[1])), []).append(part)

    def nearest(self, points: Array) -> Array:
        """Distances (n,) of these points from the nearest of all, as far as they are within one spacing."""
        keys = np.floor(points / self.spacing).astype(int)
        found = np.full(len(points), np.inf)
        unique, which = np.unique(keys, axis=0, return_inverse=True)
        for number, (x, y) in enumerate(unique):
            around = [
                part for i in (-1, 0, 1) for j in (-1, 0, 1) for part in self.cells.get((int(x) + i, int(y) + j), ())
            ]
            if around:
                mine = np.flatnonzero(which.reshape(-1) == number)
                others = np.concatenate(around)
                apart = np.hypot(*(points[mine][:, None] - others[None]).transpose(2, 0, 1))
                found[mine] = apart.min(axis=1)
        return found


def evenly(walker: Walker, first: Array, spacing: float, limit: int) -> Iterator[Array]:
    """Evenly spaced lines, at most `limit`, from the seeds `first` and then from one another."""
    crowd, queue, kept = Crowd(spacing), deque([first]), 0
    while queue:
        seeds = queue.popleft()
        seeds = seeds[((seeds > 0) & (seeds < [walker.width, walker.height])).all(axis=1)]
        while len(seeds := seeds[crowd.nearest(seeds) >= spacing]):
            seed = (float(seeds[0, 0]), float(seeds[0, 1]))
            seeds = seeds[1:]
            line = _cut(crowd, walker.half(seed, 1.0), walker.half(seed, -1.0), spacing)
            if len(line) > FEWEST:
                crowd.add(line)
                queue.append(_beside(line, spacing))
                kept += 1
                yield line
            if kept == limit:
                return


def _cut(crowd: Crowd, ahead: Array, behind: Array, spacing: float) -> Array:
    """Both halves as far as they keep their distance from others and from where the line has been a spacing before."""
    halves = []
    for half in (ahead, behind):
        near = np.flatnonzero(crowd.nearest(half) < NEAREST * spacing)
        stop = near[0] if near.size else len(half)
        halves.append(half[: min(stop, _closes(half, spacing))])
    return np.concatenate([halves[1][:0:-1], halves[0]])


def _closes(half: Array, spacing: float) -> int:
    """How many points a line has before it comes back to where it began."""
    away = np.hypot(*(half - half[0]).T)
    left = np.flatnonzero(away > spacing)
    if not left.size:
        return len(half)
    back = np.flatnonzero(away[left[0] :] < NEAREST * spacing)
    return int(left[0] + back[0]) if back.size else len(half)


def _beside(line: Array, spacing: float) -> Array:
    """Seeds one spacing to either side of the points of a line."""
    way = np.gradient(line, axis=0)
    length = np.hypot(*way.T)[:, None]
    across = np.where(length > 0, way[:, ::-1] * [-1, 1] / np.where(length > 0, length, 1), 0)
    both = np.stack([line + spacing * across, line - spacing * across], axis=1)
    return both.reshape(-1, 2)


def grid_of_seeds(width: int, height: int, spacing: float) -> Array:
    """Seeds in rows and columns about one spacing apart, in the middle of equal parts of the image."""
    columns, rows = max(round(width / spacing), 1), max(round(height / spacing), 1)
    x, y = (np.arange(columns) + 0.5) * width / columns, (np.arange(rows) + 0.5) * height / rows
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
