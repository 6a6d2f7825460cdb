"""What a viewer sees: the figures of the metrics, for pictures alone, and never of what is not finite."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lichen.accuracy import colour
from lichen.calibration.corpus import Case, cases
from lichen.calibration.sweep import errors
from lichen.calibration.table import load
from lichen.calibration.viewing import SHOWN, Look, Viewer, viewer
from lichen.catalogue import operation
from lichen.image import Image, Space
from lichen.memory import Array


def _looking(name: str, example: int = 0, shown: str = SHOWN) -> tuple[Viewer | None, Case, Array]:
    owner: Any = operation(name)
    parameters = owner.validate(owner.examples[example])
    case = next(case for case in cases(owner, parameters, 48) if case.name == shown)
    truth = owner.evaluate_truth(case.inputs, parameters)
    return viewer(owner, parameters, case, truth), case, truth


@pytest.mark.parametrize(("name", "space"), [("gaussian", Space.LINEAR), ("levels", Space.SRGB)])
def test_figures_are_those_of_the_metrics(name: str, space: Space) -> None:
    looking, _, truth = _looking(name)
    assert looking is not None
    pixels = (truth + np.random.default_rng(1).normal(0, 0.02, truth.shape)).astype(np.float32)
    image = Image(pixels, space)
    seen = colour.ciede2000(image, truth).largest, colour.flip(image, truth).mean
    assert looking.look(pixels) == pytest.approx(seen, rel=1e-5)
    assert looking.look(truth) == Look(0.0, 0.0)


def test_what_is_not_finite_is_never_perfect() -> None:
    looking, _, truth = _looking("gaussian")
    assert looking is not None
    for spoilt in (np.nan, np.inf):
        pixels = truth.copy()
        pixels[3, 4, 1] = spoilt
        assert looking.look(pixels) is None


def test_only_pictures_are_looked_at() -> None:
    assert _looking("gaussian", shown="noise")[0] is None
    for name in ("statistics", "compare", "mask"):
        assert _looking(name)[0] is None, name


def test_the_sweep_and_its_table_hold_them() -> None:
    found = errors(operation("saturation"), 0, 32)
    assert found
    assert all(entry.delta_e is not None and entry.flip is not None for entry in found)
    stores = {entry.precision: entry for entry in load().of("gaussian", 0) if entry.precision != "float32"}
    fixed8, fixed16 = stores["fixed8"], stores["fixed16"]
    assert fixed8.delta_e is not None
    assert fixed16.delta_e is not None
    assert fixed8.delta_e > 20 * fixed16.delta_e > 0
    assert all(entry.flip is None for entry in load().of("normals"))
