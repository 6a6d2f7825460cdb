"""Studies say what is: cheap ones are made again, and those of noises keep what their declarations prove."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from lichen.calibration import studies
from lichen.calibration.drawing import to_svg
from lichen.calibration.gather import predicted
from lichen.calibration.plot import plot
from lichen.catalogue import operations
from lichen.operations.noise.character import described

AGAIN = "run `lichen calibrate --errors --operation NAME` and look at what changed"
DECLARED = {name: operation for name, operation in operations().items() if operation.study}
NOISES = [name for name in DECLARED if name != "lic"]


def test_all_that_are_declared_are_kept() -> None:
    assert set(studies.load()) == set(DECLARED), AGAIN
    assert set(NOISES) == {name for name, each in operations().items() if each.family == "noise"}


@pytest.mark.parametrize("name", ["perlin_noise", "spectral_noise", "wavelet_noise", "white_noise", "lic"])
def test_what_they_say_is_found_again(name: str) -> None:
    study = DECLARED[name].study
    assert study is not None
    found, kept = study(), studies.load()[name]
    assert found.sentences == kept.sentences, AGAIN
    for label, curve in kept.curves.items():
        again = np.array(found.curves[label])
        assert np.allclose(again[: len(curve) - 1], curve[:-1], rtol=0.02), f"{label}: {AGAIN}"


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
    assert predicted(operations()["levels"]).to_json()["study"] is None
