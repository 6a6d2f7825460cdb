"""Compositing, arithmetic and statistics beside a copy, NumPy, OpenCV and OpenImageIO.

`over` reads two pictures and writes one, so at the bandwidth of a copy, which reads one and writes one, it would take
1.5 times as long as the copy beside it.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import OpenImageIO as oiio
from comparing import Call, Images, Peer, Row, Values, image, noise, pair, random, target
from libraries import Late, by_oiio
from skimage import metrics

from lichen.image import Alpha, Image

TITLE = "Compositing, arithmetic and statistics"
TEXT = "(a * b + 0.5) * (a - b) / (a + 1.5) - 0.25 * a * b + abs(a - 0.5)"
COVERED = pair(4, "image", "base", alpha=Alpha.ASSOCIATED)
PERCENTILES = (1, 25, 50, 75, 99)


def copied(inputs: Images, values: Values) -> Call:
    source, made = next(iter(inputs.values())).pixels, target(inputs, next(iter(inputs)))

    def work() -> np.ndarray:
        np.copyto(made, source)
        return made

    return work


COPY = Peer("a copy by NumPy", copied, same=False, alone=True, yardstick=True)


def over(inputs: Images, values: Values) -> Call:
    first, second = (oiio.ImageBuf(inputs[name].pixels) for name in ("image", "base"))
    height, width, channels = inputs["image"].pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.FLOAT)
    spec.alpha_channel = 3
    after = oiio.ImageBuf(spec)

    def work() -> Late:
        if not oiio.ImageBufAlgo.over(after, first, second):
            raise RuntimeError(after.geterror())
        return Late(after)

    return work


def typed(inputs: Images, values: Values) -> Call:
    """The expression as one types it, one array after the other."""
    a, b = inputs["a"].pixels, inputs["b"].pixels
    half, more, quarter = (np.float32(v) for v in (0.5, 1.5, 0.25))
    return lambda: (a * b + half) * (a - b) / (a + more) - quarter * a * b + np.abs(a - half)


def eight(side: int) -> dict[str, Image]:
    return {f"image_{n + 1}": image(random(side, 4, n)) for n in range(8)}


def averaged(inputs: Images, values: Values) -> Call:
    arrays = [each.pixels for each in inputs.values()]
    return lambda: np.mean(arrays, axis=0)


def described(inputs: Images, values: Values) -> Call:
    x = inputs["image"].pixels

    def work() -> Any:
        flat = x.reshape(-1, x.shape[2])
        figures = [flat.min(0), flat.max(0), flat.mean(0), flat.std(0), *np.percentile(flat, PERCENTILES, axis=0)]
        return np.stack(figures, axis=-1)

    return work


def structural(inputs: Images, values: Values) -> Call:
    first, second = (inputs[name].pixels for name in ("image", "reference"))
    return lambda: cv2.absdiff(first, second)


def noisy(inputs: Images, values: Values) -> Call:
    first, second = (inputs[name].pixels for name in ("image", "reference"))
    return lambda: (metrics.normalized_root_mse(first, second), np.abs(first - second))[1]


ROWS = (
    Row("composite, over, RGBA", "composite", {}, (Peer("OpenImageIO over", over), COPY), COVERED),
    *(Row(f"composite, {blend}, RGBA", "composite", {"blend": blend}, (COPY,), COVERED)
      for blend in ("multiply", "soft_light", "luminosity")),
    Row("premultiply, RGBA", "premultiply", {}, (
        Peer("OpenImageIO premult", by_oiio(lambda y, x, v: oiio.ImageBufAlgo.premult(y, x)), same=False),
        COPY), noise(4, alpha=Alpha.STRAIGHT)),
    Row("expression, 13 operators, RGBA", "expression", {"expression": TEXT}, (
        Peer("NumPy, as one types it", typed, alone=True),), pair(4, "a", "b")),
    Row("accumulate, mean of 8, RGBA, 1024 px", "accumulate", {}, (Peer("NumPy mean", averaged, alone=True),), eight,
        side=1024),
    Row("statistics, 5 percentiles, RGB, 1024 px", "statistics", {}, (Peer("NumPy", described, False, True),),
        side=1024),
    Row("compare, RGB, 1024 px", "compare", {"metrics": []}, (
        Peer("OpenCV absdiff, the map alone", structural, yardstick=True),
        Peer("scikit-image and NumPy", noisy, alone=True)),
        pair(3, "image", "reference"), side=1024),
)  # fmt: skip
