"""Squares that spectra are taken of, against one transform of the whole image."""

from __future__ import annotations

import numpy as np
import pytest

from lichen.operation import Border
from lichen.operations.convolution import transform
from lichen.operations.convolution.stencil import Stencil


@pytest.mark.parametrize("border", Border)
def test_squares_join_without_a_seam(border: Border, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(6)
    pixels = random.random((700, 530, 2), np.float32)
    pixels[350, 200], pixels[699, 0, 1] = np.nan, np.inf
    whole = Stencil(random.random((31, 20)) / 620, 7, 19)
    assert max(transform.layout(700, 530, (31, 20)).sides) < 530
    made = transform.correlated_by_transform(pixels, whole, border, 2.0)
    monkeypatch.setattr(transform, "SQUARES", ())
    transform.layout.cache_clear()
    expected = transform.correlated_by_transform(pixels, whole, border, 2.0)
    transform.layout.cache_clear()
    np.testing.assert_allclose(made, expected, atol=1e-7)


def test_a_kernel_as_wide_as_a_square_is_no_place_for_each_pixel() -> None:
    sides = transform.layout(3000, 4000, (256, 256)).sides
    assert min(sides) > 2 * 256
