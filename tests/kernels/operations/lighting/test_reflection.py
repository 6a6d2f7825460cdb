"""Models of reflection against their printed formulas in 30 digits, and against what physics demands of them."""

from __future__ import annotations

import itertools
from typing import Any

import mpmath
import numpy as np
import pytest

from lichen.operations.lighting.reflection import (
    Distribution,
    Fresnel,
    Masking,
    Material,
    Model,
    facets,
    highlight,
    reflectance,
    unmasked,
)

NORMAL = np.array([[0.0], [0.0], [1.0]])
GRAIN = np.array([[1.0], [0.0], [0.0]])
TORRANCE_SPARROW = [
    Material(Model.TORRANCE_SPARROW, distribution, masking)
    for distribution, masking in itertools.product(Distribution, Masking)
]
CONSERVING = [
    *TORRANCE_SPARROW,
    Material(Model.BLINN_PHONG),
    Material(Model.COSINE_LOBE),
    Material(Model.LAFORTUNE),
    Material(Model.WARD),
    Material(Model.WARD, stretch=1.8),
]


def direction(polar: Any, azimuth: Any) -> np.ndarray:
    polar, azimuth = np.broadcast_arrays(polar, azimuth)
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])


def evaluate(material: Material, slope: float, l: np.ndarray, v: np.ndarray) -> np.ndarray:  # noqa: E741
    l, v = np.broadcast_arrays(l, v)  # noqa: E741
    normal, grain = (np.broadcast_to(each, l.shape) for each in (NORMAL, GRAIN))
    with np.errstate(all="ignore"):
        return highlight(material, np.full(l.shape[1], slope), normal, l, v, grain)


def printed(material: Material, m: float, l: np.ndarray, v: np.ndarray) -> float:  # noqa: E741
    """pi times the reflection's part times the cosine, from the papers' own formulas, in 30 digits."""
    with mpmath.workdps(30):
        l, v = (mpmath.matrix(each.tolist()) / mpmath.norm(mpmath.matrix(each.tolist())) for each in (l, v))  # noqa: E741
        u, w = l[2], v[2]
        h = (l + v) / mpmath.norm(l + v)
        nh, hv = h[2], (h.T * v)[0]
        delta = mpmath.acos(nh)
        mirrored = mpmath.matrix([-l[0], -l[1], l[2]])
        cosine = max((mirrored.T * v)[0], 0)
        k = 2 / mpmath.mpf(m) ** 2
        match material.model:
            case Model.PHONG:
                return float(cosine**k)
            case Model.COSINE_LOBE | Model.LAFORTUNE:
                return float((k + 2) / 2 * cosine**k * u)
            case Model.BLINN_PHONG:
                return float((k + 2) * (k + 4) / (8 * (2 ** (-k / 2) + k)) * nh**k * u)
            case Model.WARD:
                a, b = m * material.stretch, m / material.stretch
                tangent = mpmath.tan(delta) ** 2 / (1 - nh**2) * ((h[0] / a) ** 2 + (h[1] / b) ** 2)
                whole = l + v
                return float(mpmath.exp(-tangent) / (a * b) * (whole.T * whole)[0] / whole[2] ** 4 * u)
            case Model.BANKS:
                sines = [mpmath.sqrt(1 - each[0] ** 2) for each in (l, v)]
                return float(max(sines[0] * sines[1] - l[0] * v[0], 0) ** k * u)
        facet = {
            Distribution.GAUSSIAN: mpmath.exp(-((delta / m) ** 2)) / m**2,
            Distribution.BECKMANN: mpmath.exp(-((mpmath.tan(delta) / m) ** 2)) / (m**2 * nh**4),
            Distribution.GGX: m**2 / (nh**4 * (m**2 + mpmath.tan(delta) ** 2) ** 2),
        }[material.distribution]

        def smith(c: Any) -> Any:
            tangent = mpmath.sqrt(1 - c * c) / c
            if material.distribution is Distribution.GGX:
                return 2 / (1 + mpmath.sqrt(1 + (m * tangent) ** 2))
            a = 1 / (m * tangent)
            shadowed = (mpmath.exp(-a * a) / (a * mpmath.sqrt(mpmath.pi)) - mpmath.erfc(a)) / 2
            return 1 / (1 + shadowed)

        grooves = min(1, 2 * nh * w / hv, 2 * nh * u / hv)
        masked = smith(u) * smith(w) if material.masking is Masking.SMITH else grooves
        sine = mpmath.sqrt(1 - hv * hv) / mpmath.sqrt(1 + mpmath.mpf(material.contrast))
        index, inner = mpmath.sqrt(1 + mpmath.mpf(material.contrast)), mpmath.sqrt(1 - sine * sine)
        across, along = (hv - index * inner) / (hv + index * inner), (index * hv - inner) / (index * hv + inner)
        return float((across**2 + along**2) / 2 * facet * masked / (4 * w))


@pytest.mark.parametrize(
    "material",
    [*CONSERVING, Material(Model.PHONG), Material(Model.BANKS)],
    ids=lambda each: f"{each.model}-{each.distribution}-{each.masking}-{each.stretch}",
)
@pytest.mark.parametrize("slope", [0.05, 0.4, 1.0])
def test_the_printed_formulas(material: Material, slope: float) -> None:
    rng = np.random.default_rng(1)
    polar, azimuth = np.arccos(rng.uniform(0.01, 1, (2, 40))), rng.uniform(0, 2 * np.pi, (2, 40))
    polar[1, ::2], azimuth[1, ::2] = polar[0, ::2] + rng.normal(0, 0.02, 20), azimuth[0, ::2] + np.pi
    polar = np.minimum(polar, 1.56)
    l, v = direction(polar[0], azimuth[0]), direction(polar[1], azimuth[1])  # noqa: E741
    expected = [printed(material, slope, a, b) for a, b in zip(l.T, v.T, strict=True)]
    assert np.allclose(evaluate(material, slope, l, v), expected, rtol=1e-9, atol=1e-12)


def test_reflectance_is_that_of_the_polarisations() -> None:
    angles = np.radians([0, 30, 45, 60, 75, 80, 85, 89])
    table = [0.040000, 0.041523, 0.050240, 0.089187, 0.253061, 0.387704, 0.612800, 0.904185]
    found = reflectance(np.cos(angles), Material(Model.TORRANCE_SPARROW, contrast=1.25))
    assert np.allclose(found, table, atol=6e-7)


@pytest.mark.parametrize("material", CONSERVING, ids=lambda each: f"{each.model}-{each.distribution}-{each.masking}")
def test_reciprocity(material: Material) -> None:
    """The reflection's part is the same both ways: highlight / u."""
    rng = np.random.default_rng(2)
    l, v = (direction(np.arccos(rng.uniform(0.02, 1, 500)), rng.uniform(0, 7, 500)) for _ in "lv")  # noqa: E741
    there, back = evaluate(material, 0.3, l, v) / l[2], evaluate(material, 0.3, v, l) / v[2]
    assert np.allclose(there, back, rtol=1e-6)


def albedo(material: Material, slope: float, polar: float) -> float:
    """What a white furnace gets back from one direction: the integral over the hemisphere, around the mirror direction
    in finer steps."""
    out = direction(polar, 0.0).reshape(3, 1)
    count = 240
    # Half vectors by the square of their angle, so that narrow lobes are met; dl = 4 <h, v> dh.
    at = (np.arange(count) + 0.5) / count
    tilt, turn = np.meshgrid(np.pi / 2 * at**3, 2 * np.pi * at, indexing="ij")
    half = direction(tilt.ravel(), turn.ravel())
    hv = (half * out).sum(axis=0)
    incoming = 2 * hv * half - out
    weight = np.sin(tilt) * (np.pi / 2 * 3 * at**2)[:, None] / count * (2 * np.pi / count)
    seen = (hv > 0) & (incoming[2] > 0)
    value = evaluate(material, slope, out, incoming) / out[2]  # light along v, sent to all sides
    return float(np.where(seen, value * incoming[2] * 4 * hv * weight.ravel(), 0).sum() / np.pi)


@pytest.mark.parametrize("polar", [0.0, 0.9, 1.45])
@pytest.mark.parametrize("slope", [0.06, 0.6])
def test_no_surface_sends_out_more_than_it_gets(slope: float, polar: float) -> None:
    for material in CONSERVING:
        whole = Material(
            material.model, material.distribution, material.masking, Fresnel.NONE, stretch=material.stretch
        )
        assert albedo(whole, slope, polar) <= 1.01, whole


def test_smooth_surfaces_send_all_of_it() -> None:
    for material in (*TORRANCE_SPARROW, Material(Model.COSINE_LOBE), Material(Model.BLINN_PHONG)):
        whole = Material(material.model, material.distribution, material.masking, Fresnel.NONE)
        assert albedo(whole, 0.03, 0.0) == pytest.approx(1, abs=0.01), whole


@pytest.mark.parametrize("distribution", [Distribution.BECKMANN, Distribution.GGX])
@pytest.mark.parametrize("slope", [0.1, 0.5, 1.0])
def test_facets_project_to_the_surface_and_to_what_a_viewer_sees(distribution: Distribution, slope: float) -> None:
    """The integral of D cos is 1; of S D <v, h>+ it is <n, v> (Heitz 2014, equations 4 and 14)."""
    count = 1500
    at = (np.arange(count) + 0.5) / count
    tilt, turn = np.meshgrid(np.pi / 2 * at**2, 2 * np.pi * at[::10], indexing="ij")
    half = direction(tilt, turn)
    weight = np.sin(tilt) * (np.pi / 2 * 2 * at)[:, None] / count * (2 * np.pi / (count // 10))
    sine = np.hypot(half[0], half[1])
    density = facets(distribution, np.full_like(sine, slope), half[2], sine**2, np.ones_like(sine)) / np.pi
    assert (density * half[2] * weight).sum() == pytest.approx(1, abs=2e-4)
    for polar in (0.3, 1.2, 1.5):
        view = direction(polar, 0.0)
        seen = np.maximum((half * view[:, None, None]).sum(axis=0), 0)
        masked = view[2] / unmasked(distribution, np.array(slope), view[2])
        assert masked * (density * seen * weight).sum() == pytest.approx(view[2], rel=2e-3)


def test_lobes_turned_by_the_grain() -> None:
    """Lafortune's factors -1, -1, 1 mirror; others send light to one side; ward's lobe is longer across fibres."""
    l, v = direction(0.5, np.array([0.3])), direction(0.6, np.array([3.4]))  # noqa: E741
    plain = evaluate(Material(Model.COSINE_LOBE), 0.3, l, v)
    assert evaluate(Material(Model.LAFORTUNE), 0.3, l, v) == pytest.approx(plain)
    back = Material(Model.LAFORTUNE, lobe=(1.0, 1.0, 1.0))
    assert evaluate(back, 0.3, l, l) > evaluate(back, 0.3, l, v)
    straight = direction(0.0, np.array([0.0]))
    along, across = (
        evaluate(Material(Model.WARD, stretch=2.0), 0.2, straight, direction(0.6, np.array([turn])))
        for turn in (0.0, np.pi / 2)
    )
    assert along > 3 * across


@pytest.mark.parametrize("material", CONSERVING, ids=lambda each: f"{each.model}-{each.distribution}-{each.masking}")
def test_half_vectors_without_direction(material: Material) -> None:
    """l = -v, and directions all but opposite: a highlight that is finite, and none from well below the surface."""
    grazing = direction(np.pi / 2 - 10.0 ** np.arange(-15, 0), 0.4)
    opposite = np.array([[-1.0], [-1.0], [1.0]]) * grazing
    assert np.isfinite(evaluate(material, 0.3, grazing, -grazing)).all()
    assert np.isfinite(evaluate(material, 0.3, grazing, opposite)).all()
    steep = direction(np.linspace(0, 1.2, 7), 0.4)
    assert np.array_equal(evaluate(material, 0.3, steep, -steep), np.zeros(7))


@pytest.mark.parametrize("material", CONSERVING, ids=lambda each: f"{each.model}-{each.distribution}-{each.masking}")
def test_highlights_do_not_end_in_a_jump(material: Material) -> None:
    """Through the silhouette, where the surface begins to face away."""
    incoming = direction(1.2, np.array([np.pi]))
    around = direction(np.pi / 2 + np.linspace(-2e-6, 2e-6, 41), 0.0)
    found = evaluate(material, 0.4, incoming, around)
    assert found.min() > 0
    assert np.abs(np.diff(found)).max() < 1e-4 * found.max()
    assert not evaluate(material, 0.4, incoming, direction(np.pi / 2 + 0.11, np.array([0.0]))).any()
