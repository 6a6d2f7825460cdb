"""Gaussian blur beside OpenCV, on a 2048 x 2048 RGBA float32 image, and where its two methods cross.

Run: python tests/benchmarks/bench_gaussian.py
"""

from __future__ import annotations

import cv2
import numpy as np
from interleaved import Row, medians, table

import lichen
from lichen.accuracy.metrics import difference
from lichen.image import as_image
from lichen.opencl.device import default_device
from lichen.operation import Facts
from lichen.operations.convolution.gaussian import Parameters, gaussian

WANTED = {5.0: 0.75, 50.0: 0.25}


def compare(sigma: float, size: int = 2048) -> list[Row]:
    """Ours at an error anyone can live with, and ours at the default, which is more accurate than OpenCV."""
    image = as_image(np.random.default_rng(1).random((size, size, 4), dtype=np.float32))
    target = np.empty_like(image.pixels)
    truth = gaussian.evaluate_truth({"image": image}, Parameters(sigma=sigma))

    def peer() -> np.ndarray:
        return cv2.GaussianBlur(image.pixels, (0, 0), sigma, dst=target, borderType=cv2.BORDER_REFLECT)

    peer_error = difference(peer(), truth).largest
    rows = []
    for asked in ({"max_error": 1e-3}, {}):

        def ours(asked: dict[str, float] = asked) -> lichen.Result:
            return lichen.run("gaussian", image, sigma=sigma, **asked)

        result = ours()
        ours_ms, peer_ms = medians([ours, peer])
        error = difference(result.image.pixels, truth).largest
        wanted = None if asked else WANTED.get(sigma)
        name = f"{result.method} ({'max_error=1e-3' if asked else 'default'})"
        rows.append(Row(f"sigma {sigma:g}", name, ours_ms, error, "cv2.GaussianBlur", peer_ms, peer_error, wanted))
    return rows


def crossover(size: int, backend: str, tail: float) -> tuple[float, list[str]]:
    """The sigma from which `dct` is the faster method, by measurement, with the times on both sides of it."""
    image = as_image(np.random.default_rng(1).random((size, size, 3), dtype=np.float32))
    device, lines, crossed = default_device(), [], float("nan")
    facts = {"image": Facts.of(image)}
    for sigma in (4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0):
        parameters = Parameters(sigma=sigma)

        def run(name: str, parameters: Parameters = parameters) -> object:
            body = gaussian.methods[name].implementation
            if backend == "opencl":
                return body.opencl(device, {"image": image}, parameters, tail)
            return body.numpy({"image": image}, parameters, tail)

        fir, dct = medians([lambda: run("fir"), lambda: run("dct")], rounds=5)
        predicted = [gaussian.methods[m].seconds(backend, parameters, tail, facts) * 1e3 for m in ("fir", "dct")]
        lines.append(f"| {sigma:g} | {fir:.1f} | {predicted[0]:.1f} | {dct:.1f} | {predicted[1]:.1f} |")
        if dct < fir and np.isnan(crossed):
            crossed = sigma
    return crossed, lines


def run() -> list[Row]:
    return [row for sigma in (1.0, 5.0, 20.0, 50.0) for row in compare(sigma)]


if __name__ == "__main__":
    print(table("gaussian, 2048 x 2048 RGBA float32", run()))
    for backend in ("opencl", "numpy"):
        for size in (512, 2048):
            crossed, lines = crossover(size, backend, 1e-4)
            title = f"fir against dct, {size} x {size} RGB, {backend}, tail 1e-4"
            print(f"### {title}: dct is faster from sigma {crossed:g}\n")
            print("| sigma | fir ms | predicted | dct ms | predicted |\n|---:|---:|---:|---:|---:|")
            print("\n".join(lines) + "\n")
