"""Colour maps against NumPy's interpolation, and what their contours must be."""

from __future__ import annotations

import numpy as np
import pytest

import lichen
from lichen.image import Space
from lichen.operations.lookup.colour_map import Map, table

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(6)
VALUES = RNG.uniform(-1, 2, (13, 17, 2)).astype(np.float32)


@pytest.mark.parametrize("backend", BACKENDS)
def test_interpolates_the_palette(backend: str) -> None:
    palette = RNG.random((1, 6, 4)).astype(np.float32)
    values = {"palette": palette, "low": -0.5, "high": 1.5, "channel": 1, "device": backend}
    found = lichen.run("colour_map", VALUES, **values).image.pixels
    t = np.clip((VALUES[..., 1].astype(np.float64) + 0.5) / 2, 0, 1)
    expected = [np.interp(t, np.linspace(0, 1, 6), palette[0, :, c]) for c in range(4)]
    assert np.abs(found - np.stack(expected, -1)).max() < 1e-6
    bands = lichen.run("colour_map", VALUES, bands=True, **values).image.pixels
    assert np.array_equal(bands, palette[0][np.minimum((t * 6).astype(int), 5)])


@pytest.mark.parametrize("channels", range(1, 6))
def test_every_pixel_of_long_rows_has_its_own_colour(channels: int) -> None:
    values = RNG.random((3, 150, 1)).astype(np.float32)
    palette = RNG.random((1, 7, channels)).astype(np.float32)
    found = lichen.run("colour_map", values, palette=palette, low=0, high=1, device="opencl").image.pixels
    expected = np.stack([np.interp(values[..., 0] * 6.0, np.arange(7), each) for each in palette[0].T], axis=-1)
    assert np.abs(found - expected).max() < 1e-6


@pytest.mark.parametrize(
    "ends", [(0, 1), (0, 0.7), (0.7, 0.1), (-0.3, 0.4), (1000, 1001), (3e-30, 1e-30), (-1e10, 1e20), (0.1, 0.1001)]
)
@pytest.mark.parametrize("entries", [1, 2, 16, 4096])
def test_colours_are_right_at_the_edges_of_cells_and_beyond_the_ends(entries: int, ends: tuple[float, float]) -> None:
    """Where an entry is left for the next a place that is rounded falls on the wrong side."""
    low, high = ends
    edges = np.linspace(low, high, max(entries, 2)).astype(np.float32)
    beside = [np.nextafter(edges, np.float32(to)) for to in (np.inf, -np.inf)]
    spread = low + (high - low) * RNG.uniform(-1, 2, 4096)
    values = np.concatenate([edges, *beside, spread, [np.nan, np.inf, -np.inf, 3e38, -3e38, 0]]).astype(np.float32)
    given = {"palette": RNG.random((1, entries, 3)).astype(np.float32), "low": low, "high": high}
    found = lichen.run("colour_map", values[None], device="opencl", **given)
    exact = lichen.evaluate_truth("colour_map", values[None], **given)
    assert np.array_equal(np.isnan(found.image.pixels), np.isnan(exact))
    assert np.nanmax(np.abs(found.image.pixels - exact)) <= found.error.value


@pytest.mark.parametrize("backend", BACKENDS)
def test_beyond_its_ends_a_palette_repeats_or_turns_back(backend: str) -> None:
    x = np.linspace(-2, 3, 41, dtype=np.float32).reshape(1, -1, 1)
    ramp = np.array([0, 1], np.float32).reshape(1, 2, 1)
    values = {"palette": ramp, "low": 0, "high": 1, "device": backend}
    repeated = lichen.run("colour_map", x, beyond="repeat", **values).image.pixels.reshape(-1)
    mirrored = lichen.run("colour_map", x, beyond="mirror", **values).image.pixels.reshape(-1)
    v = x.reshape(-1).astype(np.float64)
    assert np.abs(repeated - np.mod(v, 1)).max() < 1e-6
    assert np.abs(mirrored - np.abs((v + 1) % 2 - 1)).max() < 1e-6


@pytest.mark.parametrize("name", list(Map))
def test_named_maps_are_srgb_pictures(name: Map) -> None:
    result = lichen.run("colour_map", VALUES, map=name)
    assert result.image.space is Space.SRGB
    assert result.image.channels == 3
    colours = table(name)
    if name in (Map.VIRIDIS, Map.PLASMA, Map.INFERNO, Map.MAGMA, Map.CIVIDIS):
        light = lichen.run("convert", colours[None].copy(), source="srgb", target="lab").image.pixels[0, :, 0]
        assert np.diff(light).min() > -1.5


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("steepness", [0.02, 0.1, 0.4])
def test_contours_are_as_wide_as_asked_however_steep_the_values(steepness: float, backend: str) -> None:
    """A plane rising along x: the line's coverage summed over a period is its width."""
    values = np.broadcast_to(steepness * np.arange(400, dtype=np.float32), (3, 400))[..., None].copy()
    white = np.ones((1, 2, 1), np.float32)
    found = lichen.run(
        "colour_map", values, palette=white, spacing=float(steepness * 40), offset=float(steepness * 20.5),
        line_width=3.0, device=backend,
    ).image.pixels[1, :, 0]  # fmt: skip
    assert np.sum(1 - found[:400]) == pytest.approx(3.0 * 10, abs=1e-3)


def test_a_diagonal_contour_is_no_wider() -> None:
    x, y = np.arange(64, dtype=np.float32), np.arange(64, dtype=np.float32)[:, None]
    values = ((x + y) / np.float32(np.sqrt(2)))[..., None].astype(np.float32)
    white = np.ones((1, 2, 1), np.float32)
    found = lichen.run("colour_map", values, palette=white, spacing=1000.0, offset=44.0, line_width=2.0).image.pixels
    across = (1 - found[:, :, 0]).sum(axis=1)  # along a row, a diagonal line is sqrt(2) times its width
    assert across[10:50].mean() == pytest.approx(2 * np.sqrt(2), rel=0.01)
