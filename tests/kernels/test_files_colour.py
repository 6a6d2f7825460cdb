"""Colour: what a file says of its numbers is understood, or carried along with a note, and written back honestly."""

from __future__ import annotations

import io
import struct
import zlib
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pictures
from PIL import ImageCms

from lichen import files
from lichen.errors import TooLarge
from lichen.files import icc
from lichen.image import Alpha, Image, Space, Storage

PIXELS = np.linspace(0, 1, 5 * 7 * 3, dtype=np.float32).reshape(5, 7, 3)
CAN_HOLD_PROFILES = ("png", "jpeg", "webp", "tiff")


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png_with(*chunks: bytes, channels: int = 3) -> bytes:
    plain = files.encode(Image(PIXELS[:, :, :channels], Space.DATA, storage=Storage.UINT8), "png").data
    return plain[:33] + b"".join(chunks) + plain[33:]


def foreign_profile() -> bytes:
    """A well-formed profile that is not sRGB: our own with the primaries exchanged."""
    profile = bytearray(icc.make(Space.SRGB, grey=False))
    for i in range(struct.unpack_from(">I", profile, 128)[0]):
        at = 132 + 12 * i
        exchanged = {b"rXYZ": b"gXYZ", b"gXYZ": b"rXYZ"}
        name = bytes(profile[at : at + 4])
        profile[at : at + 4] = exchanged.get(name, name)
    return bytes(profile)


# ----------------------------------------------------------------------------------------------------- profiles


def test_littlecms_agrees_with_the_profiles_we_make() -> None:
    for space, expected in ((Space.SRGB, 128), (Space.LINEAR, 55)):  # 0.5 sRGB is 0.2140 linear, 55 of 255
        for grey, mode in ((False, "RGB"), (True, "L")):
            profile = ImageCms.ImageCmsProfile(io.BytesIO(icc.make(space, grey=grey)))
            picture = Pictures.new(mode, (1, 1), (expected,) * 3 if mode == "RGB" else expected)
            srgb = ImageCms.profileToProfile(picture, profile, ImageCms.createProfile("sRGB"), outputMode="RGB")
            assert srgb is not None
            assert np.abs(np.asarray(srgb).astype(int) - 128).max() <= 1, (space, grey)


def test_srgb_profiles_of_others_are_known_by_their_numbers() -> None:
    assert icc.space(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()) is Space.SRGB
    assert icc.space(icc.make(Space.LINEAR, grey=False)) is Space.LINEAR
    assert icc.space(icc.make(Space.SRGB, grey=True)) is Space.SRGB
    assert icc.space(foreign_profile()) is None
    assert icc.description(foreign_profile()) == "Lichen sRGB"  # a name proves nothing


@pytest.mark.parametrize("name", CAN_HOLD_PROFILES)
@pytest.mark.parametrize("size", [0, 200_000])
def test_a_foreign_profile_is_carried_byte_for_byte(name: str, size: int) -> None:
    profile = foreign_profile() + np.random.default_rng(3).bytes(size)  # the long one takes several JPEG segments
    source = files.decode(png_with(chunk(b"iCCP", b"x\0\0" + zlib.compress(profile))))
    assert source.space is Space.SRGB
    assert "not converted" in source.metadata["colour_note"]
    data = files.encode(source, name).data
    assert Pictures.open(io.BytesIO(data)).info["icc_profile"] == profile
    back = files.decode(data)
    assert back.metadata["icc"] == profile
    assert back.metadata["colour_note"] == source.metadata["colour_note"]


@pytest.mark.parametrize("name", CAN_HOLD_PROFILES)
@pytest.mark.parametrize("grey", [False, True])
def test_a_linear_picture_says_so(name: str, grey: bool) -> None:
    image = Image(np.ascontiguousarray(PIXELS[:, :, :1] if grey else PIXELS), Space.LINEAR, storage=Storage.UINT8)
    back = files.decode(files.encode(image, name).data)
    assert back.space is Space.LINEAR
    srgb = files.decode(files.encode(back.replace(space=Space.SRGB), name).data)
    assert srgb.space is Space.SRGB, "the profile of other numbers was written"


def test_pillow_writes_profiles_that_we_read() -> None:
    profile = foreign_profile()
    picture = Pictures.fromarray((PIXELS * 255).astype(np.uint8))
    for kind in CAN_HOLD_PROFILES:
        target = io.BytesIO()
        picture.save(target, kind, icc_profile=profile)
        assert files.decode(target.getvalue()).metadata["icc"] == profile


def test_a_profile_of_other_channels_is_dropped() -> None:
    grey = icc.make(Space.LINEAR, grey=True)
    for profile in (grey, b"nonsense", b""):
        image = files.decode(png_with(chunk(b"iCCP", b"x\0\0" + zlib.compress(profile))))
        assert image.space is Space.SRGB
        assert "dropped" in image.metadata["colour_note"]
        assert "icc" not in image.metadata


def test_a_profile_that_inflates_without_end_is_refused() -> None:
    bomb = zlib.compress(bytes(50_000_000), 9)
    assert len(bomb) < 60_000
    with pytest.raises(TooLarge) as refused:
        files.probe(png_with(chunk(b"iCCP", b"x\0\0" + bomb)))
    assert refused.value.limit == icc.LARGEST


def test_garbled_profiles_never_break() -> None:
    rng = np.random.default_rng(5)
    profile = icc.make(Space.SRGB, grey=False)
    for _ in range(2000):
        garbled = bytearray(profile[: rng.integers(132, len(profile) + 1)])
        for _ in range(rng.integers(1, 8)):
            garbled[rng.integers(128, len(garbled))] = rng.integers(0, 256)
        with np.errstate(all="ignore"):
            icc.read(bytes(garbled), 3, Space.SRGB)


# ------------------------------------------------------------------------------------------------ chunks of PNG


BT709 = chunk(b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000))
ADOBE = chunk(b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 21000, 71000, 15000, 6000))


def gamma(value: int) -> bytes:
    return chunk(b"gAMA", struct.pack(">I", value))


@pytest.mark.parametrize(
    ("chunks", "space", "noted"),
    [
        ((), Space.SRGB, False),
        ((gamma(45455),), Space.SRGB, False),
        ((gamma(45455), BT709), Space.SRGB, False),
        ((gamma(45455), ADOBE), Space.SRGB, True),
        ((gamma(55556),), Space.SRGB, True),
        ((gamma(0),), Space.SRGB, True),
        ((gamma(100000),), Space.LINEAR, False),
        ((gamma(100000), BT709), Space.LINEAR, False),
        ((gamma(100000), ADOBE), Space.LINEAR, True),
        ((chunk(b"sRGB", b"\0"), gamma(100000)), Space.SRGB, False),
        ((chunk(b"cICP", bytes([1, 13, 0, 1])), gamma(100000)), Space.SRGB, False),
        ((chunk(b"cICP", bytes([1, 8, 0, 1])),), Space.LINEAR, False),
        ((chunk(b"cICP", bytes([9, 16, 0, 1])),), Space.SRGB, True),
        ((chunk(b"iCCP", b"x\0\0" + zlib.compress(icc.make(Space.LINEAR, grey=False))),), Space.LINEAR, False),
    ],
)
def test_png_colour_chunks(chunks: tuple[bytes, ...], space: Space, noted: bool) -> None:
    image = files.decode(png_with(*chunks))
    assert image.space is space
    assert ("colour_note" in image.metadata) is noted
    np.testing.assert_array_equal(image.pixels, files.decode(png_with()).pixels)


def test_png_tags() -> None:
    def encoded(space: Space) -> bytes:
        return files.encode(Image(PIXELS, space, storage=Storage.UINT8), "png").data

    assert b"sRGB" in encoded(Space.SRGB)
    assert b"gAMA" not in encoded(Space.SRGB)
    assert Pictures.open(io.BytesIO(encoded(Space.LINEAR))).info["gamma"] == 1.0
    assert not any(name in encoded(Space.DATA) for name in (b"sRGB", b"gAMA", b"iCCP", b"cICP"))


# --------------------------------------------------------------------------------------------------------- EXR


@pytest.mark.parametrize("space", list(Space))
@pytest.mark.parametrize("alpha", [Alpha.NONE, Alpha.ASSOCIATED])
def test_exr_names_its_space(space: Space, alpha: Alpha) -> None:
    if space is Space.DATA and alpha is not Alpha.NONE:
        return  # data has no coverage
    pixels = np.ones((3, 4, 4 if alpha is Alpha.ASSOCIATED else 3), np.float32)
    back = files.decode(files.encode(Image(pixels, space, alpha), "exr").data)
    assert (back.space, back.alpha) == (space, alpha)
    assert "colour_note" not in back.metadata


def test_an_unknown_exr_space_is_noted() -> None:
    data = files.encode(Image(PIXELS, Space.LINEAR), "exr").data
    other = data.replace(b"lin_rec709_scene", b"lin_ap1_scene\0\0\0")
    image = files.decode(other)
    assert image.space is Space.LINEAR
    assert "lin_ap1_scene" in image.metadata["colour_note"]


def test_exif_is_left_behind() -> None:
    exif = Pictures.Exif()
    exif[274], exif[0x010E] = 6, "a private place"
    target = io.BytesIO()
    Pictures.fromarray((PIXELS * 255).astype(np.uint8)).save(target, "jpeg", exif=exif)
    assert b"a private place" in target.getvalue()
    image = files.decode(target.getvalue())
    assert (image.width, image.height) == (5, 7)
    for name in CAN_HOLD_PROFILES:
        data: Any = files.encode(image, name).data
        assert b"a private place" not in data
        assert files.probe(data).orientation == 1
