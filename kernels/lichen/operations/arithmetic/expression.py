"""Expression: arithmetic over images, written as text, compiled to one pass.

Truth: the expression in float64, pixel by pixel, with the arithmetic of IEEE 754: a division by zero is infinite or
NaN, a root of a negative number NaN, and either stays in its pixel. terms.py says what an expression may hold; it is
never run as a program. Examples: `(a + b) / 2`, `a if a < 0.5 else 1 - (1 - a) ** 2`, `(a.r, a.g, x / width)`.

Images are named a, b, c, d and are of one size. A name alone means channel by channel, and an image of one channel
serves all; channels are computed alike, coverage among them. `u ** n` for a whole n of 8 or less is a product, any
other power is defined for u >= 0 and NaN below. Numbers may change from request to request without a new program.

Error: every term carries its range and how far float32 may put it off, from the ranges of the images on; what comes out
at the top is a bound. Where there is none, because something may be divided by zero, or a logarithm meet it, the error
is an estimate that promises nothing, and says so by its size.

The values are taken as they are stored, unless `light` is linear: pictures then come as scene-linear light.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator

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
from lichen.operations.arithmetic.functions import FAR, FUNCTIONS, Known
from lichen.operations.arithmetic.terms import IMAGES, LONGEST, Term, parse

if TYPE_CHECKING:
    from lichen.opencl.device import Device

BLOCK = 1 << 15
"""Samples that the NumPy body takes at once, so that its steps stay in cache."""


class Parameters(OperationParameters):
    expression: str = Field("a", min_length=1, max_length=LONGEST)
    """arithmetic over a, b, c, d, their channels a.r or a[0], x, y, width and height"""
    light: Light = Light.STORED
    """stored: the numbers as they are; linear: pictures as scene-linear light"""

    @field_validator("expression")
    @classmethod
    def _readable(cls, text: str) -> str:
        parse(text)
        return text

    @property
    def results(self) -> tuple[Term, ...]:
        return parse(self.expression)

    @property
    def terms(self) -> list[Term]:
        return [each for result in self.results for each in result.walk()]


def _channels(p: Parameters, facts: InputFacts) -> int:
    """Of the result: of its images where it is one expression, else one for each."""
    if len(p.results) > 1:
        return len(p.results)
    whole = [each.image for each in p.terms if each.name == "image" and each.channel is None]
    return max((facts[name].channels for name in whole if name in facts), default=1)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    first = next(iter(facts.values()))
    used = {each.image for each in p.terms if each.name == "image"}
    flaws = [Flaw(f"/inputs/{name}", "is in the expression and was not given") for name in sorted(used - facts.keys())]
    for name, each in facts.items():
        if (each.height, each.width) != (first.height, first.width):
            flaws.append(Flaw(f"/inputs/{name}", f"is {each.width}x{each.height}; a is {first.width}x{first.height}"))
    wanted = 1 if len(p.results) > 1 else _channels(p, facts)
    for term in dict.fromkeys(each for each in p.terms if each.name == "image" and each.image in facts):
        has = facts[term.image].channels
        if term.channel is not None and term.channel >= has:
            flaws.append(
                Flaw("/parameters/expression", f"reads channel {term.channel} of {term.image}, which has {has}")
            )
        elif term.channel is None and has not in (1, wanted):
            flaws.append(Flaw("/parameters/expression", f"{term.image} has {has} channels where {wanted} are wanted"))
    return flaws


# -------------------------------------------------------------------------------------------------------- prediction


def known(p: Parameters, facts: InputFacts, arriving: float = 0.0) -> list[Known]:
    """Of each result, with images that are off by at most `arriving`."""
    found: dict[Term, Known] = {}
    first = next(iter(facts.values()))
    places = {"x": first.width, "y": first.height, "width": first.width, "height": first.height}

    def of(term: Term) -> Known:
        if term not in found:
            found[term] = leaf(term) if not term.terms else FUNCTIONS[term.name].known(*map(of, term.terms))
        return found[term]

    def leaf(term: Term) -> Known:
        if term.name == "number":
            exact = float(np.float32(term.number)) == term.number
            return Known(term.number, term.number, 0.0 if exact else ROUNDING * abs(term.number))
        if term.name == "place":
            most = float(places[term.image])
            return Known(0.5 if term.image in "xy" else most, most)
        # Facts are asked for before the inputs are checked, so an image may not be there yet.
        extent = facts.get(term.image, first).extent
        return Known(extent.low, extent.high, arriving, not extent.nonfinite)

    return [of(each) for each in p.results]


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    found = known(p, facts)
    value = max(each.error for each in found)
    return Error(min(value, FAR), "bound" if all(each.sure for each in found) else "estimate", min(value, FAR))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    first, found = next(iter(facts.values())), known(p, facts)
    channels = _channels(p, facts)
    low, high = (max(-FAR, min(each.bottom for each in found)), min(FAR, max(each.top for each in found)))
    sure = all(each.sure for each in found)
    extent = Extent(low, high, 0 if sure else first.pixels * channels)
    alpha = first.alpha if channels == first.channels and len(p.results) == 1 else Alpha.NONE
    return dataclasses.replace(first, channels=channels, alpha=alpha, extent=extent)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    return max(each.error for each in known(p, facts, error))


def _zeros(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    expected = [np.nan, np.inf, -np.inf, 0.5, np.nan]
    got = pixels.reshape(-1)
    return None if np.array_equal(got, expected, equal_nan=True) else f"expected {expected}, got {got.tolist()}"


expression = Operation(
    name="expression",
    family="arithmetic",
    summary="Computes an arithmetic expression over up to four images in one pass.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("a", "the first image"),
        *(Input(name, "a further image of the same size", required=False) for name in IMAGES[1:]),
    ),
    light=Light.LINEAR,
    as_stored=lambda p: p.light is Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    identity=lambda p, facts: "the expression is a" if p.results == (Term("image", image="a"),) else None,
    result=_result,
    propagate=_propagate,
    implied=lambda p, facts: (
        "the expression depends on where a pixel lies" if any(each.name == "place" for each in p.terms) else {}
    ),
    check=_check,
    examples=(
        {"expression": "a if a < 0.5 else 1 - (1 - a) ** 2"},
        {"expression": "clamp((a - 0.2) / 0.6, 0, 1)"},
        {"expression": "sqrt(abs(a)) * sin(3 * a) + exp2(-abs(a))"},
        {"expression": "(a[0], 1 - a[0], x / width)"},
        {"expression": "0.7 * a + 0.3 * b"},
    ),
    hard_cases=(
        HardCase(
            name="division by zero",
            why="a small number added to the divisor is a wrong answer everywhere",
            inputs=lambda: {
                "a": np.array([0, 1, -1, 1, np.nan], np.float32).reshape(1, 5, 1),
                "b": np.array([0, 0, 0, 2, 1], np.float32).reshape(1, 5, 1),
            },
            parameters={"expression": "a / b"},
            holds=_zeros,
        ),
    ),
)


# ------------------------------------------------------------------------------------------------- by definition


def _evaluated(p: Parameters, images: Mapping[str, Array], top: int, height: int, dtype: npt.DTypeLike) -> Array:
    """The results for a block of rows that begins at `top`; (rows, width, channels)."""
    kind: Any = np.dtype(dtype).type
    rows, width = next(iter(images.values())).shape[:2]
    found: dict[Term, Any] = {}

    def of(term: Term) -> Any:
        if term not in found:
            found[term] = leaf(term) if not term.terms else FUNCTIONS[term.name].numpy(*map(of, term.terms))
        return found[term]

    def leaf(term: Term) -> Any:
        if term.name == "number":
            return np.array(term.number, kind)
        if term.name == "image":
            pixels = images[term.image]
            return pixels if term.channel is None else pixels[..., term.channel : term.channel + 1]
        return {
            "x": (np.arange(width, dtype=kind) + kind(0.5))[None, :, None],
            "y": (np.arange(top, top + rows, dtype=kind) + kind(0.5))[:, None, None],
            "width": np.array(width, kind),
            "height": np.array(height, kind),
        }[term.image]

    with np.errstate(all="ignore"):
        made = [np.asarray(of(each)) for each in p.results]
    whole = [np.broadcast_to(each, (rows, width, each.shape[2] if each.ndim == 3 else 1)) for each in made]
    return whole[0] if len(whole) == 1 else np.concatenate(whole, axis=2)


@expression.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    height = inputs["a"].height
    return np.array(_evaluated(p, {name: each.pixels for name, each in inputs.items()}, 0, height, np.float64))


# ---------------------------------------------------------------------------------------------------- by compilation


@dataclass(frozen=True, slots=True)
class Program:
    """An expression as text for expression.cl, and its numbers."""

    flat: bool
    load: str
    results: str
    numbers: tuple[float, ...]


def compiled(p: Parameters, channels: Mapping[str, int], out: int) -> Program:
    """Text for images of these channel counts."""
    terms = p.terms
    used = sorted({each.image for each in terms if each.name == "image"})
    places = any(each.name == "place" for each in terms)
    flat = not places and all(each.channel is None for each in terms if each.name == "image")
    flat = flat and len(p.results) == 1 and all(channels[name] == out for name in used)
    numbers = list(dict.fromkeys(each.number for each in terms if each.name == "number"))

    def text(term: Term, channel: int) -> str:
        if term.terms:
            return FUNCTIONS[term.name].opencl.format(*(text(each, channel) for each in term.terms))
        if term.name == "number":
            return f"NUMBER({numbers.index(term.number)})"
        if term.name == "place":
            return f"place_{term.image}"
        if flat:
            return f"v{term.image}[0]"
        own = term.channel if term.channel is not None else (channel if channels[term.image] > 1 else 0)
        return f"v{term.image}[{own}]"

    load = []
    for name in used:
        count = 1 if flat else channels[name]
        load.append(
            f"float16 v{name}[{max(count, 4)}]; "
            f"planes_load({name} + first * {count}, {count}, {count}, count, v{name});"
        )
    pairs = [(0, p.results[0])] if flat else list(enumerate(p.results * (out if len(p.results) == 1 else 1)))
    results = " ".join(f"y[{at}] = {text(each, at)};" for at, each in pairs)
    return Program(flat, " ".join(load), results, tuple(numbers))


@expression.method(
    "compiled",
    error=_error,
    work=lambda p, knob, facts: next(iter(facts.values())).pixels * _channels(p, facts) * (8.0 + len(p.terms)),
    rates={"opencl": Rate(3e-4, 4e-11), "numpy": Rate(1e-4, 9e-10)},
)
class Compiled:
    """One pass over the images in float32: a kernel of its own on OpenCL, blocks that stay in cache with NumPy."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        first = inputs["a"]
        out = aligned_empty((first.height, first.width, _channels(p, _facts(inputs))))
        program = compiled(p, {name: each.channels for name, each in inputs.items()}, out.shape[2])
        images = [aligned(inputs[name].pixels) if name in inputs else aligned(first.pixels) for name in IMAGES]
        count = out.size if program.flat else first.height * first.width
        defines: dict[str, int | float | str] = {
            "FLAT": int(program.flat), "LOAD": program.load, "RESULTS": program.results,
            "OUT": 1 if program.flat else out.shape[2],
        }  # fmt: skip
        with device.session() as session:
            session.launch(
                "arithmetic/expression.cl", "evaluate", (-(-count // 16),),
                *images, session.write(out), aligned(np.array(program.numbers or (0.0,), np.float32)),
                np.uint64(first.width), np.uint64(first.height), np.uint64(count),
                defines=defines,
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        first = inputs["a"]
        out = aligned_empty((first.height, first.width, _channels(p, _facts(inputs))))
        rows = max(1, BLOCK // (first.width * out.shape[2]))
        for top in range(0, first.height, rows):
            part = {name: each.pixels[top : top + rows] for name, each in inputs.items()}
            out[top : top + rows] = _evaluated(p, part, top, first.height, np.float32)
        return out


def _facts(inputs: Inputs) -> InputFacts:
    """All that the number of channels depends on."""
    return {name: Facts(each.height, each.width, each.channels) for name, each in inputs.items()}
