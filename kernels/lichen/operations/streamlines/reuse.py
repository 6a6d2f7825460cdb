"""Lines that serve many pixels: what `fastlic` does, in NumPy and on a device, round by round alike.

A line is followed from a pixel's centre, by the midpoint rule in equal steps of arc length, `length` and a stretch more
each way. The differences of its samples from the first are summed along it; then the mean over any part of the line is
the difference of two sums. Every pixel whose centre the line passes within `distance` takes the mean over the part
around the point nearest to it. Among lines of one round the nearest wins, of equals the first; a value once given
stays.

Rounds begin at pixels without a value: those of a lattice of up to 8 x 8 first, then the places between, in
portions that fit into memory. Which they are follows from the image alone, so results do not depend on threads. When
too few pixels are left for lines to meet them, each is followed for its own pixel only.

Positions are absolute: they are rounded to 2^-24 of the image's side.

Source: D. Stalling and H.-C. Hege, Fast and resolution independent line integral convolution, SIGGRAPH 1995. The
distance is ours: there, a line serves every pixel it crosses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operations.streamlines.following import Reader
from lichen.operations.streamlines.launch import SEGMENT, decoded, defines, texels
from lichen.operations.streamlines.lines import (
    Grid,
    Index,
    border_share,
    critical_share,
    displacements,
    runge_kutta_2,
)
from lichen.operations.streamlines.task import Task

SOURCE = "streamlines/reuse.cl"
LATTICES = ((1 << 18, 16), (1 << 16, 8), (1 << 14, 4), (1 << 12, 2), (0, 1))
"""Pixels from which on the lattice has that side: rounds are of some hundred lines at least."""
MEMORY = 1 << 25
"""Bytes that the samples of one portion of lines may take."""
FREE, TAKEN = 0xFFFFFFFF, 0
"""Keys of pixels: no line has come near; it has its value."""
NEARNESS = 255.0
"""Codes of the distance in a key."""

Keys = npt.NDArray[np.uint32]


@dataclass(frozen=True, slots=True)
class Reach:
    """How far lines of a portion are followed, in steps: `window` for a pixel's own mean, and `extra` each way."""

    step: float
    window: int
    extra: int

    @property
    def count(self) -> int:
        return self.window + self.extra

    @property
    def samples(self) -> int:
        return 2 * self.count + 1

    @property
    def lines(self) -> int:
        """Of a portion."""
        return max(MEMORY // (12 * self.samples) // SEGMENT, 1) * SEGMENT


def step_of(task: Task, distance: float) -> tuple[float, int]:
    """The length of equal steps, and how many make up the line each way: finer for smaller distances."""
    count = max(task.p.steps(float(np.clip(8 * distance, 0.25, 1.0))), 1)
    return task.p.length / count, count


def portions(keys: Keys, task: Task, distance: float) -> Iterator[tuple[Array, Reach]]:
    """Pixels to begin at, and how far to go; `keys` is read anew before each portion."""
    if not keys.any():
        return
    step, window = step_of(task, distance)
    farthest = int(min(2 * window, max(task.width, task.height) / step + 1))
    shared, own = Reach(step, window, farthest), Reach(step, window, 0)
    rows, columns = np.arange(task.height), np.arange(task.width)
    side = next(side for least, side in LATTICES if keys.size >= least)
    for places in _rounds(side) if side > 1 else ():
        inside = np.concatenate([(rows[y::side, None] * task.width + columns[x::side]).reshape(-1) for y, x in places])
        while (inside := inside[keys[inside] == FREE]).size:
            if 4 * distance * task.p.length * np.count_nonzero(keys) <= keys.size:
                break
            yield inside[: shared.lines].astype(np.int32), shared
            inside = inside[shared.lines :]
    left = np.flatnonzero(keys == FREE).astype(np.int32)
    for first in range(0, left.size, own.lines):
        yield left[first : first + own.lines], own


def _rounds(side: int) -> Iterator[list[tuple[int, int]]]:
    """The places of a lattice, those far apart first, in rounds of ever more: each as many as all before it. The digits
    of a place's number in base 4 halve the lattice, and halve it again."""
    places = []
    for number in range(side * side):
        y, x, half, rest = 0, 0, side // 2, number
        while half:
            rest, digit = divmod(rest, 4)
            x, y, half = x + half * (digit & 1), y + half * ((digit & 1) ^ (digit >> 1)), half // 2
        places.append((y, x))
    yield places[:1]
    for power in range(2 * (side.bit_length() - 1)):
        yield places[1 << power : 2 << power]


def at_rest(vectors: Array, task: Task) -> Index:
    """The pixels without a line: they keep their own texels, whatever ends there."""
    begins = np.isfinite(vectors).all(axis=1) & (vectors != 0).any(axis=1) & (task.p.length > 0)
    return np.flatnonzero(~begins)


def own_texels(task: Task, pixels: Index) -> Array:
    """float32 (n, channels)."""
    field = Grid.of(task.field)
    texture = Grid.of(task.texels(np.float32), task.p.sampling, task.wraps)
    return Reader(texture, field, (pixels % task.width, pixels // task.width), np.float32).own


# -------------------------------------------------------------------------------------------------------------- OpenCL


def reused_opencl(device: Device, task: Task, distance: float) -> Array:
    """The result, (height, width, channels)."""
    keys = aligned_empty((task.height * task.width,), np.uint32)
    with device.session() as session:
        vectors = decoded(session, task, task.field)
        texture, sizes, result = texels(session, task, padded=True)
    resting = at_rest(vectors[:-1], task)
    result.reshape(-1, result.shape[2])[resting] = own_texels(task, resting)
    for channel in range(result.shape[2]):
        keys[:] = FREE
        keys[resting] = TAKEN
        for seeds, reach in portions(keys, task, distance):
            padded = aligned(np.concatenate([seeds, np.full(-seeds.size % SEGMENT, -1)]), np.int32)
            plan = (np.int32(channel), np.int32(reach.count), np.int32(padded.size), np.float32(reach.step))
            near = (np.int32(reach.window), np.int32(reach.extra), np.float32(distance))
            segments, kinds = (padded.size // SEGMENT,), defines(task, order=2)
            with device.session() as session:
                shape = (reach.samples, padded.size)
                path, sums = session.scratch((*shape, 2)), session.scratch(shape)
                ends = session.scratch((2, padded.size))
                session.launch(
                    SOURCE, "trace", segments, vectors, texture, padded, session.write(path), session.write(sums),
                    session.write(ends), *sizes, *plan, local=(1,), defines=kinds,
                )  # fmt: skip
                for kernel in ("offer", "settle_values"):
                    session.launch(
                        SOURCE, kernel, segments, padded, path, sums, ends, texture, session.readwrite(keys),
                        session.readwrite(result), *sizes, *plan, *near, local=(1,), defines=kinds,
                    )  # fmt: skip
    return result


# --------------------------------------------------------------------------------------------------------------- NumPy


def reused_numpy(task: Task, distance: float) -> Array:
    """The result, (height, width, channels)."""
    width = task.width
    field = Grid.of(task.vectors(np.float32), task.p.field_sampling, task.wraps)
    texture = Grid.of(task.texels(np.float32), task.p.sampling, task.wraps)
    resting, planes = at_rest(field.samples, task), []
    own = own_texels(task, resting)
    with np.errstate(all="ignore"):
        for channel in range(texture.samples.shape[1]):
            plane = Grid(texture.samples[:, channel : channel + 1], texture.height, texture.width, texture.sampling,
                         texture.wraps)  # fmt: skip
            keys = np.full(task.height * width, FREE, np.uint32)
            made = np.zeros(task.height * width, np.float32)
            keys[resting], made[resting] = TAKEN, own[:, channel]
            for seeds, reach in portions(keys, task, distance):
                lines = _Traced(field, plane, seeds.astype(np.int64), reach)
                _serve(lines, keys, made, distance)
            planes.append(made)
    return np.stack(planes, axis=1).reshape(task.height, width, -1)


class _Traced:
    """Lines of a portion: places (samples, lines, 2), sums (samples, lines), and how far they go (2, lines)."""

    def __init__(self, field: Grid, texture: Grid, seeds: Index, reach: Reach) -> None:
        self.field, self.reach, self.seeds = field, reach, seeds
        start = np.stack([seeds % field.width, seeds // field.width], axis=1).astype(np.float32)
        origin = (np.zeros(seeds.size, np.int64),) * 2
        read = Reader(texture, field, origin, np.float32)
        self.own = read(start)
        self.path = np.empty((reach.samples, seeds.size, 2), np.float32)
        self.sums = np.zeros((reach.samples, seeds.size), np.float32)
        self.ends = np.zeros((2, seeds.size), np.float32)
        self.path[reach.count] = start
        for way, sign in enumerate((1.0, -1.0)):
            step = sign * reach.step
            at: Array = start
            here, last = field.at(origin, start[:, 0], start[:, 1]), np.zeros_like(self.own)
            alive, total, end = np.ones(seeds.size, bool), np.zeros_like(self.own), np.zeros(seeds.size, np.float32)

            def slope(at: Array, part: float, step: float = step) -> Array:
                return displacements(field.at(origin, at[:, 0], at[:, 1]), step, True)

            for j in range(1, reach.count + 1):
                moves = runge_kutta_2(slope, at, displacements(here, step, True))
                there = field.at(origin, at[:, 0] + moves[:, 0], at[:, 1] + moves[:, 1])
                share = np.minimum(border_share(field, origin, at, moves), critical_share(here, there, moves, sign))
                share = np.where(alive & (share > 0), share, 0).astype(np.float32)
                at = np.where(share[:, None] > 0, at + share[:, None] * moves, at)
                sample = read(at) - self.own
                total = total + np.where(share > 0, share, 0)[:, None] * np.float32(step / 2) * (last + sample)
                end += share * np.float32(reach.step)
                self.path[reach.count + int(sign) * j] = at
                self.sums[reach.count + int(sign) * j] = total[:, 0]
                alive, here, last = share == 1, there, sample
            self.ends[way] = end

    def offers(self, sample: int, distance: float) -> tuple[Index, Array, Index, Array]:
        """Of the lines' samples of that number: which lines, how far along the line from there the point nearest to the
        centre of the pixel lies, the pixel, and its distance."""
        field, reach, path = self.field, self.reach, self.path
        at, k = path[sample], sample - reach.count
        ahead, behind = path[min(sample + 1, reach.samples - 1)], path[max(sample - 1, 0)]
        along = ahead - behind
        length = np.sqrt(np.square(along).sum(axis=1))
        unit = np.where(length[:, None] > 0, along / length[:, None], np.float32(0))
        size = np.array([field.width, field.height], np.float32)
        at_home = at - size * np.floor((at + np.float32(0.5)) / size) if field.wraps else at
        cell = np.clip(np.floor(at_home + np.float32(0.5)), 0, size - 1)
        off = cell - at_home
        t = (off * unit).sum(axis=1)
        apart = np.sqrt(np.maximum(np.square(off - t[:, None] * unit).sum(axis=1), 0))
        s = np.float32(abs(k) * reach.step)
        within = (s <= self.ends[0 if k >= 0 else 1]) & (np.abs(t) <= np.float32(reach.step / 2)) & (apart <= distance)
        lines = np.flatnonzero(within)
        pixels = (cell[lines, 1] * field.width + cell[lines, 0]).astype(np.int64)
        return lines, t[lines], pixels, apart[lines]

    def means(self, sample: int, lines: Index, t: Array) -> Array:
        """Over the part of those lines around the points at `t` from the sample."""
        reach = self.reach
        s = np.float32((sample - reach.count) * reach.step) + t
        window = np.float32(reach.window * reach.step)
        high = np.minimum(s + window, self.ends[0, lines])
        low = np.maximum(s - window, -self.ends[1, lines])
        apart = high - low
        mean = (self._sum(lines, high) - self._sum(lines, low)) / apart
        means: Array = np.where(apart > 0, self.own[lines, 0] + mean, self.own[lines, 0])
        return means

    def _sum(self, lines: Index, s: Array) -> Array:
        """Up to `s`, linear between samples."""
        place = s / np.float32(self.reach.step) + np.float32(self.reach.count)
        cell = np.clip(np.floor(place).astype(np.int64), 0, self.reach.samples - 2)
        part = place - cell.astype(np.float32)
        a, b = self.sums[cell, lines], self.sums[cell + 1, lines]
        mixed: Array = a + part * (b - a)
        return mixed


def _serve(lines: _Traced, keys: Keys, made: Array, distance: float) -> None:
    reach = lines.reach
    samples = range(reach.count - reach.extra, reach.count + reach.extra + 1)
    offered = []
    for sample in samples:
        which, t, pixels, apart = lines.offers(sample, distance)
        near = np.rint(apart / np.float32(distance) * np.float32(NEARNESS)).astype(np.uint32)
        key = (near << np.uint32(24)) | (which + 1).astype(np.uint32)
        np.minimum.at(keys, pixels, key)
        offered.append((sample, which, t, pixels, key))
    for sample, which, t, pixels, key in offered:
        won = keys[pixels] == key
        if won.any():
            made[pixels[won]] = lines.means(sample, which[won], t[won])
            keys[pixels[won]] = TAKEN
