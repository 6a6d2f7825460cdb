"""Buffers in other conventions stand for those in the usual ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest

from .test_materials import SCENE, sent

LIT = {**SCENE, "ambient": [0, 0, 0], "environment": {"image": "sky", "fresnel": "dielectric", "coated": True}}
SKY = np.random.default_rng(3).random((16, 32, 3)).astype(np.float32)
Y_DOWN, LEFT_HANDED = np.float32([1, -1, 1]), np.float32([1, 1, -1])


def render(images: dict[str, Any], **said: Any) -> np.ndarray:
    return lichen.render({**LIT, **said}, images={**images, "sky": SKY}).image.pixels


@pytest.mark.parametrize("buffer", ["normal", "position"])
@pytest.mark.parametrize(("convention", "turned"), [("y_down", Y_DOWN), ("left_handed", LEFT_HANDED)])
def test_axes_are_turned_back(buffer: str, convention: str, turned: np.ndarray) -> None:
    images = sent()
    name = SCENE["buffers"][buffer]
    other = {**images, name: images[name] * turned}
    plain = render(images)
    np.testing.assert_array_equal(render(other, conventions={convention: [buffer]}), plain)
    assert np.abs(render(other) - plain).max() > 0.01


def test_all_at_once_with_normals_as_pictures_hold_them() -> None:
    images = sent()
    images["n"] /= np.abs(images["n"]).max()
    other = {"n": (images["n"] * Y_DOWN * LEFT_HANDED + 1) / 2, "p": images["p"] * LEFT_HANDED}
    said = {"encoding": "unit", "y_down": ["normal"], "left_handed": ["normal", "position"]}
    np.testing.assert_allclose(render(other, conventions=said), render(images), rtol=1e-3, atol=1e-4)


def test_one_picture_may_be_two_buffers() -> None:
    shared = sent()["n"]
    buffers = {"position": "n", "normal": "n"}
    found = render({"n": shared * LEFT_HANDED}, buffers=buffers, conventions={"left_handed": ["normal", "position"]})
    np.testing.assert_array_equal(found, render({"n": shared}, buffers=buffers))


def test_conventions_of_what_is_not_given_are_refused() -> None:
    scene = {
        **SCENE,
        "ambient": [0, 0, 0],
        "buffers": {"depth": "p", "normal": "n"},
        "conventions": {"y_down": ["position"]},
    }
    with pytest.raises(InvalidRequest) as refused:
        lichen.render(scene, images=sent())
    assert [flaw.pointer for flaw in refused.value.flaws] == ["/conventions/y_down"]
    with pytest.raises(InvalidRequest) as refused:
        lichen.render({"objects": [{"shape": "plane"}], "conventions": {"encoding": "unit"}})
    assert [flaw.pointer for flaw in refused.value.flaws] == ["/conventions/encoding"]
