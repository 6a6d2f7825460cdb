"""Lamps whose cones miss sixteen points are passed over, and not a bit changes."""

from __future__ import annotations

import numpy as np

import lichen


def test_lamps_that_miss_are_passed_over_without_a_trace() -> None:
    """A visibility of one everywhere says nothing, but keeps every lamp."""
    rng = np.random.default_rng(4)
    x, z = np.meshgrid(np.linspace(-8, 8, 160), np.linspace(-6, 6, 90))
    position = np.stack([x, 0.3 * np.sin(3 * x), z], axis=-1).astype(np.float32)
    position[:9, :30] = np.inf
    position[40, 50] = np.nan
    normal = np.broadcast_to(np.float32([0.1, 1, 0]), position.shape).copy()
    lights = [
        {
            "kind": "spot", "position": [float(rng.uniform(-8, 8)), 3.0, float(rng.uniform(-6, 6))],
            "direction": [float(rng.uniform(-0.4, 0.4)), -1, 0], "inner": 9, "outer": float(rng.uniform(12, 40)),
        }
        for _ in range(21)
    ]  # fmt: skip
    lights += [{"kind": "point", "position": [0, 2, 0]}, {"kind": "directional"}]
    for model in ("lambert", "torrance_sparrow"):
        given = {"position": position, "lights": lights, "model": model, "eye": [0, 9, 0], "device": "opencl"}
        first = lichen.run("lighting", normal, **given).image.pixels
        second = lichen.run("lighting", normal, **given, visibility=np.ones((90, 160, 1), np.float32)).image.pixels
        assert np.array_equal(first, second, equal_nan=True)
        assert np.isnan(first[40, 50]).all()
        assert not first[:9, :30].any()
