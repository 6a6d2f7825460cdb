"""Tone beside OpenImageIO, scikit-image, OpenCV, colour-science and NumPy as one types it.

NumPy's functions of arrays run on one thread whatever they are given, scikit-image's and colour-science's with them.
"""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import colour
import cv2
import numpy as np
import OpenImageIO as oiio
from comparing import Call, Images, Peer, Prepare, Row, Values, pair, target
from libraries import by_oiio, typed
from skimage import exposure

from lichen.operations.tone.cube import written

TITLE = "Tone"
F = np.float32
POINTS = [[0, 0], [0.25, 0.15], [0.5, 0.5], [0.75, 0.88], [1, 1]]
LUT = np.interp(np.linspace(0, 1, 4096), *np.array(POINTS).T).astype(F)


def decoded(x: np.ndarray) -> np.ndarray:
    """sRGB as one types it."""
    return np.where(x <= F(0.04045), x / F(12.92), ((x + F(0.055)) / F(1.055)) ** F(2.4))


def in_place() -> Prepare:
    """The same with every step into an array that exists."""

    def prepare(inputs: Images, values: Values) -> Call:
        x = inputs["image"].pixels
        power, toe, mask = np.empty_like(x), np.empty_like(x), np.empty(x.shape, bool)

        def work() -> np.ndarray:
            np.add(x, F(0.055), out=power)
            np.divide(power, F(1.055), out=power)
            np.power(power, F(2.4), out=power)
            np.divide(x, F(12.92), out=toe)
            np.less_equal(x, F(0.04045), out=mask)
            np.copyto(power, toe, where=mask)
            return power

        return work

    return prepare


def converted(source: str, goal: str) -> Peer:
    return Peer("OpenImageIO colorconvert", by_oiio(lambda y, x, v: oiio.ImageBufAlgo.colorconvert(y, x, source, goal)))


@cache
def cube() -> tuple[str, str]:
    """A table of 33^3 colours as text, and its file."""
    axis = np.linspace(0, 1, 33)
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    text = written(np.stack([red**0.8, (green + 0.2 * red) / 1.2, blue**1.3], axis=-1))
    path = Path(tempfile.mkdtemp(prefix="lichen-")) / "table.cube"
    path.write_text(text)
    return text, str(path)


def table(interpolation: str) -> Row:
    peer = Peer(
        "OpenImageIO ociofiletransform", by_oiio(lambda y, x, v: oiio.ImageBufAlgo.ociofiletransform(y, x, cube()[1])),
        same=interpolation == "tetrahedral",
    )  # fmt: skip
    values = {"cube": cube()[0], "interpolation": interpolation}
    return Row(f"table3d, 33^3 {interpolation}, RGB", "table3d", values, (peer,))


def mixed(inputs: Images, values: Values) -> Call:
    over, base, made = inputs["image"].pixels, inputs["base"].pixels, target(inputs)
    return lambda: cv2.addWeighted(base, -0.7, over, 1.7, 0, dst=made)


STORED, LIGHT = "srgb_rec709_scene", "lin_rec709_scene"
ROWS = (
    Row("transfer, sRGB decode, RGB", "transfer", {"curve": "srgb"}, (
        converted(STORED, LIGHT), typed("NumPy, as one types it", decoded),
        Peer("NumPy, in place", in_place(), alone=True))),
    Row("transfer, sRGB encode, RGB", "transfer", {"curve": "srgb", "direction": "encode"}, (
        converted(LIGHT, STORED),)),
    Row("transfer, PQ decode, RGB", "transfer", {"curve": "pq"}, (
        typed("colour-science", lambda x: colour.models.eotf_ST2084(x), same=False),), side=1024),
    Row("gamma 2.2, decode, RGB", "gamma", {"gamma": 2.2}, (
        typed("NumPy **", lambda x: x ** F(2.2)),
        Peer("OpenCV pow", lambda i, v: lambda: cv2.pow(i["image"].pixels, 2.2)))),
    Row("levels, black, white, clamp, RGB", "levels", {"black": 0.2, "white": 0.7, "clamp": True}, (
        typed("scikit-image rescale_intensity", lambda x: exposure.rescale_intensity(x, (0.2, 0.7), (0.0, 1.0))),)),
    Row("levels, gamma 2.2, RGB", "levels", {"gamma": 2.2}, (typed("NumPy **", lambda x: x ** F(1 / 2.2)),)),
    Row("curve, 5 points, linear, RGB", "curve", {"points": POINTS, "interpolation": "linear"}, (
        typed("NumPy, table of 4096", lambda x: LUT[(x * 4095 + 0.5).astype(np.int32)]),)),
    Row("mix, 1.7, RGB", "mix", {"amount": 1.7}, (Peer("OpenCV addWeighted", mixed),), pair(3, "image", "base")),
    Row("tone_map, Reinhard, RGB", "tone_map", {"operator": "reinhard"}, (
        typed("NumPy x / (1 + x)", lambda x: x / (F(1) + x)),)),
    Row("quantise, 5 levels, RGB", "quantise", {"levels": 5, "dither": "none"}, (
        typed("NumPy floor(4 x + 0.5) / 4", lambda x: np.floor(x * 4 + F(0.5)) / 4),)),
    Row("equalise, RGB", "equalise", {}, (
        typed("scikit-image equalize_hist", lambda x: exposure.equalize_hist(x), same=False),)),
    table("tetrahedral"), table("trilinear"),
)  # fmt: skip
