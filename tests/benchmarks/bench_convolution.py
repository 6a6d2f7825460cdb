"""The convolution family beside OpenCV and SciPy, on 2048 x 2048 float32 images.

Run: python tests/benchmarks/bench_convolution.py [convolve gaussian box median]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from interleaved import Row, medians, table

import lichen
from lichen.accuracy.metrics import difference
from lichen.catalogue import operations
from lichen.image import Image, as_image
from lichen.operations.convolution.gaussian_weights import fir_radius

SIZE = 2048


SIGMA, TAPS = 5.0, 31
"""Of the Gaussian: so many taps leave 2e-3 of its weight out."""


def compare(
    work: str,
    name: str,
    image: Image,
    peer_name: str,
    peer: Callable[[np.ndarray], np.ndarray],
    wanted: float | None = None,
    **parameters: Any,
) -> Row:
    """One operation at its defaults beside one function of a peer that writes to an array made beforehand."""
    target = np.empty_like(image.pixels)
    operation = operations()[name]
    own = {key: value for key, value in parameters.items() if key in operation.parameters.model_fields}
    truth = operation.evaluate_truth({"image": image}, operation.validate(own))
    result = lichen.run(name, image, **parameters)
    ours_ms, peer_ms = medians([lambda: lichen.run(name, image, **parameters), lambda: peer(target)])
    peer_error = difference(peer(target).reshape(truth.shape), truth).largest
    ours_error = difference(result.image.pixels, truth).largest
    return Row(work, result.method, ours_ms, ours_error, peer_name, peer_ms, peer_error, wanted)


def noise(channels: int) -> Image:
    return as_image(np.random.default_rng(1).random((SIZE, SIZE, channels), dtype=np.float32))


def convolve() -> list[Row]:
    image, rows = noise(4), []
    for size, wanted in ((3, None), (7, 0.66), (15, None)):
        kernel = np.random.default_rng(size).random((size, size))

        def peer(target: np.ndarray, kernel: np.ndarray = kernel) -> np.ndarray:
            return cv2.filter2D(image.pixels, -1, kernel, dst=target, borderType=cv2.BORDER_REFLECT)

        dense = {"kernel": kernel.tolist(), "mode": "correlation"}
        rows.append(compare(f"{size} x {size} dense RGBA", "convolve", image, "cv2.filter2D", peer, wanted, **dense))
    return rows


def gaussian() -> list[Row]:
    """Ours at the error that so many taps leave, by whatever method and by as many taps; and as accurate as can be."""
    image = noise(4)

    def peer(target: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(image.pixels, (TAPS, TAPS), SIGMA, dst=target, borderType=cv2.BORDER_REFLECT)

    tail = next(t for t in np.geomspace(1e-2, 1e-4, 100) if fir_radius(SIGMA, t)[0] == TAPS // 2)
    asked: tuple[dict[str, Any], ...] = ({"max_error": 5e-3}, {"method": "fir", "tail": float(tail)}, {})
    names = ("error of its kind", "as many taps", "default")
    rows = []
    for name, some in zip(names, asked, strict=True):
        wanted = 0.65 if some else None
        work = f"{TAPS} taps of a Gaussian, RGBA, {name}"
        rows.append(compare(work, "gaussian", image, "cv2.GaussianBlur", peer, wanted, sigma=SIGMA, **some))
    return rows


def box() -> list[Row]:
    image, rows = noise(4), []
    for size in (5, 41):

        def peer(target: np.ndarray, size: int = size) -> np.ndarray:
            return cv2.blur(image.pixels, (size, size), dst=target, borderType=cv2.BORDER_REFLECT)

        work = f"mean of {size} x {size}, RGBA"
        rows.append(compare(work, "box", image, "cv2.blur", peer, width=size, height=size))
    return rows


def median() -> list[Row]:
    image, rows = noise(3), []
    for size in (3, 5):

        def peer(target: np.ndarray, size: int = size) -> np.ndarray:
            return cv2.medianBlur(image.pixels, size, dst=target)

        work = f"median of {size} x {size}, RGB"
        rows.append(compare(work, "median", image, "cv2.medianBlur", peer, 1.0, size=size, border="clamp"))
    return rows


PARTS = {"convolve": convolve, "gaussian": gaussian, "box": box, "median": median}

if __name__ == "__main__":
    for name in sys.argv[1:] or PARTS:
        print(table(f"{name}, 2048 x 2048 float32", PARTS[name]()), flush=True)
