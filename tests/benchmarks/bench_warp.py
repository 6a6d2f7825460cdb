"""The warp family beside OpenCV, OpenImageIO and libvips.

Run: python tests/benchmarks/bench_warp.py

Errors are the largest distance from truth for resizing; for the perspective by bicubic interpolation, that of the
coordinate, px, found on a ramp. OpenImageIO's filtered warp is only ever given a benign map: with a vanishing line in
the image it does not end.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable

import cv2
import numpy as np
import OpenImageIO as oiio
from interleaved import Row, medians, table

import lichen
from lichen.accuracy.metrics import difference
from lichen.catalogue import operations
from lichen.image import Image, as_image

SIZE = 2048
MATRIX = np.array([[1.02, 0.08, -60.0], [-0.05, 0.98, 40.0], [2e-5, 3e-5, 1.0]])
HALF = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
CENTRED = np.linalg.inv(HALF) @ MATRIX @ HALF
"""The same map where the centres of pixels are whole numbers."""


def noise(size: int, channels: int = 4) -> Image:
    return as_image(np.random.default_rng(1).random((size, size, channels), dtype=np.float32))


def teeth() -> np.ndarray:
    """Ramps of slope 1 from -32 to 32, one beside the other: values so small that their rounding is no shift."""
    tooth = (np.arange(SIZE) % 64 - 31.5).astype(np.float32)
    return np.broadcast_to(tooth, (SIZE, SIZE)).copy()


def off_by(made: np.ndarray) -> float:
    """Of the warped ramps: the largest error of the x coordinate, px, well inside each. OpenCV's cubic kernel
    (a = -3/4) bends a ramp, which counts here as if it had moved it."""
    inverse = np.linalg.inv(MATRIX)
    u, v = np.meshgrid(np.arange(SIZE) + 0.5, np.arange(SIZE) + 0.5)
    x, y, w = np.einsum("ij,jyx->iyx", inverse, np.stack([u, v, np.ones_like(u)]))
    x, y = x / w, y / w
    tooth = x % 64
    inside = (x > 8) & (x < SIZE - 8) & (y > 8) & (y < SIZE - 8) & (tooth > 4) & (tooth < 60)
    return float(np.abs(made.astype(np.float64) - (tooth - 32))[inside].max())


def perspective() -> list[Row]:
    image, target = noise(SIZE), np.empty((SIZE, SIZE, 4), np.float32)
    ramp = teeth()
    rows = []
    for method, flag, wanted in (("bilinear", cv2.INTER_LINEAR, None), ("bicubic", cv2.INTER_CUBIC, 0.61)):

        def peer(source: np.ndarray, out: np.ndarray | None = None, flag: int = flag) -> np.ndarray:
            return cv2.warpPerspective(source, CENTRED, (SIZE, SIZE), dst=out, flags=flag)

        def ours(source: Image | np.ndarray, method: str = method) -> lichen.Result:
            return lichen.run("homography", source, matrix=MATRIX.tolist(), method=method)

        def timed(run: Callable[..., object] = ours) -> object:
            return run(image)

        def theirs(run: Callable[..., object] = peer) -> object:
            return run(image.pixels, target)

        ours_ms, peer_ms = medians([timed, theirs])
        found, other = off_by(ours(ramp).image.pixels[..., 0]), off_by(peer(ramp))
        work = f"perspective, {method}, RGBA"
        rows.append(Row(work, method, ours_ms, found, "cv2.warpPerspective", peer_ms, other, wanted))
    return rows


def filtered() -> list[Row]:
    """Both with their own filters: there is no error of one by the other's definition."""
    image = noise(SIZE)
    buffer, matrix = oiio.ImageBuf(image.pixels), [float(each) for each in MATRIX.T.reshape(-1)]
    rows = []
    for samples in (1.0, 2.0):

        def ours(samples: float = samples) -> object:
            return lichen.run("homography", image, matrix=MATRIX.tolist(), method="ewa", samples=samples)

        def peer() -> object:
            return oiio.ImageBufAlgo.warp(buffer, matrix, "lanczos3", 0.0)

        ours_ms, peer_ms = medians([ours, peer], rounds=3)
        work = f"perspective, ewa of {samples:g}, RGBA"
        rows.append(Row(work, "ewa", ours_ms, float("nan"), "OpenImageIO lanczos3", peer_ms, float("nan"), 0.05))
    return rows


def resize() -> list[Row]:
    image, side = noise(4096), 1024
    target = np.empty((side, side, 4), np.float32)
    operation = operations()["resize"]
    truth = operation.evaluate_truth({"image": image}, operation.validate({"width": side}))

    def area() -> np.ndarray:
        return cv2.resize(image.pixels, (side, side), dst=target, interpolation=cv2.INTER_AREA)

    def lanczos4() -> np.ndarray:
        return cv2.resize(image.pixels, (side, side), dst=target, interpolation=cv2.INTER_LANCZOS4)

    peers: list[tuple[str, str, Callable[[], np.ndarray], float | None]] = [
        ("box", "cv2 INTER_AREA", area, None),
        ("lanczos3", "cv2 INTER_LANCZOS4", lanczos4, 1.0),
    ]
    try:
        vips = importlib.import_module("pyvips")
    except ImportError:
        print("libvips is not installed: `pip install pyvips-binary pyvips` for its row")
    else:
        whole = vips.Image.new_from_array(image.pixels)
        peers.append(("lanczos3", "libvips", lambda: whole.resize(side / 4096, kernel="lanczos3").numpy(), 1.0))
    rows = []
    for method, name, peer, wanted in peers:

        def ours(method: str = method) -> lichen.Result:
            return lichen.run("resize", image, width=side, method=method)

        ours_ms, peer_ms = medians([ours, peer])
        found, other = (difference(each, truth).largest for each in (ours().image.pixels, peer()))
        rows.append(Row(f"4096 to 1024, {method}, RGBA", method, ours_ms, found, name, peer_ms, other, wanted))
    return rows


def run() -> list[Row]:
    return [*perspective(), *filtered(), *resize()]


if __name__ == "__main__":
    print(table("warp, float32", run()))
