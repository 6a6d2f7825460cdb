"""Accumulate: a weighted sum of many images.

Truth: the sum of weight_i image_i over the images there are, image_1 to image_16; each weight is 1 / n for n images
unless given. An image of weight zero takes no part, not even with a NaN. Sums of light: pictures come scene-linear with
associated coverage, and coverage is summed like any channel, so that a mean of covered pictures is what their mean over
any ground is.

Exposures, jittered renderings and frames of a motion are averaged so (the accumulation buffer, with no clamping and no
bits lost); weights may be negative, so that differences and filters in time are sums, too.

Methods: `compensated` carries the rounding of every product and of every sum in a second float32 and adds it at the
end (Ogita, Rump and Oishi's Dot2), which is as if computed in twice the precision and rounded once; `plain` adds as it
reads. The difference shows where large terms cancel.

Sources: P. Haeberli and K. Akeley, The accumulation buffer, SIGGRAPH 1990; T. Ogita, S. Rump and S. Oishi, Accurate sum
and dot product, SIAM J. Sci. Comput. 26, 2005.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)

if TYPE_CHECKING:
    from lichen.opencl.device import Device

MOST = 16
NAMES = tuple(f"image_{number}" for number in range(1, MOST + 1))
FLOAT_MAX = float(np.finfo(np.float32).max)
BLOCK = 1 << 16
"""Samples that the NumPy body takes at once."""
SPLITTER = np.float32(4097)
"""2^12 + 1: halves a float32's bits (Veltkamp)."""


class Parameters(OperationParameters):
    weights: (
        Annotated[tuple[Annotated[float, Field(ge=-1e6, le=1e6)], ...], Field(min_length=1, max_length=MOST)] | None
    ) = None
    """one for each image, in their order; a mean unless given"""

    def of(self, names: Mapping[str, object]) -> dict[str, float]:
        """Weights by image, float32 numbers."""
        there = [name for name in NAMES if name in names]
        each = self.weights or (1 / len(there),) * len(there)
        return {name: float(np.float32(weight)) for name, weight in zip(there, each, strict=False)}


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    first, flaws = facts[NAMES[0]], []
    if p.weights is not None and len(p.weights) != len(facts):
        flaws.append(Flaw("/parameters/weights", f"has {len(p.weights)} weight(s) for {len(facts)} image(s)"))
    for name, each in facts.items():
        if (each.height, each.width, each.channels) != (first.height, first.width, first.channels):
            shapes = [f"{one.width}x{one.height}, {one.channels} channel(s)" for one in (each, first)]
            flaws.append(Flaw(f"/inputs/{name}", f"is {shapes[0]}; image_1 is {shapes[1]}"))
    return flaws


def _terms(p: Parameters, facts: InputFacts) -> float:
    """The sum of |weight| |image|."""
    weights = p.of(facts)
    return min(sum(abs(weight) * facts[name].extent.magnitude for name, weight in weights.items()), FLOAT_MAX)


def _rounded(p: Parameters, facts: InputFacts) -> float:
    """A weight is rounded to float32 before it is used; the mean's, too."""
    return ROUNDING * _terms(p, facts)


def _ends(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    low = high = 0.0
    for name, weight in p.of(facts).items():
        ends = sorted((weight * facts[name].extent.low, weight * facts[name].extent.high))
        low, high = low + ends[0], high + ends[1]
    return low, high


def _plain_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = min((len(facts) + 2) * ROUNDING * _terms(p, facts) + _rounded(p, facts), FLOAT_MAX)
    return Error(value, "bound", value)


def _compensated_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    largest = max(map(abs, _ends(p, facts)))
    own = 1.01 * ROUNDING * largest + 4 * (len(facts) * ROUNDING) ** 2 * _terms(p, facts)
    value = min(own + _rounded(p, facts), FLOAT_MAX)
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    first = next(iter(facts.values()))
    low, high = _ends(p, facts)
    slack = _plain_error(p, 0.0, facts).value
    bad = any(each.extent.nonfinite for each in facts.values()) or max(abs(low), abs(high)) + slack >= FLOAT_MAX
    extent = Extent(max(low - slack, -FLOAT_MAX), min(high + slack, FLOAT_MAX), first.samples if bad else 0)
    return dataclasses.replace(first, extent=extent)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    others = [weight for name, weight in p.of(facts).items() if name != NAMES[0]]
    return (
        "the first image's weight is 1 and no other has any" if p.of(facts)[NAMES[0]] == 1 and not any(others) else None
    )


def _cancelling() -> Mapping[str, Any]:
    values = (1e8, 1.0, -1e8)
    return {name: np.full((2, 3, 1), value, np.float32) for name, value in zip(NAMES, values, strict=False)}


accumulate = Operation(
    name="accumulate",
    family="arithmetic",
    summary="Sums up to sixteen images by weights: means of exposures and frames, differences, filters in time.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input(NAMES[0], "the first image"),
        *(Input(name, "a further image of the same size and channels", required=False) for name in NAMES[1:]),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    result=_result,
    propagate=lambda p, facts, error: sum(map(abs, p.of(facts).values())) * error,
    check=_check,
    examples=({"weights": [0.3]}, {"weights": [0.5, -1.25]}, {"weights": [0.5, 0.25, -0.125]}),
    hard_cases=(
        HardCase(
            name="large terms that cancel",
            why="added in float32, 1 beside 1e8 is lost",
            inputs=_cancelling,
            parameters={"weights": [1, 1, 1]},
            holds=lambda inputs, pixels: None if (pixels == 1).all() else f"got {pixels.reshape(-1)[0]}",
            methods=("compensated",),
        ),
        HardCase(
            name="no weight for what is not a number",
            why="0 x NaN is NaN",
            inputs=lambda: {"image_1": np.ones((1, 2, 1)), "image_2": np.full((1, 2, 1), np.nan)},
            parameters={"weights": [2, 0]},
            holds=lambda inputs, pixels: None if (pixels == 2).all() else f"got {pixels.reshape(-1)}",
        ),
    ),
)


@accumulate.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """With the weights as given, not as rounded."""
    there = [name for name in NAMES if name in inputs]
    total = np.zeros_like(inputs[NAMES[0]].pixels)
    with np.errstate(all="ignore"):
        for name, weight in zip(there, p.weights or (1 / len(there),) * len(there), strict=True):
            if weight:
                total = total + weight * inputs[name].pixels
    return total


def _launched(device: Device, inputs: Inputs, p: Parameters, *, compensated: bool) -> Array:
    weights = {name: weight for name, weight in p.of(inputs).items() if weight}
    first = inputs[NAMES[0]].pixels
    out = aligned_empty(first.shape)
    images = [aligned(inputs[name].pixels) for name in weights]
    images += [aligned(first)] * (MOST - len(images))
    numbers = np.zeros(MOST, np.float32)
    numbers[: len(weights)] = list(weights.values())
    with device.session() as session:
        session.launch(
            "arithmetic/accumulate.cl", "accumulate", (-(-first.size // 16),),
            *images, session.write(out), aligned(numbers), np.uint64(first.size),
            defines={"COMPENSATED": int(compensated), "COUNT": len(weights)},
        )  # fmt: skip
    return out


def _blocks(inputs: Inputs, p: Parameters, *, compensated: bool) -> Array:
    weights = {name: np.float32(weight) for name, weight in p.of(inputs).items() if weight}
    first = inputs[NAMES[0]].pixels
    out = aligned_empty(first.shape)
    flat, made = {name: inputs[name].pixels.reshape(-1) for name in weights}, out.reshape(-1)
    with np.errstate(all="ignore"):
        for start in range(0, made.size, BLOCK):
            block = slice(start, start + BLOCK)
            total, rest = np.zeros_like(made[block]), np.zeros_like(made[block])
            for name, weight in weights.items():
                x = flat[name][block]
                product = weight * x
                summed = total + product
                if compensated:
                    part = summed - total
                    rest += ((total - (summed - part)) + (product - part)) + _lost(x, weight, product)
                total = summed
            made[block] = np.where(np.isfinite(rest), total + rest, total) if compensated else total
    return out


def _lost(x: Array, weight: np.float32, product: Array) -> Array:
    """What rounding took from x weight, exactly (Dekker); nothing where it cannot be held."""

    def halves(v: Any) -> tuple[Any, Any]:
        high = SPLITTER * v - (SPLITTER * v - v)
        return high, v - high

    (a, b), (c, d) = halves(x), halves(weight)
    lost: Array = b * d - (((product - a * c) - b * c) - a * d)
    return np.where(np.isfinite(lost), lost, np.float32(0))


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    return next(iter(facts.values())).samples * (len(facts) + 1.0)


@accumulate.method(
    "compensated",
    error=_compensated_error,
    work=_work,
    rates={"opencl": Rate(3e-4, 4e-10), "numpy": Rate(1e-4, 8e-9)},
)
class Compensated:
    """Sums and products with what their roundings lost."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, compensated=True)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _blocks(inputs, p, compensated=True)


@accumulate.method(
    "plain",
    error=_plain_error,
    work=_work,
    rates={"opencl": Rate(3e-4, 2.5e-10), "numpy": Rate(1e-4, 6e-10)},
)
class Plain:
    """Sums in float32, one image after the other."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, compensated=False)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _blocks(inputs, p, compensated=False)
