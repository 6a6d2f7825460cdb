"""Running transfer.cl: what it is built with, the numbers it reads, and the launch."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from lichen.image import Alpha, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operations.tone import curves
from lichen.operations.tone.curves import Form
from lichen.operations.tone.evaluate import ceiling32
from lichen.operations.tone.fitted import Fit, Layout, fit


@lru_cache(maxsize=256)
def fitted(shape: Form, degree: int) -> Fit | None:
    """A power that begins with a toe, or PQ's signal of light, as polynomials of samples up to 1; None of other curves:
    those of a power alone would not make 0 of 0."""
    if shape.body == "pq_encode":
        layout = Layout(roots=2, bits=0)
    elif shape.body == "power" and shape.knee > 0:
        layout = Layout(roots=0 if shape.convex else 1, bits=0)
    else:
        return None
    return fit(shape.upper, 1.0 + shape.shift, degree, layout, shape.knee)


@lru_cache(maxsize=256)
def constants(shape: Form, degree: int = 0) -> Array:
    """The numbers that transfer.cl reads, float32, in its order, with a degree its polynomials' too; nobody writes
    them."""
    power, inner, outer = shape.exponent, shape.inner, shape.outer
    if shape.body == "exponential":
        power /= math.log(2)
    elif shape.body == "logarithm":
        outer *= math.log(2)
    elif shape.body == "pq_decode":
        power = 1 / curves.PQ_M1
    elif shape.body == "pq_encode":
        inner = curves.PQ_M1 * math.log2(inner)
    high = float(np.float32(power))
    numbers = (
        *(shape.shift, shape.offset, shape.toe_scale, float(ceiling32(shape.knee)), shape.floor),
        *(inner, shape.lift, high, power - high, outer, shape.drop, curves.pq_ceiling_signal()),
    )
    found = fitted(shape, degree) if degree else None
    made = aligned(np.array([*numbers, *((found.top, *found.numbers) if found else ())], dtype=np.float32))
    made.flags.writeable = False
    return made


def _body(shape: Form) -> str:
    """The function of transfer.cl. Displays' powers are roots; beside a toe a power needs no care for zero, and one of
    its two sums is empty."""
    if shape.body != "power":
        return shape.body
    if shape.exponent == 12 / 5 and (shape.outer, shape.drop) == (1, 0):
        return "fifths_of_sum"
    if shape.exponent == 5 / 12 and (shape.inner, shape.lift) == (1, 0):
        return "sum_of_twelfths"
    if shape.knee <= 0:
        plain = (shape.exponent, shape.inner, shape.lift, shape.outer, shape.drop) == (11 / 5, 1, 0, 1, 0)
        return "eleven_fifths" if plain else "power"
    return "power_of_sum" if shape.lift else "sum_of_power"


def definitions(shape: Form, clamped: bool, degree: int = 0) -> dict[str, int | float | str]:
    """What a curve's text is built with. PQ's signal of no light is not 0, so its zero must have no sign."""
    found = fitted(shape, degree) if degree else None
    return {
        "BODY": _body(shape),
        "TOE": shape.toe,
        "GAPPED": int(shape.floor > -math.inf),
        "MOVED": int(shape.shift != 0 or shape.body == "pq_encode"),
        "SHIFTED": int(shape.offset != 0),
        "CLAMPED": int(clamped),
        "DEGREE": found.degree if found else 0,
        "ROOTS": found.roots if found else 0,
        "SHIFTED_BITS": found.shift if found else 0,
    }


def launch(
    device: Device, image: Image, shape: Form, clamped: bool, kernel: str, *arguments: Any, degree: int = 0
) -> Array:
    """The colour channels through a kernel of transfer.cl; `arguments` come between its constants and the count. With a
    degree the curve is fitted polynomials."""
    source = aligned(image.pixels)
    out = aligned_empty(source.shape)
    coverage = image.channels if image.alpha is not Alpha.NONE else 0
    defines = {**definitions(shape, clamped, degree), "COVERAGE": coverage}
    samples = source.size
    with device.session() as session:
        session.launch(
            "tone/transfer.cl", kernel, (-(-samples // 16),),
            source, session.write(out), constants(shape, degree), *arguments, np.uint64(samples),
            defines=defines,
        )  # fmt: skip
    return out
