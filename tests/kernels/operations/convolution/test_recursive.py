"""Recursive filters and boxes: how near they come to a Gaussian, beside published figures, and what edges do."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import signal

from lichen.catalogue import operation
from lichen.opencl.device import default_device
from lichen.operation import Border, Facts
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.convolution.boxes import boxes, boxes_distance, boxes_numpy, boxes_opencl
from lichen.operations.convolution.recursive import ITEMS, LANES, recursive_numpy, recursive_opencl
from lichen.operations.convolution.recursive_filters import (
    Filter,
    deriche,
    deriche_extent,
    distance,
    vliet_young,
    vliet_young_extent,
)

# Norms of the error by sigma 1, 2, 5, 20 and 100: of filters made of the coefficients that their authors published.
DERICHE = {2: (4.8e-2, 3.8e-2, 3.5e-2, 3.3e-2, 3.3e-2), 4: (8.3e-4, 5.8e-4, 6.2e-4, 6.3e-4, 6.2e-4)}
VLIET_YOUNG = {
    3: (7.0e-2, 2.8e-2, 2.1e-2, 2.0e-2, 2.0e-2),
    4: (4.0e-2, 1.1e-2, 6.7e-3, 6.3e-3, 6.3e-3),
    5: (2.7e-2, 4.3e-3, 2.4e-3, 2.2e-3, 2.1e-3),
}
SIGMAS = (1.0, 2.0, 5.0, 20.0, 100.0)


@pytest.mark.parametrize("order", [3, 4, 5])
def test_vliet_young_errs_as_published(order: int) -> None:
    for sigma, published in zip(SIGMAS, VLIET_YOUNG[order], strict=True):
        filtered = vliet_young(sigma, order)
        assert 2 * distance(filtered, sigma) == pytest.approx(published, rel=0.03)
        at, half = np.arange(3 * filtered.reach), filtered.response(3 * filtered.reach)
        assert 2 * half @ at**2 == pytest.approx(sigma**2, rel=1e-4)


@pytest.mark.parametrize("order", [2, 4])
def test_deriche_errs_hardly_more_than_the_best_published(order: int) -> None:
    for sigma, published in zip(SIGMAS, DERICHE[order], strict=True):
        assert 2 * distance(deriche(sigma, order), sigma) < 1.5 * published
    assert 2 * distance(deriche(100.0, order), 100.0) < DERICHE[order][-1]


def test_more_poles_come_nearer() -> None:
    for sigma in (0.6, 3.0, 30.0):
        each = [distance(deriche(sigma, order), sigma) for order in (2, 4, 6, 8)]
        assert all(later < earlier / 15 for earlier, later in pairwise(each))


@pytest.mark.parametrize("filtered", [deriche(3.0, 8), vliet_young(3.0, 5)], ids=["deriche", "vliet-young"])
def test_response_is_that_of_a_recursion(filtered: Filter) -> None:
    """SciPy runs each pole as a complex filter over a single 1, from either end."""
    point = np.zeros(401, complex)
    point[200] = 1
    made = np.zeros(401)
    for pole, weight in zip(filtered.poles, filtered.weights, strict=True):
        ahead = signal.lfilter([1], [1, -pole], point)
        behind = signal.lfilter([0, pole], [1, -pole], point[::-1])[::-1]
        made += (weight * (ahead + behind)).real
    np.testing.assert_allclose(made[200:], filtered.response(201), atol=1e-14)
    assert made.sum() == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("border", list(Border))
@pytest.mark.parametrize("sigma", [0.7, 5.0, 80.0])
def test_edges_are_as_right_as_the_middle(border: Border, sigma: float) -> None:
    """Against the response itself, summed over the continued image: also where that repeats the image many times."""
    device = default_device()
    assert device is not None
    rng = np.random.default_rng(5)
    for shape in ((1, 37, 2), (45, 16, 1), (33, 7, 3)):
        pixels = rng.random(shape, dtype=np.float32)
        down, across = deriche(sigma, 4), vliet_young(sigma, 3)
        expected = pixels.astype(np.float64)
        for axis, filtered in ((0, down), (1, across)):
            reach = 2 * filtered.reach
            half = filtered.response(reach + 1)
            lines = np.moveaxis(expected, axis, 0)
            at = continued(np.arange(-reach, len(lines) + reach), len(lines), border)
            around = np.where((at == OUTSIDE)[:, None, None], 0.4, lines[np.maximum(at, 0)])
            whole = np.concatenate([half[:0:-1], half])[:, None, None]
            expected = np.moveaxis(signal.fftconvolve(around, whole, "valid", axes=0), 0, axis)
        np.testing.assert_allclose(recursive_numpy(pixels, down, across, border, 0.4), expected, atol=3e-6)
        np.testing.assert_allclose(recursive_opencl(device, pixels, down, across, border, 0.4), expected, atol=3e-6)


@pytest.mark.parametrize("shape", [(3, LANES * ITEMS + 37, 2), (2 * LANES * ITEMS + 5, 4, 3)])
def test_items_take_lines_after_lines_where_there_are_more_of_them(shape: tuple[int, int, int]) -> None:
    device = default_device()
    assert device is not None
    pixels = np.random.default_rng(6).random(shape, dtype=np.float32)
    filters, made = (deriche(3.0, 4), vliet_young(2.0, 3)), (boxes(3.0, extended=True), boxes(2.0, extended=False))
    expected = recursive_numpy(pixels, *filters, Border.REFLECT, 0.0)
    np.testing.assert_allclose(recursive_opencl(device, pixels, *filters, Border.REFLECT, 0.0), expected, atol=3e-6)
    expected = boxes_numpy(pixels, *made, Border.CONSTANT, 0.4)
    np.testing.assert_allclose(boxes_opencl(device, pixels, *made, Border.CONSTANT, 0.4), expected, atol=1e-5)


@pytest.mark.parametrize("sigma", [0.3, 1.0, 2.0, 7.7, 50.0])
def test_boxes_have_the_variance_they_can(sigma: float) -> None:
    for extended in (False, True):
        made = boxes(sigma, extended)
        kernel = made.kernel()
        at = np.arange(len(kernel)) - len(kernel) // 2
        assert kernel.sum() == pytest.approx(1)
        if extended:
            assert kernel @ at**2 == pytest.approx(sigma**2)
        else:
            assert abs(kernel @ at**2 - sigma**2) <= (2 * (made.radii[0] + 1)) / 3 + 1e-9  # half a step of one box
    assert boxes_distance(boxes(sigma, extended=True), sigma) < 0.1


@pytest.mark.parametrize("name", ["deriche", "vliet-young", "box3"])
def test_what_is_known_of_a_method_at_once_is_what_it_states_when_asked(name: str) -> None:
    blur, facts = operation("gaussian"), {"image": Facts(64, 96, 3)}
    method = blur.methods[name]
    assert method.knob is not None
    assert method.least is not None
    for sigma in (0.3, *np.geomspace(1, 1000, 25).tolist(), 1.5, 2.0):
        for given in ({"sigma": sigma}, {"sigma": sigma, "sigma_x": 1.0}, {"sigma": 0.0, "sigma_y": sigma}):
            parameters = blur.validate(given)
            for knob in method.knob.values:
                stated = method.error(parameters, knob, facts)
                assert method.least(parameters, knob, facts) <= stated.value - stated.rounding
    assert method.least(blur.validate({"sigma": 3.0}), method.knob.values[0], facts) > 1e-3


@pytest.mark.parametrize("sigma", [0.6, 1.7, 13.0, 400.0])
def test_a_filter_reaches_as_far_as_is_known_without_making_it(sigma: float) -> None:
    for order in (2, 4, 6, 8):
        made = deriche(sigma, order)
        assert deriche_extent(sigma, order) == (pytest.approx(made.reach, rel=1e-3, abs=1), len(made.poles))
    for order in (3, 4, 5):
        made = vliet_young(sigma, order)
        assert vliet_young_extent(sigma, order) == (pytest.approx(made.reach, rel=1e-3, abs=1), len(made.poles))
