"""Files made to harm: huge claims, damaged and missing parts, garbage. Only `LichenError`s come out, early."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
import textwrap
import zlib
from functools import cache

import numpy as np
import pytest
import tifffile
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from PIL import Image as Pictures

from lichen import files
from lichen.errors import LichenError, TooLarge, UnreadableImage, UnsupportedFormat
from lichen.files import ifd
from lichen.image import Image, Space, Storage, as_image

SMALL = files.Limits(pixels=1_000_000)


@cache
def valid(kind: str) -> bytes:
    """A small valid file of each format and of the codings whose decoders differ."""
    codes = np.random.default_rng(2).integers(0, 256, (23, 31, 3)).astype(np.uint8)
    image, picture = as_image(codes).replace(space=Space.LINEAR), Pictures.fromarray(codes)
    target = io.BytesIO()
    match kind.split():
        case ["jpeg", "progressive"]:
            picture.save(target, "jpeg", progressive=True)
        case ["webp", "lossy"]:
            picture.save(target, "webp", quality=50)
        case ["webp", "animated"]:
            picture.save(
                target, "webp", save_all=True, append_images=[picture.transpose(Pictures.Transpose.ROTATE_180)]
            )
        case ["png", "palette"]:
            picture.quantize(9).save(target, "png", transparency=2)
        case ["tiff", "tiles"]:
            tifffile.imwrite(target, np.tile(codes, (2, 2, 1)), tile=(16, 16), photometric="rgb")
        case ["tiff", coding]:
            picture.save(target, "tiff", compression=coding)
        case [name, storage]:
            return files.encode(image, name, storage=Storage(storage)).data
    return target.getvalue()


KINDS = (
    *("png uint8", "png uint16", "png palette", "jpeg uint8", "jpeg progressive", "webp uint8", "webp lossy"),
    *("webp animated", "tiff uint8", "tiff float32", "tiff tiles", "tiff tiff_lzw", "tiff tiff_adobe_deflate"),
    *("tiff jpeg", "exr float16", "exr float32", "npy float32", "npy uint8"),
)


def mended(data: bytes) -> bytes:
    """A PNG file with its checksums made right again, so that damage reaches the decoder."""
    result, start = bytearray(data), 8
    while start + 12 <= len(result):
        size = struct.unpack_from(">I", result, start)[0]
        end = start + 8 + size
        if end + 4 > len(result):
            break
        result[end : end + 4] = struct.pack(">I", zlib.crc32(result[start + 4 : end]))
        start = end + 4
    return bytes(result)


# --------------------------------------------------------------------------------------------------- huge claims


def claims() -> dict[str, bytes]:
    """Small files whose headers claim gigapixels."""
    noise = Pictures.fromarray(np.random.default_rng(0).integers(0, 256, (40, 40, 3)).astype(np.uint8))
    target = io.BytesIO()
    noise.save(target, "jpeg")
    jpeg = target.getvalue()
    frame = jpeg.index(b"\xff\xc0")
    linear = Image(np.ones((8, 8, 3), np.float32), Space.LINEAR)
    exr = bytearray(files.encode(linear, "exr").data)
    window = exr.index(b"dataWindow\0box2i\0") + 21
    exr[window : window + 16] = struct.pack("<4i", -(1 << 30), -(1 << 30), (1 << 30) - 1, (1 << 30) - 1)
    tiff = bytearray(files.encode(linear, "tiff").data)
    ifd = struct.unpack_from("<I", tiff, 4)[0]
    for i in range(struct.unpack_from("<H", tiff, ifd)[0]):
        at = ifd + 2 + 12 * i
        if struct.unpack_from("<H", tiff, at)[0] in (256, 257):
            struct.pack_into("<HII", tiff, at + 2, 4, 1, 4_000_000)
    png = bytearray(files.encode(linear, "png").data)
    struct.pack_into(">II", png, 16, 16_384, 16_384)
    packed = struct.pack("<BI", 0x2F, 16_382 | 16_382 << 14)
    webp = b"RIFF" + struct.pack("<I", 18) + b"WEBPVP8L" + struct.pack("<I", 5) + packed + b"\0"
    shape = b"{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000, 1000000000, 3), }\n"
    return {
        "jpeg": jpeg[: frame + 5] + struct.pack(">HH", 64_250, 64_250) + jpeg[frame + 9 :],
        "exr": bytes(exr),
        "tiff": bytes(tiff),
        "png": mended(bytes(png)),
        "webp": webp,
        "npy": b"\x93NUMPY\1\0" + struct.pack("<H", len(shape)) + shape,
    }


@pytest.mark.parametrize("name", list(files.FORMATS))
def test_huge_claims_are_refused_by_the_header(name: str) -> None:
    data = claims()[name]
    assert len(data) < 8000
    with pytest.raises((TooLarge, UnreadableImage)) as refused:
        files.decode(data)
    if name != "tiff":  # uncompressed: the bytes are missing, which is found first
        assert isinstance(refused.value, TooLarge)
        assert refused.value.actual > refused.value.limit  # type: ignore[operator]
        assert refused.value.flaws


def test_every_limit_is_checked() -> None:
    data = files.encode(Image(np.zeros((20, 30, 5), np.float32)), "npy").data
    exact = files.Limits(pixels=600, side=30, channels=5, bytes=12_000)
    assert files.decode(data, limits=exact).channels == 5
    for change in ({"pixels": 599}, {"side": 29}, {"channels": 4}, {"bytes": 11_999}):
        with pytest.raises(TooLarge) as refused:
            files.decode(data, limits=files.Limits(**{"pixels": 600, "side": 30, "channels": 5, **change}))
        assert len(refused.value.flaws) == 1
        assert refused.value.limit == next(iter(change.values()))
    with pytest.raises(TooLarge) as refused:
        files.decode(data, limits=files.Limits(1, 1, 1, 1))
    assert len(refused.value.flaws) == 5


def test_claims_take_no_memory() -> None:
    """All bombs in one fresh process: its peak of memory grows by no more than 20 MB over that of a small decode."""
    script = f"""
    import importlib.util, resource, struct, zlib
    import numpy as np
    spec = importlib.util.spec_from_file_location("hostile", {__file__!r})
    hostile = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hostile)
    bombs = list(hostile.claims().values())
    tiff = hostile.valid("tiff uint8")
    bombs += [hostile.long_chain(tiff, 100_000), hostile.ring(tiff), hostile.hollow(tiff)]
    png = hostile.valid("png uint8")
    for name in (b"iCCP", b"zTXt"):
        body = b"x\\0\\0" + zlib.compress(bytes(100_000_000), 9)
        chunk = struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        bombs.append(png[:33] + chunk * 5 + png[33:])
    tall = bytearray(png)
    struct.pack_into(">II", tall, 16, 9_000, 9_000)  # below the limit, but the data cannot hold it
    bombs.append(hostile.mended(bytes(tall)))
    jpeg = hostile.valid("jpeg uint8")
    frame = jpeg.index(b"\\xff\\xc0")
    bombs.append(jpeg[: frame + 5] + struct.pack(">HH", 9_000, 9_000) + jpeg[frame + 9 :])
    for kind in hostile.KINDS:
        hostile.files.decode(hostile.valid(kind))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for bomb in bombs:
        try:
            hostile.files.decode(bomb)
        except hostile.LichenError:
            pass
    print(len(bombs), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    """
    run = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, check=True)
    count, grown = map(int, run.stdout.split())
    assert count == 13
    assert grown < 20_000, f"{grown} kB"


def long_chain(data: bytes, count: int) -> bytes:
    """A TIFF with so many directories of one entry behind its own."""
    tiff = bytearray(data)
    first = struct.unpack_from("<I", tiff, 4)[0]
    struct.pack_into("<I", tiff, first + 2 + 12 * struct.unpack_from("<H", tiff, first)[0], len(tiff))
    for i in range(count):
        tiff += struct.pack("<HHHIII", 1, 256, 4, 1, 31, len(tiff) + 18 if i < count - 1 else 0)
    return bytes(tiff)


def ring(data: bytes) -> bytes:
    """A TIFF whose directory is followed by a hundred, of which the last is followed by the first: few bytes, and no
    end of directories."""
    tiff = bytearray(long_chain(data, 100))
    tiff[-4:] = tiff[4:8]
    return bytes(tiff)


def hollow(data: bytes) -> bytes:
    """A TIFF in 5 kB with 600 directories of six bytes each, which hold nothing."""
    tiff = bytearray(long_chain(data, 1))
    tiff[-4:] = struct.pack("<I", len(tiff))
    for i in range(600):
        tiff += struct.pack("<HI", 0, len(tiff) + 6 if i < 599 else 0)
    return bytes(tiff)


def test_a_chain_of_directories_ends() -> None:
    tiff = valid("tiff uint8")
    for few in (0, 1, 999):
        assert files.decode(long_chain(tiff, few) if few else tiff).width == 31
    with pytest.raises(TooLarge, match="1001 pictures") as refused:
        files.decode(long_chain(tiff, 100_000))
    assert (refused.value.limit, refused.value.actual) == (1000, 1001)
    assert [flaw.pointer for flaw in refused.value.flaws] == ["/image/pages"]
    with pytest.raises(UnreadableImage, match="lead back"):
        files.decode(ring(tiff))
    with pytest.raises(UnreadableImage, match="no entries"):
        files.decode(hollow(tiff))


def test_of_a_directory_no_more_is_read_than_is_needed() -> None:
    many = [struct.pack("<HHII", 338, 3, size, 100) for size in (50_000, 1, 50_000)]
    values = bytes(100_000)
    found = ifd.read(
        memoryview(b"II*\0" + struct.pack("<IH", 8, len(many)) + b"".join(many) + values),
        frozenset([338]),
    )
    assert len(found.values[338]) == 1024, "long values are cut, and the first of a tag stands"


@pytest.mark.parametrize("name", ["png", "jpeg", "webp", "exr"])
def test_headers_in_very_many_pieces_are_refused(name: str) -> None:
    """Each piece takes time, and few bytes."""
    kind = {"exr": "exr float32"}.get(name, f"{name} uint8")
    data, at = valid(kind), {"png": 33, "jpeg": 2, "webp": 12, "exr": 8}[name]
    piece = {
        "png": struct.pack(">I4sI", 0, b"tEXt", zlib.crc32(b"tEXt")),
        "jpeg": b"\xff\xfe\x00\x02",
        "webp": b"EXIF" + struct.pack("<I", 0),
        "exr": b"a\0string\0" + struct.pack("<i", 0),
    }[name]
    if name == "webp":
        at = 12 + 8 + struct.unpack_from("<I", data, 16)[0]
        at += at % 2

    def made(count: int) -> bytes:
        longer = bytearray(data[:at] + piece * count + data[at:])
        if name == "webp":
            struct.pack_into("<I", longer, 4, len(longer) - 8)
        return bytes(longer)

    assert files.probe(made(50)).width == files.probe(data).width
    with pytest.raises(TooLarge, match="more than 5000") as refused:
        files.probe(made(6000))
    assert (refused.value.limit, refused.value.actual) == (5000, 5001)


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '|O', 'fortran_order': False, 'shape': (2, 2), }",
        b"{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (2, 2), }",
        b"{'descr': '<c8', 'fortran_order': False, 'shape': (2, 2), }",
        b"{'descr': '<i4', 'fortran_order': False, 'shape': (2, 2), }",
        b"{'descr': '<f4', 'fortran_order': 0, 'shape': (2, 2), }",
        b"{'descr': '<f4', 'fortran_order': False, 'shape': (-2, 2), }",
        b"{'descr': '<f4', 'fortran_order': False, 'shape': (True, 2), }",
        b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2, 2, 2), }",
        b"{'descr': '<f4', 'fortran_order': False, 'shape': (0, 2), }",
        b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }",
        b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2), 'more': 1, }",
        b"__import__('os').abort()",
        b"(" * 5000,
        b"-" * 9000 + b"1",
        b"\xff\xfe",
        b"",
    ],
)
def test_npy_headers_are_parsed_not_evaluated(header: bytes) -> None:
    data = b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header + bytes(16)
    with pytest.raises((UnreadableImage, UnsupportedFormat)):
        files.decode(data)


# ------------------------------------------------------------------------------------------- damage and garbage


@pytest.mark.parametrize("kind", KINDS)
def test_truncated_files_are_refused_at_every_length(kind: str) -> None:
    data = valid(kind)
    files.decode(data)
    lengths = {*range(min(len(data), 40)), *range(40, len(data), max(1, len(data) // 60)), len(data) - 2}
    if kind.startswith("tiff"):  # the directory lies anywhere, and its end need not be the file's
        lengths = {length for length in lengths if length < 0.9 * len(data)}
    for length in sorted(lengths):
        with pytest.raises((UnreadableImage, UnsupportedFormat)):
            files.decode(data[:length])


@pytest.mark.parametrize("kind", ["png uint8", "png uint16", "png palette"])
def test_a_changed_bit_in_a_png_is_found(kind: str) -> None:
    data = valid(kind)
    for position in range(8, len(data), max(1, len(data) // 200)):
        damaged = bytearray(data)
        damaged[position] ^= 4
        with pytest.raises(LichenError):
            files.decode(bytes(damaged))


def test_a_jpeg_may_have_fill_bytes_before_its_markers() -> None:
    data = valid("jpeg progressive")
    scan = data.index(b"\xff\xda", data.index(b"\xff\xda") + 2)  # the second, behind data
    filled = data[:scan] + b"\xff\xff" + data[scan:-2] + b"\xff" + data[-2:]
    assert np.array_equal(files.decode(filled).pixels, files.decode(data).pixels)


def test_half_a_jpeg_with_an_end_is_no_picture() -> None:
    data = valid("jpeg uint8")
    with pytest.raises(UnreadableImage, match="premature"):
        files.decode(data[: len(data) * 2 // 3] + b"\xff\xd9")


def test_empty_and_unknown_bytes() -> None:
    with pytest.raises(UnreadableImage, match="no bytes"):
        files.decode(b"")
    for data in (b"GIF89a" + bytes(100), b"\0" * 100, b"%PDF", b"RIFF1234WAVE"):
        with pytest.raises(UnsupportedFormat, match="png or jpeg"):
            files.decode(data)


QUIET = settings(max_examples=250, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
MAGIC = st.sampled_from([valid(kind)[:n] for kind in KINDS for n in (4, 8, 12, 16)])


@QUIET
@given(st.binary(max_size=400), MAGIC)
@example(b"", b"\x93NUMPY\1\0")
def test_garbage_raises_only_our_errors(tail: bytes, magic: bytes) -> None:
    for data in (tail, magic + tail):
        try:
            image = files.decode(data, limits=SMALL)
        except LichenError:
            continue
        assert image.pixels.size


Change = tuple[str, int, bytes]
CHANGES = st.lists(
    st.tuples(
        st.sampled_from(["set", "insert", "delete", "end"]), st.integers(0, 1 << 16), st.binary(min_size=1, max_size=6)
    ),
    min_size=1,
    max_size=6,
)


@settings(QUIET, max_examples=1200)
@given(st.sampled_from(KINDS), CHANGES, st.booleans())
def test_mutated_files_raise_only_our_errors(kind: str, changes: list[Change], early: bool) -> None:
    data = bytearray(valid(kind))
    for what, where, piece in changes:
        at = where % max(1, min(len(data), 300) if early else len(data))
        match what:
            case "set":
                data[at : at + len(piece)] = piece
            case "insert":
                data[at:at] = piece
            case "delete":
                del data[at : at + len(piece)]
            case "end":
                del data[max(at, 16) :]
    try:
        image = files.decode(mended(bytes(data)) if kind.startswith("png") else bytes(data), limits=SMALL)
    except LichenError:
        return
    assert image.pixels.shape == (image.height, image.width, image.channels)
