"""Studies say what is: cheap ones are made again, and those of noises keep what their declarations prove."""

from __future__ import annotations

import dataclasses
from importlib.resources import files
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from lichen.calibration import by_value, studies
from lichen.calibration.drawing import to_svg
from lichen.calibration.gather import measured, predicted
from lichen.calibration.plot import plot
from lichen.catalogue import operations
from lichen.operation import Operation
from lichen.operations.noise.character import described

AGAIN = "run `lichen calibrate --errors --operation NAME` and look at what changed"
DECLARED = {name: operation for name, operation in operations().items() if operation.study}
NOISES = [name for name in DECLARED if name != "lic"]


def test_all_that_are_declared_are_kept_and_little_else() -> None:
    kept = studies.load()
    assert {name for name in kept if " " not in name} == set(DECLARED), AGAIN
    assert set(NOISES) == {name for name, each in operations().items() if each.family == "noise"}
    assert (files("lichen.calibration") / studies.NAME).stat().st_size < 120_000, "it is loaded with every report"


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


@pytest.mark.parametrize("name", sorted(set(operations()) - set(DECLARED)))
def test_where_pointwise_operations_err_is_found_again(name: str) -> None:
    """But for the last digits of another processor."""
    found, report = studies.made(operations()[name]), predicted(operations()[name])
    assert report.study == studies.load().get(f"{name} {report.example}")
    assert found.keys() == {each for each in studies.load() if each.partition(" ")[0] == name}, AGAIN
    for label, study in found.items():
        kept = {(chart.up, chart.across): chart for chart in studies.load()[label].charts}
        made = {(chart.up, chart.across): chart for chart in study.charts}
        assert kept.keys() == made.keys(), AGAIN
        for (up, across), errors in kept.items():
            if "output units" in up:
                again, units = made[up, across], kept["largest error, in ULP of float32", across]
                assert errors.places == again.places
                assert errors.curves.keys() == again.curves.keys(), AGAIN
                for method, curve in errors.curves.items():
                    told = zip(errors.places, curve, units.curves[method], again.curves[method], strict=True)
                    for at, old, ulp, new in told:
                        assert (old is None) == (new is None), f"{label}, {method}, at {at:.3g}: {AGAIN}"
                        if old is not None and ulp is not None and new is not None:
                            digit = old / ulp if ulp else 2.0**-23 * max(1.0, abs(at))
                            said = f"{label}, {method}, at {at:.3g}: {AGAIN}"
                            assert abs(new - old) <= 0.1 * old + 4 * digit, said


@pytest.mark.parametrize("name", sorted({name.partition(" ")[0] for name in studies.load() if " " in name}))
def test_every_method_that_takes_a_picture_shows_where_it_errs(name: str) -> None:
    report = predicted(operations()[name])
    assert report.study is not None
    taken = {report.settings[i].method for i in report.ours if report.settings[i].failed is None}
    shown = {curve.partition(",")[0] for chart in report.study.charts for curve in chart.curves}
    assert shown >= taken


def test_methods_for_the_domain_of_displays_are_shown_there_alone() -> None:
    inside, beyond = studies.load()["transfer 0"].charts[:2]
    assert {"cubic", "sextic", "exact"} <= inside.curves.keys()
    assert beyond.curves.keys() == inside.curves.keys() - {"cubic", "sextic"}
    assert (inside.places[0], inside.places[-1]) == (0, 1)
    assert (beyond.places[0], beyond.places[-1]) == pytest.approx((-16, 16384), rel=0.01)
    ulp = studies.load()["transfer 0"].numbers["ulp"]
    assert ulp["cubic"].keys() == {"in [0, 1]"}
    assert ulp["exact"].keys() == by_value.SPANS.keys()
    assert ulp["cubic"]["in [0, 1]"][-1] > 100 * ulp["exact"]["in [0, 1]"][-1]


@pytest.mark.parametrize("span", [by_value.DISPLAY, by_value.WIDE], ids=lambda span: span.name)
def test_colours_lie_in_their_part_of_the_range(span: by_value.Range) -> None:
    for (low, high), row in zip(span.parts, span.colours(3), strict=True):
        leading = np.take_along_axis(row, np.abs(row).argmax(axis=1, keepdims=True), axis=1)
        assert np.all((np.float32(low) <= leading) & (leading <= np.float32(high)))
        assert leading[0, 0] == np.float32(low)
        assert leading[2, 0] == np.float32(high)
        assert np.all(row[::2] == row[::2, :1]), "greys"
        assert np.any(row[1::2] != row[1::2, :1]), "colours"


def test_what_a_value_is_wrong_by_is_told_where_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """A method that doubles what lies between 3 and 4, and has no result from 0.3 to 0.4, errs nowhere else."""
    gamma = operations()["gamma"]
    exact = gamma.methods["exact"]

    class Wrong:
        @staticmethod
        def numpy(inputs: Any, parameters: Any, knob: float) -> Any:
            right = gamma.evaluate_truth(inputs, parameters)
            pixels = inputs["image"].pixels
            wrong = np.where((pixels > 3) & (pixels < 4), 2 * right, right)
            return np.where((pixels > 0.3) & (pixels < 0.4), np.nan, wrong).astype(np.float32)

        opencl = None

    monkeypatch.setattr("lichen.calibration.sweep.backends", lambda: ("numpy",))
    monkeypatch.setitem(gamma.methods, "exact", dataclasses.replace(exact, implementation=Wrong))
    found = by_value.study(gamma, gamma.validate(gamma.examples[0]))
    assert found is not None
    inside, beyond = (dict(zip(chart.places, chart.curves["exact"], strict=True)) for chart in found.charts[:2])
    assert max(error for error in inside.values() if error is not None) < 1e-7
    assert max(error for at, error in beyond.items() if error is not None and 0 <= at < 4) < 1e-6
    assert beyond[4.0] is not None
    assert beyond[4.0] > 10
    ulp = found.numbers["ulp"]["exact"]
    assert ulp["in [0, 1]"][-1] <= 0.5
    assert ulp["above 1"][-1] > 1e6
    assert "results are finite where the exact one is not" in found.sentences[0]
    assert not any("results are finite" in each for each in studies.load()["gamma 0"].sentences)


def test_other_examples_and_parameters_are_studied_when_they_are_measured() -> None:
    levels = operations()["levels"]
    for asked in (2, {"gamma": 3.0}):
        study = measured(levels, asked, size=64, quick=True).study
        assert study is not None
        assert study.charts[0].curves.keys() == levels.methods.keys()
    assert predicted(levels, 2).study is None


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
    assert "Largest error, in ULP of float32" in drawn
    assert "theory -2" in " ".join(ElementTree.fromstring(to_svg(plot(predicted(operations()["curve"])))).itertext())
