"""Statistics against NumPy and exact rationals, and the findings against the table."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import lichen

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_agrees_with_numpy(backend: str) -> None:
    image = RNG.lognormal(size=(150, 131, 3)).astype(np.float32)
    wanted = [0, 3, 50, 99.5, 100]
    result = lichen.run(
        "statistics", image, percentiles=wanted, bins=20, low=0.5, high=4, method="exact", device=backend
    )
    flat = image.reshape(-1, 3).astype(np.float64)
    counts = [np.histogram(np.clip(column, 0.5, 4), 20, (0.5, 4))[0] / len(flat) for column in flat.T]
    expected = np.column_stack(
        [np.ones(3), flat.min(0), flat.max(0), flat.mean(0), flat.std(0), np.percentile(flat, wanted, axis=0).T, counts]
    )
    assert np.allclose(result.image.pixels[:, :, 0], expected, rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_variance_is_exact_far_from_zero(backend: str) -> None:
    """Against rationals: the mean of squares less the square of the mean would have no digit right."""
    image = (1e6 + RNG.integers(0, 3, (64, 301, 1)) / 16).astype(np.float32)
    values = [Fraction(float(x)) for x in image.reshape(-1)]
    mean = sum(values) / len(values)
    variance = sum((x - mean) ** 2 for x in values) / len(values)
    found = lichen.run("statistics", image, device=backend).findings["channels"][0]
    assert found["variance"] == pytest.approx(float(variance), rel=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_backends_count_alike_and_bins_keep_their_word(backend: str) -> None:
    image = RNG.normal(size=(77, 65, 2)).astype(np.float32)
    exact = lichen.run("statistics", image, method="exact", device=backend).image.pixels
    for resolution in (16, 256, 65536):
        result = lichen.run("statistics", image, method="binned", resolution=resolution, device=backend)
        assert np.abs(result.image.pixels - exact).max() <= result.error.value
        assert result.error.value < 10 / resolution


def test_findings_name_what_the_table_holds() -> None:
    image = np.array([[[1.0], [np.nan], [3.0], [np.inf]]], np.float32)
    result = lichen.run("statistics", image, percentiles=[50], bins=2)
    found = result.findings["channels"][0]
    assert (found["finite"], found["nonfinite"]) == (2, 2)
    assert (found["low"], found["high"], found["mean"], found["deviation"]) == (1, 3, 2, 1)
    assert found["percentiles"] == {"50": pytest.approx(2)}
    assert found["histogram"] == [0.5, 0.5]
    assert (result.findings["histogram_low"], result.findings["histogram_high"]) == (1, 3)


def test_nothing_finite_has_no_figures() -> None:
    found = lichen.run("statistics", np.full((3, 4, 1), np.nan, np.float32)).findings["channels"][0]
    assert (found["finite"], found["nonfinite"]) == (0, 12)
    assert np.isnan(found["mean"]) or found["mean"] is None
