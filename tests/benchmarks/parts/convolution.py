"""The convolution family beside OpenCV, scikit-image and SciPy."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from comparing import Call, Images, Peer, Prepare, Row, Values, noise, target
from skimage import filters

from lichen.operations.convolution.gaussian_turned import Turned, stencil
from lichen.operations.convolution.gaussian_weights import fir_radius

TITLE = "Convolution"
BORDER = cv2.BORDER_REFLECT
SIGMA, TAPS = 5.0, 31
"""Of the Gaussian as many write it down: so many taps leave 2e-3 of its weight out."""


def by_opencv(work: Any) -> Prepare:
    """`work` receives the pixels, an array to write to, and the parameters."""

    def prepare(inputs: Images, values: Values) -> Call:
        pixels, made = inputs["image"].pixels, target(inputs)
        return lambda: work(pixels, made, values)

    return prepare


def opencv(name: str, work: Any, same: bool = True) -> Peer:
    return Peer(f"OpenCV {name}", by_opencv(work), same)


def blur(taps: int = 0) -> Peer:
    return opencv(
        "GaussianBlur",
        lambda x, y, values: cv2.GaussianBlur(x, (taps, taps), values["sigma"], dst=y, borderType=BORDER),
    )


def turned(along: float, across: float, angle: float) -> Row:
    """OpenCV is given the kernel; from some size on it multiplies spectra, too."""
    taps = stencil(Turned(along, across, angle), 1e-7).taps
    peer = opencv("filter2D", lambda x, y, values: cv2.filter2D(x, -1, taps, dst=y, borderType=BORDER))
    values = {"sigma": along, "sigma_y": across, "angle": angle}
    return Row(f"gaussian, {along:g} x {across:g} turned by {angle:g} degrees, RGB", "gaussian", values, (peer,))


def as_many_taps() -> float:
    """The tail with which ours takes as many taps."""
    return float(next(t for t in np.geomspace(1e-2, 1e-4, 100) if fir_radius(SIGMA, t)[0] == TAPS // 2))


def dense(size: int) -> Row:
    kernel = np.random.default_rng(size).random((size, size))
    kernel /= kernel.sum()
    peer = opencv("filter2D", lambda x, y, values: cv2.filter2D(x, -1, kernel, dst=y, borderType=BORDER))
    values = {"kernel": kernel.tolist(), "mode": "correlation"}
    work = f"convolve, {size} x {size} dense, RGBA"
    return Row(work, "convolve", values, (peer,), noise(4), flops=2.0 * size * size)


def window(size: int) -> Row:
    peer = opencv("blur", lambda x, y, values: cv2.blur(x, (size, size), dst=y, borderType=BORDER))
    return Row(f"box, {size} x {size}, RGBA", "box", {"width": size, "height": size}, (peer,), noise(4))


def middle(size: int, channels: int) -> Row:
    """OpenCV has no medians of floats beyond 5 x 5."""
    if size <= 5:
        peer = opencv("medianBlur", lambda x, y, values: cv2.medianBlur(x, size, dst=y))
        side = 2048
    else:
        block, side = np.ones((size, size, 1)), 256

        def sorted_out(inputs: Images, values: Values) -> Call:
            return lambda: filters.median(inputs["image"].pixels, block, mode="nearest")

        peer = Peer("scikit-image median", sorted_out, alone=True)
    work = f"median, {size} x {size}, {'RGB' if channels == 3 else 'grey'}"
    return Row(work, "median", {"size": size, "border": "clamp"}, (peer,), noise(channels), side=side)


def sobel(x: np.ndarray, y: np.ndarray, values: Values) -> np.ndarray:
    across = cv2.Sobel(x, -1, 1, 0, scale=1 / 8, borderType=BORDER)
    down = cv2.Sobel(x, -1, 0, 1, scale=1 / 8, borderType=BORDER)
    return cv2.magnitude(across, down, magnitude=y)


def grown(width: int, height: int) -> Row:
    block = np.ones((height, width), np.uint8)
    peer = opencv("dilate", lambda x, y, values: cv2.dilate(x, block, dst=y, borderType=BORDER))
    values = {"step": "dilate", "width": width, "height": height}
    return Row(f"morphology, dilation {width} x {height}, RGB", "morphology", values, (peer,))


def unsharp(x: np.ndarray, y: np.ndarray, values: Values) -> np.ndarray:
    blurred = cv2.GaussianBlur(x, (0, 0), values["sigma"], borderType=BORDER)
    return cv2.addWeighted(x, 2.0, blurred, -1.0, 0, dst=y)


ROWS = (
    *(Row(f"gaussian, sigma {sigma:g}, RGBA", "gaussian", {"sigma": sigma}, (blur(),), noise(4),
          error_side=256) for sigma in (1.0, 5.0, 20.0, 50.0)),
    Row("gaussian, sigma 5, RGBA, max_error=1e-3", "gaussian", {"sigma": 5.0}, (blur(),), noise(4),
        {"max_error": 1e-3}),
    Row("gaussian, sigma 5, RGBA, 31 taps each", "gaussian", {"sigma": SIGMA}, (blur(TAPS),), noise(4),
        {"method": "fir", "tail": as_many_taps()}),
    turned(4, 1, 30), turned(20, 5, 30),
    Row("sharpen, sigma 2, RGB", "sharpen", {"sigma": 2.0, "amount": 1.0}, (
        opencv("GaussianBlur, addWeighted", unsharp),)),
    *(dense(size) for size in (3, 7, 15)),
    *(window(size) for size in (5, 41)),
    *(middle(size, 3) for size in (3, 5)),
    middle(9, 1),
    Row("derivative, Sobel, magnitude, RGB", "derivative", {}, (opencv("Sobel, magnitude", sobel),)),
    Row("laplacian, RGB", "laplacian", {}, (
        opencv("Laplacian", lambda x, y, values: cv2.Laplacian(x, -1, dst=y, ksize=1, borderType=BORDER)),)),
    grown(3, 3), grown(15, 15),
)  # fmt: skip
