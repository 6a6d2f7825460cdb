"""Filters in which pixels take no part, against SciPy and least squares over what takes part."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

import lichen
from lichen.errors import InvalidRequest
from lichen.image import as_image
from lichen.operation import Border

KERNEL = ((1.0, 2.0, 0.0), (0.5, 3.0, 1.0), (0.0, 0.0, 4.0))
RNG = np.random.default_rng(11)
PIXELS = RNG.normal(2, 1, (29, 37, 3)).astype(np.float32)
HOLES = RNG.random((29, 37, 1)) < 0.3
HOLES[3:17, 5:22] = True
MASK = np.where(HOLES, 0, RNG.uniform(0.1, 1, HOLES.shape)).astype(np.float32)

Filter = Callable[[np.ndarray, str, float], np.ndarray]


def _gaussian(values: np.ndarray, mode: str, beyond: float) -> np.ndarray:
    return np.asarray(ndimage.gaussian_filter(values, 1.5, mode=mode, cval=beyond, radius=6, axes=(0, 1)))


def _box(values: np.ndarray, mode: str, beyond: float) -> np.ndarray:
    return np.asarray(ndimage.uniform_filter(values, (3, 5), mode=mode, cval=beyond, axes=(0, 1)))


def _convolve(values: np.ndarray, mode: str, beyond: float) -> np.ndarray:
    kernel = np.array(KERNEL)[..., None] / np.sum(KERNEL)
    return np.asarray(ndimage.correlate(values, kernel, mode=mode, cval=beyond))


FILTERS: dict[str, tuple[Filter, dict[str, Any]]] = {
    "gaussian": (_gaussian, {"sigma": 1.5}),
    "box": (_box, {"width": 5, "height": 3}),
    "convolve": (_convolve, {"kernel": KERNEL, "mode": "correlation", "normalise": True}),
}
each = pytest.mark.parametrize("name", list(FILTERS))
backends = pytest.mark.parametrize("backend", ["opencl", "numpy"])


def expected(name: str, values: np.ndarray, weights: np.ndarray, border: str, beyond: float = 0.0) -> np.ndarray:
    """Where hardly any weight is left of SciPy's sums, which keep traces of running sums, there is no value."""
    counted = np.broadcast_to(weights, values.shape).astype(np.float64)
    filtered, _ = FILTERS[name]
    sums = filtered(np.where(counted > 0, values, 0) * counted, border, beyond)
    shares = filtered(counted, border, 1.0 if beyond else 0.0)
    return np.where(shares > 1e-9, sums / np.maximum(shares, 1e-9), np.nan)


@each
@backends
def test_masked_pixels_take_no_part(name: str, backend: str) -> None:
    spoilt = np.where(HOLES, np.float32(np.nan), PIXELS)
    made = lichen.run(name, spoilt, mask=MASK, device=backend, **FILTERS[name][1]).image.pixels
    np.testing.assert_allclose(made, expected(name, PIXELS, MASK, "reflect"), rtol=2e-5)
    assert np.isnan(made).any()  # the hole is larger than the kernels


@each
@backends
def test_samples_that_are_no_numbers_are_skipped_channel_by_channel(name: str, backend: str) -> None:
    bad = RNG.random(PIXELS.shape) < 0.2
    spoilt = np.where(bad, RNG.choice(np.float32([np.nan, np.inf, -np.inf]), PIXELS.shape), PIXELS)
    made = lichen.run(name, spoilt, missing="skip", border="wrap", device=backend, **FILTERS[name][1]).image.pixels
    np.testing.assert_allclose(made, expected(name, PIXELS, ~bad, "grid-wrap"), rtol=2e-5)


@each
@backends
def test_what_lies_beyond_the_edges_is_left_out_or_counted(name: str, backend: str) -> None:
    arguments = {"device": backend, **FILTERS[name][1]}
    inside = lichen.run(name, PIXELS, missing="inside", **arguments).image.pixels
    np.testing.assert_allclose(inside, expected(name, PIXELS, np.ones((29, 37, 1)), "constant"), rtol=2e-5)
    around = lichen.run(name, PIXELS, mask=MASK, border="constant", value=0.5, **arguments).image.pixels
    sums = FILTERS[name][0](PIXELS.astype(np.float64) * MASK, "constant", 0.5)
    shares = FILTERS[name][0](np.broadcast_to(MASK, PIXELS.shape).astype(np.float64), "constant", 1.0)
    there = shares > 1e-9
    np.testing.assert_allclose(around[there], sums[there] / shares[there], rtol=2e-5)


@each
@backends
def test_a_single_pixel_that_is_left_is_the_result_whatever_its_size(name: str, backend: str) -> None:
    """Its weight is small, its value huge or tiny: nothing overflows, nothing vanishes."""
    for value in (1e-30, 3.0, 1e37):
        pixels = np.full((11, 11), np.nan, np.float32)
        pixels[5, 5] = value
        mask = np.where(np.isnan(pixels), 0, 2e-6).astype(np.float32)
        made = lichen.run(name, pixels, mask=mask, device=backend, **FILTERS[name][1]).image.pixels
        found = made[np.isfinite(made)]
        assert len(found) >= 6
        np.testing.assert_allclose(found, np.float32(value), rtol=1e-5)


@each
def test_approximations_are_out_of_the_question(name: str) -> None:
    plan = lichen.explain(name, PIXELS, missing="skip", **FILTERS[name][1]).to_json()["nodes"][0]
    refused = [offer for offer in plan["alternatives"] if "left out" in offer["verdict"]]
    assert {offer["method"] for offer in refused} >= {"gaussian": {"dct", "deriche", "box3"}, "box": {"table"},
                                                      "convolve": {"fft"}}[name]  # fmt: skip


@each
def test_what_is_no_mask_is_named(name: str) -> None:
    for mask in (np.full((29, 37), -1, np.float32), np.ones((3, 3), np.float32)):
        with pytest.raises(InvalidRequest) as caught:
            lichen.run(name, PIXELS, mask=mask, **FILTERS[name][1])
        assert [flaw.pointer for flaw in caught.value.flaws] == ["/inputs/mask"]


def test_definition_is_the_ratio() -> None:
    for name, (_, arguments) in FILTERS.items():
        operation = lichen.operations()[name]
        p = operation.validate({**arguments, "border": Border.REFLECT101})
        inputs = {"image": as_image(PIXELS.astype(np.float64)), "mask": as_image(MASK.astype(np.float64))}
        truth = operation.evaluate_truth(inputs, p)
        np.testing.assert_allclose(truth, expected(name, PIXELS, MASK.astype(np.float64), "mirror"), rtol=1e-9)


@backends
def test_a_narrow_gaussian_does_not_reach_its_neighbours(backend: str) -> None:
    """Their weights, 1e-235 here, are numbers in float64 and none in float32: undefined must mean the same in both."""
    values = {"sigma": 0.03, "mask": as_image(MASK)}
    made = lichen.run("gaussian", PIXELS, device=backend, **values).image.pixels
    np.testing.assert_array_equal(np.isnan(made[..., :1]), MASK == 0)
    np.testing.assert_array_equal(np.isnan(lichen.evaluate_truth("gaussian", PIXELS, **values)), np.isnan(made))


# ------------------------------------------------------------------- filters that choose, fit, or go on from means

Window = Callable[[np.ndarray], float]
"""Of the numbers in a window of 3 x 5, of which there is at least one."""

STEPS: dict[str, tuple[Window, dict[str, Any]]] = {
    "median": (lambda seen: float(np.sort(seen)[(len(seen) - 1) // 2]), {"size": 5}),
    "erode": (lambda seen: float(seen.min()), {"step": "erode", "width": 5, "height": 3}),
    "dilate": (lambda seen: float(seen.max()), {"step": "dilate", "width": 5, "height": 3}),
    "gradient": (lambda seen: float(seen.max() - seen.min()), {"step": "gradient", "width": 5, "height": 3}),
}
choosing = pytest.mark.parametrize("name", list(STEPS))


def of_those_left(name: str, pixels: np.ndarray, mode: str) -> np.ndarray:
    """SciPy shows every window, NaN where nothing takes part."""
    choose, values = STEPS[name]

    def window(seen: np.ndarray) -> float:
        there = seen[~np.isnan(seen)]
        return choose(there) if there.size else np.nan

    rows, columns = (5, 5) if name == "median" else (values["height"], values["width"])
    planes = [
        ndimage.generic_filter(plane, window, (rows, columns), mode=mode, cval=np.nan)
        for plane in np.moveaxis(pixels.astype(np.float64), -1, 0)
    ]
    return np.stack(planes, -1)


def chosen(name: str, pixels: np.ndarray, backend: str, **values: Any) -> np.ndarray:
    operation = "median" if name == "median" else "morphology"
    return lichen.run(operation, pixels, device=backend, **STEPS[name][1], **values).image.pixels


@choosing
@backends
def test_choices_are_made_among_what_takes_part(name: str, backend: str) -> None:
    made = chosen(name, np.where(HOLES, np.float32(np.nan), PIXELS), backend, mask=MASK)
    holes = np.where(HOLES, np.nan, PIXELS)
    np.testing.assert_allclose(made, of_those_left(name, holes, "reflect"), rtol=1e-6)
    assert np.isnan(made).any()
    garbage = chosen(name, np.where(HOLES, np.float32(-1e9), PIXELS), backend, mask=MASK)
    np.testing.assert_array_equal(garbage, made)


@choosing
@backends
def test_choices_skip_what_is_no_number_channel_by_channel(name: str, backend: str) -> None:
    bad = RNG.random(PIXELS.shape) < 0.6
    with np.errstate(invalid="ignore"):
        minus = -np.float32(np.nan)  # its sign would make it the smallest of all
    spoilt = np.where(bad, RNG.choice(np.array([np.nan, minus, np.inf, -np.inf], np.float32), PIXELS.shape), PIXELS)
    made = chosen(name, spoilt, backend, missing="skip", border="wrap")
    np.testing.assert_allclose(made, of_those_left(name, np.where(bad, np.nan, PIXELS), "grid-wrap"), rtol=1e-6)


@choosing
@backends
def test_choices_inside_see_nothing_beyond_the_edges(name: str, backend: str) -> None:
    made = chosen(name, PIXELS, backend, missing="inside", border="wrap")
    np.testing.assert_allclose(made, of_those_left(name, PIXELS, "constant"), rtol=1e-6)


@choosing
@backends
def test_what_is_undefined_and_not_left_out_spreads(name: str, backend: str) -> None:
    """A mask says which pixels take part, and a NaN among those is one."""
    pixels = PIXELS.copy()
    pixels[20, 30, 1] = np.nan
    made = chosen(name, pixels, backend, mask=np.ones((29, 37), np.float32))
    rows = slice(18, 23) if name == "median" else slice(19, 22)
    expected = np.zeros(PIXELS.shape, bool)
    expected[rows, 28:33, 1] = True
    np.testing.assert_array_equal(np.isnan(made), expected)


@backends
def test_openings_and_closings_of_a_part_lie_on_their_side_of_it(backend: str) -> None:
    values: dict[str, Any] = {"width": 4, "height": 3, "mask": MASK, "device": backend}
    there = ~HOLES[..., 0]
    opened = lichen.run("morphology", PIXELS, step="open", **values).image.pixels
    closed = lichen.run("morphology", PIXELS, step="close", **values).image.pixels
    assert (opened[there] <= PIXELS[there]).all()
    assert (closed[there] >= PIXELS[there]).all()
    again = lichen.run("morphology", opened, step="open", **values).image.pixels
    np.testing.assert_array_equal(again[there], opened[there])
    hat = lichen.run("morphology", PIXELS, step="tophat", **values).image.pixels
    np.testing.assert_array_equal(hat, PIXELS - opened)


WEIGHTS = {
    "sobel": np.outer((1, 2, 1), (1, 2, 1)),
    "scharr": np.outer((3, 10, 3), (3, 10, 3)),
    "prewitt": np.ones((3, 3)),
    "central": np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]]),
}


def planes(pixels: np.ndarray, kind: str, mode: str) -> np.ndarray:
    """The slopes (x, y) of the plane that fits what takes part, by LAPACK, one pixel after the other."""
    outside: dict[str, Any] = {"constant_values": np.nan} if mode == "constant" else {}
    around = np.pad(pixels.astype(np.float64), 1, mode=mode, **outside)  # type: ignore[call-overload]
    slopes = np.full((*pixels.shape, 2), np.nan)
    roots = np.sqrt(WEIGHTS[kind]).ravel()
    grid = np.stack([np.ones(9), np.tile((-1, 0, 1), 3), np.repeat((-1, 0, 1), 3)], 1)
    for y, x in np.ndindex(*pixels.shape):
        seen = around[y : y + 3, x : x + 3].ravel()
        part = ~np.isnan(seen) & (roots > 0)
        if np.linalg.matrix_rank(grid[part]) == 3:
            solved = np.linalg.lstsq(roots[part, None] * grid[part], roots[part] * seen[part], rcond=None)
            slopes[y, x] = solved[0][1:]
    return slopes


def of_slopes(slopes: np.ndarray) -> dict[str, np.ndarray]:
    x, y = slopes[..., 0], slopes[..., 1]
    along = np.cos(np.radians(30)) * x + np.sin(np.radians(30)) * y
    return {"x": x, "y": y, "l1": np.abs(x) + np.abs(y), "l2": np.hypot(x, y), "along": along}


@pytest.mark.parametrize("kind", list(WEIGHTS))
@backends
def test_slopes_are_those_of_the_plane_through_what_is_left(kind: str, backend: str) -> None:
    plane, holes = PIXELS[..., 0], HOLES[..., 0]
    garbage = np.where(holes, np.float32(-1e9), plane)
    for output, expected in of_slopes(planes(np.where(holes, np.nan, plane), kind, "symmetric")).items():
        values: dict[str, Any] = {"mask": kind, "output": output, "angle": 30, "device": backend}
        made = lichen.run("derivative", garbage, valid=MASK, **values).image.pixels[..., 0]
        np.testing.assert_allclose(made, expected, atol=2e-5)
        assert np.isnan(made).any()
        assert np.isfinite(made[holes]).any()  # a plane has a slope where none of its samples is, too


@pytest.mark.parametrize("kind", list(WEIGHTS))
@backends
def test_slopes_skip_what_is_no_number_and_see_nothing_beyond_the_edges(kind: str, backend: str) -> None:
    bad = RNG.random(PIXELS.shape) < 0.2
    spoilt = np.where(bad, RNG.choice(np.float32([np.nan, np.inf, -np.inf]), PIXELS.shape), PIXELS)
    values: dict[str, Any] = {"mask": kind, "output": "x", "device": backend}
    skipped = lichen.run("derivative", spoilt, missing="skip", border="wrap", **values).image.pixels
    inside = lichen.run("derivative", spoilt, missing="inside", border="wrap", **values).image.pixels
    for channel in range(3):
        left = np.where(bad, np.nan, PIXELS)[..., channel]
        np.testing.assert_allclose(skipped[..., channel], planes(left, kind, "wrap")[..., 0], atol=2e-5)
        np.testing.assert_allclose(inside[..., channel], planes(left, kind, "constant")[..., 0], atol=2e-5)


@backends
def test_an_undefined_sample_that_is_not_left_out_has_no_plane(backend: str) -> None:
    pixels = PIXELS.copy()
    pixels[20, 30, 1] = np.nan
    made = lichen.run("derivative", pixels, valid=np.ones((29, 37), np.float32), device=backend).image.pixels
    expected = np.zeros(PIXELS.shape, bool)
    expected[19:22, 29:32, 1] = True
    np.testing.assert_array_equal(np.isnan(made), expected)


def test_a_mask_without_fits_leaves_nothing_out() -> None:
    for values in ({"missing": "skip"}, {"valid": MASK}):
        with pytest.raises(InvalidRequest) as caught:
            lichen.run("derivative", PIXELS, mask="gaussian", **values)
        assert [flaw.pointer for flaw in caught.value.flaws] == ["/parameters/mask"]


def test_who_takes_part_is_named_where_it_is_wrong() -> None:
    for operation, name in (("median", "mask"), ("morphology", "mask"), ("derivative", "valid"), ("sharpen", "mask")):
        for wrong in (np.full((29, 37), -1, np.float32), np.ones((3, 3), np.float32)):
            with pytest.raises(InvalidRequest) as caught:
                lichen.run(operation, PIXELS, **{name: wrong})
            assert [flaw.pointer for flaw in caught.value.flaws] == [f"/inputs/{name}"]


@backends
def test_detail_is_told_from_what_takes_part(backend: str) -> None:
    values: dict[str, Any] = {"sigma": 1.5, "device": backend}
    made = lichen.run("sharpen", PIXELS, mask=MASK, amount=2, **values).image.pixels
    blur = expected("gaussian", PIXELS, MASK, "reflect")
    np.testing.assert_allclose(made, PIXELS + 2 * (PIXELS - blur), rtol=2e-5, atol=2e-5)
    spoilt = PIXELS.copy()
    spoilt[5, 7] = np.nan
    made = lichen.run("sharpen", spoilt, missing="skip", **values).image.pixels
    assert np.argwhere(np.isnan(made[..., 0])).tolist() == [[5, 7]]


def test_nothing_to_leave_out_leaves_the_quick_methods() -> None:
    """`skip` of an image whose samples are all numbers is the plain filter, by the plain filter's method."""
    plain = lichen.run("median", PIXELS, size=3)
    skipped = lichen.run("median", PIXELS, size=3, missing="skip")
    assert plain.method == skipped.method == "network"
    np.testing.assert_array_equal(plain.image.pixels, skipped.image.pixels)
    plan = lichen.explain("median", PIXELS, size=3, missing="inside").to_json()["nodes"][0]
    assert any("left out" in offer["verdict"] for offer in plan["alternatives"])
