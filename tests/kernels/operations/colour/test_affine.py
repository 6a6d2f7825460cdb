"""Matrix, saturation and hue rotation against independent definitions."""

from __future__ import annotations

import colour
import cv2
import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image, Space
from lichen.operations.colour.hue_rotate import rotation
from lichen.operations.colour.matrix import NEGATIVE, SEPIA
from lichen.operations.colour.primaries import luminance

BACKENDS = ("opencl", "numpy")
PICTURE = np.random.default_rng(3).random((37, 41, 3), dtype=np.float32)
COVERED = np.random.default_rng(4).random((37, 41, 4), dtype=np.float32)
BT709 = colour.normalised_primary_matrix(
    colour.RGB_COLOURSPACES["ITU-R BT.709"].primaries, colour.RGB_COLOURSPACES["ITU-R BT.709"].whitepoint
)


@pytest.mark.parametrize("backend", BACKENDS)
def test_matrix_agrees_with_opencv(backend: str) -> None:
    found = lichen.run("matrix", PICTURE, matrix=SEPIA, device=backend).image.pixels
    assert np.abs(found - cv2.transform(PICTURE, np.array(SEPIA, np.float32))).max() < 5e-7


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "rows", [NEGATIVE, ((1, 0, 0, 0.5, 0), (0, 1, 0, 0, 0.25), (0, 0, 1, 0, 0), (0, 0, 0, 0.5, 0.5))]
)
def test_added_column(backend: str, rows: tuple[tuple[float, ...], ...]) -> None:
    found = lichen.run("matrix", COVERED, matrix=rows, device=backend).image.pixels
    expected = COVERED.copy()
    expected[..., : len(rows)] = cv2.transform(COVERED[..., : len(rows)], np.array(rows, np.float32))
    assert np.abs(found - expected).max() < 5e-7


@pytest.mark.parametrize("backend", BACKENDS)
def test_negative_of_a_picture_with_coverage_is_that_of_its_straight_colour(backend: str) -> None:
    straight = Image(COVERED, Space.LINEAR, Alpha.STRAIGHT)
    found = lichen.run("matrix", straight, matrix=NEGATIVE, device=backend).image
    assert found.alpha is Alpha.STRAIGHT
    shown = COVERED[..., 3] > 1e-3
    assert np.abs(found.pixels[shown][:, :3] - (1 - COVERED[shown][:, :3])).max() < 1e-4
    assert np.array_equal(found.pixels[..., 3], COVERED[..., 3])


@pytest.mark.parametrize(
    "matrix", [((1, 0), (0, 1)), ((1, 0, 0), (0, 1), (0, 0, 1)), "[[1,0,0],[0,1,0]]", "[[1e9,0,0],[0,1,0],[0,0,1]]"]
)
def test_matrices_of_other_shapes_are_refused(matrix: object) -> None:
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("matrix", PICTURE, matrix=matrix)
    assert refused.value.flaws[0].pointer.startswith("/parameters/matrix")


def test_four_rows_need_four_channels() -> None:
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("matrix", PICTURE, matrix=np.eye(4).tolist())
    assert refused.value.flaws[0].pointer == "/parameters/matrix"


def test_luminance_weights_are_those_of_the_primaries() -> None:
    assert np.abs(luminance() - BT709[1]).max() < 1e-15


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("amount", [0, 0.25, 2, -1])
def test_saturation_agrees_with_its_matrix_form(backend: str, amount: float) -> None:
    """Rows as the course prints them: (1 - s) w, plus s on the diagonal."""
    rows = (1 - amount) * np.tile(BT709[1], (3, 1)) + amount * np.eye(3)
    found = lichen.run("saturation", PICTURE, amount=amount, device=backend).image.pixels
    assert np.abs(found - PICTURE.astype(np.float64) @ rows.T).max() < 2e-6


def test_saturation_of_minus_one_is_the_complement() -> None:
    found = lichen.run("saturation", np.array([[[1.0, 0, 0]]]), amount=-1).image.pixels[0, 0]
    light = BT709[1, 0]
    assert found == pytest.approx([2 * light - 1, 2 * light, 2 * light], abs=1e-6)


@pytest.mark.parametrize("angle", [0, 1, 90, 120, 200, -45, 3600 + 33])
def test_rotation_keeps_luminance_and_grey(angle: float) -> None:
    turned = rotation(angle)
    assert np.abs(BT709[1] @ turned - BT709[1]).max() < 1e-14
    assert np.abs(turned @ np.ones(3) - 1).max() < 1e-14
    assert np.abs(turned @ rotation(-angle) - np.eye(3)).max() < 1e-13


def test_rotations_add_up_and_start_towards_green() -> None:
    assert np.abs(rotation(50) @ rotation(70) - rotation(120)).max() < 1e-13
    red = rotation(60) @ [1, 0, 0]
    assert red[1] > red[2]
    assert np.abs(rotation(90)).max() == pytest.approx(1.32, abs=0.35)


@pytest.mark.parametrize("backend", BACKENDS)
def test_there_and_back(backend: str) -> None:
    turned = lichen.run("hue_rotate", PICTURE, angle=77, device=backend).image
    back = lichen.run("hue_rotate", turned, angle=-77, device=backend).image.pixels
    assert np.abs(back - PICTURE).max() < 2e-6
