"""Neighbourhoods as devices work on them whose items step together, here on a processor that passes for one."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest

import lichen
from lichen.accuracy.metrics import difference
from lichen.image import as_image
from lichen.opencl.device import LANES, Device, default_device
from lichen.opencl.session import Session
from lichen.operation import Facts

TAKEN = (
    ("gaussian", "fir"),
    ("gaussian", "multirate"),
    ("gaussian", "dct"),
    ("convolve", "direct"),
    ("convolve", "separable"),
    ("box", "running"),
    ("morphology", "blocks"),
    ("median", "network"),
    ("median", "bisect"),
    ("derivative", "direct"),
    ("laplacian", "direct"),
)
STAGING = {
    ("stencil.cl", "correlate"),
    ("products.cl", "multiply"),
    ("multirate.cl", "sums"),
    *itertools.product(["median.cl"], ["network", "bisect"]),
    *itertools.product(["passes.cl"], ["both", "columns", "rows"]),
    *itertools.product(["windows.cl"], ["both", "down", "across"]),
}
"""Kernels whose items keep tiles."""


@pytest.fixture
def in_step() -> Device:
    found = default_device()
    assert found is not None
    return dataclasses.replace(found, lanes=LANES)


@pytest.mark.parametrize(("name", "method"), TAKEN)
def test_examples_and_hard_cases_hold(name: str, method: str, in_step: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    launched: set[tuple[str, str]] = set()
    launch = Session.launch

    def noted(session: Session, source: str, kernel: str, *given: Any, **more: Any) -> None:
        launched.add((source.removeprefix("convolution/"), kernel))
        launch(session, source, kernel, *given, **more)

    monkeypatch.setattr(Session, "launch", noted)
    operation = lichen.operations()[name]
    chosen = operation.methods[method]
    knob = chosen.knob.values[-1] if chosen.knob else 0.0
    tried = 0
    for example, channels in itertools.product(operation.examples, (1, 3, 4)):
        p = operation.validate(example)
        inputs = {"image": as_image(np.random.default_rng(channels).random((33, 47, channels), np.float32) - 0.25)}
        facts = {"image": Facts.of(inputs["image"])}
        if operation.check(p, facts) or chosen.unfit(p, facts):
            continue
        found = difference(chosen.implementation.opencl(in_step, inputs, p, knob), operation.evaluate_truth(inputs, p))
        assert found.largest <= chosen.error(p, knob, facts).value, example
        assert not found.mismatched
        tried += 1
    for case in operation.hard_cases:
        p, given = operation.validate(case.parameters), case.inputs()
        inputs = {each: as_image(value) for each, value in given.items()}
        facts = {each: Facts.of(image) for each, image in inputs.items()}
        if (not case.methods or method in case.methods) and not chosen.unfit(p, facts):
            assert case.holds(given, chosen.implementation.opencl(in_step, inputs, p, knob)) is None, case.name
    assert tried
    assert launched
    assert not launched & STAGING
