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


@lru_cache(maxsize=256)
def constants(shape: Form) -> Array:
    """The numbers that transfer.cl reads, float32, in its order; nobody writes them."""
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
    made = aligned(np.array(numbers, dtype=np.float32))
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


def definitions(shape: Form, clamped: bool) -> dict[str, int | float | str]:
    """What a curve's text is built with. PQ's signal of no light is not 0, so its zero must have no sign."""
    return {
        "BODY": _body(shape),
        "TOE": shape.toe,
        "GAPPED": int(shape.floor > -math.inf),
        "MOVED": int(shape.shift != 0 or shape.body == "pq_encode"),
        "SHIFTED": int(shape.offset != 0),
        "CLAMPED": int(clamped),
    }


def launch(device: Device, image: Image, shape: Form, clamped: bool, kernel: str, *arguments: Any) -> Array:
    """The colour channels through a kernel of transfer.cl; `arguments` come between its constants and the count."""
    source = aligned(image.pixels)
    out = aligned_empty(source.shape)
    coverage = image.channels if image.alpha is not Alpha.NONE else 0
    defines = {**definitions(shape, clamped), "COVERAGE": coverage}
    samples = source.size
    with device.session() as session:
        session.launch(
            "tone/transfer.cl", kernel, (-(-samples // 16),),
            source, session.write(out), constants(shape), *arguments, np.uint64(samples),
            defines=defines,
        )  # fmt: skip
    return out
