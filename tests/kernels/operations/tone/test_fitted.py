"""Curves as polynomials: what they err, where they end, and that a sample's neighbours do not matter."""

from __future__ import annotations

import numpy as np
import pytest

import lichen
from lichen.opencl.device import default_device
from lichen.operations.tone import curves
from lichen.operations.tone.curves import Curve, Direction
from lichen.operations.tone.transfer_launch import fitted

DEVICES = [pytest.param("opencl", marks=pytest.mark.skipif(default_device() is None, reason="no device")), "numpy"]
FORMS = [
    (Curve.SRGB, Direction.DECODE), (Curve.SRGB, Direction.ENCODE), (Curve.BT709, Direction.DECODE),
    (Curve.BT709, Direction.ENCODE), (Curve.PQ, Direction.ENCODE),
]  # fmt: skip


@pytest.mark.parametrize("degree", [3, 6])
@pytest.mark.parametrize(("curve", "way"), FORMS)
def test_polynomials_err_as_stated(curve: Curve, way: Direction, degree: int) -> None:
    """On other samples than those of the fit, the ends among them; and not by far less, which would be worth little."""
    form = curves.form(curve, way, gamma=2.2, white=203.0, black=0.0)
    found = fitted(form, degree)
    assert found is not None
    x = np.random.default_rng(1).random(1 << 17) * found.top
    x = np.concatenate([x, x**6, [form.knee, found.top]]).astype(np.float32)
    x = x[(x >= form.knee) & (x <= found.top)]
    wrong = np.abs(found(x) - form.upper(x.astype(np.float64)))
    assert wrong.max() <= found.error + found.rounding
    assert wrong.max() >= found.error / 2


def test_other_curves_have_none() -> None:
    for curve, way in ((Curve.HLG, Direction.DECODE), (Curve.GAMMA, Direction.DECODE), (Curve.PQ, Direction.DECODE)):
        assert fitted(curves.form(curve, way, gamma=2.2, white=203.0, black=0.0), 3) is None


NEIGHBOURS = {
    "pq": ("transfer", {"curve": "pq", "direction": "encode", "method": "sextic"}),
    "decode": ("transfer", {"direction": "decode", "method": "cubic"}),
    "encode": ("transfer", {"direction": "encode", "method": "cubic"}),
    "clamped": ("transfer", {"direction": "encode", "method": "cubic", "negative": "clamp"}),
    "convert": ("convert", {"source": "srgb", "target": "bt2100_pq", "method": "fitted", "degree": 6}),
    "back": ("convert", {"source": "linear_bt709", "target": "srgb", "method": "fitted", "degree": 6}),
}


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("low", [0.0, -0.003, -0.1])
@pytest.mark.parametrize("name", NEIGHBOURS)
def test_neighbours_do_not_matter(name: str, low: float, device: str) -> None:
    """What lies beyond the polynomials is computed for its own lane alone, and NaN stays there. Samples of which none
    has a sign or lies beyond them are taken another way, to the same bits."""
    operation, asked = NEIGHBOURS[name]
    pixels = low + (1 - low) * np.random.default_rng(2).random((8, 40, 3), dtype=np.float32)
    pixels[0, 0] = low, 0.0, 1.0
    alone = lichen.run(operation, pixels, device=device, **asked).image.pixels  # type: ignore[arg-type]
    again = pixels.copy()
    again[3, 7] = np.nan
    among = lichen.run(operation, again, device=device, **asked).image.pixels  # type: ignore[arg-type]
    assert np.isnan(among[3, 7]).all()
    among[3, 7] = alone[3, 7]
    assert np.array_equal(alone, among)
