"""Affine, projective and rotating warps: geometry against OpenCV and scikit-image, and what must be refused."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from skimage.transform import ProjectiveTransform

import lichen
from lichen.errors import InvalidRequest
from lichen.operation import Border
from lichen.operations.warp.correspondences import fit
from lichen.operations.warp.maps import Projective
from lichen.operations.warp.reference import Source
from lichen.operations.warp.rotate import direction
from lichen.operations.warp.shears import turned_by_shears

PHOTO = cv2.GaussianBlur(np.random.default_rng(2).random((60, 80)), (0, 0), 2).astype(np.float32)
HALF = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])


def in_opencv(matrix: np.ndarray) -> np.ndarray:
    """The same map with pixel centres at whole numbers."""
    return np.linalg.inv(HALF) @ matrix @ HALF


@pytest.mark.parametrize("seed", range(8))
def test_how_much_a_matrix_shrinks_at_most_is_its_larger_singular_value(seed: int) -> None:
    matrix = np.random.default_rng(seed).normal(size=(3, 3)) * 10.0 ** (seed - 4)
    matrix[2] = 0, 0, 1.7
    largest = np.linalg.svd(matrix[:2, :2] / 1.7, compute_uv=False)[0]
    assert Projective.of(matrix).largest() == pytest.approx(largest, rel=1e-14)
    matrix[2, 0] = 1e-3
    assert Projective.of(matrix).largest() is None


@pytest.mark.parametrize("inverse", [False, True])
def test_homography_is_opencvs(inverse: bool) -> None:
    matrix = np.array([[0.9, 0.2, 4.0], [-0.15, 1.1, 7.0], [1e-3, -5e-4, 1.0]])
    found = lichen.run("homography", PHOTO, matrix=matrix.tolist(), inverse=inverse, method="bilinear", border="clamp")
    flags = cv2.INTER_LINEAR | (cv2.WARP_INVERSE_MAP if inverse else 0)
    expected = cv2.warpPerspective(PHOTO, in_opencv(matrix), (80, 60), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    np.testing.assert_allclose(found.image.pixels[..., 0], expected, atol=1e-4)


def test_affine_is_opencvs() -> None:
    matrix = np.array([[0.9, 0.2, 4.0], [-0.15, 1.1, 7.0], [0, 0, 1]])
    found = lichen.run("affine", PHOTO, matrix=matrix[:2].tolist(), method="bilinear", value=0.25)
    expected = cv2.warpAffine(
        PHOTO, in_opencv(matrix)[:2], (80, 60), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.25
    )
    np.testing.assert_allclose(found.image.pixels[..., 0], expected, atol=1e-4)


def test_points_give_the_matrix_they_came_from() -> None:
    truth = np.array([[1.1, 0.05, 3], [-0.1, 0.9, 20], [2e-5, -1e-5, 1]])
    rng = np.random.default_rng(1)
    for count in (4, 9):
        sources = rng.uniform(0, 16000, (count, 2))
        targets = ProjectiveTransform(truth)(sources)
        found = fit(sources, targets)
        np.testing.assert_allclose(found.matrix / found.matrix[2, 2], truth, rtol=1e-7, atol=1e-7)
        assert found.ahead
        assert found.residual < 1e-6


def test_findings_tell_matrix_and_condition() -> None:
    square = [[0, 0], [80, 0], [80, 60], [0, 60]]
    moved = [[3, 4], [70, 1], [77, 58], [5, 50]]
    findings = lichen.run("homography", PHOTO, source_points=square, target_points=moved).findings
    assert 1 < findings["condition"] < 100
    assert findings["largest_residual"] < 1e-9
    product = np.array(findings["input_to_output"]) @ np.array(findings["output_to_input"])
    np.testing.assert_allclose(product, np.eye(3), atol=1e-12)


SQUARE = [[0, 0], [9, 0], [9, 9], [0, 9]]
CROSSED = [[0, 0], [9, 9], [9, 0], [0, 9]]
ON_A_LINE = [[0, 0], [1, 0], [2, 0], [0, 1]]


@pytest.mark.parametrize(
    ("wrong", "pointer"),
    [
        ({"matrix": [[1, 2, 0], [2, 4, 0], [0, 0, 1]]}, "/parameters/matrix"),
        ({"matrix": [[0, 0, 0], [0, 0, 0], [0, 0, 0]]}, "/parameters/matrix"),
        ({"matrix": [[1, 1, 0], [1, 1 + 1e-14, 0], [0, 0, 1]]}, "/parameters/matrix"),
        ({"matrix": [[1e300, 0, 0], [0, 1e-300, 0], [0, 0, 1]]}, "/parameters/matrix"),
        ({"matrix": [[math.nan, 0, 0], [0, 1, 0], [0, 0, 1]]}, "/parameters/matrix/0/0"),
        ({"source_points": ON_A_LINE, "target_points": SQUARE}, "/parameters/target_points"),
        ({"source_points": SQUARE}, "/parameters/target_points"),
        ({"source_points": SQUARE, "target_points": CROSSED}, "/parameters/target_points"),
        ({"source_points": [[1, 1]] * 4, "target_points": SQUARE}, "/parameters/source_points"),
    ],
)
def test_what_shows_nothing_is_refused(wrong: dict[str, object], pointer: str) -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("homography", PHOTO, **wrong)
    assert pointer in {flaw.pointer for flaw in caught.value.flaws}


@pytest.mark.parametrize("size", [16, 64, 256])
def test_nothing_is_seen_from_behind(size: int) -> None:
    """The vanishing line goes through the image at every angle; what lies beyond is background, all is finite."""
    image = np.full((size, size), 0.5, np.float32)
    for angle in (0.0, 0.3, 1.9, 4.0):
        line = np.array([math.cos(angle), math.sin(angle)]) * 4 / size
        matrix = np.array([[1, 0.1, 0], [0, 1, 0], [*line, -2 * line.sum() * size / 4 * 0.5 - 0.1]])
        u, v = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
        ahead = matrix[2, 0] * u + matrix[2, 1] * v + matrix[2, 2] > 0
        assert ahead.any()
        assert not ahead.all()
        for method in ("bicubic", "ewa"):
            found = lichen.run(
                "homography", image, matrix=matrix.tolist(), inverse=True, border="wrap", method=method, value=-7
            ).image.pixels[..., 0]
            np.testing.assert_allclose(found[ahead], 0.5, atol=2e-6)
            np.testing.assert_array_equal(found[~ahead], -7)


@pytest.mark.parametrize("quarters", range(-4, 5))
def test_quarter_turns_are_exact(quarters: int) -> None:
    image = np.random.default_rng(quarters + 9).random((21, 34, 3), dtype=np.float32)
    found = lichen.run("rotate", image, angle=90.0 * quarters, expand=True, prune=False).image.pixels
    np.testing.assert_array_equal(found, np.rot90(image, quarters))


def test_rotation_turns_to_the_left_about_the_middle() -> None:
    matrix = cv2.getRotationMatrix2D((39.5, 29.5), 25, 1)
    expected = cv2.warpAffine(PHOTO, matrix, (80, 60), flags=cv2.INTER_LINEAR)
    found = lichen.run("rotate", PHOTO, angle=25, method="bilinear").image.pixels[..., 0]
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_directions_are_exact_at_quarter_turns() -> None:
    assert [direction(angle) for angle in (0, 90, 180, 270, -90, 450)] == [
        (1, 0), (0, 1), (-1, 0), (0, -1), (0, -1), (0, 1)
    ]  # fmt: skip


def test_three_shears_turn_a_disc_into_itself() -> None:
    """With tan(a) / 2 for the outer shears, as is printed in places, it would become an ellipse."""
    y, x = np.mgrid[0:101, 0:101] - 50.0
    disc = np.exp(-(((x * x + y * y) / 300) ** 2))[..., None]
    for angle in (10.0, 44.0, 133.0, -80.0):
        turned = turned_by_shears(Source(disc, Border.CONSTANT, 0.0), angle, 101, 101, 6)
        assert np.abs(turned - disc).max() < 2e-3
