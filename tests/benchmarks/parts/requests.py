"""From the bytes of a file that arrive to those that leave.

One client on this machine sends a picture of 12 megapixels in each format, asks for a Gaussian blur (sigma 2) and gets
the same format back, over a connection that is kept. Stages are those that the service tells in `Server-Timing`;
`socket` is what the client waited beyond their total: sending, receiving and the time between. Below, what each
library takes to read and write the same files.
"""

from __future__ import annotations

import compileall
import contextlib
import importlib
import io
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenImageIO as oiio
import serving
from measuring import Copies, Turns, available, quick
from PIL import Image as Pillow
from sections import Section, bars, lines, table

import lichen
import lichen_service
from lichen.files import FORMATS, decode, encode, probe
from lichen.image import Image, Space, Storage
from lichen.memory import Array

TITLE = "Whole requests"
WIDTH, HEIGHT = (800, 600) if quick() else (4000, 3000)
BLUR = "/v1/operations/gaussian?sigma=2"
STAGES = ("queue", "decode", "plan", "upload", "kernel", "download", "encode", "other", "socket")
FILES = {
    "JPEG, quality 90": ("jpeg", Storage.UINT8),
    "PNG, 16 bits": ("png", Storage.UINT16),
    "EXR, half": ("exr", Storage.FLOAT16),
    "NPY, float32": ("npy", Storage.FLOAT32),
}
OPENCV = {
    "jpeg": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 90, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x111111]),
    "png": (".png", []),
}
REPEATS = 7
CLIENTS = (1, 2, 4, 8, 16, 32)
SECONDS = 0.2 if quick() else 3.0


def photo(width: int = WIDTH, height: int = HEIGHT) -> Array:
    """The sample photograph enlarged, with the noise of a sensor, so that it packs as photographs do; in [0, 1]."""
    path = Path(__file__).resolve().parents[3] / "docs" / "samples" / "photo.jpg"
    small = decode(path.read_bytes())
    large = lichen.run("resize", small, width=width, height=height, method="bicubic").image.pixels
    grain = np.random.default_rng(6).standard_normal(large.shape, dtype=np.float32) * np.float32(1.5 / 255)
    return np.clip(large + grain, 0, 1)


def as_image(pixels: Array, format: str, storage: Storage) -> Image:
    space = {"exr": Space.LINEAR, "npy": Space.DATA}.get(format, Space.SRGB)
    return Image(pixels, space, storage=storage)


def files(pixels: Array) -> dict[str, bytes]:
    return {
        name: bytes(encode(as_image(pixels, format, storage), format, storage=storage).data)
        for name, (format, storage) in FILES.items()
    }


def sections(tell: Callable[[str], None]) -> list[Section]:
    pixels = photo()
    packed = files(pixels)
    with serving.lichen() as server:
        found = [*stages(server, packed, tell), crowd(server, pixels, tell)]
    return [*found, *codecs(pixels, packed, tell), cold(tell)]


# ------------------------------------------------------------------------------------------------------------- stages


def stages(server: serving.Server, packed: Mapping[str, bytes], tell: Callable[[str], None]) -> list[Section]:
    shown: dict[str, dict[str, float]] = {}
    rows = []
    for name, (format, _) in FILES.items():
        path = f"{BLUR}&format={format}"
        media = FORMATS[format].media_types[0]
        server.ask(path, packed[name], Content_Type=media)
        server.forget()
        taken = [split(server.ask(path, packed[name], Content_Type=media)) for _ in range(REPEATS)]
        middle = sorted(taken, key=lambda each: sum(each.values()))[REPEATS // 2]
        shown[name] = middle
        whole = sum(middle.values())
        rows.append([
            name, f"{len(packed[name]) / 1e6:.1f}", *(f"{middle.get(each, 0.0):.1f}" for each in STAGES),
            f"{whole:.0f}", f"{server.peak / 2**20:.0f}",
        ])  # fmt: skip
        tell(f"{name}: {whole:.0f} ms, " + ", ".join(f"{key} {value:.0f}" for key, value in middle.items()))
    text = (
        f"Milliseconds of the median of {REPEATS} requests, {WIDTH} x {HEIGHT} RGB. Memory is the most that the "
        "service's processes held meanwhile, each counted by itself, with all libraries and kernels."
    )
    title = "Where the milliseconds go"
    return [
        table(title, ["file", "MB", *STAGES, "all", "memory, MiB"], rows, text),
        bars("stages", f"A blur of 12 megapixels over HTTP: {title.lower()}", "ms", STAGES, shown),
    ]


def split(answer: serving.Answer) -> dict[str, float]:
    """Milliseconds by stage, which add up to what the client waited."""
    entries = (each.split(";dur=") for each in answer.headers["server-timing"].split(", "))
    told = {name: float(value) for name, value in entries}
    total = told.pop("total")
    known = {name: value for name, value in told.items() if name in STAGES and "." not in name}
    known["other"] = max(total - sum(known.values()), 0.0)
    known["socket"] = max(answer.seconds * 1e3 - total, 0.0)
    return known


def crowd(server: serving.Server, pixels: Array, tell: Callable[[str], None]) -> Section:
    """Requests a second and how long one waits, by the number of clients."""
    small = np.ascontiguousarray(pixels[:1024, :1024])
    body = bytes(encode(as_image(small, "jpeg", Storage.UINT8), "jpeg").data)
    rate, wait, worst = [], [], []
    for clients in CLIENTS:
        taken, seconds = serving.together(
            lambda: server.ask(f"{BLUR}&format=jpeg", body, Content_Type="image/jpeg"), clients, SECONDS
        )
        rate.append((clients, len(taken) / seconds))
        wait.append((clients, statistics.median(taken) * 1e3))
        worst.append((clients, float(np.quantile(taken, 0.95)) * 1e3))
        tell(f"{clients} clients: {rate[-1][1]:.1f}/s, {wait[-1][1]:.0f} ms")
    most = max(each for _, each in rate)
    text = (
        f"Each client asks again as soon as it has its answer: a blur of 1024 x 1024 pixels, JPEG there and back. One "
        f"client gets {rate[0][1]:.0f} answers a second; the most is {most:.0f}, with {rate[-1][0]} clients it is "
        f"{rate[-1][1]:.0f}. Past what the processors can do, waiting grows with the number of clients, and none is "
        "refused."
    )
    series = {"answers a second": rate, "median wait, ms": wait, "19 of 20 wait less, ms": worst}
    return lines("crowd", "Clients at the same time", "clients", "answers a second; ms", series, text)


# ------------------------------------------------------------------------------------------------------------- codecs


def stored(data: bytes) -> Array:
    """By ours: the samples as they are in the file."""
    view = memoryview(data)
    header = probe(view)
    return FORMATS[header.format].samples(view, header)


def by_oiio(path: Path, sample: str) -> Array:
    reader = oiio.ImageInput.open(str(path))
    try:
        return np.asarray(reader.read_image(sample))
    finally:
        reader.close()


def to_oiio(path: Path, samples: Array, sample: Any, **attributes: Any) -> None:
    spec = oiio.ImageSpec(samples.shape[1], samples.shape[0], samples.shape[2], sample)
    for name, value in attributes.items():
        spec.attribute(name, value)
    writer = oiio.ImageOutput.create(str(path))
    if not (writer.open(str(path), spec) and writer.write_image(samples)):
        raise RuntimeError(writer.geterror())
    writer.close()


def codecs(pixels: Array, packed: Mapping[str, bytes], tell: Callable[[str], None]) -> list[Section]:
    """Each library reads the same file to the samples that are in it and writes the same samples."""
    oiio.attribute("threads", len(available()))
    turns = Turns(Copies(len(available())), rounds=5, longest=5.0)
    rows: list[list[Any]] = []
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as name:
        for label, (format, storage) in FILES.items():
            given = as_image(pixels, format, storage)
            readers, writers = sides(format, storage, given, packed[label], Path(name))
            expected = stored(packed[label])
            for way, runs in (("read", readers), ("write", writers)):
                taken = turns(runs)
                for library, each in taken.items():
                    if way == "read":
                        apart = np.abs(runs[library]().astype(np.float64) - expected).max()
                        said = "the same" if apart == 0 else f"up to {apart:.3g} apart"
                    else:
                        said = f"{len(runs[library]()) / 1e6:.1f} MB"
                    rows.append([label, way, library, f"{each.median * 1e3:.0f}", said])
                    tell(f"{label}, {way}, {library}: {each.median * 1e3:.0f} ms, {said}")
    text = (
        "From bytes to stored samples and back, in memory (OpenImageIO's Python module opens paths alone: a file "
        "system in memory). What the service uses is marked with a star; it adds the checks of the header and of every "
        "checksum."
    )
    head = ["file", "way", "library", "ms", "samples; size"]
    return [table("Libraries that read and write", head, rows, text)]


def sides(
    format: str, storage: Storage, given: Image, data: bytes, folder: Path
) -> tuple[dict[str, Callable[[], Any]], dict[str, Callable[[], Any]]]:
    """Readers and writers by library; a star marks ours."""
    samples = stored(data)
    path, made = folder / f"in.{format}", folder / f"out.{format}"
    path.write_bytes(data)
    star = {"jpeg": "simplejpeg (libjpeg-turbo) *", "png": "OpenImageIO *", "exr": "OpenImageIO *", "npy": "NumPy *"}
    written = {"jpeg": star["jpeg"], "png": "ISA-L, bands in parallel *", "exr": "ISA-L, blocks in parallel *"}
    readers: dict[str, Callable[[], Any]] = {star[format]: lambda: stored(data)}
    writers: dict[str, Callable[[], Any]] = {
        written.get(format, star["npy"]): lambda: FORMATS[format].write(
            samples, given, 90 if format == "jpeg" else None
        )
    }
    raw = np.frombuffer(data, np.uint8)
    if format in OPENCV:
        ending, options = OPENCV[format]
        swapped = np.ascontiguousarray(samples[..., ::-1])
        readers["OpenCV"] = lambda: cv2.imdecode(raw, cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR_RGB)
        writers["OpenCV"] = lambda: cv2.imencode(ending, swapped, options)[1]
    if format == "jpeg":
        readers["Pillow"] = lambda: np.asarray(Pillow.open(io.BytesIO(data)))
        writers["Pillow"] = lambda: by_pillow(samples)
    if format == "exr":
        with contextlib.suppress(ImportError):
            openexr = importlib.import_module("OpenEXR")
            readers["OpenEXR"] = lambda: openexr.File(str(path)).channels()["RGB"].pixels
    if format != "npy":
        kind = {"jpeg": ("uint8", oiio.UINT8), "png": ("uint16", oiio.UINT16), "exr": ("half", oiio.HALF)}[format]
        about = {"jpeg": {"Compression": "jpeg:90", "jpeg:subsampling": "4:4:4"}, "exr": {"compression": "zip"}}
        if format != "exr" and format != "png":
            readers["OpenImageIO"] = lambda: by_oiio(path, kind[0])

        def to_bytes() -> bytes:
            to_oiio(made, samples, kind[1], **about.get(format, {}))
            return made.read_bytes()

        writers["OpenImageIO"] = to_bytes
    return readers, writers


def by_pillow(samples: Array) -> bytes:
    out = io.BytesIO()
    Pillow.fromarray(samples).save(out, "jpeg", quality=90, subsampling=0)
    return out.getvalue()


# --------------------------------------------------------------------------------------------------------- cold start


def cold(tell: Callable[[str], None]) -> Section:
    """From the start of the command to the first answer, Python and kernels compiled before; the second of two runs at
    least."""
    for package in (lichen, lichen_service):  # as an installation does: sources that were changed since cost 2 ms each
        compileall.compile_dir(Path(str(package.__file__)).parent, quiet=2)
    body = bytes(encode(as_image(photo(512, 384), "jpeg", Storage.UINT8), "jpeg").data)
    taken = []
    command = [sys.executable, "-m", "lichen_service", "--cache", "0"]
    for _ in range(2 if quick() else 4):
        with tempfile.TemporaryDirectory() as data:
            began = time.perf_counter()
            with serving.started(
                "Lichen",
                lambda port: [*command, "--port", str(port)],
                "/livez",
                LICHEN_DATA=data,
                LICHEN_CALIBRATE="off",
            ) as server:
                alive = time.perf_counter() - began
                server.ask(f"{BLUR}&format=jpeg", body, Content_Type="image/jpeg")
                taken.append((alive, time.perf_counter() - began))
    alive, first = (statistics.median(each) for each in zip(*taken[1:], strict=True))
    importing = [sys.executable, "-X", "importtime", "-c", "import lichen_service.app"]
    told = subprocess.run(importing, check=True, capture_output=True, text=True).stderr.splitlines()[-1]
    text = (
        f"{first:.2f} s from the start of the command to the first picture, Python and kernels compiled earlier; "
        f"the service listens after {alive:.2f} s. Importing takes {int(told.split('|')[1]) / 1e6:.2f} s of it. Other "
        "kernels are read from the cache in the background."
    )
    tell(text)
    return table("Cold start", [], [], text)
