"""Decoders: they give what decoding here gives, and what kills one costs the request that brought it, nothing else."""

from __future__ import annotations

import base64
import os
import signal
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from lichen.errors import InvalidRequest, LichenError, TooLarge, UnreadableImage, UnsupportedFormat
from lichen.files import FORMATS, Limits, decode, encode
from lichen.image import Alpha, Image, Space, Storage
from lichen_service.app import Service
from lichen_service.decoding import messages, processes
from lichen_service.decoding.pool import Decoders
from lichen_service.settings import Settings

from ..conftest import Caller, picture, pointers, problem_of, read_json

PATIENCE = 120.0
LIMITS = Limits()


def until(holds: Callable[[], bool]) -> None:
    ends = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < ends, "it did not happen"
        time.sleep(0.01)


@pytest.fixture(scope="module")
def pool() -> Iterator[Decoders]:
    begun = processes.begin(1 << 30)
    decoders = Decoders(1, 1 << 30, PATIENCE, begun=[begun])
    decoders.start()
    until(lambda: decoders.standing == 1)
    assert begun.process.poll() is None, "it is the one that stands"
    yield decoders
    decoders.end()


def files() -> Iterator[tuple[str, bytes]]:
    for format in FORMATS.values():
        for storage in format.storages:
            for channels in (1, 3, 4):
                pixels = picture(9, 7, channels).pixels
                alpha = Alpha.NONE if channels != 4 else format.association or Alpha.ASSOCIATED
                image = Image(pixels, format.natural_space(storage), alpha, storage)
                try:
                    yield f"{format.name}-{storage}-{channels}", bytes(encode(image, format.name, storage=storage).data)
                except LichenError:
                    continue  # the format does not hold this many channels


@pytest.mark.parametrize(("data"), [data for _, data in files()], ids=[name for name, _ in files()])
def test_a_decoder_gives_what_decoding_here_gives(pool: Decoders, data: bytes) -> None:
    here, there = decode(data), pool.decode(data, limits=LIMITS)
    assert there.pixels.dtype == here.pixels.dtype
    assert np.array_equal(there.pixels, here.pixels)
    assert (there.space, there.alpha, there.storage, there.metadata) == (
        here.space,
        here.alpha,
        here.storage,
        here.metadata,
    )


def test_pictures_stay_when_their_decoder_decodes_others(pool: Decoders, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its memory is used again and again, and what is more than is kept of it is given back."""
    monkeypatch.setattr(messages, "KEPT", 4096)
    sizes = (9, 90, 5, 30)
    images = [picture(size, size, storage=Storage.FLOAT32) for size in sizes] + [picture(size, size) for size in sizes]
    images += [images[-1].replace(pixels=1 - images[-1].pixels), images[-1], images[-2], images[-1]]
    sent = [bytes(encode(image, "exr" if at < 4 else "jpeg").data) for at, image in enumerate(images)]
    decoded = [pool.decode(data, limits=LIMITS) for data in sent]
    for data, image in zip(sent, decoded, strict=True):
        assert np.array_equal(decode(data).pixels, image.pixels)


def test_flaws_come_back_as_they_are(pool: Decoders, png: bytes) -> None:
    with pytest.raises(TooLarge) as large:
        pool.decode(png, limits=Limits(pixels=10))
    assert (large.value.limit, large.value.actual) == (10, 16 * 12)
    for broken in (png[:-30], png[:60] + bytes(len(png) - 60), png[:20]):
        with pytest.raises(UnreadableImage) as found:
            pool.decode(broken, limits=LIMITS)
        with pytest.raises(UnreadableImage) as expected:
            decode(broken, limits=LIMITS)
        assert found.value.detail == expected.value.detail
    assert pool.died == 0


def test_a_process_that_was_begun_in_vain_is_replaced() -> None:
    pool = Decoders(1, 1 << 30, PATIENCE, begun=[processes.begin(1 << 30, "lichen_service.no_such_module")])
    data = encode(picture(), "png").data
    assert pool.decode(data, limits=LIMITS).width == picture().width
    assert pool.standing == 1
    pool.end()


def test_npy_needs_no_decoder() -> None:
    pool = Decoders(1, 1 << 30, PATIENCE)
    data = encode(Image(picture().pixels, Space.DATA, storage=Storage.FLOAT32), "npy").data
    assert np.array_equal(pool.decode(data, limits=LIMITS).pixels, picture().pixels)
    assert pool.standing == 0


def wind() -> bytes:
    """Two times of a wind on 3 x 4 places, in NetCDF."""
    file = netCDF4.Dataset("wind.nc", "w", memory=1 << 14)
    for name, size in (("time", 2), ("lat", 3), ("lon", 4)):
        file.createDimension(name, size)
    for name, sign in (("u", 1), ("v", -1)):
        file.createVariable(name, "f4", ("time", "lat", "lon"))[:] = sign * np.arange(1.0, 25.0).reshape(2, 3, 4)
    return bytes(file.close())


WIND = np.repeat(np.arange(13.0, 25.0).reshape(3, 4, 1)[::-1], 2, axis=2)
"""At the second time: v points down in pictures."""


def test_files_of_data_are_turned_into_npy(pool: Decoders, png: bytes) -> None:
    plain = pool.plain(wind(), select="time=1")
    assert np.array_equal(pool.decode(plain, limits=LIMITS).pixels, WIND)
    assert pool.plain(png) is png
    with pytest.raises(InvalidRequest, match="2 places"):
        pool.plain(wind(), select="time=2")
    with pytest.raises(UnreadableImage):
        pool.plain(wind()[:2000])
    with pytest.raises(UnsupportedFormat, match="none runs here"):
        Decoders(0, 1, 1).plain(wind())
    assert pool.died == 0


NAMING_ANOTHER_FILE = base64.b85decode(
    "c-rgqaB<`1lHy|K;9!7(|4?Af4B;C<#aEm>;N<V&62!z%!6byN5C*uI7#JBC*mxL#6l3XTs5U6S>^mb=z=DBnu-4xHKG+FB0~u8q7?_wC8KJIZV"
    "1d#Yd=UmlK?QjzUx7iKgF(C=$YKS$mYIuP185Qh*o6%Hp)TY=vlSKq96(<)Gs1ie6J;o27!bgdw4Tw!)iD6XmVk=Eg7`ios#^Wjl4SjY#Ny)e6fm"
    "E5VaUupl)`XhRPF^_VW`ZEKMVnTB})w"
)
"""HDF5 whose variables u and v, 3 x 4 float32, are 48 bytes of /etc/passwd; compressed. Made with h5py."""


def test_files_that_a_file_of_data_names_are_not_read(pool: Decoders) -> None:
    naming = zlib.decompress(NAMING_ANOTHER_FILE)
    assert decode(naming).pixels.any()  # who reads a file of their own reads what it names
    with pytest.raises(UnreadableImage):
        pool.plain(naming)
    assert np.array_equal(pool.decode(pool.plain(wind(), select="time=1"), limits=LIMITS).pixels, WIND)


def test_a_run_reads_what_is_selected(pool: Decoders, tmp_path: Path, settings: Settings, png: bytes) -> None:
    chosen = replace(settings, data=str(tmp_path))
    service = Service(chosen)
    service.decoders = service._running._decoders = pool
    call = Caller(service, chosen)
    run = "/v1/operations/vector?make=rotate&angle=0&format=npy&device=numpy"
    made = call("POST", f"{run}&select=time%3D1", wind(), {"content-type": "application/x-netcdf"})
    assert np.array_equal(decode(made.body).pixels, WIND)
    stored = read_json(call("PUT", "/v1/assets", wind()))
    assert (stored["media_type"], "width" in stored) == ("application/x-netcdf", False)
    by_name = call("GET", f"{run}&select=image.time%3D1&image={stored['id']}")
    assert by_name.headers["ETag"] == made.headers["ETag"]
    assert call("POST", run, wind()).headers["ETag"] != made.headers["ETag"]
    piped = call("POST", "/v1/pipelines?pipeline=vector:make=rotate,angle=0&format=npy&select=time%3D1", wind())
    assert np.array_equal(decode(piped.body).pixels, WIND)
    for select, data in (("time%3D7", wind()), ("time%3D1", png), ("time", wind())):
        problem = problem_of(call("POST", f"{run}&select={select}", data), 422, "invalid-request")
        assert pointers(problem) == {"/query/select"}


def test_an_idle_decoder_that_was_killed_is_replaced(pool: Decoders, png: bytes) -> None:
    pool.decode(png, limits=LIMITS)
    (decoder,) = pool._all
    os.kill(decoder.process.pid, signal.SIGKILL)
    until(lambda: decoder.process.poll() is not None)
    assert pool.decode(png, limits=LIMITS).width == 16
    assert pool.died == 0


CRASHING = """
import os, sys, time
from lichen_service.decoding import child
decode = child._decode
def dangerous(asked, descriptor, place):
    data = os.pread(descriptor, asked["count"], 0)
    if b"abort" in data:
        os.abort()
    if b"spin" in data:
        child._allow(0.0)
        while True:
            pass
    if b"killed" in data and not (b"once" in data and os.path.exists(__file__ + ".mark")):
        open(__file__ + ".mark", "w").close()
        os.kill(os.getpid(), 9)
    if b"sleep" in data:
        time.sleep(600)
    if b"lie" in data:
        return {"shape": [1 << 20, 1 << 20, 3], "dtype": "|u1"}
    if b"object" in data:
        return {"shape": [1, 1, 1], "dtype": "|O"}
    return decode(asked, descriptor, place)
child._decode = dangerous
sys.exit(child.main(*map(int, sys.argv[1:])))
"""


@pytest.fixture
def crashing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[float], Decoders]]:
    (tmp_path / "crashing.py").write_text(CRASHING)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    made: list[Decoders] = []

    def make(seconds: float = PATIENCE) -> Decoders:
        made.append(Decoders(1, 1 << 30, seconds, module="crashing"))
        return made[-1]

    yield make
    for each in made:
        each.end()


def test_what_kills_a_decoder_costs_one_image(crashing: Callable[..., Decoders], png: bytes) -> None:
    pool = crashing()
    for at, poison in enumerate((b"abort", b"spin"), start=1):
        with pytest.raises(UnreadableImage):
            pool.decode(png + poison, limits=LIMITS)
        assert pool.died == at
        assert pool.decode(png, limits=LIMITS).width == 16
    for poison in (b"lie", b"object"):
        with pytest.raises(UnreadableImage, match="promised"):
            pool.decode(png + poison, limits=LIMITS)
    assert pool.decode(png, limits=LIMITS).width == 16


def test_a_decoder_killed_from_outside_costs_nothing_unless_the_next_one_is_too(
    crashing: Callable[..., Decoders], png: bytes
) -> None:
    pool = crashing()
    assert pool.decode(png + b"killed once", limits=LIMITS).width == 16
    assert pool.died == 1
    with pytest.raises(UnreadableImage):
        pool.decode(png + b"killed", limits=LIMITS)
    assert pool.died == 3
    assert pool.decode(png, limits=LIMITS).width == 16


def test_what_takes_too_long_is_ended(crashing: Callable[..., Decoders], png: bytes) -> None:
    pool = crashing(1.0)
    pool.start()
    until(lambda: pool.standing == 1)
    with pytest.raises(UnreadableImage, match="too long"):
        pool.decode(png + b"sleep", limits=LIMITS)
    until(lambda: pool.standing == 1)


def test_a_decoder_may_not_take_more_memory_than_it_is_given() -> None:
    data = bytes(encode(picture(1500, 1500), "png").data)
    small = Decoders(1, 4 << 20, PATIENCE)
    try:
        with pytest.raises(LichenError) as refused:
            small.decode(data, limits=LIMITS)
        assert isinstance(refused.value, TooLarge | UnreadableImage)
        tiny = bytes(encode(picture(8, 8), "png").data)
        assert small.decode(tiny, limits=LIMITS).width == 8
    finally:
        small.end()


def test_a_request_whose_image_kills_a_decoder_is_a_422(
    crashing: Callable[..., Decoders], tmp_path: Path, settings: Settings, png: bytes
) -> None:
    chosen = replace(settings, data=str(tmp_path))
    service = Service(chosen)
    service.decoders = service._running._decoders = crashing()
    call = Caller(service, chosen)
    blur = "/v1/operations/gaussian?sigma=1&device=numpy"
    problem = problem_of(call("POST", blur, png + b"abort"), 422, "unreadable-image")
    assert problem["errors"][0]["pointer"] == "/inputs/image"
    assert call("POST", blur, png).status == 200


def test_decoders_are_replaced_after_many_images(png: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lichen_service.decoding.pool.USES", 2)
    pool = Decoders(1, 1 << 30, PATIENCE)
    try:
        for _ in range(2):
            pool.decode(png, limits=LIMITS)
        assert pool.died == 0
        until(lambda: {each.uses for each in pool._all} == {0})
    finally:
        pool.end()


def test_decoders_that_do_not_start_are_a_refusal(png: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    pool = Decoders(1, 1 << 30, 0.3, module="lichen_service.no_such_module")
    with pytest.raises(Exception, match="No decoder became free") as refused:
        pool.decode(png, limits=LIMITS)
    assert refused.value.status == 503  # type: ignore[attr-defined]
    pool.end()
