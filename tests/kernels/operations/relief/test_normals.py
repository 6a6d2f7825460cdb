"""Normal maps in and out of their encodings, and details laid on as rotations and sums of slopes say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lichen


def directions(seed: int, tilt: float = 0.8) -> np.ndarray:
    """Unit normals towards the viewer, as float32."""
    made = np.random.default_rng(seed).normal(size=(7, 9, 3)) * [tilt, tilt, 0.1] + [0, 0, 1]
    made[..., 2] = np.abs(made[..., 2])
    return (made / np.linalg.norm(made, axis=-1, keepdims=True)).astype(np.float32)


def laid(n: np.ndarray, m: np.ndarray, **values: object) -> np.ndarray:
    return np.asarray(lichen.evaluate_truth("normals", n, detail=m, source="signed", **values))


def test_encodings_undo_each_other() -> None:
    n = directions(1)
    stored = lichen.run("normals", n, source="signed", target="unit", target_convention="directx").image.pixels
    assert np.allclose(stored, (n * [1, -1, 1] + 1) / 2, atol=1e-6)
    back = lichen.run("normals", stored, source="unit", target="signed", source_convention="directx").image.pixels
    assert np.allclose(back, n, atol=1e-6)


def test_eight_bits_are_renormalised() -> None:
    n = directions(2)
    codes = np.rint((n + 1) * 127.5).astype(np.uint8)
    found = lichen.run("normals", codes).image.pixels
    assert np.allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-6)
    assert np.abs(found - n).max() < 1 / 127.5


def test_reoriented_details_are_turned_with_the_surface() -> None:
    """By the rotation that turns the z axis into the surface's normal on the shortest way."""
    n, m = directions(3), directions(4)
    found = laid(n, m)
    for y, x in np.ndindex(7, 9):
        axis = np.cross([0, 0, 1], n[y, x].astype(float))
        sine = np.linalg.norm(axis)
        turn = Rotation.from_rotvec(axis / sine * np.arctan2(sine, float(n[y, x, 2])))
        assert np.allclose(found[y, x], turn.apply(m[y, x].astype(float)), atol=1e-6)


def test_slopes_are_added_by_partial_derivatives() -> None:
    n, m = directions(5).astype(float), directions(6).astype(float)
    found = laid(n.astype(np.float32), m.astype(np.float32), blend="partial", amount=2)
    slopes = n[..., :2] / n[..., 2:] + 2 * m[..., :2] / m[..., 2:]
    assert np.allclose(found[..., :2] / found[..., 2:], slopes, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("blend", ["partial", "whiteout", "udn", "reoriented"])
def test_nothing_laid_on_changes_nothing(blend: str) -> None:
    n = directions(7)
    flat = np.broadcast_to(np.float32([0, 0, 1]), n.shape)
    assert np.allclose(laid(n, flat, blend=blend), n, atol=1e-6)
    assert np.allclose(laid(n, directions(8), blend=blend, amount=0), n, atol=1e-6)
