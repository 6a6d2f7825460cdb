"""Studies say what is: cheap ones are made again, and those of noises keep what their declarations prove."""

from __future__ import annotations

import dataclasses
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from lichen.calibration import by_value, studies
from lichen.calibration.drawing import to_svg
from lichen.calibration.gather import predicted
from lichen.calibration.plot import plot
from lichen.catalogue import operations
from lichen.operation import Operation
from lichen.operations.noise.character import described

AGAIN = "run `lichen calibrate --errors --operation NAME` and look at what changed"
DECLARED = {name: operation for name, operation in operations().items() if operation.study}
NOISES = [name for name in DECLARED if name != "lic"]


def test_all_that_are_declared_are_kept() -> None:
    kept = studies.load()
    assert {name for name in kept if " " not in name} == set(DECLARED), AGAIN
    assert set(NOISES) == {name for name, each in operations().items() if each.family == "noise"}
    assert {"transfer", "gamma", "tone_map", "levels", "curve", "convert"} < {name.partition(" ")[0] for name in kept}


@pytest.mark.parametrize("name", ["perlin_noise", "spectral_noise", "wavelet_noise", "white_noise", "lic"])
def test_what_they_say_is_found_again(name: str) -> None:
    study = DECLARED[name].study
    assert study is not None
    found, kept = study(), studies.load()[name]
    assert found.sentences == kept.sentences, AGAIN
    for old, new in zip(kept.charts, found.charts, strict=True):
        for label, curve in old.curves.items():
            pairs = [each for each in zip(new.curves[label], curve, strict=True) if None not in each]
            assert np.allclose(*np.array(pairs[:-1], float).T, rtol=0.02), f"{label}: {AGAIN}"


@pytest.mark.parametrize("name", sorted({name.partition(" ")[0] for name in studies.load() if " " in name}))
def test_where_pointwise_operations_err_is_found_again(name: str) -> None:
    """But for the last digits of another processor."""
    operation = operations()[name]
    made = {f"{name} {number}" for number in range(len(operation.examples))} & set(studies.load())
    label = min(made)
    found = by_value.study(operation, operation.validate(operation.examples[int(label.partition(" ")[2])]))
    assert found is not None
    (errors, units), (again, _) = studies.load()[label].charts, found.charts
    assert errors.places == again.places
    assert errors.curves.keys() == again.curves.keys(), AGAIN
    for method, curve in errors.curves.items():
        for at, old, ulp, new in zip(errors.places, curve, units.curves[method], again.curves[method], strict=True):
            if old is not None and ulp is not None and new is not None:
                digit = old / ulp if ulp else 2.0**-23 * max(1.0, abs(at))
                assert abs(new - old) <= 0.1 * old + 4 * digit, f"{label}, {method}, at {at:.3g}: {AGAIN}"
            else:
                assert (old is None) == (new is None), f"{label}, {method}, at {at:.3g}: {AGAIN}"


def test_what_a_value_is_wrong_by_is_told_where_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """A method that doubles what lies between 3 and 4 errs there by as much, and nowhere else."""
    levels = operations()["gamma"]
    exact = levels.methods["exact"]

    class Wrong:
        @staticmethod
        def numpy(inputs: Any, parameters: Any, knob: float) -> Any:
            right = levels.evaluate_truth(inputs, parameters)
            pixels = inputs["image"].pixels
            return np.where((pixels > 3) & (pixels < 4), 2 * right, right).astype(np.float32)

        opencl = None

    monkeypatch.setattr("lichen.calibration.sweep.backends", lambda: ("numpy",))
    monkeypatch.setitem(levels.methods, "exact", dataclasses.replace(exact, implementation=Wrong))
    found = by_value.study(levels, levels.validate(levels.examples[0]))
    assert found is not None
    by_place = dict(zip(found.charts[0].places, found.charts[0].curves["exact"], strict=True))
    wrong = [at for at, error in by_place.items() if error is not None and error > 1e-4 * max(1.0, abs(at))]
    assert wrong
    assert all(at > 3 / 2**0.5 for at in wrong)
    assert found.numbers["ulp"]["exact"]["in [0, 1]"][-1] <= 0.5
    assert found.numbers["ulp"]["exact"]["beyond"][-1] > 1e6


@pytest.mark.parametrize("operation", operations().values(), ids=list(operations()))
def test_errors_fall_with_the_orders_that_are_declared(operation: Operation[Any]) -> None:
    for order in predicted(operation).orders:
        assert order.measured == pytest.approx(order.expected, abs=0.4), order


def test_steps_have_the_orders_of_their_rules() -> None:
    for name, found in studies.load()["lic"].numbers["orders"].items():
        for method, wanted in (("euler", 1), ("rk2", 2), ("rk4", 4)):
            assert found[method] == pytest.approx(wanted, abs=0.15), (name, method)
        assert found["rk45"] > 5


@pytest.mark.parametrize("name", NOISES)
def test_noises_are_what_they_should_be(name: str) -> None:
    numbers = studies.load()[name].numbers
    (low, high), (least, largest) = numbers["range_proved"], numbers["range_found"]
    assert low <= least < largest <= high
    assert numbers["seeds"] < 4
    assert 0.8 < numbers["anisotropy"] < 1.5


def test_seeds_that_are_alike_are_found_out() -> None:
    rng = np.random.default_rng(5)
    one, two, three = rng.normal(size=(3, 256, 256))
    assert described([one, two, three], 1, (-1, 1), "never").numbers["seeds"] < 4
    assert described([one, two, three + 0.05 * one], 1, (-1, 1), "never").numbers["seeds"] > 8


def test_a_direction_shows_in_the_anisotropy() -> None:
    y, x = np.mgrid[:256, :256]
    noise = np.random.default_rng(5).normal(size=(256, 256))
    found = [
        described([noise + 2 * wave, noise], 1, (-1, 1), "never").numbers["anisotropy"]
        for wave in (np.sin(x * np.pi / 2), np.sin((x + y) * np.pi / 3))
    ]
    assert found[0] > 2
    assert found[1] < 0.5


def test_reports_and_plots_show_them() -> None:
    report = predicted(operations()["perlin_noise"])
    values = report.to_json()
    assert values["study"]["numbers"]["variance"] > 0
    assert values["settings"][0]["megapoints"] > 0
    texts = " ".join(ElementTree.fromstring(to_svg(plot(report))).itertext())
    assert "radial spectrum" in texts
    assert "is proved" in texts
    assert "Mpoint/s" in texts
    assert predicted(operations()["median"]).to_json()["study"] is None
    drawn = " ".join(ElementTree.fromstring(to_svg(plot(predicted(operations()["transfer"])))).itertext())
    assert "largest error, in ULP of float32" in drawn
    assert "theory -2" in " ".join(ElementTree.fromstring(to_svg(plot(predicted(operations()["curve"])))).itertext())
