"""What is written is what is read: every format, storage, channel count and kind of alpha that a format can hold."""

from __future__ import annotations

import numpy as np
import pytest

import lichen
from lichen import files
from lichen.errors import InvalidRequest, UnreadableImage, UnsupportedFormat
from lichen.files.samples import extent_of, to_floats
from lichen.image import Alpha, Image, Space, Storage, as_image, measure_extent
from lichen.memory import ALIGNMENT, Array

HEIGHT, WIDTH = 19, 23
EXACT = ("png", "webp", "tiff", "exr", "npy")


def samples(storage: Storage, channels: int, seed: int = 1) -> Array:
    """Codes over the whole range; floats over many decades with NaN, infinities, denormals and both zeros."""
    rng = np.random.default_rng(seed)
    if storage.integer:
        codes = rng.integers(0, storage.levels + 1, (HEIGHT, WIDTH, channels))
        codes[:3] = 0
        return codes.astype(storage.value)
    values = rng.normal(size=(HEIGHT, WIDTH, channels)) * 10.0 ** rng.integers(-4, 4, (HEIGHT, WIDTH, channels))
    values[0, :6] = np.array([np.nan, np.inf, -np.inf, -0.0, 1e-7, -6e-8])[:, np.newaxis]
    return values.astype(storage.value)


def picture(storage: Storage, channels: int, space: Space, alpha: Alpha) -> Image:
    array = samples(storage, channels)
    if alpha is not Alpha.NONE:
        array[3:6, :, -1] = 0  # transparent, with colour
    return as_image(array).replace(space=space, alpha=alpha)


def same(a: Array, b: Array) -> bool:
    return a.shape == b.shape and a.dtype == b.dtype and bool(np.array_equal(a, b, equal_nan=True))


def cases() -> list[tuple[str, Storage, int, Space, Alpha]]:
    found = []
    for name in EXACT:
        form = files.FORMATS[name]
        for storage in form.storages:
            natural = form.natural_space(storage)
            none, straight, associated = Alpha.NONE, Alpha.STRAIGHT, Alpha.ASSOCIATED
            plain = {"png": (1, 3), "webp": (3,), "tiff": (1, 3), "exr": (1, 3, 5, 9), "npy": (1, 2, 3, 4, 7, 64)}[name]
            found += [(name, storage, count, natural, none) for count in plain]
            if name != "npy":
                with_alpha = {"png": (2, 4), "webp": (4,), "tiff": (2, 4), "exr": (2, 4, 6)}[name]
                kinds = {"tiff": (straight, associated), "exr": (associated,)}.get(name, (straight,))
                found += [(name, storage, count, natural, kind) for count in with_alpha for kind in kinds]
            if name in ("tiff", "exr"):
                found += [(name, storage, count, Space.DATA, none) for count in (2, 3, 4, 6)]
            off = Space.LINEAR if natural is Space.SRGB else Space.SRGB
            if name != "npy":
                found += [(name, storage, 3, off, none)]
    return found


@pytest.mark.parametrize(("name", "storage", "channels", "space", "alpha"), cases())
def test_exact_round_trip(name: str, storage: Storage, channels: int, space: Space, alpha: Alpha) -> None:
    image = picture(storage, channels, space, alpha)
    encoded = files.encode(image, name)
    back = files.decode(encoded.data, media_type=encoded.media_type)
    assert same(back.pixels, image.pixels)
    assert (back.space, back.alpha, back.storage) == (space, alpha, storage)
    assert back.pixels.ctypes.data % ALIGNMENT == 0
    assert back.pixels.flags.c_contiguous
    assert (encoded.clipped, encoded.nonfinite) == (0, 0)
    header = files.probe(encoded.data)
    assert (header.height, header.width, header.channels) == image.pixels.shape
    assert (header.space, header.alpha, header.storage) == (space, alpha, storage)
    assert files.encode(image, name).data == encoded.data, "the same image must give the same bytes"


def test_float64_npy_keeps_every_bit() -> None:
    array = samples(Storage.FLOAT64, 2)
    assert files.decode(files.encode(as_image(array), "npy").data).pixels.tobytes() == array.tobytes()


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 70, 1), (70, 1, 4), (16, 5, 3), (17, 5, 3), (33, 1, 1)])
@pytest.mark.parametrize("name", EXACT)
def test_thin_and_tiny_images(name: str, shape: tuple[int, int, int]) -> None:
    storage = Storage.UINT8 if Storage.UINT8 in files.FORMATS[name].storages else Storage.FLOAT16
    array = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape).astype(storage.value)
    alpha = files.FORMATS[name].association or Alpha.STRAIGHT
    image = as_image(array).replace(space=Space.SRGB, alpha=alpha if shape[2] == 4 else Alpha.NONE)
    back = files.decode(files.encode(image, name).data)
    expected = np.repeat(image.pixels, 3, axis=2) if (name, shape[2]) == ("webp", 1) else image.pixels
    assert same(back.pixels, expected)


def test_many_bands_make_one_png_stream() -> None:
    array = np.random.default_rng(0).integers(0, 65536, (700, 900, 4)).astype(np.uint16)  # five bands
    image = as_image(array).replace(space=Space.SRGB, alpha=Alpha.STRAIGHT)
    assert same(files.decode(files.encode(image, "png").data).pixels, image.pixels)


@pytest.mark.parametrize(("quality", "largest"), [(95, 12), (60, 40)])
@pytest.mark.parametrize("channels", [1, 3])
def test_jpeg_is_near(quality: int, largest: int, channels: int) -> None:
    y, x = np.mgrid[0:64, 0:80] / 80
    array = np.stack([x, y, 0.5 + 0.5 * np.sin(6 * x)], axis=2)[:, :, :channels].astype(np.float32)
    image = Image(array, Space.SRGB, storage=Storage.UINT8)
    back = files.decode(files.encode(image, "jpeg", quality=quality).data)
    assert back.pixels.shape == array.shape
    assert np.abs(back.pixels - array).max() < largest / 255


def test_jpeg_drops_opaque_alpha_only() -> None:
    image = picture(Storage.UINT8, 4, Space.SRGB, Alpha.STRAIGHT)
    with pytest.raises(UnsupportedFormat, match="background"):
        files.encode(image, "jpeg")
    opaque = image.pixels.copy()
    opaque[:, :, 3] = 1
    assert files.decode(files.encode(image.replace(pixels=opaque), "jpeg").data).channels == 3


def test_lossy_webp_keeps_alpha_exactly() -> None:
    image = picture(Storage.UINT8, 4, Space.SRGB, Alpha.STRAIGHT)
    back = files.decode(files.encode(image, "webp", quality=80).data)
    assert same(back.pixels[:, :, 3:], image.pixels[:, :, 3:])
    assert not same(back.pixels, image.pixels)


# ------------------------------------------------------------------------------------------------------ quantising


@pytest.mark.parametrize("storage", [Storage.UINT8, Storage.UINT16])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_integers_clamp_and_round_half_to_even(storage: Storage, kind: type) -> None:
    levels = storage.levels
    codes = np.array([0.5, 1.5, 2.5, levels - 0.5, -0.4, levels + 0.4], np.float64)
    bad = np.array([-3.0, 7.0, np.nan, np.inf, -np.inf, -0.6 / levels, np.finfo(kind).max])
    pixels: Array = np.concatenate([codes / levels, bad]).astype(kind).reshape(1, -1, 1)
    encoded = files.encode(Image(pixels), "npy", storage=storage)
    got = np.rint(files.decode(encoded.data).pixels.reshape(-1).astype(np.float64) * levels)
    if kind is np.float64:
        np.testing.assert_array_equal(got[:4], np.rint(codes[:4]))
    assert got[4] == 0
    assert got[5] == levels
    np.testing.assert_array_equal(got[6:], [0, levels, 0, levels, 0, 0, levels])
    assert encoded.clipped == 4  # -3, 7, just below zero, the largest float
    assert encoded.nonfinite == 3


def test_ties_in_float32_go_to_even() -> None:
    pixels = np.array([0.5, 0.25, 0.75], np.float32).reshape(1, 3, 1)  # 127.5, 63.75 and 191.25 of 255
    data = files.encode(Image(pixels), "npy", storage=Storage.UINT8).data
    assert list(data[-3:]) == [128, 64, 191]


def test_half_never_turns_finite_into_infinite() -> None:
    pixels = np.array([65504, 65519, 65520, 1e30, -1e30, np.inf, np.nan], np.float32).reshape(1, 7, 1)
    encoded = files.encode(Image(pixels, Space.LINEAR), "exr", storage=Storage.FLOAT16)
    back = files.decode(encoded.data).pixels.reshape(-1)
    np.testing.assert_array_equal(back, [65504, 65504, 65504, 65504, -65504, np.inf, np.nan])
    assert (encoded.clipped, encoded.nonfinite) == (3, 0)


@pytest.mark.parametrize(
    ("name", "born", "expected"),
    [
        ("png", Storage.UINT8, Storage.UINT8),
        ("png", Storage.FLOAT16, Storage.UINT16),
        ("png", Storage.FLOAT32, Storage.UINT16),
        ("jpeg", Storage.UINT16, Storage.UINT8),
        ("exr", Storage.UINT8, Storage.FLOAT16),
        ("exr", Storage.UINT16, Storage.FLOAT32),
        ("exr", Storage.FLOAT64, Storage.FLOAT32),
        ("tiff", Storage.FLOAT16, Storage.FLOAT16),
        ("npy", Storage.FLOAT64, Storage.FLOAT64),
    ],
)
def test_default_storage(name: str, born: Storage, expected: Storage) -> None:
    image = Image(np.full((2, 2, 3), 0.25, np.float32), Space.LINEAR, storage=born)
    assert files.FORMATS[name].storage_for(born) is expected
    assert files.probe(files.encode(image, name).data).storage is expected


# ------------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("name", "channels", "space", "alpha", "error"),
    [
        ("png", 5, Space.SRGB, Alpha.NONE, UnsupportedFormat),
        ("png", 4, Space.SRGB, Alpha.NONE, UnsupportedFormat),
        ("png", 3, Space.SRGB, Alpha.STRAIGHT, UnsupportedFormat),
        ("png", 4, Space.LINEAR, Alpha.ASSOCIATED, InvalidRequest),
        ("webp", 4, Space.LINEAR, Alpha.ASSOCIATED, InvalidRequest),
        ("webp", 2, Space.DATA, Alpha.NONE, UnsupportedFormat),
        ("exr", 4, Space.LINEAR, Alpha.STRAIGHT, InvalidRequest),
        ("jpeg", 2, Space.DATA, Alpha.NONE, UnsupportedFormat),
        ("jpeg", 4, Space.DATA, Alpha.NONE, UnsupportedFormat),
    ],
)
def test_what_a_format_cannot_say_is_refused(
    name: str, channels: int, space: Space, alpha: Alpha, error: type[Exception]
) -> None:
    image = Image(np.full((4, 4, channels), 0.5, np.float32), space, alpha)
    with pytest.raises(error) as refused:
        files.encode(image, name)
    assert refused.value.flaws  # type: ignore[attr-defined]


def test_plain_data_of_two_or_four_channels_fills_a_png() -> None:
    for channels in (2, 4):
        image = as_image(samples(Storage.UINT8, channels))
        assert same(files.decode(files.encode(image, "png").data).pixels, image.pixels)


def test_sizes_storages_and_qualities_are_checked_together() -> None:
    wide = Image(np.zeros((1, 20_000, 5), np.float32), Space.SRGB)
    with pytest.raises(UnsupportedFormat) as refused:
        files.encode(wide, "webp", storage=Storage.FLOAT16)
    assert [flaw.pointer for flaw in refused.value.flaws] == ["/storage", "/image", "/image/channels"]
    small = Image(np.zeros((2, 2, 3), np.float32), Space.SRGB)
    for name, quality in (("png", 50), ("jpeg", 101), ("webp", -1)):
        with pytest.raises(InvalidRequest, match="quality"):
            files.encode(small, name, quality=quality)


def test_formats_by_name() -> None:
    assert files.format_for_media_type("image/PNG; q=1").name == "png"
    assert files.format_for_path("a/b.TIF").name == "tiff"
    with pytest.raises(UnsupportedFormat, match="image/png"):
        files.format_for_media_type("image/gif")
    with pytest.raises(UnsupportedFormat, match=r"\.tif"):
        files.format_for_path("x.tiif")
    with pytest.raises(UnsupportedFormat, match="did you mean jpeg"):
        files.encode(Image(np.zeros((1, 1, 1), np.float32)), "jpg")


def test_media_type_must_agree() -> None:
    data = files.encode(Image(np.zeros((2, 2, 3), np.float32), Space.SRGB), "png").data
    for neutral in (None, "", "application/octet-stream", "image/*", "image/png", "image/x-png"):
        assert files.decode(data, media_type=neutral).width == 2
    with pytest.raises(UnreadableImage, match="image/jpeg but begin like image/png"):
        files.decode(data, media_type="image/jpeg")
    with pytest.raises(UnsupportedFormat, match="image/gif"):
        files.decode(data, media_type="image/gif")
    with pytest.raises(UnsupportedFormat, match="called image/png"):
        files.decode(b"GIF89a" + bytes(40), media_type="image/png")


def test_bytearray_and_memoryview_are_read() -> None:
    data = files.encode(Image(np.full((3, 2, 3), 0.5, np.float32), Space.SRGB), "png").data
    assert files.decode(bytearray(data)).height == files.decode(memoryview(data)).height == 3


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_the_range_of_samples_is_that_of_their_floats(kind: type) -> None:
    largest = np.iinfo(kind).max
    samples = np.full((700, 900, 3), largest // 3, kind)
    for at, value in ((0, 0), (1_500_000, 2), (-1, largest - 1), (5, largest), (-2, 0)):
        samples.reshape(-1)[at] = value
        assert extent_of(samples) == measure_extent(to_floats(samples))
    samples.reshape(-1)[[0, -2]] = 7
    assert extent_of(samples) == measure_extent(to_floats(samples))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_stored_samples_become_floats_only_where_they_are_read(kind: type) -> None:
    samples = np.random.default_rng(3).integers(0, np.iinfo(kind).max, (40, 31, 3), kind, endpoint=True)
    file = files.encode(as_image(samples).replace(space=Space.SRGB), "png").data
    widened: list[tuple[int, ...]] = []

    def widen(stored: Array) -> Array:
        widened.append(stored.shape)
        return to_floats(stored)

    image = files.decode(file, widen=widen)
    assert (image.height, image.width, image.channels) == samples.shape
    same = lichen.run("levels", image).image
    assert files.decode(files.encode(same, "png").data).pixels.tobytes() == to_floats(samples).tobytes()
    assert not widened, "nothing has read a float"
    mirrored = lichen.run("levels", image, black=1, white=0).image
    np.testing.assert_allclose(mirrored.pixels, 1 - to_floats(samples), atol=1e-6)
    assert len(widened) == 1
    assert "pixels" not in vars(image), "the floats belong to the run"
    assert image.replace(storage=Storage.FLOAT32).pixels.tobytes() == to_floats(samples).tobytes()
    plain = image.replace()
    again = [files.encode(each, "png", storage=Storage.UINT16).data for each in (image, plain)]
    assert again[0] == again[1]
