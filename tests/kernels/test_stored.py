"""Pictures that stay as they were stored: what steps make of 256 numbers, to the bit what they make of all floats."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import lichen
from lichen import engine
from lichen.files import decode, encode
from lichen.files.samples import to_floats
from lichen.image import Image, Space, Storage, StoredImage, as_image
from lichen.memory import Array
from lichen.opencl.device import LANES, default_device
from lichen.opencl.samples import WORTH
from lichen.sharing import Shared, Sharing

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


def stored(kind: type, widened: list[int], side: int = SIDE) -> Image:
    samples = np.random.default_rng(4).integers(0, np.iinfo(kind).max, (side, side, 3), kind, endpoint=True)

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


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("side", [40, SIDE])
@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("resize", {"width": 21}),
        ("gaussian", {"sigma": 1.5, "method": "fir"}),
        ("gaussian", {"sigma": 3.0, "method": "multirate"}),
        ("gaussian", {"sigma": 3.0, "method": "multirate", "device": "numpy"}),
    ],
)
def test_data_of_any_kind_are_read_as_they_are(name: str, given: dict[str, Any], side: int, kind: type) -> None:
    """Nothing stands between these and the samples, which a kernel reads as codes or as floats."""
    known = stored(kind, [], side)
    assert isinstance(known, StoredImage)
    image = StoredImage(known.codes, space=Space.DATA, storage=known.storage)
    made, plain = (lichen.run(name, each, **given) for each in (image, image.replace()))
    assert made.image.pixels.tobytes() == plain.image.pixels.tobytes()


def test_runs_that_share_steps_look_up_too() -> None:
    widened: list[int] = []
    image = stored(np.uint8, widened)
    prepared = engine.prepare("resize", image, width=200)
    (made,) = prepared.run(shared=Shared(Sharing(), {"input.image": "a picture"})).values()
    assert made.device == "numpy" or not widened
    plain = lichen.run("resize", image.replace(), width=200)
    assert made.image.pixels.tobytes() == plain.image.pixels.tobytes()


@pytest.mark.parametrize("method", ["fir", "multirate"])
def test_a_device_whose_items_step_together_gets_floats(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = default_device()
    if found is None:
        pytest.skip("there is no OpenCL device")
    known = stored(np.uint8, [])
    assert isinstance(known, StoredImage)
    plain = lichen.run("gaussian", known.replace(), sigma=3.0, method=method)
    monkeypatch.setattr("lichen.engine.default_device", lambda: dataclasses.replace(found, lanes=LANES))
    made = lichen.run("gaussian", known, sigma=3.0, method=method)
    np.testing.assert_allclose(made.image.pixels, plain.image.pixels, atol=1e-4)


def test_a_copy_with_the_same_pixels_is_not_measured_again() -> None:
    for image in (as_image(np.array([[1.0, 3.0]], np.float32)), stored(np.uint8, [])):
        known = image.extent
        assert vars(image.replace(space=Space.SRGB))["extent"] is known
        assert image.replace(pixels=2 * image.pixels).extent.high == 2 * known.high


SHARPEN = {"kernel": [[-1, -1, -1], [-1, 9, -1], [-1, -1, -1]]}


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("gaussian", {"sigma": 2.0, "method": "fir"}),
        ("gaussian", {"sigma": 5.0, "method": "multirate"}),
        ("convolve", {**SHARPEN, "method": "direct"}),
    ],
)
@pytest.mark.parametrize("size", [(90, 64), (90, 61)])
def test_what_is_only_stored_is_written_as_codes(name: str, given: dict[str, Any], size: tuple[int, int]) -> None:
    """By the kernel that makes it, with the same counts of what 8 bits cannot hold."""
    pixels = np.random.default_rng(7).uniform(-0.2, 1.2, (*size, 3)).astype(np.float32)
    pixels[20:60, 20:60] = 1.1
    if spoilt := given["method"] != "multirate":  # which takes none such
        pixels[3, 5], pixels[70, 2, 1] = np.nan, np.inf
    prepared = engine.prepare(name, Image(pixels, Space.SRGB), **given, storage="uint8", precision="float32")
    assert prepared.plan.graph.fused or prepared.device is None
    (plain,), (codes,) = prepared.run().values(), prepared.run(stored=True).values()
    assert isinstance(codes.image, StoredImage) is (prepared.device is not None)
    expected, found = (encode(each.image, "png", storage=Storage.UINT8) for each in (plain, codes))
    assert found == expected
    assert codes.nonfinite == plain.nonfinite == found.nonfinite
    assert bool(found.nonfinite) is spoilt
    assert found.clipped > 0


def test_codes_are_shared_as_codes_and_floats_as_floats() -> None:
    image = Image(stored(np.uint8, []).pixels, Space.SRGB)
    prepared = engine.prepare("gaussian", image, sigma=2.0, storage="uint8")
    shared = Shared(Sharing(), {"input.image": "a picture"})
    (codes,) = prepared.run(shared=shared, stored=True).values()
    (again,) = prepared.run(shared=shared, stored=True).values()
    (floats,) = prepared.run(shared=shared).values()
    assert not isinstance(floats.image, StoredImage)
    if prepared.device is not None:
        assert isinstance(codes.image, StoredImage)
        assert isinstance(again.image, StoredImage)
        assert again.image.codes is codes.image.codes
    wanted = encode(floats.image, "png", storage=Storage.UINT8)
    assert wanted == encode(codes.image, "png", storage=Storage.UINT8)


def test_what_is_compared_with_truth_comes_as_floats() -> None:
    prepared = engine.prepare("gaussian", stored(np.uint8, [], 64), sigma=2.0, storage="uint8", verify=True)
    (made,) = prepared.run(stored=True).values()
    assert not isinstance(made.image, StoredImage)
    assert made.measured is not None
    assert made.measured.largest <= made.error.value
