"""Pictures that stay as they were stored: what steps make of 256 numbers, to the bit what they make of all floats."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.files import decode, encode
from lichen.files.samples import to_floats
from lichen.image import Image, Space, Storage, StoredImage, as_image
from lichen.memory import Array
from lichen.opencl.samples import WORTH

SIDE = 640
RUNS: tuple[tuple[str, dict[str, Any], bool], ...] = (
    ("transfer", {"direction": "decode"}, False),
    ("levels", {"black": 0.1, "white": 0.7, "gamma": 1.7}, False),
    ("resize", {"width": 200, "method": "lanczos3"}, False),
    ("resize", {"width": 900, "height": 70, "method": "bicubic", "border": "constant", "value": 0.2}, False),
    ("resize", {"width": 160, "height": 160, "method": "box"}, False),
    ("gaussian", {"sigma": 5.0, "method": "multirate"}, False),
    ("gaussian", {"sigma": 9.0, "border": "constant", "value": 0.3, "method": "multirate"}, False),
    ("gaussian", {"sigma": 2.0, "method": "fir"}, False),
    ("derivative", {}, False),
    ("matrix", {"matrix": [[0, 1, 0], [1, 0, 0], [0, 0, 1]]}, True),
)
"""What runs, and whether it needs the floats that files stand for."""


def stored(kind: type, widened: list[int]) -> Image:
    samples = np.random.default_rng(4).integers(0, np.iinfo(kind).max, (SIDE, SIDE, 3), kind, endpoint=True)

    def widen(found: Array) -> Array:
        widened.append(found.size)
        return to_floats(found)

    return decode(encode(as_image(samples).replace(space=Space.SRGB), "png").data, widen=widen)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize(("name", "given", "floats"), RUNS, ids=[f"{n}-{i}" for i, (n, _, _) in enumerate(RUNS)])
def test_what_is_looked_up_is_what_is_computed(name: str, given: dict[str, Any], floats: bool, kind: type) -> None:
    assert SIDE * SIDE * 3 >= WORTH
    widened: list[int] = []
    image = stored(kind, widened)
    assert isinstance(image, StoredImage)
    made = lichen.run(name, image, **given)
    if made.device != "numpy":
        assert bool(widened) is (floats or kind is np.uint16)
    assert not image.widened
    plain = lichen.run(name, image.replace(), **given)
    assert made.method == plain.method
    assert made.image.pixels.tobytes() == plain.image.pixels.tobytes()
    assert encode(made.image, "png", storage=Storage.UINT16) == encode(plain.image, "png", storage=Storage.UINT16)
