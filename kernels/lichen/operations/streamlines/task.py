"""What line integral convolution follows and smears, in all its frames and passes; and what is made of the result.

A `Task` is one smearing of one texture along one field. `pictured` makes all frames of a request out of tasks, whatever
carries them out, and finishes them: the same few lines for truth, OpenCL and NumPy, in the precision of their inputs.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lichen.hashing import pcg3d, unit
from lichen.memory import Array, aligned
from lichen.operation import Inputs
from lichen.operations.streamlines.maps import Map, coloured
from lichen.operations.streamlines.parameters import Edge, Parameters, Speed

FARTHEST = 1e9
"""px; farther than any line goes inside an image."""


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """`field` and `texture` are (height, width, channels); vectors are (c - bias) * scale of the first two channels.
    `later` is the field after `interval`, where lines are those of particles in the changing field."""

    field: Array
    later: Array | None
    texture: Array | None
    """None: noise"""
    p: Parameters
    phase: float = 0.0
    time: float = 0.0

    @property
    def height(self) -> int:
        return int(self.field.shape[0])

    @property
    def width(self) -> int:
        return int(self.field.shape[1])

    @property
    def arc(self) -> bool:
        return self.p.speed is Speed.ARC

    @property
    def wraps(self) -> bool:
        return self.p.border is Edge.WRAP

    @property
    def limit(self) -> float:
        """Of a component: where lengths count, far beyond any image and far from overflow."""
        return float(np.finfo(np.float32).max) if self.arc else 2.0**40

    @property
    def texture_shape(self) -> tuple[int, int, int]:
        if self.texture is None:
            return (*noise_size(self.height, self.width, self.p), 1)
        return self.texture.shape

    def weights(self, count: int) -> npt.NDArray[np.float64]:
        return self.p.weights(count, self.phase)

    def vectors(self, dtype: npt.DTypeLike) -> Array:
        return decode(self.field, self.p, self.limit, dtype)

    def texels(self, dtype: npt.DTypeLike) -> Array:
        made = noise(self.height, self.width, self.p) if self.texture is None else self.texture
        return made.astype(dtype)


def decode(field: Array, p: Parameters, limit: float, dtype: npt.DTypeLike) -> Array:
    """The vectors, (height, width, 2); NaN for one that is not finite. The difference is taken in float32, so a
    component stored as the bias is exactly zero."""
    vectors: Array = (field[:, :, :2].astype(np.float32) - np.float32(p.bias)).astype(dtype) * p.scale
    bound = vectors.dtype.type(limit)
    finite = np.isfinite(vectors).all(axis=2, keepdims=True)
    bounded: Array = np.where(finite, np.clip(vectors, -bound, bound), vectors.dtype.type(np.nan))
    return bounded


def decode_any(field: Array, scale: float, bias: float) -> Array:
    """The vectors of operations that follow lines by arc length alone, float64."""
    vectors = (field[:, :, :2].astype(np.float32) - np.float32(bias)).astype(np.float64) * scale
    decoded: Array = np.where(np.isfinite(vectors).all(axis=2, keepdims=True), vectors, np.nan)
    return decoded


def noise_size(height: int, width: int, p: Parameters) -> tuple[int, int]:
    return max(round(height / p.grain), 1), max(round(width / p.grain), 1)


def noise(height: int, width: int, p: Parameters) -> Array:
    """White noise, uniform in [0, 1), or drops of 1, float32 (rows, columns, 1) for a field of that size; `noise` in
    lic.cl gives the same bits."""
    rows, columns = noise_size(height, width, p)
    made = unit(pcg3d(np.arange(columns), np.arange(rows)[:, None], p.seed)[0])
    return (made if p.density == 1 else (made < np.float32(p.density)).astype(np.float32))[:, :, None]


def texture_of(inputs: Inputs, p: Parameters) -> Array:
    """What is smeared: the texture, or the noise that stands in for it."""
    field = inputs["field"]
    return inputs["texture"].pixels if "texture" in inputs else noise(field.height, field.width, p)


# ---------------------------------------------------------------------------------------------------- frames and passes

Carry = Callable[[Task], Array]
"""Carries a task out: (height, width, channels of the texture)."""


def pictured(inputs: Inputs, p: Parameters, carry: Carry) -> Array:
    """All frames, one below the other."""
    texture = inputs["texture"].pixels if "texture" in inputs else None
    frames = []
    for frame in range(p.frames):
        time = time_of(p, frame)
        field, later = _slices(inputs, p, time)
        task = Task(field, later, texture, p, frame / p.frames, time)
        made = carry(task)
        if p.enhance:
            made = carry(dataclasses.replace(task, texture=aligned(sharpened(made, p.enhance), made.dtype)))
        frames.append(made)
    whole = frames[0] if len(frames) == 1 else np.concatenate(frames)
    if p.contrast:
        whole = stretched(whole, p.contrast)
    return whole if p.colour is Map.NONE else _painted(whole, inputs, p)


def time_of(p: Parameters, frame: int) -> float:
    return p.time + (1 - p.time) * frame / p.frames


def _slices(inputs: Inputs, p: Parameters, time: float) -> tuple[Array, Array | None]:
    """The field that lines start in, and the one that it turns into while they go on."""
    field = inputs["field"].pixels
    later = inputs["later"].pixels if "later" in inputs else None
    if later is not None and p.interval == 0:
        field, later = between(field, later, time), None
    return masked(field, inputs), None if later is None else masked(later, inputs)


def masked(field: Array, inputs: Inputs) -> Array:
    """The field without what the mask shuts out."""
    if "mask" not in inputs:
        return field
    shut = inputs["mask"].pixels[:, :, :1] < 0.5
    return np.where(shut, field.dtype.type(np.nan), field[:, :, :2])


def between(field: Array, later: Array, time: float) -> Array:
    """The field as it stands at `time`; equal values stay what they are."""
    first: Array = field[:, :, :2]
    share = first.dtype.type(time)
    mixed: Array = later[:, :, :2] if time == 1 else first + share * (later[:, :, :2] - first)
    return mixed if time else first


def sharpened(pixels: Array, gain: float) -> Array:
    """Values plus `gain` times what they differ by from the mean of 3 x 3; at borders, the mean of what there is,
    continued. Equal neighbours keep their value exactly."""
    height, width, _ = pixels.shape
    around = np.pad(pixels, ((1, 1), (1, 1), (0, 0)), mode="edge")
    total = np.zeros_like(pixels)
    for i in range(3):
        for j in range(3):
            total += pixels - around[i : i + height, j : j + width]
    sharp: Array = pixels + pixels.dtype.type(gain / 9) * total
    return sharp


def stretched(pixels: Array, deviation: float) -> Array:
    """Finite values brought to the mean 1/2 and this standard deviation, over all frames and channels, within [0, 1];
    1/2 where all are equal."""
    finite = pixels[np.isfinite(pixels)].astype(np.float64)
    mean, spread = (float(finite.mean()), float(finite.std())) if finite.size else (0.0, 0.0)
    factor = deviation / spread if spread > 0 else 0.0
    moved = np.where(pixels == mean, 0.0, (pixels - mean) * factor)
    return np.where(np.isnan(moved), np.nan, np.clip(0.5 + moved, 0, 1)).astype(pixels.dtype)


def _painted(pixels: Array, inputs: Inputs, p: Parameters) -> Array:
    """The one channel as the brightness of colours that tell how long the vectors of each frame are; grey where there
    is no vector. Lengths are found in double precision, so that they are the same in truth."""
    field = inputs["field"].pixels.astype(np.float64)
    lengths = []
    for frame in range(p.frames):
        standing = field
        if "later" in inputs:
            standing = between(field, inputs["later"].pixels.astype(np.float64), time_of(p, frame))
        x, y = np.moveaxis(decode(masked(standing, inputs), p, np.inf, np.float64), 2, 0)
        lengths.append(np.hypot(x, y))
    length = np.concatenate(lengths)
    longest = p.fastest or float(np.nanmax(length, initial=0.0))
    share = np.divide(np.minimum(length, longest), longest, out=np.zeros_like(length), where=longest > 0)
    share = np.where(np.isnan(length), np.nan, share)
    colours = np.where(np.isnan(share)[:, :, None], 1.0, coloured(share, p.colour)).astype(pixels.dtype)
    painted: Array = colours * pixels[:, :, :1]
    return painted
