"""Other people's readers agree with what we write, and we agree with them on what they write."""

from __future__ import annotations

import io
from typing import Any, Literal

import cv2
import numpy as np
import OpenEXR
import pytest
import simplejpeg
import tifffile
from PIL import Image as Pictures
from PIL import ImageOps

from lichen import files
from lichen.errors import UnsupportedFormat
from lichen.image import Alpha, Image, Space, Storage, as_image
from lichen.memory import Array

HEIGHT, WIDTH = 21, 34
rng = np.random.default_rng(7)
RGBA8 = rng.integers(0, 256, (HEIGHT, WIDTH, 4)).astype(np.uint8)
RGBA8[:4, :, 3] = 0
RGBA16 = rng.integers(0, 65536, (HEIGHT, WIDTH, 4)).astype(np.uint16)
FLOATS = rng.normal(size=(HEIGHT, WIDTH, 7)).astype(np.float32)
FLOATS[0, :4, 0] = [np.nan, np.inf, -np.inf, 1e-42]


def coded(image: Image) -> Array:
    """The codes a decoded integer image came from."""
    codes: Array = np.rint(image.pixels * image.storage.levels).astype(image.storage.value)
    return codes


def pillow_file(picture: Pictures.Image, kind: str, **options: Any) -> bytes:
    target = io.BytesIO()
    picture.save(target, kind, **options)
    return target.getvalue()


def tiff_file(array: Array, **options: Any) -> bytes:
    target = io.BytesIO()
    tifffile.imwrite(target, array, metadata=None, **options)
    return target.getvalue()


def exr_file(channels: dict[str, Array], **header: Any) -> bytes:
    target = io.BytesIO()
    options = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(options, {name: np.ascontiguousarray(value) for name, value in channels.items()}).write(target)
    return target.getvalue()


def image_of(array: Array, space: Space, alpha: Alpha = Alpha.NONE) -> Image:
    return as_image(np.ascontiguousarray(array)).replace(space=space, alpha=alpha)


# ---------------------------------------------------------------------------------------------- what we write


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_pillow_reads_our_png(channels: int) -> None:
    alpha = Alpha.STRAIGHT if channels in (2, 4) else Alpha.NONE
    array = RGBA8[:, :, 4 - channels :]
    picture = Pictures.open(io.BytesIO(files.encode(image_of(array, Space.SRGB, alpha), "png").data))
    assert picture.mode == ["L", "LA", "RGB", "RGBA"][channels - 1]
    np.testing.assert_array_equal(np.asarray(picture).reshape(array.shape), array)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_opencv_reads_our_16_bit_png(channels: int) -> None:
    array = RGBA16[:, :, :channels]
    data = files.encode(image_of(array, Space.SRGB, Alpha.STRAIGHT if channels == 4 else Alpha.NONE), "png").data
    read: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    order = {1: [0], 3: [2, 1, 0], 4: [2, 1, 0, 3]}[channels]
    np.testing.assert_array_equal(read.reshape(array.shape)[:, :, order], array)


def test_pillow_reads_our_webp_and_jpeg() -> None:
    data = files.encode(image_of(RGBA8, Space.SRGB, Alpha.STRAIGHT), "webp").data
    np.testing.assert_array_equal(np.asarray(Pictures.open(io.BytesIO(data))), RGBA8)
    for channels in (1, 3):
        data = files.encode(image_of(RGBA8[:, :, :channels], Space.SRGB), "jpeg", quality=100).data
        read = np.asarray(Pictures.open(io.BytesIO(data))).reshape(HEIGHT, WIDTH, channels)
        # the samples of two decoders may differ in the rounding of the inverse transform
        assert np.abs(read.astype(int) - coded(files.decode(data))).max() <= 1


@pytest.mark.parametrize(
    ("shape", "quality"), [((2500, 50, 3), 90), ((600, 61, 3), 75), ((257, 40, 1), 90), ((70, 65_500, 1), 50)]
)
def test_a_jpeg_of_bands_holds_what_one_in_one_piece_does(shape: tuple[int, int, int], quality: int) -> None:
    """More bands than there are restart markers; both samplings; a row too many; blocks too many for one interval."""
    samples = np.random.default_rng(1).integers(0, 256, shape, np.uint8)
    kind, sampling = ("RGB", "444" if quality >= 90 else "420") if shape[2] == 3 else ("GRAY", "Gray")
    whole = np.frombuffer(simplejpeg.encode_jpeg(samples, quality, kind, sampling), np.uint8)
    data = files.encode(image_of(samples, Space.SRGB), "jpeg", quality=quality).data
    assert b"\xff\xdd" in bytes(data[:1000])
    banded = np.frombuffer(data, np.uint8)
    np.testing.assert_array_equal(cv2.imdecode(banded, -1), cv2.imdecode(whole, -1))
    np.testing.assert_array_equal(Pictures.open(io.BytesIO(data)), Pictures.open(io.BytesIO(whole.tobytes())))
    assert files.decode(data).pixels.shape == shape


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float16, np.float32, np.float64])
@pytest.mark.parametrize("alpha", [Alpha.STRAIGHT, Alpha.ASSOCIATED])
def test_tifffile_reads_our_tiff(kind: type, alpha: Alpha) -> None:
    array: Array = (np.abs(FLOATS[1:, :, :4]) * 50).astype(kind)
    space = Space.SRGB if array.dtype.kind == "u" else Space.LINEAR
    page: Any = tifffile.TiffFile(io.BytesIO(files.encode(image_of(array, space, alpha), "tiff").data)).pages[0]
    np.testing.assert_array_equal(page.asarray(), array)
    assert page.photometric == tifffile.PHOTOMETRIC.RGB
    assert page.extrasamples == ({Alpha.ASSOCIATED: 1, Alpha.STRAIGHT: 2}[alpha],)


def test_pillow_reads_our_tiff() -> None:
    data = files.encode(image_of(RGBA8, Space.SRGB, Alpha.STRAIGHT), "tiff").data
    np.testing.assert_array_equal(np.asarray(Pictures.open(io.BytesIO(data))), RGBA8)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("rows", [1, 15, 16, 17, 21])
def test_openexr_reads_our_exr(kind: type, rows: int) -> None:
    array: Array = FLOATS[:rows, :, :5].astype(kind)
    data = files.encode(image_of(array, Space.LINEAR, Alpha.ASSOCIATED), "exr").data
    part = OpenEXR.File(io.BytesIO(data), separate_channels=True)
    for i, name in enumerate(["R", "G", "B", "channel003", "A"]):
        channel = part.channels()[name].pixels
        assert channel.dtype == kind
        np.testing.assert_array_equal(channel, array[:, :, i])


def test_numpy_reads_our_npy() -> None:
    for array in (RGBA8, RGBA16, FLOATS, FLOATS.astype(np.float16), FLOATS.astype(np.float64)):
        read = np.load(io.BytesIO(files.encode(as_image(array), "npy").data), allow_pickle=False)
        assert read.dtype == array.dtype
        np.testing.assert_array_equal(read, array)


# ------------------------------------------------------------------------------------------- what we read: PNG


def test_palettes_low_depths_and_transparent_colours() -> None:
    colours = Pictures.fromarray(RGBA8[:, :, :3]).quantize(13)
    grey = Pictures.fromarray(RGBA8[:, :, 0])
    first = tuple(int(value) for value in RGBA8[0, 0, :3])
    cases: tuple[tuple[Pictures.Image, dict[str, Any], str], ...] = (
        (colours, {}, "RGB"),
        (colours, {"transparency": 3}, "RGBA"),
        (colours, {"transparency": bytes([0, 100, 200])}, "RGBA"),
        (Pictures.fromarray(RGBA8[:, :, 0] > 128), {}, "L"),
        (grey, {"transparency": 77}, "LA"),
        (Pictures.fromarray(RGBA8[:, :, :3]), {"transparency": first}, "RGBA"),
    )
    for picture, options, mode in cases:
        data = pillow_file(picture, "png", **options)
        expected = np.asarray(Pictures.open(io.BytesIO(data)).convert("RGBA").convert(mode))
        image = files.decode(data)
        assert image.alpha is (Alpha.STRAIGHT if "A" in mode else Alpha.NONE)
        np.testing.assert_array_equal(coded(image), expected.reshape(HEIGHT, WIDTH, -1))


def test_opencv_writes_16_bit_png() -> None:
    for array, order in ((RGBA16[:, :, :3], [2, 1, 0]), (RGBA16, [2, 1, 0, 3])):
        data = cv2.imencode(".png", np.ascontiguousarray(array[:, :, order]))[1].tobytes()
        np.testing.assert_array_equal(coded(files.decode(data)), array)


@pytest.mark.parametrize("kind", ["jpeg", "png", "webp", "tiff"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_honoured(kind: str, orientation: int) -> None:
    exif = Pictures.Exif()
    exif[274] = orientation
    choices: dict[str, dict[str, Any]] = {"webp": {"lossless": True}, "jpeg": {"quality": 100, "subsampling": 0}}
    options = choices.get(kind, {})
    smooth = np.stack(np.broadcast_arrays(*np.mgrid[0:HEIGHT, 0:WIDTH], 90), axis=2).astype(np.uint8) * 2
    data = pillow_file(Pictures.fromarray(smooth), kind, exif=exif, **options)
    upright = np.asarray(ImageOps.exif_transpose(Pictures.open(io.BytesIO(data))))
    header, image = files.probe(data), files.decode(data)
    assert (header.height, header.width) == image.pixels.shape[:2] == upright.shape[:2]
    assert np.abs(coded(image).astype(int) - upright).max() <= (2 if kind == "jpeg" else 0)


# ------------------------------------------------------------------------------------------ what we read: JPEG


def test_progressive_and_long_segments() -> None:
    smooth = Pictures.fromarray(np.add.outer(np.arange(50), np.arange(60)).astype(np.uint8)).convert("RGB")
    plain = pillow_file(smooth, "jpeg", quality=95, progressive=True)
    stuffed = plain[:2] + (b"\xff\xef\xff\xff" + b"\xff\xd8" * 32766 + b"\0") * 5 + plain[2:]  # 5 x 64 KiB of markers
    assert len(stuffed) == len(plain) + 5 * 65_537
    for data in (plain, stuffed):
        assert np.abs(coded(files.decode(data)).astype(int) - np.asarray(smooth)).max() <= 3


def test_four_colour_jpeg_is_refused() -> None:
    with pytest.raises(UnsupportedFormat, match="4 components"):
        files.decode(pillow_file(Pictures.fromarray(RGBA8[:, :, :3]).convert("CMYK"), "jpeg"))


# ------------------------------------------------------------------------------------------ what we read: WebP


def test_first_frame_of_an_animation() -> None:
    frames = [Pictures.fromarray(RGBA8[:, :, :3]), Pictures.fromarray(255 - RGBA8[:, :, :3])]
    data = pillow_file(frames[0], "webp", save_all=True, append_images=frames[1:], lossless=True)
    assert files.probe(data).pages == 2
    np.testing.assert_array_equal(coded(files.decode(data))[:, :, :3], RGBA8[:, :, :3])


# ------------------------------------------------------------------------------------------ what we read: TIFF


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float16, np.float32, np.float64])
@pytest.mark.parametrize(
    "options",
    [{}, {"byteorder": ">"}, {"bigtiff": True}, {"compression": "zlib"}, {"tile": (16, 16)}, {"rowsperstrip": 3}],
    ids=str,
)
def test_tiff_layouts(kind: type, options: dict[str, Any]) -> None:
    array: Array = (np.abs(FLOATS[1:, :, :3]) * 50).astype(kind)
    data = tiff_file(array, photometric="rgb", **options)
    if kind is np.float64 and "tile" in options:
        with pytest.raises(UnsupportedFormat, match="tiles"):
            files.decode(data)
        return
    image = files.decode(data)
    expected = as_image(array)
    np.testing.assert_array_equal(image.pixels, expected.pixels)
    assert image.space is (Space.SRGB if array.dtype.kind == "u" else Space.LINEAR)


def test_tiff_planes_and_white_zero_and_extras() -> None:
    planes = files.decode(tiff_file(np.moveaxis(RGBA16[:, :, :3], 2, 0), photometric="rgb", planarconfig="separate"))
    np.testing.assert_array_equal(coded(planes), RGBA16[:, :, :3])
    for array in (RGBA8, RGBA16):
        white = files.decode(tiff_file(array[:, :, 0], photometric="miniswhite"))
        np.testing.assert_array_equal(coded(white)[:, :, 0], np.iinfo(array.dtype).max - array[:, :, 0])
    alpha_first = np.concatenate([RGBA8, RGBA8[:, :, :1]], axis=2)
    moved = files.decode(tiff_file(alpha_first, photometric="rgb", extrasamples=["assocalpha", "unspecified"]))
    assert moved.alpha is Alpha.ASSOCIATED
    np.testing.assert_array_equal(coded(moved), alpha_first[:, :, [0, 1, 2, 4, 3]])
    field = files.decode(tiff_file(FLOATS[:, :, :2], photometric="minisblack", planarconfig="contig"))
    assert (field.space, field.alpha) == (Space.DATA, Alpha.NONE)
    np.testing.assert_array_equal(field.pixels, FLOATS[:, :, :2])
    unsaid = cv2.imencode(".tiff", RGBA8[:, :, [2, 1, 0, 3]])[1].tobytes()
    assert files.decode(unsaid).alpha is Alpha.STRAIGHT
    np.testing.assert_array_equal(coded(files.decode(unsaid)), RGBA8)


@pytest.mark.parametrize("compression", ["tiff_lzw", "tiff_adobe_deflate", "packbits", "tiff_deflate"])
def test_pillow_writes_compressed_tiff(compression: str) -> None:
    data = pillow_file(Pictures.fromarray(RGBA8), "tiff", compression=compression)
    image = files.decode(data)
    assert image.alpha is Alpha.STRAIGHT
    np.testing.assert_array_equal(coded(image), RGBA8)


def test_tiff_that_we_do_not_read() -> None:
    for data in (
        pillow_file(Pictures.fromarray(RGBA8[:, :, :3]).convert("CMYK"), "tiff"),
        pillow_file(Pictures.fromarray(RGBA8[:, :, :3]).convert("LAB"), "tiff"),
        tiff_file(RGBA8.astype(np.uint32)[:, :, 0], photometric="minisblack"),
        tiff_file(RGBA8.astype(np.int16)[:, :, 0], photometric="minisblack"),
    ):
        with pytest.raises(UnsupportedFormat):
            files.decode(data)


def test_pages_are_counted_and_the_first_is_read() -> None:
    target = io.BytesIO()
    with tifffile.TiffWriter(target) as writer:
        for page in (RGBA8[:, :, 0], RGBA8[:, :, 1], RGBA8[:, :, 2]):
            writer.write(page, photometric="minisblack", metadata=None)
    assert files.probe(target.getvalue()).pages == 3
    np.testing.assert_array_equal(coded(files.decode(target.getvalue()))[:, :, 0], RGBA8[:, :, 0])


# ------------------------------------------------------------------------------------------- what we read: EXR


def planes(names: str) -> dict[str, Array]:
    return {name: FLOATS[:, :, i] for i, name in enumerate(names.split())}


@pytest.mark.parametrize(
    ("names", "order", "space", "alpha"),
    [
        ("B A R G", "R G B A", Space.LINEAR, Alpha.ASSOCIATED),
        ("Z R G A B", "R G B Z A", Space.LINEAR, Alpha.ASSOCIATED),
        ("R G B N.Z N.X N.Y", "R G B N.X N.Y N.Z", Space.LINEAR, Alpha.NONE),
        ("beauty.A beauty.B beauty.G beauty.R Z", "beauty.R beauty.G beauty.B Z beauty.A", Space.LINEAR, None),
        ("Y A", "Y A", Space.LINEAR, Alpha.ASSOCIATED),
        ("Y", "Y", Space.LINEAR, Alpha.NONE),
        ("R G", "R G", Space.DATA, Alpha.NONE),
        ("v u", "u v", Space.DATA, Alpha.NONE),
        ("Z", "Z", Space.DATA, Alpha.NONE),
        ("A", "A", Space.DATA, Alpha.NONE),
    ],
)
def test_exr_channels(names: str, order: str, space: Space, alpha: Alpha | None) -> None:
    channels = planes(names)
    image = files.decode(exr_file(channels))
    assert image.metadata["channel_names"] == tuple(order.split())
    assert (image.space, image.alpha) == (space, Alpha.ASSOCIATED if alpha is None else alpha)
    for i, name in enumerate(order.split()):
        np.testing.assert_array_equal(image.pixels[:, :, i], channels[name])
    again = files.decode(files.encode(image, "exr").data)
    assert again.metadata["channel_names"] == image.metadata["channel_names"]
    assert (again.space, again.alpha) == (image.space, image.alpha)
    np.testing.assert_array_equal(again.pixels, image.pixels)


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ"])
def test_exr_compressions(compression: str) -> None:
    half = FLOATS[:, :, 0].astype(np.float16)
    data = exr_file({"R": half, "G": half, "B": half}, compression=getattr(OpenEXR, f"{compression}_COMPRESSION"))
    image = files.decode(data)
    assert image.storage is Storage.FLOAT16
    np.testing.assert_array_equal(image.pixels[:, :, 1], half.astype(np.float32))


def test_exr_mixed_types_tiles_parts_and_integers() -> None:
    half = FLOATS[:, :, :3].astype(np.float16)
    mixed: dict[str, Array] = {"R": half[:, :, 0], "G": half[:, :, 1], "B": half[:, :, 2], "Z": FLOATS[:, :, 3]}
    image = files.decode(exr_file(mixed))
    assert image.storage is Storage.FLOAT32
    np.testing.assert_array_equal(image.pixels[:, :, 3], FLOATS[:, :, 3])
    tiles = exr_file(mixed, type=OpenEXR.tiledimage, tiles=OpenEXR.TileDescription())
    np.testing.assert_array_equal(files.decode(tiles).pixels, image.pixels)
    target = io.BytesIO()
    first = OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"Z": np.ascontiguousarray(FLOATS[:, :, 1])}, name="one")
    second = OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"Z": np.ascontiguousarray(FLOATS[:, :, 2])}, name="two")
    OpenEXR.File([first, second]).write(target)
    assert files.probe(target.getvalue()).pages == 2
    np.testing.assert_array_equal(files.decode(target.getvalue()).pixels[:, :, 0], FLOATS[:, :, 1])
    with pytest.raises(UnsupportedFormat, match="'id'"):
        files.decode(exr_file({"id": np.zeros((4, 4), np.uint32)}))


def test_exr_attributes_are_carried() -> None:
    aces = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
    header = {
        "chromaticities": aces,
        "whiteLuminance": 120.0,
        "pixelAspectRatio": 2.0,
        "owner": "a name",
        "a_number": 42,
        "a_name_that_is_longer_than_thirty_one_characters": "kept",
    }
    image = files.decode(exr_file(planes("R G B"), **header))
    assert "chromaticities" in image.metadata["colour_note"]
    back = OpenEXR.File(io.BytesIO(files.encode(image, "exr").data)).header()
    for name, value in header.items():
        if name != "chromaticities":
            assert back[name] == value
    np.testing.assert_allclose(back["chromaticities"], aces, rtol=1e-6)
    assert "colorInteropID" not in back, "it would contradict the chromaticities"
    plain = OpenEXR.File(io.BytesIO(files.encode(image.replace(space=Space.DATA), "exr").data)).header()
    assert "chromaticities" not in plain


# ------------------------------------------------------------------------------------------- what we read: NPY


@pytest.mark.parametrize("kind", ["<f2", ">f2", "<f4", ">f4", "<f8", ">f8", "|u1", "<u2", ">u2", "|b1"])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_numpy_writes_npy(kind: str, order: Literal["C", "F"], dimensions: int) -> None:
    array: Any = np.abs(FLOATS[1:] * 50)
    array = (array > 9 if kind == "|b1" else array).astype(kind)
    array = array[:, :, 0] if dimensions == 2 else array
    target = io.BytesIO()
    np.save(target, np.asarray(array, order=order), allow_pickle=False)
    image = files.decode(target.getvalue())
    expected = as_image(array.astype(array.dtype.newbyteorder("=")))
    assert image.pixels.dtype == expected.pixels.dtype
    np.testing.assert_array_equal(image.pixels, expected.pixels)
    assert image.storage is expected.storage
