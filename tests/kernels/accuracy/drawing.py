"""Draws for property tests: images, parameters and settings of any operation, from its declaration alone.

Images mix what breaks filters (impulses, checks, extremes in two levels) with what breaks curves (values across all
magnitudes, neighbours of the numbers where standards change their formula) and what breaks line integrals (vortices and
saddles). Numbers are drawn by magnitude as often as evenly, with the ends of their range and their defaults.

Strategies take operations by name: hypothesis prints its arguments, and declarations are full of functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Image, as_image
from lichen.operation import Facts, Input, Knob, Method

OPERATIONS = lichen.operations()
DEAREST = 0.15
"""Predicted seconds of truth; more than is drawn."""
LARGEST_SIDE = 16384
"""px; a width or height that goes so far is that of the result."""
KNEES = (0.0, 0.0031308, 0.018, 0.04045, 1 / 12, 0.081, 0.5, 1.0, 1.8396, 1.9921, 2.0)


def _noise(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    return rng.random((height, width))


def _levels(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    return rng.integers(0, 2, (height, width)).astype(float)


def _impulse(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    made = np.zeros((height, width))
    made[rng.integers(height), rng.integers(width)] = 1
    return made


def _checks(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    side = int(rng.integers(1, 5))
    return ((np.arange(height)[:, None] // side + np.arange(width) // side) % 2).astype(float)


def _wave(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    down, across, phase = rng.uniform(-np.pi, np.pi, 3)
    return 0.5 + 0.5 * np.sin(down * np.arange(height)[:, None] + across * np.arange(width) + phase)


def _edge(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    angle = rng.uniform(0, 2 * np.pi)
    y, x = np.arange(height)[:, None] - height / 2, np.arange(width) - width / 2
    return (np.cos(angle) * x + np.sin(angle) * y > 0).astype(float)


def _magnitudes(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    return rng.choice([-1, 1], (height, width)) * 10 ** rng.uniform(-12, 4, (height, width))


def _knees(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    values = rng.choice(np.float32(KNEES), (height, width)) * rng.choice(np.float32([-1, 1, 1]), (height, width))
    near = (values.view(np.int32) + rng.integers(-2, 3, values.shape).astype(np.int32)).view(np.float32)
    return np.where(np.isfinite(near), near, 0)


def _highlights(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    return np.where(rng.random((height, width)) > 0.97, 1e4, rng.random((height, width)))


def _turning(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """One component of a linear field around a centre; two of them make vortices, nodes and saddles."""
    a, b = rng.standard_normal(2)
    y, x = rng.uniform(0, height), rng.uniform(0, width)
    return (a * (np.arange(width) - x) + b * (np.arange(height)[:, None] - y)) / 16


PATTERNS: Mapping[str, Callable[[np.random.Generator, int, int], np.ndarray]] = {
    "noise": _noise,
    "levels": _levels,
    "impulse": _impulse,
    "checks": _checks,
    "wave": _wave,
    "edge": _edge,
    "magnitudes": _magnitudes,
    "knees": _knees,
    "highlights": _highlights,
    "turning": _turning,
}
BOOLEANS, FOURTHS, FIFTHS, SIDES, SEEDS = (
    st.booleans(), st.integers(0, 3), st.integers(0, 4), st.integers(1, 48), st.integers(0, 2**32 - 1)
)  # fmt: skip
NAMES = st.sampled_from(sorted(PATTERNS))
SCALES = st.sampled_from([(1, 0), (1, 0), (1, -0.5), (-2, 1), (1e-3, 1), (1e3, -500), (1e-6, 0)])


@st.composite
def pixels(draw: st.DrawFn, height: int, width: int, channels: int) -> np.ndarray:
    """float32 (height, width, channels): a pattern for each channel, often moved and scaled."""
    name = draw(NAMES)
    rng = np.random.default_rng(draw(SEEDS))
    made = np.stack([PATTERNS[name](rng, height, width) for _ in range(channels)], axis=-1)
    scale, offset = draw(SCALES)
    return (made * scale + offset).astype(np.float32)


@st.composite
def images(draw: st.DrawFn, name: str) -> dict[str, Image]:
    """Inputs of an operation, of one size as a rule; optional ones half of the time."""
    height, width = draw(SIDES), draw(SIDES)
    made = {}
    for declared in OPERATIONS[name].inputs:
        if declared.required or draw(BOOLEANS):
            size = (height, width) if draw(FIFTHS) else (draw(SIDES), draw(SIDES))
            made[declared.name] = as_image(draw(pixels(*size, draw(channels(declared)))))
    return made


@cache
def channels(declared: Input) -> st.SearchStrategy[int]:
    fewest, most = declared.channels
    return st.sampled_from([count for count in (1, 2, 3, 4, 5) if fewest <= count and (most is None or count <= most)])


@st.composite
def parameters(draw: st.DrawFn, operation_name: str) -> dict[str, Any]:
    """Values for the parameters, as their JSON schema allows; half of the time an example with some of them replaced.

    What no schema says (the shape of a matrix, what a text means, fields that depend on one another) is known from the
    examples alone: arrays are theirs with other numbers, texts are theirs.
    """
    base = dict(draw(BASES[operation_name]))
    for name, drawn, required in fields(operation_name):
        if name not in base and not required and draw(BOOLEANS):
            continue
        if name in base and draw(FOURTHS):
            continue
        if drawn is not None:
            base[name] = draw(drawn)
    return base


BASES = {
    name: st.one_of(st.just({}), st.sampled_from([dict(each) for each in operation.examples]))
    for name, operation in OPERATIONS.items()
}


@cache
def fields(operation_name: str) -> list[tuple[str, st.SearchStrategy[Any] | None, bool]]:
    """Names of parameters, what draws them, and whether they must be given; kept, since making them is dear."""
    operation = OPERATIONS[operation_name]
    schema = operation.schema()
    found = []
    for name, field in schema.get("properties", {}).items():
        shapes = [example[name] for example in operation.examples if isinstance(example.get(name), list | tuple)]
        offered = (field, *field.get("anyOf", ()))
        drawn: st.SearchStrategy[Any] | None = None
        if name in ("width", "height") and LARGEST_SIDE in (each.get("maximum") for each in offered):
            drawn = SIDES
        elif shapes:
            drawn = st.one_of([renumbered(shape) for shape in shapes])
        elif "string" not in (each.get("type") for each in offered if "enum" not in each):
            drawn = value(field, schema.get("$defs", {}))
        found.append((name, drawn, name in schema.get("required", [])))
    return found


def renumbered(array: Any) -> st.SearchStrategy[Any]:
    """An array of the same shape; every number itself, another, or zero."""
    if isinstance(array, list | tuple):
        return st.tuples(*(renumbered(each) for each in array)).map(list)
    if isinstance(array, bool) or not isinstance(array, int | float):
        return st.just(array)
    return st.one_of(st.just(array), st.floats(-4, 4, allow_subnormal=False), st.just(0.0))


def value(field: Mapping[str, Any], definitions: Mapping[str, Any]) -> st.SearchStrategy[Any]:
    """Values that a field of a JSON schema takes."""
    if "$ref" in field:
        return value(definitions[field["$ref"].removeprefix("#/$defs/")], definitions)
    if "anyOf" in field:
        return st.one_of([value(each, definitions) for each in field["anyOf"]])
    if "enum" in field:
        return st.sampled_from(field["enum"])
    if "const" in field:
        return st.just(field["const"])
    kind = field["type"]
    if kind == "null":
        return st.none()
    if kind == "boolean":
        return st.booleans()
    if kind == "array":
        fewest, most = field.get("minItems", 0), field.get("maxItems", field.get("minItems", 0) + 3)
        items = field.get("prefixItems")
        if items:
            return st.tuples(*(value(each, definitions) for each in items)).map(list)
        return st.lists(value(field["items"], definitions), min_size=fewest, max_size=most)
    if kind == "object":
        return st.just({})  # with the defaults of all that it holds
    low = field.get("minimum", field.get("exclusiveMinimum", -1e3))
    high = field.get("maximum", field.get("exclusiveMaximum", 1e3))
    if kind == "integer":
        return st.integers(int(low) + ("exclusiveMinimum" in field), int(high) - ("exclusiveMaximum" in field))
    assert kind == "number", f"no way to draw a {kind}"
    return numbers(low, high, open_low="exclusiveMinimum" in field, open_high="exclusiveMaximum" in field)


def numbers(low: float, high: float, *, open_low: bool = False, open_high: bool = False) -> st.SearchStrategy[float]:
    """Evenly, by magnitude, and at the ends."""
    even = st.floats(low, high, exclude_min=open_low, exclude_max=open_high)
    signs = [sign for sign in (1.0, -1.0) if (high > 0 if sign > 0 else low < 0)]
    sized = st.tuples(st.sampled_from(signs), st.floats(-3, 3)).map(lambda drawn: drawn[0] * 10 ** drawn[1])
    within = sized.map(lambda number: min(max(number, low), high))
    usual = within.filter(lambda number: not (open_low and number <= low) and not (open_high and number >= high))
    return st.one_of(usual, usual, usual, even)


@st.composite
def cases(draw: st.DrawFn, name: str) -> tuple[dict[str, Image], Any, dict[str, Facts]]:
    """Inputs, parameters and facts that the operation takes and whose truth is soon found."""
    operation = OPERATIONS[name]
    given = draw(images(name))
    try:
        chosen = operation.validate(draw(parameters(name)))
    except InvalidRequest:
        assume(False)
    facts = {name: Facts.of(image) for name, image in given.items()}
    assume(not operation.check(chosen, facts))
    assume(operation.truth_seconds(chosen, facts) < DEAREST)
    return given, chosen, facts


def settings_of(method: Method[Any]) -> st.SearchStrategy[float]:
    """A knob's values and what lies between."""
    return _settings_of(method.knob)


@cache
def _settings_of(knob: Knob | None) -> st.SearchStrategy[float]:
    if knob is None:
        return st.just(0.0)
    if knob.low <= 0:
        return st.one_of(st.sampled_from(knob.values), st.floats(knob.low, knob.high))
    between = st.floats(math.log(knob.low), math.log(knob.high)).map(
        lambda drawn: min(max(math.exp(drawn), knob.low), knob.high)
    )
    return st.one_of(st.sampled_from(knob.values), between)
