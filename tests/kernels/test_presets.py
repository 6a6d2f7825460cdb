"""Named textures: they run as they are, at any size and seed, on both backends, and repeat where they say so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest, UnknownTexture
from lichen.presets import Size

NAMES = tuple(lichen.textures())


def painted(name: str, device: str = "opencl", **values: Any) -> np.ndarray:
    (result,) = lichen.run_pipeline(lichen.texture(name, **values), images={}, device=device).values()
    return result.image.pixels


def test_there_are_those_the_field_knows() -> None:
    assert {"marble", "wood", "granite", "smoke", "fire", "clouds"} <= set(NAMES)
    assert all(summary.endswith(".") for summary in lichen.textures().values())


@pytest.mark.parametrize("name", NAMES)
def test_a_texture_has_contrast_colours_in_range_and_the_same_look_on_both_backends(name: str) -> None:
    one, two = (painted(name, device, width=96, height=64) for device in ("opencl", "numpy"))
    assert one.shape[:2] == (64, 96)
    assert one.min() >= -1e-6
    assert one.max() <= 1 + 1e-6
    assert one.std() > 0.05
    assert np.abs(one - two).max() < 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_another_seed_is_another_picture(name: str) -> None:
    values = {"width": 48, "height": 32}
    assert np.array_equal(painted(name, **values), painted(name, **values, seed=0))
    assert not np.array_equal(painted(name, **values), painted(name, **values, seed=1))


@pytest.mark.parametrize("name", [name for name in NAMES if "repeats at its edges" in lichen.textures()[name]])
def test_no_seam_shows(name: str) -> None:
    """Across the seam a step is no larger than the steps beside it."""
    pixels = painted(name, width=192, height=160)
    for axis in (0, 1):
        steps = np.abs(np.roll(pixels, -1, axis) - pixels).mean(axis=(1 - axis, 2))
        assert steps[-1] <= 2 * steps[:-1].max()


def test_what_is_wrong_is_all_named() -> None:
    with pytest.raises(UnknownTexture, match="marble"):
        lichen.texture("marbel")
    with pytest.raises(InvalidRequest) as caught:
        lichen.texture("marble", width=0, seed=-1, colour="red")
    assert {flaw.pointer for flaw in caught.value.flaws} == {
        "/parameters/width", "/parameters/seed", "/parameters/colour"
    }  # fmt: skip
    assert lichen.texture("marble", seed=Size.model_fields["seed"].default) == lichen.texture("marble")
