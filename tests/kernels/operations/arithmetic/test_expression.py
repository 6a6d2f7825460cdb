"""Expressions against NumPy as one types it, what may not be written, and errors that hold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Image
from lichen.opencl.device import default_device
from lichen.operation import Facts
from lichen.operations.arithmetic.functions import FUNCTIONS

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(2)
A, B, C = (RNG.random((21, 33, n)).astype(np.float32) for n in (3, 3, 1))
OPERATION = lichen.operations()["expression"]

TYPED = {
    "(a + b) / 2 - c": lambda a, b, c: (a + b) / 2 - c,
    "a.r * b[2] - c": lambda a, b, c: a[..., :1] * b[..., 2:] - c,
    "(a.b, a.g, a.r, 1)": lambda a, b, c: np.concatenate([a[..., ::-1], np.ones_like(c)], -1),
    "-a ** 2 + b ** 3 - (-a) ** 5": lambda a, b, c: -(a**2) + b**3 - (-a) ** 5,
    "0.2 < a <= 0.7 and not b > 0.5 or c == c": lambda a, b, c: ((a > 0.2) & (a <= 0.7) & ~(b > 0.5) | (c == c)) * 1.0,
    "max(min(a, b), c) if a > b else atan2(a, b)": lambda a, b, c: np.where(
        a > b, np.maximum(np.minimum(a, b), c), np.arctan2(a, b)
    ),
    "log(a + 1) * exp(-b) + sqrt(c) + cos(2 * pi * a) + pow(a, 2.4)": lambda a, b, c: (
        np.log(a + 1) * np.exp(-b) + np.sqrt(c) + np.cos(2 * math.pi * a) + a**2.4
    ),
    "floor(9 * a) / 9 + round(4 * b) + ceil(c) + sign(a - 0.5) + a ** -1": lambda a, b, c: (
        np.floor(np.float32(9) * a.astype(np.float32)) / 9 + np.rint(4 * b) + np.ceil(c) + np.sign(a - 0.5) + 1 / a
    ),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("text", list(TYPED))
def test_means_what_it_says(text: str, backend: str) -> None:
    expected = TYPED[text](*(each.astype(np.float64) for each in (A, B, C)))
    found = lichen.run("expression", A, b=B, c=C, expression=text, device=backend).image.pixels
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() < 2e-4 if "-1" in text else np.abs(found - expected).max() < 3e-6


@pytest.mark.parametrize("backend", BACKENDS)
def test_places_are_pixel_centres(backend: str) -> None:
    found = lichen.run("expression", A, expression="(x, y, width, height)", device=backend).image.pixels
    assert np.array_equal(found[2, 5], [5.5, 2.5, 33, 21])
    assert np.array_equal(found[20, 32], [32.5, 20.5, 33, 21])


REFUSED = [
    "__import__('os')", "a.__class__", "a.r.b", "eval('1')", "lambda: 1", "[a for a in a]", "a['r']", "a[-1]", "a[99]",
    "a if", "(a, b)[0]", "min(a)", "min(*a)", "min(a, b=1)", "'text'", "True", "None", "a @ b", "a % b", "a // b", "~a",
    "a is b", "a in b", "f'{a}'", "a := 1", "...", "1e999", "9" * 400, "1j", "e", "(" * 60 + "a" + ")" * 60 + "(",
    "-" * 40 + "a", "+".join("a" * 200), "a" + " " * 3000, "()", "(a, b, c, d, a, b, c, d, a)", "", "a\nb", "a;b",
]  # fmt: skip


@pytest.mark.parametrize("text", REFUSED)
def test_what_may_not_be_written(text: str) -> None:
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("expression", A, expression=text)
    assert refused.value.flaws[0].pointer.startswith(("/parameters/expression", "/inputs/"))


def test_flaws_name_image_and_channel() -> None:
    for values, pointer in (
        ({"expression": "a + d"}, "/inputs/d"),
        ({"expression": "a + b", "b": np.zeros((21, 33, 2))}, "/parameters/expression"),
        ({"expression": "a[3]"}, "/parameters/expression"),
        ({"expression": "a + b", "b": np.zeros((20, 33, 3))}, "/inputs/b"),
        ({"expression": "(a, a.r)"}, "/parameters/expression"),
    ):
        with pytest.raises(InvalidRequest) as refused:
            lichen.run("expression", A, **values)
        assert [flaw.pointer for flaw in refused.value.flaws] == [pointer]


@st.composite
def written(draw: st.DrawFn, depth: int = 0) -> str:
    """An expression of everything there is."""
    if depth > 3 or draw(st.integers(0, 4)) == 0:
        return draw(st.sampled_from(["a", "b", "a.r", "0.5", "2", "-3", "x", "1e-3"]))
    part = written(depth + 1)
    kind = draw(st.integers(0, 3))
    if kind == 0:
        return f"({draw(part)} {draw(st.sampled_from(['+', '-', '*', '/', '<', '>=', 'and', 'or']))} {draw(part)})"
    if kind == 1:
        return f"({draw(part)} if {draw(part)} else {draw(part)})"
    name = draw(st.sampled_from(sorted(each for each, made in FUNCTIONS.items() if made.called)))
    return f"{name}({', '.join(draw(part) for _ in range(FUNCTIONS[name].arguments))})"


@settings(max_examples=300, derandomize=True, database=None, deadline=None)
@given(written(), st.sampled_from([(0, 1), (-1, 1), (0.5, 2), (-1e3, 1e3)]))
def test_any_expression_keeps_its_bound(text: str, spread: tuple[float, float]) -> None:
    """By NumPy; what is not sure promises nothing, but that it says so."""
    rng = np.random.default_rng(len(text))
    inputs = {name: Image(rng.uniform(*spread, (5, 7, 1)).astype(np.float32)) for name in "ab"}
    parameters = OPERATION.validate({"expression": text})
    facts = {name: Facts.of(image) for name, image in inputs.items()}
    method = OPERATION.methods["compiled"]
    stated, predicted = method.error(parameters, 0.0, facts), OPERATION.result(parameters, facts)
    truth, pixels = OPERATION.evaluate_truth(inputs, parameters), method.implementation.numpy(inputs, parameters, 0.0)
    if stated.kind == "bound":
        same = np.isnan(truth) == np.isnan(pixels)
        assert same.all(), text
        apart = np.abs(np.where(np.isnan(truth), 0, truth) - np.where(np.isnan(pixels), 0, pixels))
        assert apart.max() <= stated.value + 1.2e-38, text
        assert np.nanmin(truth, initial=np.inf) >= predicted.extent.low
        assert np.nanmax(truth, initial=-np.inf) <= predicted.extent.high


def test_a_few_any_expressions_agree_on_opencl() -> None:
    """The same on the device, for expressions that use every function once."""
    calls = [
        f"{name}({', '.join(['abs(a) + 0.1', 'b', '1 + b'][: made.arguments])})"
        for name, made in sorted(FUNCTIONS.items())
        if made.called
    ]
    for start in range(0, len(calls), 8):
        text = f"({', '.join(calls[start : start + 8])})"
        first, second = (RNG.uniform(0.1, 3, (5, 23, 1)).astype(np.float32) for _ in range(2))
        results = [
            lichen.run("expression", first, b=second, expression=text, device=backend).image.pixels
            for backend in BACKENDS
        ]
        assert np.allclose(*results, rtol=2e-6, atol=1e-6)


def test_programs_are_dropped_when_there_are_many() -> None:
    """Every new shape of an expression is a new program; their number stays bounded."""
    device = default_device()
    assert device is not None
    kept = device.programs.kept
    assert kept >= 64
    for number in range(3):
        lichen.run("expression", C, expression=f"a + {number}.5", device="opencl")
    built = device.programs.count
    lichen.run("expression", C, expression="a + 1234.5", device="opencl")
    assert device.programs.count == built <= kept
