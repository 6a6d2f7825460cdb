"""Transfer functions against OpenImageIO and NumPy: milliseconds and errors of both sides, interleaved in one process.

2048 x 2048 RGB float32, outputs preallocated where a side lets its caller do so. The error is the largest difference
from float64, relative to the result, for results above 1e-3. Run as a script to print the table.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import OpenImageIO as oiio

import lichen
from lichen.image import Image
from lichen.memory import Array, aligned
from lichen.opencl.device import default_device
from lichen.operations.tone.transfer import Parameters, transfer

SIZE = 2048
ROUNDS = 15

Job = Callable[[], Array]


@dataclass(frozen=True)
class Row:
    """One comparison; `ours_ms` and `peer_ms` are medians, `ratio` the median of the rounds' ratios."""

    name: str
    ours_ms: float
    peer_ms: float
    ratio: float
    our_error: float
    peer_error: float


def numpy_decode(x: Array, spare: list[Array]) -> Array:
    """sRGB decoding as one writes it in NumPy, every step into an array that exists."""
    power, toe, mask = spare
    np.add(x, np.float32(0.055), out=power)
    np.divide(power, np.float32(1.055), out=power)
    np.power(power, np.float32(2.4), out=power)
    np.divide(x, np.float32(12.92), out=toe)
    np.less_equal(x, np.float32(0.04045), out=mask)
    np.copyto(power, toe, where=mask)
    return power


def plain_decode(x: Array) -> Array:
    """The same as one types it."""
    decoded: Array = np.where(
        x <= np.float32(0.04045),
        x / np.float32(12.92),
        ((x + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4),
    )
    return decoded


def oiio_convert(x: Array, source: str, target: str) -> Job:
    """OpenImageIO's colorconvert between two buffers."""
    height, width, channels = x.shape
    before = oiio.ImageBuf(x)
    after = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, oiio.FLOAT))

    def convert() -> Array:
        if not oiio.ImageBufAlgo.colorconvert(after, before, source, target):
            raise RuntimeError(after.geterror())
        return np.empty(0)

    def pixels() -> Array:
        convert()
        return np.asarray(after.get_pixels(oiio.FLOAT))

    convert.pixels = pixels  # type: ignore[attr-defined]
    return convert


def worst(got: Array, expected: Array) -> float:
    bright = expected > 1e-3
    return float(np.abs(got[bright] / expected[bright] - 1).max())


def compare(name: str, ours: Job, peer: Job, expected: Array) -> Row:
    """Time both sides in turn and measure both errors."""
    our_error = worst(ours(), expected)
    peer_error = worst(getattr(peer, "pixels", peer)(), expected)
    times: list[tuple[float, float]] = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        ours()
        middle = time.perf_counter()
        peer()
        times.append((middle - start, time.perf_counter() - middle))
    mine, theirs = (1e3 * statistics.median(side) for side in zip(*times, strict=True))
    return Row(name, mine, theirs, statistics.median(a / b for a, b in times), our_error, peer_error)


def run() -> list[Row]:
    """All comparisons."""
    device = default_device()
    picture = Image(aligned(np.random.default_rng(1).random((SIZE, SIZE, 3), dtype=np.float32)))
    inputs, p = {"image": picture}, Parameters()
    expected = transfer.evaluate_truth(inputs, p)
    x = picture.pixels
    spare = [np.empty_like(x), np.empty_like(x), np.empty(x.shape, dtype=bool)]
    exact, table = (transfer.methods[name].implementation for name in ("exact", "table"))

    def in_numpy() -> Array:
        return numpy_decode(x, spare)

    def typed() -> Array:
        return plain_decode(x)

    by_oiio = oiio_convert(x, "srgb_rec709_scene", "lin_rec709_scene")
    rows = []
    if device is not None:
        rows += [
            compare("sRGB decode, kernel / OIIO", lambda: exact.opencl(device, inputs, p, 0), by_oiio, expected),
            compare("sRGB decode, kernel / NumPy **", lambda: exact.opencl(device, inputs, p, 0), typed, expected),
            compare(
                "sRGB decode, kernel / NumPy, in place", lambda: exact.opencl(device, inputs, p, 0), in_numpy, expected
            ),
            compare(
                "sRGB decode, table 4096 / NumPy, in place",
                lambda: table.opencl(device, inputs, p, 4096),
                in_numpy,
                expected,
            ),
            compare(
                "sRGB decode, lichen.run / OIIO",
                lambda: lichen.run("transfer", picture, method="exact", device="opencl").image.pixels,
                by_oiio,
                expected,
            ),
        ]
        for curve, way in (
            ("srgb", "encode"),
            ("pq", "decode"),
            ("pq", "encode"),
            ("hlg", "decode"),
            ("hlg", "encode"),
        ):
            rows.append(ladder(curve, way, picture))
    rows.append(
        compare("sRGB decode, our NumPy / NumPy, in place", lambda: exact.numpy(inputs, p, 0), in_numpy, expected)
    )
    return rows


def ladder(curve: str, way: str, picture: Image) -> Row:
    """Our exact method against our table, on OpenCL."""
    device = default_device()
    assert device is not None
    inputs, p = {"image": picture}, Parameters(curve=curve, direction=way)  # type: ignore[arg-type]
    exact, table = (transfer.methods[name].implementation for name in ("exact", "table"))
    return compare(
        f"{curve} {way}, exact / table 4096",
        lambda: exact.opencl(device, inputs, p, 0),
        lambda: table.opencl(device, inputs, p, 4096),
        transfer.evaluate_truth(inputs, p),
    )


def main() -> None:
    print("| comparison | ours, ms | peer, ms | ratio | our error | peer's error |")
    print("|---|---|---|---|---|---|")
    for row in run():
        print(
            f"| {row.name} | {row.ours_ms:.1f} | {row.peer_ms:.1f} | {row.ratio:.3f} "
            f"| {row.our_error:.2g} | {row.peer_error:.2g} |"
        )


if __name__ == "__main__":
    main()
