"""Spectral noise: white noise whose spectrum is made to fall as a power of frequency.

Truth: uniform white noise of variance 1, w = sqrt(3) (2 u - 1) with u as in white.py, goes through the discrete Fourier
transform of the picture's size; every frequency (k / width, l / height), in cycles per px, is multiplied with (k^2 +
l^2)^(-beta / 4), its length to the power -beta / 2, and that of length 0 with 0; the inverse transform is divided by
four times the standard deviation that comes of it, the root of the mean square of those factors. So power falls as 1 /
f^beta: 0 is white, 1 pink, 2 like photographs, 3 and 4 mountains, negative ones blue. `low_cut` and `high_cut` leave
out frequencies beyond them.

A transform has no edges: the picture always repeats. Its size is part of what it is; another size is another noise.

Range: values are nearly normal with a standard deviation of 1/4, so one in 16 000 leaves [-1, 1]; by the inequality of
Cauchy and Schwarz none exceeds the root of 3 x pixels over four.

Sources: Voss, Random fractal forgeries, 1985; Saupe, Algorithms for random fractals, The science of fractal images,
1988."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.hashing import pcg3d, unit
from lichen.memory import Array, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    ROUNDING,
    WHOLE,
    Error,
    HardCase,
    InputFacts,
    Inputs,
    Light,
    Operation,
    Rate,
)
from lichen.operations.noise.character import studied
from lichen.operations.noise.parameters import Generated, no_inputs


class Parameters(Generated):
    beta: float = Field(2.0, ge=-4, le=8, description="power falls as frequency^-beta")
    low_cut: float = Field(
        0.0, ge=0, lt=0.71, description="frequencies below are left out", json_schema_extra={"unit": "cycles/px"}
    )
    high_cut: float = Field(
        0.75, gt=0, le=0.75, description="frequencies above are left out", json_schema_extra={"unit": "cycles/px"}
    )


def factors(p: Parameters, dtype: Any) -> tuple[Array, float]:
    """What every frequency is multiplied with, for half of the spectrum, and the standard deviation that comes of
    it."""
    down, across = np.fft.fftfreq(p.height)[:, None], np.fft.rfftfreq(p.width)[None, :]
    length = np.hypot(down, across)
    kept = (length > 0) & (length >= p.low_cut) & (length <= p.high_cut)
    gain = np.zeros_like(length)
    largest = float(length[kept].min(initial=1.0))
    gain[kept] = (length[kept] / largest) ** (-p.beta / 2)
    twice = np.full(across.shape, 2.0)
    twice[0, 0] = 1.0
    if p.width % 2 == 0:
        twice[0, -1] = 1.0
    deviation = math.sqrt(float((gain * gain * twice).sum()) / (p.width * p.height))
    return gain.astype(dtype), deviation


def picture(p: Parameters, dtype: Any) -> Array:
    kind = np.dtype(dtype).type
    white = unit(pcg3d(np.arange(p.width), np.arange(p.height)[:, None], p.seed)[0]).astype(kind)
    gain, deviation = factors(p, dtype)
    if deviation == 0:
        return np.full((p.height, p.width, 1), p.middle, dtype)
    spectrum = np.fft.rfft2((2 * white - 1) * kind(math.sqrt(3))) * gain
    made = np.fft.irfft2(spectrum, (p.height, p.width)) * kind(1 / (4 * deviation))
    out = aligned_empty((p.height, p.width, 1), dtype)
    out[..., 0] = kind(p.middle) + kind(p.half) * made
    return out


def reach(p: Parameters) -> float:
    """Bound of |n|: each value is a product of the white noise with numbers whose squares add up to its variance."""
    return math.sqrt(3 * p.width * p.height) / 4


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Of two transforms whose rounding grows with the logarithm of the size; the norm of the white noise carries it."""
    log = math.log2(p.width * p.height) + 2
    value = ROUNDING * (2 * abs(p.middle) + abs(p.half) * (3 * log + 4))
    return Error(value, "estimate", value)


def _error_double(p: Parameters, knob: float, facts: InputFacts) -> Error:
    log = math.log2(p.width * p.height) + 2
    value = ROUNDING * (2 * abs(p.middle) + 4 * abs(p.half)) + 2.0**-50 * log * abs(p.half)
    return Error(value, "estimate", value)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    if p.low_cut < p.high_cut:
        return []
    return [Flaw("/parameters/low_cut", f"must be below high_cut, {p.high_cut:g} (got {p.low_cut:g})")]


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    return p.width * p.height * (math.log2(p.width * p.height) + 4)


def _middle(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if (pixels == np.float32(0.5)).all() else "not plain"


def _centred(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    if not np.isfinite(pixels).all():
        return "values are not finite"
    return None if abs(float(pixels.mean()) - 0.5) < 1e-4 else f"the mean is {pixels.mean()}"


spectral_noise = Operation(
    name="spectral_noise",
    family="noise",
    summary="Spectral noise: power falls as 1/f^beta, from white over pink to mountains; always tileable.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(),
    light=Light.STORED,
    footprint=lambda p, facts: WHOLE,
    result=lambda p, facts: p.facts(reach(p), slack=1e-4 * (abs(p.middle) + abs(p.half) * reach(p))),
    implied=no_inputs,
    check=_check,
    examples=(
        {"width": 96, "height": 64},
        {"width": 64, "height": 64, "beta": 0, "low_cut": 0.1, "high_cut": 0.25},
        {"width": 45, "height": 64, "beta": -1.5, "low": -1},
    ),
    hard_cases=(
        HardCase("one pixel", "it has no frequency but 0", dict, {"width": 1, "height": 1}, _middle),
        HardCase("no frequency", "the band lies between two", dict,
                 {"width": 8, "height": 8, "low_cut": 0.01, "high_cut": 0.02}, _middle),
        HardCase("a prime size", "no transform of powers of two", dict, {"width": 127, "height": 61}, _centred),
        HardCase("steep", "the lowest frequency outweighs all others by 10^15", dict,
                 {"width": 128, "height": 64, "beta": 8}, _centred),
    ),
)  # fmt: skip


spectral_noise.study = studied(spectral_noise, {}, 1, "at the picture's edges, always")


@spectral_noise.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return picture(p, np.float64)


@spectral_noise.method(
    "single", error=_error, work=_work, rates={"opencl": Rate(3e-4, 4.0e-9), "numpy": Rate(3e-4, 4.0e-9)}
)
class Single:
    """Transforms in float32, on the processor."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return picture(p, np.float32)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return picture(p, np.float32)


@spectral_noise.method(
    "double", error=_error_double, work=_work, rates={"opencl": Rate(3e-4, 4.6e-9), "numpy": Rate(3e-4, 4.6e-9)}
)
class Double:
    """Transforms in float64, on the processor; the result is rounded to float32 once."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return picture(p, np.float64).astype(np.float32)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return picture(p, np.float64).astype(np.float32)
