"""Lines that serve many pixels: what `fastlic` does, in NumPy and on a device, round by round alike.

A line is followed from a pixel's centre, by the midpoint rule in equal steps of arc length, `length` and a stretch more
each way. The differences of its samples from the first are summed along it; then the mean over any part of the line is
the difference of two sums. Kernels other than the box are sums of waves (`Parameters.waves`), and cos(w (s - s0)) is
cos(w s) cos(w s0) + sin(w s) sin(w s0): of products with cosine and sine the sums are kept, too, and the mean around
any place s0 is a mixture of differences. The trapezoid rule makes a factor (w h / 2) / tan(w h / 2) of a wave's
integral, and the weights that a mean is divided by have it as well. A mean lies within the texture, whatever the
roundings of a line that ends at once. Every pixel whose centre the line passes within `distance` takes the mean over
the part around the point nearest to it. Among lines of one round the nearest wins, of equals the first; a value once
given stays.

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
from lichen.operations.streamlines.parameters import OVERSHOOT, Sampling
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
    sums: int = 1
    """kept of each sample"""

    @property
    def count(self) -> int:
        return self.window + self.extra

    @property
    def samples(self) -> int:
        return 2 * self.count + 1

    @property
    def lines(self) -> int:
        """Of a portion."""
        return max(MEMORY // (4 * (2 + self.sums) * self.samples) // SEGMENT, 1) * SEGMENT


def step_of(task: Task, distance: float) -> tuple[float, int]:
    """The length of equal steps, and how many make up the line each way: finer for smaller distances."""
    count = max(task.p.steps(float(np.clip(8 * distance, 0.25, 1.0))), 1)
    return task.p.length / count, count


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """A kernel in waves: `factors` (sums, samples) that samples are multiplied with before they are summed, of the
    constant, and of cosine and sine of each wave; `constant`; of each wave in `waves` (n, 4) its weight, radians a
    pixel, phase, and the weight of its integral; and the weight of a `whole` window."""

    factors: Array
    constant: float
    waves: Array
    whole: float

    @classmethod
    def of(cls, task: Task, reach: Reach) -> Weights:
        constant, *waves = task.p.waves(task.phase)
        s = (np.arange(reach.samples) - reach.count) * reach.step
        far = reach.window * reach.step
        factors, rows, whole = [np.ones_like(s)], [], 2 * constant.weight * far
        for wave in waves:
            pace = np.pi * wave.turns / task.p.length
            half = pace * reach.step / 2
            integral = 2 * wave.weight * half / np.tan(half) / pace
            factors += [np.cos(pace * s), np.sin(pace * s)]
            rows.append((wave.weight, pace, wave.phase, integral))
            whole += integral * np.cos(wave.phase) * np.sin(pace * far)
        return cls(
            np.array(factors, np.float32),
            constant.weight,
            np.array(rows, np.float32).reshape(-1, 4),
            float(whole),
        )


def extremes(task: Task) -> tuple[np.float32, np.float32]:
    """What means lie within: the values of the texture, and what cubics between them make."""
    texture = task.texels(np.float32)
    low, high = float(texture.min()), float(texture.max())
    more = OVERSHOOT * (high - low) if task.p.sampling is Sampling.CUBIC else 0.0
    return np.float32(low - more), np.float32(high + more)


def portions(keys: Keys, task: Task, distance: float) -> Iterator[tuple[Array, Reach]]:
    """Pixels to begin at, and how far to go; `keys` is read anew before each portion."""
    if not keys.any():
        return
    step, window = step_of(task, distance)
    farthest = int(min(2 * window, max(task.width, task.height) / step + 1))
    sums = 2 * len(task.p.waves()) - 1
    shared, own = Reach(step, window, farthest, sums), Reach(step, window, 0, sums)
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
    least, most = extremes(task)
    for channel in range(result.shape[2]):
        keys[:] = FREE
        keys[resting] = TAKEN
        for seeds, reach in portions(keys, task, distance):
            padded = aligned(np.concatenate([seeds, np.full(-seeds.size % SEGMENT, -1)]), np.int32)
            plan = (np.int32(channel), np.int32(reach.count), np.int32(padded.size), np.float32(reach.step))
            near = (np.int32(reach.window), np.int32(reach.extra), np.float32(distance))
            segments, kinds = (padded.size // SEGMENT,), defines(task, order=2)
            weights = Weights.of(task, reach)
            count = np.int32(len(weights.waves))
            waves = aligned(np.vstack([weights.waves, np.zeros((1, 4), np.float32)]))
            scales = (count, *(np.float32(each) for each in (weights.constant, weights.whole, least, most)))
            with device.session() as session:
                shape = (reach.samples, padded.size)
                path, sums = session.scratch((*shape, 2)), session.scratch((reach.sums, *shape))
                ends = session.scratch((2, padded.size))
                session.launch(
                    SOURCE, "trace", segments, vectors, texture, padded, session.write(path), session.write(sums),
                    session.write(ends), aligned(weights.factors), *sizes, *plan, np.int32(reach.sums), local=(1,),
                    defines=kinds,
                )  # fmt: skip
                for kernel in ("offer", "settle_values"):
                    session.launch(
                        SOURCE, kernel, segments, padded, path, sums, ends, texture, session.readwrite(keys),
                        session.readwrite(result), waves, *sizes, *plan, *near, *scales, local=(1,), defines=kinds,
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
    least, most = extremes(task)
    with np.errstate(all="ignore"):
        for channel in range(texture.samples.shape[1]):
            plane = Grid(texture.samples[:, channel : channel + 1], texture.height, texture.width, texture.sampling,
                         texture.wraps)  # fmt: skip
            keys = np.full(task.height * width, FREE, np.uint32)
            made = np.zeros(task.height * width, np.float32)
            keys[resting], made[resting] = TAKEN, own[:, channel]
            for seeds, reach in portions(keys, task, distance):
                lines = _Traced(field, plane, seeds.astype(np.int64), reach, Weights.of(task, reach))
                _serve(lines, keys, made, distance)
            planes.append(np.clip(made, least, most))
    return np.stack(planes, axis=1).reshape(task.height, width, -1)


class _Traced:
    """Lines of a portion: places (samples, lines, 2), sums (of factors, samples, lines), and how far they go
    (2, lines)."""

    def __init__(self, field: Grid, texture: Grid, seeds: Index, reach: Reach, weights: Weights) -> None:
        self.field, self.reach, self.seeds, self.weights = field, reach, seeds, weights
        factors = weights.factors
        start = np.stack([seeds % field.width, seeds // field.width], axis=1).astype(np.float32)
        origin = (np.zeros(seeds.size, np.int64),) * 2
        read = Reader(texture, field, origin, np.float32)
        self.own = read(start)
        self.path = np.empty((reach.samples, seeds.size, 2), np.float32)
        self.sums = np.zeros((reach.sums, reach.samples, seeds.size), np.float32)
        self.ends = np.zeros((2, seeds.size), np.float32)
        self.path[reach.count] = start
        for way, sign in enumerate((1.0, -1.0)):
            step = sign * reach.step
            at: Array = start
            here, last = field.at(origin, start[:, 0], start[:, 1]), np.zeros_like(self.own)
            alive, end = np.ones(seeds.size, bool), np.zeros(seeds.size, np.float32)
            total = np.zeros((reach.sums, seeds.size), np.float32)

            def slope(at: Array, part: float, step: float = step) -> Array:
                return displacements(field.at(origin, at[:, 0], at[:, 1]), step, True)

            for j in range(1, reach.count + 1):
                moves = runge_kutta_2(slope, at, displacements(here, step, True))
                there = field.at(origin, at[:, 0] + moves[:, 0], at[:, 1] + moves[:, 1])
                share = np.minimum(border_share(field, origin, at, moves), critical_share(here, there, moves, sign))
                share = np.where(alive & (share > 0), share, 0).astype(np.float32)
                at = np.where(share[:, None] > 0, at + share[:, None] * moves, at)
                sample = read(at) - self.own
                to = reach.count + int(sign) * j
                before, after = factors[:, to - int(sign), None], factors[:, to, None]
                pieces = before * last[:, 0] + (before + share * (after - before)) * sample[:, 0]
                total = total + share * np.float32(step / 2) * pieces
                end += share * np.float32(reach.step)
                self.path[to] = at
                self.sums[:, to] = total
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
        found = self._sum(lines, high) - self._sum(lines, low)
        total, weight = self.weights.constant * found[0], self.weights.constant * (high - low)
        for n, (amount, pace, phase, integral) in enumerate(self.weights.waves):
            angle = phase - pace * s
            total = total + amount * (np.cos(angle) * found[2 * n + 1] - np.sin(angle) * found[2 * n + 2])
            middle, half = pace * (np.float32(0.5) * (high + low)) + angle, pace * (np.float32(0.5) * (high - low))
            weight = weight + integral * np.cos(middle) * np.sin(half)
        means: Array = np.where(weight > 0, self.own[lines, 0] + total / weight, self.own[lines, 0]).astype(np.float32)
        return means

    def _sum(self, lines: Index, s: Array) -> Array:
        """Up to `s`, linear between samples, (sums, n)."""
        place = s / np.float32(self.reach.step) + np.float32(self.reach.count)
        cell = np.clip(np.floor(place).astype(np.int64), 0, self.reach.samples - 2)
        part = place - cell.astype(np.float32)
        a, b = self.sums[:, cell, lines], self.sums[:, cell + 1, lines]
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
