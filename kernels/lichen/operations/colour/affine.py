"""A matrix applied to the first channels of every pixel: what `matrix`, `saturation` and `hue_rotate` share.

y_i = sum_j m_ij x_j + b_i w, where w is the pixel's coverage if colour is associated with it, else 1: the same affine
map of the straight colour. Factors of zero take no part, so a NaN reaches only what depends on it. The channels after
the matrix's pass unchanged.

Rounding: the factors are rounded to float32 and each of the terms adds one fused rounding, so n terms differ from the
exact sum by at most (n + 1) roundings of sum |m_ij| |x_j| + |b_i| |w|, to first order; one more covers the rest.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lichen.image import Alpha, Extent, Image
from lichen.joining import Joined, Link
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import ROUNDING, Error, Facts, Inputs, Rate
from lichen.stage import Stage

FLOAT_MAX = float(np.finfo(np.float32).max)
LARGEST = 1e6
"""Of a factor's magnitude."""
BLOCK = 1 << 14
"""Pixels of a block of NumPy's work, which stays in cache."""
RATES = {"opencl": Rate(2e-4, 3e-10), "numpy": Rate(3e-5, 1.6e-9)}
"""Of `Applied`, per sample."""


@dataclass(frozen=True, slots=True)
class Affine:
    """Rows of factors, one for each channel the map reads, and what each row adds."""

    factors: tuple[tuple[float, ...], ...]
    added: tuple[float, ...]

    @classmethod
    def of(cls, rows: object, added: object = None) -> Affine:
        """From a square matrix, and a vector if anything is added."""
        factors = np.asarray(rows, dtype=np.float64)
        more = np.zeros(len(factors)) if added is None else np.asarray(added, dtype=np.float64)
        return cls(tuple(tuple(map(float, row)) for row in factors), tuple(map(float, more)))

    @property
    def size(self) -> int:
        return len(self.factors)

    @property
    def trivial(self) -> bool:
        """Whether nothing changes."""
        same = all(value == (i == j) for i, row in enumerate(self.factors) for j, value in enumerate(row))
        return same and not any(self.added)

    @property
    def gain(self) -> float:
        """The largest sum of magnitudes in a row."""
        return max(sum(map(abs, row)) + abs(more) for row, more in zip(self.factors, self.added, strict=True))


def follows(affine: Affine, alpha: Alpha, channels: int) -> int:
    """The channel that what is added is multiplied by: coverage that is no channel of the matrix itself; or -1."""
    return channels - 1 if alpha is Alpha.ASSOCIATED and channels > affine.size else -1


def apply(image: Image, affine: Affine) -> Array:
    """The map in the precision of the pixels, in blocks that stay in cache."""
    pixels = image.pixels
    out = aligned_empty(pixels.shape, pixels.dtype)
    flat, result = pixels.reshape(-1, image.channels), out.reshape(-1, image.channels)
    weight = follows(affine, image.alpha, image.channels)
    for start in range(0, len(flat), BLOCK):
        block, made = flat[start : start + BLOCK], result[start : start + BLOCK]
        planes = [np.ascontiguousarray(block[:, c]) for c in range(affine.size)]
        term = np.empty(len(block), pixels.dtype)
        made[:, affine.size :] = block[:, affine.size :]
        for row, (factors, more) in enumerate(zip(affine.factors, affine.added, strict=True)):
            total = np.zeros(len(block), pixels.dtype)
            for plane, factor in zip(planes, factors, strict=True):
                if factor:
                    total += np.multiply(plane, pixels.dtype.type(factor), out=term)
            if more:
                total += pixels.dtype.type(more) * (block[:, weight] if weight >= 0 else pixels.dtype.type(1))
            made[:, row] = total
    return out


def launch(device: Device, image: Image, affine: Affine) -> Array:
    """The map by affine.cl."""
    source = aligned(image.pixels)
    out = aligned_empty(source.shape)
    numbers = _numbers(affine)
    pixels = image.height * image.width
    defines: dict[str, int | float | str] = {
        "IN": image.channels, "OUT": image.channels, "READ": affine.size, "MADE": affine.size, "SIZE": affine.size,
        "FOLLOWS": follows(affine, image.alpha, image.channels), **_pattern(numbers),
    }  # fmt: skip
    with device.session() as session:
        session.sweep(
            "colour/affine.cl", "affine", -(-pixels // 16),
            source, session.write(out), aligned(numbers.reshape(-1)), np.int32(pixels),
            defines=defines,
        )  # fmt: skip
    return out


def _numbers(affine: Affine) -> Array:
    """What affine.cl reads: rows of four factors and what is added."""
    numbers = np.zeros((affine.size, 5), np.float32)
    numbers[:, : affine.size] = affine.factors
    numbers[:, 4] = affine.added
    return numbers


def stage(affine: Affine, facts: Facts) -> Stage:
    """The map as a step of a generated kernel."""
    numbers = _numbers(affine)
    weight = follows(affine, facts.alpha, facts.channels)
    defines = {"SIZE": affine.size, "FOLLOWS": weight, **_pattern(numbers)}
    return Stage("colour/affine_stage.clh", defines, tuple(map(float, numbers.reshape(-1))))


def _pattern(numbers: Array) -> dict[str, int]:
    """What affine.cl is told of zeros, so that its loop does not ask for them."""
    return {"DENSE": int(numbers[:, : len(numbers)].all()), "ADDED": int(numbers[:, 4].any())}


def error(affine: Affine, facts: Facts) -> Error:
    """The bound of the module's docstring; NumPy multiplies and adds apart, which doubles the roundings."""
    far = max(facts.extent.magnitude, 1.0 if any(affine.added) else 0.0)
    value = (2 * affine.size + 3) * ROUNDING * affine.gain * far
    return Error(value, "bound", value)


def result(affine: Affine, facts: Facts) -> Facts:
    """Facts of the output: the rows' intervals, and the channels that pass."""
    if affine.trivial:
        return facts
    low, high = facts.extent.low, facts.extent.high
    weights = (low, high) if follows(affine, facts.alpha, facts.channels) >= 0 else (1.0, 1.0)
    lows, highs = [], []
    for row, more in zip(affine.factors, affine.added, strict=True):
        terms = [sorted((factor * low, factor * high)) for factor in row] + [sorted(more * w for w in weights)]
        lows.append(sum(term[0] for term in terms))
        highs.append(sum(term[1] for term in terms))
    if facts.channels > affine.size:
        lows.append(low)
        highs.append(high)
    slack = error(affine, facts).value
    bottom, top = min(lows) - slack, max(highs) + slack
    overflow = max(abs(bottom), abs(top)) > FLOAT_MAX
    nonfinite = facts.samples if overflow or facts.extent.nonfinite else 0
    return dataclasses.replace(facts, extent=Extent(max(bottom, -FLOAT_MAX), min(top, FLOAT_MAX), nonfinite))


def propagate(affine: Affine, facts: Facts, by: float) -> float:
    """Largest change of the output; the coverage that what is added follows changes too."""
    weighted = follows(affine, facts.alpha, facts.channels) >= 0
    rows = (sum(map(abs, row)) + abs(more) * weighted for row, more in zip(affine.factors, affine.added, strict=True))
    return max([*rows, 1.0 if facts.channels > affine.size else 0.0]) * by


def departure(affine: Affine, facts: Facts) -> dict[str, float]:
    """How far the output is from the picture: (M - 1) x + b w."""
    weight = facts.extent.magnitude if follows(affine, facts.alpha, facts.channels) >= 0 else 1.0
    rows = [
        sum(abs(factor - (i == j)) for j, factor in enumerate(row)) * facts.extent.magnitude + abs(more) * weight
        for i, (row, more) in enumerate(zip(affine.factors, affine.added, strict=True))
    ]
    return {"image": max(rows)}


@dataclass(frozen=True, slots=True)
class Mixing:
    """A map for its neighbours: two that read as many channels are one, their product.

    What is added follows coverage in both or in neither, and coverage passes, so b becomes M b + c in either case. A
    channel that takes part in the product took part in the two."""

    affine: Affine
    size: int
    """channels of the picture"""

    @classmethod
    def of(cls, affine: Affine, facts: Facts) -> Mixing:
        return cls(affine, facts.channels)

    def then(self, following: Link) -> Joined | str | None:
        if not isinstance(following, Mixing) or following.affine.size != self.affine.size:
            return None
        first, second = (np.array(each.affine.factors) for each in (self, following))
        added = second @ np.array(self.affine.added) + np.array(following.affine.added)
        rows = np.column_stack([second @ first, added])
        if not np.abs(rows).max() <= LARGEST:
            return "a factor of the product is too large for a matrix"
        return Joined("matrix", {"matrix": rows.tolist()}, same=True, reason="two matrices are one, their product")


class Scaling(Mixing):
    """A factor for every channel: part of a matrix beside it; two of them are left to a chain, which is as quick."""

    def then(self, following: Link) -> Joined | str | None:
        return None if isinstance(following, Scaling) else Mixing.then(self, following)


class Mapped(Protocol):
    """Parameters that come down to an affine map."""

    @property
    def affine(self) -> Affine: ...


class Applied:
    """The bodies of a method that applies its parameters' map."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Mapped, knob: float) -> Array:
        return launch(device, inputs["image"], parameters.affine)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Mapped, knob: float) -> Array:
        return apply(inputs["image"], parameters.affine)
