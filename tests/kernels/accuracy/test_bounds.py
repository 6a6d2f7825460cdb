"""No drawn image and no drawn parameter takes a method beyond the error it states.

A proved bound is never exceeded; an estimate at most once in a thousand draws. A few dozen draws for each operation,
always the same, run with every test; `make fuzz` draws thousands of new ones (LICHEN_DRAWS).
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

import lichen
from lichen.accuracy.metrics import difference
from lichen.accuracy.precision import PRECISIONS, Precision
from lichen.errors import LichenError
from lichen.image import Alpha, Image, Space
from lichen.opencl.device import default_device
from lichen.operation import Facts, Operation

from . import drawing

OPERATIONS = dict(lichen.operations())
BACKENDS = ("opencl", "numpy")
UNDERFLOW = float(np.finfo(np.float32).tiny)
FUZZED = int(os.environ.get("LICHEN_DRAWS", "0"))
MOST = 1 << 14
"""Pixels of a result that are drawn."""
SHARE = 1e-3
"""Of draws in which an estimate may be exceeded."""


def draws(usual: int) -> Callable[[Any], Any]:
    """`usual` draws, the same every time; or as many new ones as were asked for."""
    return settings(
        max_examples=FUZZED or usual,
        derandomize=not FUZZED,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate,),  # shrinking would evaluate slow truths for minutes
    )


@dataclass
class Tally:
    """Estimates: how many were put to the test, and which did not hold."""

    tried: int = 0
    broken: list[str] = field(default_factory=list)

    def check(self) -> None:
        """As many may break as are likely to, were each to break with the probability allowed: with 1 % of doubt."""
        likely = self.tried * SHARE
        left, allowed = math.exp(-likely), 0
        term = left
        while left < 0.99 and FUZZED:
            allowed += 1
            term *= likely / allowed
            left += term
        assert len(self.broken) <= allowed, f"{len(self.broken)} of {self.tried}:\n" + "\n".join(self.broken[:20])


def representable(truth: np.ndarray, pixels: np.ndarray, error: float) -> np.ndarray:
    """Truth with what float32 cannot hold as infinity; within the stated error of its end, as the result has it."""
    largest = float(np.finfo(np.float32).max)
    held = np.where(np.abs(truth) > largest, np.copysign(np.inf, truth), truth)
    near = (np.abs(truth) > largest - error) & ~np.isnan(truth)
    return np.where(near & np.isinf(pixels), np.copysign(np.inf, truth), np.where(near, pixels, held))


@pytest.mark.parametrize("operation", list(OPERATIONS.values()), ids=list(OPERATIONS))
def test_methods_keep_what_they_state(operation: Operation[Any]) -> None:
    tally = Tally()

    @draws(5)
    @given(st.data())
    def holds(data: st.DataObject) -> None:
        inputs, parameters, facts = data.draw(drawing.cases(operation.name))
        fit = [each for each in operation.methods.values() if each.unfit(parameters, facts) is None]
        assume(fit)
        truth = operation.evaluate_truth(inputs, parameters)
        device = default_device()
        assert device is not None
        for method in fit:
            knob = data.draw(drawing.settings_of(method))
            stated = method.error(parameters, knob, facts)
            for backend in BACKENDS:
                with np.errstate(all="ignore"):
                    if backend == "numpy":
                        pixels = method.implementation.numpy(inputs, parameters, knob)
                    else:
                        pixels = method.implementation.opencl(device, inputs, parameters, knob)
                found = difference(pixels, representable(truth, pixels, stated.value))
                good = found.largest <= stated.value + UNDERFLOW and not found.mismatched
                said = f"{method.name} at {knob:g} on {backend}, {parameters!r}, {inputs}: {found} beyond {stated}"
                if stated.kind == "bound":
                    assert good, said
                else:
                    tally.tried += 1
                    if not good:
                        tally.broken.append(said)

    holds()
    tally.check()


PICTURED = {
    name: each
    for name, each in OPERATIONS.items()
    if each.inputs
    and each.inputs[0].picture
    and each.inputs[0].channels[0] <= 4 <= (each.inputs[0].channels[1] or 4)
    and sum(declared.required for declared in each.inputs) == 1
}


@st.composite
def pictures(draw: st.DrawFn) -> Image:
    """With a meaning: light, display values or data; covered or not, coverage in [0, 1] and often at its ends."""
    height, width = draw(st.integers(1, 40)), draw(st.integers(1, 40))
    alpha = draw(st.sampled_from(list(Alpha)))
    made = draw(drawing.pixels(height, width, draw(st.sampled_from([1, 3]))))
    if alpha is not Alpha.NONE:
        rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
        coverage = np.clip(rng.uniform(-0.3, 1.3, (height, width, 1)), 0, 1).astype(np.float32)
        colour = made * coverage if alpha is Alpha.ASSOCIATED else made
        made = np.concatenate([colour, coverage], axis=-1)
    return Image(np.ascontiguousarray(made), draw(st.sampled_from(list(Space))), alpha)


@pytest.mark.parametrize("operation", list(PICTURED.values()), ids=list(PICTURED))
def test_whole_runs_keep_what_they_state(operation: Operation[Any]) -> None:
    """Conversions of light and coverage around the operation, and stores of every precision between them."""
    tally = Tally()

    @draws(8)
    @given(st.data())
    def holds(data: st.DataObject) -> None:
        picture = data.draw(pictures())
        values = data.draw(drawing.parameters(operation.name))
        wish = {
            "precision": data.draw(st.sampled_from(PRECISIONS)),
            "device": data.draw(st.sampled_from(BACKENDS)),
            "storage": data.draw(st.sampled_from(["uint8", "float32", None])),
        }
        assume(float(values.get("sigma", 1)) < 100)
        try:
            parameters, facts = operation.validate(values), {operation.inputs[0].name: Facts.of(picture)}
            assume(operation.check(parameters, facts) or operation.result(parameters, facts).pixels <= MOST)
            result = lichen.run(operation.name, picture, **wish, **values)
        except LichenError:
            assume(False)
        truth = lichen.evaluate_truth(operation.name, picture, **wish, **values)
        pixels = result.image.pixels
        if wish["precision"] is not Precision.FLOAT32:
            # Truth that no float32 holds is none that a store could be held to.
            assume(np.isfinite(truth).all())
        found = difference(pixels, representable(truth, pixels, result.error.value), result.image.alpha)
        good = found.largest <= result.error.value + UNDERFLOW and not found.mismatched
        said = f"{result.method}, {wish}, {values}, {picture}: {found} beyond {result.error}"
        if result.error.kind == "bound":
            assert good, said
        else:
            tally.tried += 1
            if not good:
                tally.broken.append(said)

    holds()
    tally.check()
