"""Solid angles, spherical harmonics against scipy and closed forms, prefiltered environments against quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import special
from scipy.integrate import dblquad

import lichen
from lichen.operations.environment.harmonics import basis, cosine
from lichen.operations.environment.solid import reduced, sphere
from lichen.operations.warp.charts import Chart

BACKENDS = ("opencl", "numpy")
BOTH = pytest.mark.parametrize("backend", BACKENDS)
RNG = np.random.default_rng(21)
SIZES = {
    Chart.LATLONG: (64, 128),
    Chart.CUBE: (64, 96),
    Chart.CUBE_CROSS: (96, 128),
    Chart.CUBE_PAGES: (192, 32),
    Chart.PARABOLOID: (64, 128),
    Chart.MIRROR_BALL: (96, 96),
}


@pytest.mark.parametrize("chart", list(SIZES), ids=str)
def test_solid_angles_integrate_what_is_known_of_the_sphere(chart: Chart) -> None:
    d, angle = sphere(chart, *SIZES[chart])
    assert np.allclose(np.linalg.norm(d[angle > 0], axis=1), 1, atol=1e-12)
    assert angle.sum() == pytest.approx(4 * math.pi, rel=1e-12)
    # The mean of a direction is 0, of a square of its parts 1/3, of their product 0.
    assert np.allclose((angle[..., None] * d).sum(axis=(0, 1)) / (4 * math.pi), 0, atol=3e-3)
    second = np.einsum("yx,yxi,yxj->ij", angle, d, d) / (4 * math.pi)
    assert np.allclose(second, np.eye(3) / 3, atol=3e-3)


def test_solid_angles_of_a_cube_are_areas_of_the_sphere() -> None:
    _, angle = sphere(Chart.CUBE, 4, 6)
    for x0, y0, found in ((-1, -1, angle[0, 2]), (0, -1, angle[0, 3])):
        expected = dblquad(lambda y, x: (1 + x * x + y * y) ** -1.5, x0, x0 + 1, y0, y0 + 1)[0]
        assert found == pytest.approx(expected, rel=1e-9)


def test_paraboloids_as_drawn_in_the_text() -> None:
    """4 dA / (1 + r^2)^2 over the disc is half of the sphere; its rim counts a quarter of its middle."""
    _, angle = sphere(Chart.PARABOLOID, 256, 512)
    assert angle[:, :256].sum() == pytest.approx(2 * math.pi, rel=1e-4)
    assert angle[128, 1] / angle[128, 128] == pytest.approx(0.25, rel=0.03)


def test_functions_are_those_of_scipy() -> None:
    d = RNG.standard_normal((50, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    d = np.concatenate([d, np.eye(3), -np.eye(3)])
    found = basis(d, 8)
    theta, phi = np.arccos(np.clip(d[:, 2], -1, 1)), np.arctan2(d[:, 1], d[:, 0])
    for degree in range(8):
        for m in range(-degree, degree + 1):
            complex_value = special.sph_harm_y(degree, abs(m), theta, phi)
            part = complex_value.real if m >= 0 else complex_value.imag
            expected = part * ((-1) ** m * math.sqrt(2) if m else 1)
            assert np.allclose(found[:, degree * degree + degree + m], expected, atol=1e-12)


def test_a_cosine_by_its_degrees() -> None:
    for degree, known in enumerate([1, 2 / 3, 1 / 4, 0, -1 / 24, 0, 1 / 64]):
        assert cosine(degree) == pytest.approx(known, abs=1e-15)
    c, w = np.polynomial.legendre.leggauss(200)
    half, weight = (c + 1) / 2, w / 2
    for degree in range(10):
        expected = 2 * np.sum(weight * half * special.eval_legendre(degree, half))
        assert cosine(degree) == pytest.approx(expected, abs=1e-12)


@BOTH
def test_coefficients_of_a_function_are_its_own(backend: str) -> None:
    d, _ = sphere(Chart.LATLONG, 256, 512)
    wanted = RNG.standard_normal(25)
    light = (basis(d, 5) @ wanted)[..., None].astype(np.float32)
    result = lichen.run("spherical_harmonics", light, bands=5, device=backend, width=64, height=32)
    found = np.array(result.findings["coefficients"])[:, 0]
    assert np.abs(found - wanted).max() < 1e-3
    there, _ = sphere(Chart.LATLONG, 32, 64)
    assert np.abs(result.image.pixels[..., 0] - basis(there, 5) @ wanted).max() < 3e-3


@BOTH
def test_irradiance_of_nine_coefficients_is_near_that_of_all_light(backend: str) -> None:
    light = np.zeros((32, 64, 3), np.float32)
    light[:16] = (0.4, 0.6, 1.0)
    light[6:9, 20:24] = 12
    exact = lichen.run("prefilter", light, width=32, height=16, device=backend).image.pixels
    previous = np.inf
    for bands, most in ((2, 0.4), (3, 0.12), (5, 0.05)):
        nine = lichen.run(
            "spherical_harmonics", light, bands=bands, output="irradiance", width=32, height=16, device=backend
        ).image.pixels
        off = np.abs(nine - exact).max() / exact.max()
        assert off < min(most, previous)
        previous = off


@BOTH
def test_a_matt_surface_under_half_a_sky(backend: str) -> None:
    """White above the horizon: (1 + cos of the tilt) / 2."""
    light = np.repeat(np.array([1.0, 0.0]), 128)[:, None, None] * np.ones((1, 512, 1))
    found = lichen.run("prefilter", light.astype(np.float32), width=16, height=8, device=backend).image.pixels
    d, _ = sphere(Chart.LATLONG, 8, 16)
    assert np.abs(found[..., 0] - (1 + d[..., 1]) / 2).max() < 1e-3


@BOTH
@pytest.mark.parametrize(("lobe", "value"), [("phong", 20.0), ("ggx", 0.5)])
def test_glossy_lobes_of_a_polar_sky(lobe: str, value: float, backend: str) -> None:
    """Light that is the cosine to the pole, seen straight up: an integral over one angle."""
    latitude = (0.5 - (np.arange(128) + 0.5) / 128) * math.pi
    light = np.repeat(np.maximum(np.sin(latitude), 0)[:, None, None], 256, axis=1).astype(np.float32)
    given = {"exponent": value} if lobe == "phong" else {"roughness": value}
    found = lichen.run("prefilter", light, lobe=lobe, width=4, height=64, device=backend, **given).image.pixels
    c, w = np.polynomial.legendre.leggauss(2000)
    c, w = (c + 1) / 2, w / 2
    t = (1 - c) / 2 + value**4 * (1 + c) / 2
    kernel = c**value if lobe == "phong" else c / t**2
    assert found[0, 0, 0] == pytest.approx(np.sum(w * kernel * c) / np.sum(w * kernel), abs=2e-3)


@BOTH
@pytest.mark.parametrize("chart", list(SIZES), ids=str)
def test_white_furnace(chart: Chart, backend: str) -> None:
    light = np.full((*SIZES[chart], 1), 0.7, np.float32)
    for lobe in ("diffuse", "phong", "ggx"):
        found = lichen.run("prefilter", light, chart=chart, lobe=lobe, width=8, height=4, device=backend)
        assert np.abs(found.image.pixels - 0.7).max() < 1e-6


def test_blocks_keep_the_light_they_hold() -> None:
    light = RNG.random((96, 128, 2))
    _, angle = sphere(Chart.CUBE_CROSS, 96, 128)
    whole = (angle[..., None] * light).sum(axis=(0, 1))
    for most in (4000.0, 600.0, 60.0, 6.0):
        blocks = reduced(light, Chart.CUBE_CROSS, most)
        assert len(blocks.angle) <= max(most, 6)
        assert np.allclose((blocks.angle[:, None] * blocks.light).sum(axis=0), whole)


def test_fewer_texels_cost_accuracy() -> None:
    y, x = np.mgrid[0:64, 0:128]
    light = (np.sin(x / 9) * np.cos(y / 7) + 1)[..., None].astype(np.float32)
    exact = lichen.run("prefilter", light, width=16, height=8, method="all").image.pixels
    off = [
        float(
            np.abs(
                lichen.run("prefilter", light, width=16, height=8, method="reduced", texels=n).image.pixels - exact
            ).max()
        )
        for n in (64, 512, 4096)
    ]
    assert 0.2 > off[0] > 2 * off[1] > 4 * off[2] > 0
