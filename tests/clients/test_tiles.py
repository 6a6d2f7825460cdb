"""Images in tiles give the pixels of images as a whole, and what tiles cannot do is refused with a reason."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
import zarr

import lichen
from lichen.errors import InvalidRequest
from lichen.files import decode, encode
from lichen.image import Alpha, Image, Space, Storage
from lichen.opencl.device import default_device
from lichen_batch import rasters, tiles
from lichen_batch.tiles import Layout
from lichen_cli.main import main

HEIGHT, WIDTH = 310, 530


@pytest.fixture(scope="module")
def scene() -> np.ndarray:
    """High values lie in one corner only, so no tile alone knows the range of the whole."""
    pixels = np.random.default_rng(3).random((HEIGHT, WIDTH, 3), np.float32)
    pixels[:5, :5] *= 50
    pixels[200, 150] = np.nan
    return pixels


@pytest.fixture
def store(scene: np.ndarray, tmp_path: Path) -> str:
    path = str(tmp_path / "scene.zarr")
    array = zarr.create_array(path, shape=scene.shape, chunks=(200, 170, 3), dtype="float32")
    array[...] = scene
    array.attrs["space"] = "linear"
    return path


@pytest.fixture
def picture(scene: np.ndarray, tmp_path: Path) -> str:
    path = str(tmp_path / "scene.tif")
    tifffile.imwrite(path, scene, photometric="rgb", tile=(128, 128))
    return path


@pytest.fixture
def small_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """The largest tile that is tried, so that these small pictures have several."""
    monkeypatch.setattr(tiles, "LARGEST", 256)


NUMPY = {"device": "numpy"}
NUMPY_SET = ("--set", "device=numpy")
"""Warm at once; that devices agree is shown elsewhere."""
PIPELINES = [
    ("numpy", "gaussian:sigma=4,method=fir|levels:gamma=1.4"),
    ("numpy", "morphology:step=dilate,width=9|levels:black=0.1"),
    ("opencl", "saturation:amount=1.4|gaussian:sigma=2,method=fir,border=clamp"),
]


@pytest.mark.usefixtures("small_tiles")
@pytest.mark.parametrize(("device", "text"), PIPELINES)
def test_tiles_give_the_pixels_of_the_whole(
    device: str, text: str, scene: np.ndarray, store: str, tmp_path: Path
) -> None:
    if device == "opencl" and default_device() is None:
        pytest.skip("no device here")
    image = Image(scene, Space.LINEAR, storage=Storage.FLOAT32)
    expected = lichen.run_pipeline(text, image, device=device)["result"]
    target = str(tmp_path / "out.zarr")
    told: list[tuple[int, int]] = []
    account = tiles.run(
        document(text), {"image": store}, target, wishes={"device": device}, tell=lambda *at: told.append(at)
    )
    assert account["tiles"] == 6
    assert told == [(done, 6) for done in range(7)]
    assert account["method"] == expected.method
    made = zarr.open_array(target, mode="r")
    assert (made.metadata.zarr_format, dict(made.attrs)["space"]) == (3, "linear")
    np.testing.assert_array_equal(made[...], expected.image.pixels)


def document(text: str) -> dict[str, Any]:
    from lichen.planning.pipeline import read
    from lichen_batch import checking

    return checking.document(read(text), {})


@pytest.mark.usefixtures("small_tiles")
@pytest.mark.parametrize("storage", ["float32", "uint16"])
def test_a_tiff_in_tiles_is_what_any_reader_reads(
    storage: str, scene: np.ndarray, picture: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "out.tif"
    command = ["batch", "tiles", picture, str(target), "--operation", "gaussian", "--set", "sigma=3", *NUMPY_SET]
    space = ["--set", "space=srgb"] if storage == "uint16" else []
    assert main([*command, "--set", "method=fir", "--set", f"storage={storage}", *space]) == 0
    account = json.loads(capsys.readouterr().out)
    assert (account["tiles"], account["storage"]) == (2, storage)
    with tifffile.TiffFile(target) as file:
        assert file.pages[0].tile == (256, 256)
        stored = file.asarray()
    image = Image(scene, Space.LINEAR, storage=Storage.FLOAT32)
    form = {"storage": storage, "space": "srgb" if space else None}
    wanted = lichen.run("gaussian", image, sigma=3, method="fir", device="numpy", **form)
    expected, _, _ = tiles.to_storage(wanted.image.pixels, Storage(storage))
    np.testing.assert_array_equal(stored, expected)
    if storage == "uint16":
        assert decode(target.read_bytes()).pixels.shape == scene.shape


@pytest.mark.usefixtures("small_tiles")
@pytest.mark.parametrize("storage", [Storage.FLOAT16, Storage.FLOAT32])
@pytest.mark.parametrize("source", ["lines", "tiles"])
def test_an_exr_in_tiles_is_what_the_whole_would_be(
    storage: Storage, source: str, scene: np.ndarray, tmp_path: Path
) -> None:
    given, made = tmp_path / "given.exr", tmp_path / "made.exr"
    pixels = np.dstack([scene, np.linspace(0, 1, scene.size // 3, dtype=np.float32).reshape(HEIGHT, WIDTH)])
    image = Image(pixels, Space.LINEAR, Alpha.ASSOCIATED, storage)
    given.write_bytes(bytes(encode(image, "exr").data))
    if source == "tiles":
        tiles.run(document("matrix"), {"image": str(given)}, str(made), wishes=NUMPY)
        np.testing.assert_array_equal(decode(made.read_bytes()).pixels, decode(given.read_bytes()).pixels)
        made.rename(given)
    account = tiles.run(document("gaussian:sigma=3,method=fir"), {"image": str(given)}, str(made), wishes=NUMPY)
    assert (account["tiles"], account["storage"]) == (2, storage)
    found, whole = decode(made.read_bytes()), decode(given.read_bytes())
    assert (found.space, found.alpha, found.storage) == (Space.LINEAR, Alpha.ASSOCIATED, storage)
    expected = lichen.run("gaussian", whole, sigma=3, method="fir", device="numpy", storage=storage)
    stored = bytes(encode(expected.image, "exr", storage=storage).data)
    np.testing.assert_array_equal(found.pixels, decode(stored).pixels)
    first = made.read_bytes()
    tiles.run(document("gaussian:sigma=3,method=fir"), {"image": str(given)}, str(made), wishes=NUMPY)
    assert made.read_bytes() == first, "the same picture is the same file"
    with pytest.raises(InvalidRequest, match="storage"):
        tiles.run(document("levels"), {"image": str(given)}, str(made), storage=Storage.UINT8, wishes=NUMPY)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["given.exr", "made.exr"]


def test_a_method_that_sums_over_all_it_is_given_stays_within_its_error(
    scene: np.ndarray, store: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tiles, "LARGEST", 256)
    finite = np.nan_to_num(scene)
    zarr.open_array(store)[...] = finite
    image = Image(finite, Space.LINEAR, storage=Storage.FLOAT32)
    whole = lichen.run("gaussian", image, sigma=6, method="deriche", device="numpy")
    said: dict[str, Any] = {"nodes": {"g": {"operation": "gaussian", "parameters": {"sigma": 6}, "method": "deriche"}}}
    said["outputs"] = {"result": {"node": "g"}}
    tiles.run(said, {"image": store}, str(tmp_path / "out.zarr"), wishes=NUMPY)
    made = zarr.open_array(str(tmp_path / "out.zarr"), mode="r")[...]
    assert 0 < np.abs(made - whole.image.pixels).max() <= 2 * whole.error.value


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("equalise", "whole"),
        ("statistics", "another size"),
        ("resize:width=10,height=10", "another size"),
        ("rotate:angle=10", "tiles"),
        ("gaussian:sigma=2,border=wrap", "edges"),
    ],
)
def test_what_tiles_cannot_do_is_refused_with_a_reason(text: str, reason: str, store: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidRequest) as raised:
        tiles.run(document(text), {"image": store}, str(tmp_path / "out.zarr"))
    assert reason in str(raised.value)
    assert not (tmp_path / "out.zarr").exists()


def test_memory_decides_how_large_tiles_are(store: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidRequest, match=r"are needed"):
        tiles.run(document("gaussian:sigma=2"), {"image": store}, str(tmp_path / "out.zarr"), memory=tiles.FIXED)


def test_every_tile_reads_as_much_and_all_it_looks_at() -> None:
    for shape, tile, reach in (
        ((100, 90, 1), (32, 32), (5, 3)),
        ((20, 500, 3), (64, 64), (9, 9)),
        ((7, 7, 1), (7, 7), (0, 0)),
    ):
        layout = Layout(shape, tile, reach)
        for row in range(-(-shape[0] // tile[0])):
            for column in range(-(-shape[1] // tile[1])):
                for at, start, t, r, size, whole in zip(
                    (row, column), layout.start(row, column), tile, reach, layout.read, shape[:2], strict=True
                ):
                    assert start >= 0
                    assert start + size <= whole
                    assert start <= max(0, at * t - r)
                    assert start + size >= min(whole, (at + 1) * t + r)


def test_a_failed_run_leaves_what_was_there(store: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "out.zarr"
    tiles.run(document("levels"), {"image": store}, str(target), wishes=NUMPY)
    before = zarr.open_array(str(target), mode="r")[...]

    def fail(*_: Any) -> None:
        raise OSError("a disk that fails")

    monkeypatch.setattr(tiles, "to_storage", fail)
    with pytest.raises(OSError, match="fails"):
        tiles.run(document("levels:gamma=3"), {"image": store}, str(target), wishes=NUMPY)
    np.testing.assert_array_equal(zarr.open_array(str(target), mode="r")[...], before)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.zarr", "scene.zarr"]


def test_what_is_no_image_is_told(tmp_path: Path) -> None:
    from lichen.errors import UnsupportedFormat

    zarr.create_array(str(tmp_path / "deep.zarr"), shape=(2, 2, 2, 2), chunks=(2, 2, 2, 2), dtype="float32")
    zarr.create_array(str(tmp_path / "wide.zarr"), shape=(2, 2), chunks=(2, 2), dtype="int64")
    (tmp_path / "file.bin").write_bytes(b"x")
    for name in ("deep.zarr", "wide.zarr", "file.bin"):
        with pytest.raises(UnsupportedFormat):
            rasters.open_raster(str(tmp_path / name))
    with pytest.raises(FileNotFoundError):
        rasters.open_raster(str(tmp_path / "nothing.zarr"))
