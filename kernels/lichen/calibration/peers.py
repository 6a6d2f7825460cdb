"""Other libraries' functions that compute the same thing as one of our operations.

A peer is listed for exactly those parameters with which its documentation promises the same result. Peers are looked
up when they are asked for: a library that is not installed has none. Each works on buffers that it finds prepared,
so that what is timed is its computation alone.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from lichen.image import Alpha
from lichen.memory import Array
from lichen.operation import Inputs, Operation, OperationParameters
from lichen.operations.streamlines.task import texture_of


@dataclass(frozen=True)
class Job:
    """One computation by a peer. `run` is what is timed; `pixels`, after it, the result, (height, width, channels)."""

    run: Callable[[], Any]
    pixels: Callable[[], Array]


Prepare = Callable[[Any, Inputs, Any], Job]
"""Receives the library's module, the inputs and the parameters."""


@dataclass(frozen=True)
class Peer:
    name: str
    """the library and its function"""
    module: str
    distribution: str
    operation: str
    same: Callable[[Any], bool]
    """whether it computes the same with these parameters"""
    prepare: Prepare

    @property
    def version(self) -> str:
        return importlib.metadata.version(self.distribution)

    def job(self, inputs: Inputs, parameters: OperationParameters) -> Job:
        return self.prepare(importlib.import_module(self.module), inputs, parameters)


def peers(operation: Operation[Any], parameters: OperationParameters) -> Iterator[Peer]:
    """The installed peers of an operation with these parameters."""
    for peer in PEERS:
        if peer.operation == operation.name and peer.same(parameters):
            try:
                importlib.import_module(peer.module)
            except ImportError:
                continue
            yield peer


def _returning(compute: Callable[[], Array]) -> Job:
    """A job whose function returns the result."""
    kept: list[Array] = []

    def run() -> None:
        kept[:] = [compute()]

    return Job(run, lambda: kept[0].reshape(*kept[0].shape[:2], -1))


# -------------------------------------------------------------------------------------------------------- convolution

_OPENCV_BORDERS = {"reflect": "BORDER_REFLECT", "reflect101": "BORDER_REFLECT_101", "clamp": "BORDER_REPLICATE"}
_SKIMAGE_BORDERS = {
    "reflect": "reflect",
    "reflect101": "mirror",
    "clamp": "nearest",
    "wrap": "wrap",
    "constant": "constant",
}


def _opencv_blur(cv2: Any, inputs: Inputs, p: Any) -> Job:
    pixels = inputs["image"].pixels
    target, border = np.empty_like(pixels), getattr(cv2, _OPENCV_BORDERS[p.border])
    return _returning(lambda: cv2.GaussianBlur(pixels, (0, 0), p.sigma, dst=target, borderType=border))


def _skimage_blur(filters: Any, inputs: Inputs, p: Any) -> Job:
    pixels, border = inputs["image"].pixels, _SKIMAGE_BORDERS[p.border]
    return _returning(
        lambda: filters.gaussian(
            pixels, p.sigma, mode=border, cval=p.value, preserve_range=True, channel_axis=-1, truncate=4.0
        )
    )


def _opencv(inputs: Inputs, p: Any, cv2: Any, call: Callable[[Array, Array, int], Array]) -> Job:
    """`call` receives the pixels, an array for the result and the border."""
    pixels = inputs["image"].pixels
    target, border = np.empty_like(pixels), getattr(cv2, _OPENCV_BORDERS[p.border])
    return _returning(lambda: call(pixels, target, border))


def _opencv_box(cv2: Any, inputs: Inputs, p: Any) -> Job:
    return _opencv(inputs, p, cv2, lambda x, y, border: cv2.blur(x, (p.width, p.height), dst=y, borderType=border))


def _opencv_filter(cv2: Any, inputs: Inputs, p: Any) -> Job:
    """OpenCV correlates: the kernel is turned round."""
    taps = np.array(p.kernel)[::-1, ::-1] * p.scale
    return _opencv(inputs, p, cv2, lambda x, y, border: cv2.filter2D(x, -1, taps, dst=y, borderType=border))


def _opencv_laplacian(cv2: Any, inputs: Inputs, p: Any) -> Job:
    return _opencv(
        inputs, p, cv2, lambda x, y, border: cv2.Laplacian(x, -1, dst=y, ksize=1, scale=p.scale, borderType=border)
    )


def _opencv_morphology(cv2: Any, inputs: Inputs, p: Any) -> Job:
    step, block = getattr(cv2, p.step), np.ones((p.height, p.width), np.uint8)
    return _opencv(inputs, p, cv2, lambda x, y, border: step(x, block, dst=y, borderType=border))


def _plain_median(p: Any) -> bool:
    return bool(p.size > 1 and p.missing == "spread")


def _skimage_median(filters: Any, inputs: Inputs, p: Any) -> Job:
    pixels, window = inputs["image"].pixels, np.ones((p.size, p.size, 1))
    mode = _SKIMAGE_BORDERS[p.border]
    return _returning(lambda: filters.median(pixels, window, mode=mode, cval=p.value))


def _odd(p: Any) -> bool:
    return p.border in _OPENCV_BORDERS and p.width % 2 == 1 == p.height % 2 and p.anchor is None


def _plain_kernel(p: Any) -> bool:
    if p.kernel is None or p.border not in _OPENCV_BORDERS:
        return False
    odd = len(p.kernel) % 2 == 1 == len(p.kernel[0]) % 2
    plain = (p.mode, p.anchor, p.normalise, p.bias, p.coverage) == ("convolution", None, False, 0, "convolved")
    return odd and plain and p.missing == "spread"


# ------------------------------------------------------------------------------------------------------------- colour


def _opencv_matrix(cv2: Any, inputs: Inputs, p: Any) -> Job:
    pixels, matrix = inputs["image"].pixels, np.array(p.matrix)
    target = np.empty_like(pixels)
    return _returning(lambda: cv2.transform(pixels, matrix, dst=target))


# --------------------------------------------------------------------------------------------------------------- tone


def _oiio(library: Any, inputs: Inputs, work: Callable[[Any, Any], bool]) -> Job:
    image = inputs["image"]
    spec = library.ImageSpec(image.width, image.height, image.channels, library.FLOAT)
    if image.alpha is not Alpha.NONE:
        spec.alpha_channel = image.channels - 1
    source, target = library.ImageBuf(spec), library.ImageBuf(spec)
    source.set_pixels(library.ROI(), image.pixels)

    def run() -> None:
        if not work(target, source):
            raise RuntimeError(target.geterror())

    return Job(run, lambda: np.asarray(target.get_pixels(library.FLOAT)))


def _oiio_srgb(library: Any, inputs: Inputs, p: Any) -> Job:
    stored, linear = "srgb_rec709_scene", "lin_rec709_scene"
    ends = (stored, linear) if p.direction == "decode" else (linear, stored)
    return _oiio(library, inputs, lambda to, source: bool(library.ImageBufAlgo.colorconvert(to, source, *ends)))


def _oiio_premultiply(library: Any, inputs: Inputs, p: Any) -> Job:
    work = library.ImageBufAlgo.unpremult if p.inverse else library.ImageBufAlgo.premult
    return _oiio(library, inputs, lambda to, source: bool(work(to, source)))


def _colour_srgb(models: Any, inputs: Inputs, p: Any) -> Job:
    pixels = inputs["image"].pixels
    curve = models.eotf_sRGB if p.direction == "decode" else models.eotf_inverse_sRGB
    return _returning(lambda: np.asarray(curve(pixels)))


# -------------------------------------------------------------------------------------------------------- streamlines


def _rlic(library: Any, inputs: Inputs, p: Any) -> Job:
    textures = [np.ascontiguousarray(channel) for channel in np.moveaxis(texture_of(inputs, p), 2, 0)]
    u, v = (np.ascontiguousarray(inputs["field"].pixels[:, :, axis]) for axis in (0, 1))
    length = round(p.length)
    weights = np.full(2 * length + 1, 1 / (2 * length + 1), np.float32)  # rlic does not normalise
    return _returning(lambda: np.stack([library.convolve(each, u, v, kernel=weights) for each in textures], axis=-1))


def _rlic_same(p: Any) -> bool:
    plain = (p.kernel, p.speed, p.bias, p.border, p.frames) == ("box", "arc", 0, "end", 1)
    plain = plain and (p.oriented, p.enhance, p.contrast, p.colour, p.grain) == (False, 0, 0, "none", 1)
    return plain and p.length == round(p.length) and p.scale > 0


def _plain_blur(p: Any) -> bool:
    return p.sigma > 0 and (p.sigma_x, p.sigma_y, p.missing) == (None, None, "spread")


def _plain_srgb(p: Any) -> bool:
    return (p.curve, p.negative) == ("srgb", "mirror")


PEERS = (
    Peer(
        "OpenCV GaussianBlur",
        "cv2",
        "opencv-python-headless",
        "gaussian",
        lambda p: p.border in _OPENCV_BORDERS and _plain_blur(p),
        _opencv_blur,
    ),
    Peer(
        "scikit-image gaussian",
        "skimage.filters",
        "scikit-image",
        "gaussian",
        lambda p: p.border in _SKIMAGE_BORDERS and _plain_blur(p),
        _skimage_blur,
    ),
    Peer(
        "OpenCV blur", "cv2", "opencv-python-headless", "box", lambda p: _odd(p) and p.missing == "spread", _opencv_box
    ),
    Peer("OpenCV filter2D", "cv2", "opencv-python-headless", "convolve", _plain_kernel, _opencv_filter),
    Peer(
        "OpenCV Laplacian",
        "cv2",
        "opencv-python-headless",
        "laplacian",
        lambda p: p.mask == "four" and p.border in _OPENCV_BORDERS,
        _opencv_laplacian,
    ),
    Peer(
        "OpenCV dilate, erode",
        "cv2",
        "opencv-python-headless",
        "morphology",
        lambda p: _odd(p) and p.missing == "spread" and p.step in ("dilate", "erode"),
        _opencv_morphology,
    ),
    Peer("scikit-image median", "skimage.filters", "scikit-image", "median", _plain_median, _skimage_median),
    Peer("OpenCV transform", "cv2", "opencv-python-headless", "matrix", lambda p: len(p.matrix) == 3, _opencv_matrix),
    Peer("OpenImageIO colorconvert", "OpenImageIO", "OpenImageIO", "transfer", _plain_srgb, _oiio_srgb),
    Peer("colour-science sRGB", "colour.models", "colour-science", "transfer", _plain_srgb, _colour_srgb),
    Peer("OpenImageIO premult", "OpenImageIO", "OpenImageIO", "premultiply", lambda p: True, _oiio_premultiply),
    Peer("rlic", "rlic", "rlic", "lic", _rlic_same, _rlic),
)
