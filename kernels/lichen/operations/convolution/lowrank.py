"""A kernel as a sum of columns times rows, each of them two passes: what `convolve` and a turned Gaussian share."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import ROUNDING, Border
from lichen.operations.convolution.kernels import Matrix
from lichen.operations.convolution.stencil import Stencil, correlate, correlated

Terms = Sequence[tuple[Matrix, Matrix]]
Passes = list[tuple[Stencil, Stencil, float]]


def passes(terms: Terms, top: int, left: int, bias: float, value: float) -> Passes:
    """Stencils down and across for each term, and what the constant border has become after the first."""
    made: Passes = []
    for down, across in terms:
        made.append((Stencil(down, top, 0), Stencil(across, 0, left, bias), value * float(down.sum())))
        bias = 0.0
    nothing = Stencil(np.zeros((1, 1)), 0, 0)
    return made or [(nothing, dataclasses.replace(nothing, bias=bias), 0.0)]


def summed_opencl(device: Device, pixels: Array, made: Passes, border: Border, value: float) -> Array:
    out, between = aligned_empty(pixels.shape), aligned_empty(pixels.shape)
    with device.session() as session:
        for number, (down, across, beside) in enumerate(made):
            correlate(session, pixels, between, down, border, value)
            correlate(session, between, out, across, border, beside, add=number > 0)
    return out


def summed_numpy(pixels: Array, made: Passes, border: Border, value: float) -> Array:
    out = aligned(np.zeros(pixels.shape, np.float32))
    for down, across, beside in made:
        out += correlated(correlated(pixels, down, border, value), across, border, beside)
    return out


def dropped(left: Matrix, low: float, high: float) -> float:
    """What the taps left out change in a result, about the middle of the input's range, at most."""
    return float(abs(left.sum()) * abs(high + low) / 2 + np.abs(left).sum() * (high - low) / 2)


def rounding(terms: Terms, magnitude: float, bias: float) -> float:
    """Of both passes of all terms, and of their sum."""
    weight = 0.0
    if terms:
        downs, acrosses = (
            np.concatenate([down for down, _ in terms], axis=1),
            np.concatenate([each for _, each in terms]),
        )
        weight = float(np.abs(downs).sum(axis=0) @ np.abs(acrosses).sum(axis=1))
    longest = max((len(down) + across.shape[1] for down, across in terms), default=2)
    return rounding_of(longest, len(terms), weight * magnitude + abs(bias))


def rounding_of(taps: int, terms: int, size: float) -> float:
    """Of so many terms, each of so many taps down and across, where what they add has no larger magnitudes in all."""
    return 1.01 * (taps + terms + 6) * ROUNDING * size
