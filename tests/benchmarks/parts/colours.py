"""Colour beside OpenCV, OpenColorIO, OpenImageIO, scikit-image and colour-science.

The slow peers get a picture of 512 x 512, and ours the same one.
"""

from __future__ import annotations

import atexit
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

import colour
import cv2
import numpy as np
import OpenImageIO as oiio
import PyOpenColorIO as ocio
import skimage.color
from comparing import Call, Images, Peer, Row, Values, noise, pair, target
from libraries import by_oiio, typed
from measuring import available

from lichen.image import Space
from lichen.memory import Array
from lichen.operations.colour.primaries import Primaries, to_xyz

TITLE = "Colour"
SRGB = noise(3, space=Space.SRGB)
SMALL = 512
MATRIX = [[0.8, 0.15, 0.05], [0.1, 0.8, 0.1], [0.05, 0.15, 0.8]]
D65 = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]


def opencv(code: int) -> Peer:
    def prepare(inputs: Images, values: Values) -> Call:
        pixels, made = inputs["image"].pixels, target(inputs)
        return lambda: cv2.cvtColor(pixels, code, dst=made)

    return Peer("OpenCV cvtColor", prepare)


def pq_by_colour(x: Array) -> Array:
    """Decode, matrix and encode, one after the other."""
    matrix = np.linalg.solve(to_xyz(Primaries.BT2020), to_xyz(Primaries.BT709))
    return np.asarray(colour.models.eotf_inverse_ST2084(203 * (colour.models.eotf_sRGB(x) @ matrix.T)))


def pq_steps() -> ocio.Processor:
    """Decode, matrix and encode as OpenColorIO fuses them, with its own fast mathematics."""
    matrix = np.eye(4)
    matrix[:3, :3] = 2.03 * np.linalg.solve(to_xyz(Primaries.BT2020), to_xyz(Primaries.BT709))
    group = ocio.GroupTransform([
        ocio.ExponentWithLinearTransform([2.4, 2.4, 2.4, 1], [0.055, 0.055, 0.055, 0]),
        ocio.MatrixTransform(matrix.reshape(-1).tolist()),
        ocio.BuiltinTransform("CURVE - ST-2084_to_LINEAR", ocio.TRANSFORM_DIR_INVERSE),
    ])  # fmt: skip
    return ocio.Config.CreateRaw().getProcessor(group)


def pq_by_oiio(inputs: Images, values: Values) -> Call:
    """The same as OpenImageIO runs them, from a file of OpenColorIO's Color Transform Format."""
    with NamedTemporaryFile("w", suffix=".ctf", delete=False) as file:
        file.write(pq_steps().createGroupTransform().write("Color Transform Format", ocio.Config.CreateRaw()))
    atexit.register(Path(file.name).unlink)
    return by_oiio(lambda made, x, _: oiio.ImageBufAlgo.ociofiletransform(made, x, file.name))(inputs, values)


def pq_by_ocio(inputs: Images, values: Values) -> Call:
    """The same by OpenColorIO alone, rows shared out to all threads by hand."""
    processor = pq_steps().getDefaultCPUProcessor()
    x, made = inputs["image"].pixels, target(inputs)
    threads = len(available())
    bands = list(zip(np.array_split(x, threads), np.array_split(made, threads), strict=True))
    pool = ThreadPoolExecutor(threads)

    def convert(band: tuple[Array, Array]) -> None:
        source, goal = (ocio.PackedImageDesc(each, each.shape[1], each.shape[0], 3) for each in band)
        processor.apply(source, goal)

    def work() -> Array:
        list(pool.map(convert, bands))
        return made

    return work


def multiplied(inputs: Images, values: Values) -> Call:
    pixels, made, matrix = inputs["image"].pixels, target(inputs), np.array(MATRIX)
    return lambda: cv2.transform(pixels, matrix, dst=made)


def apart(inputs: Images, values: Values) -> Call:
    """CIEDE2000 of two pictures by scikit-image, from linear light."""
    first, second = inputs["image"].pixels, inputs["reference"].pixels

    def lab(x: Any) -> Any:
        return skimage.color.xyz2lab(x @ to_xyz(Primaries.BT709).T.astype(np.float32))

    return lambda: skimage.color.deltaE_ciede2000(lab(second), lab(first))


def convert(name: str, goal: str, *peers: Peer, side: int = 2048, ask: Values | None = None) -> Row:
    said = "".join(f", {key}={value:g}" for key, value in (ask or {}).items())
    small = "" if side == 2048 else f", {side} px"
    return Row(f"convert, {name}{said}{small}", "convert", {"target": goal}, peers, SRGB, ask or {}, side=side)


ROWS = (
    convert("sRGB to Lab", "lab", opencv(cv2.COLOR_RGB2Lab)),
    convert("sRGB to Luv", "luv", opencv(cv2.COLOR_RGB2Luv)),
    convert("sRGB to HSV", "hsv", opencv(cv2.COLOR_RGB2HSV)),
    convert(
        "sRGB to PQ of BT.2100", "bt2100_pq", Peer("OpenColorIO", pq_by_ocio), typed("colour-science", pq_by_colour)
    ),
    convert(
        "sRGB to PQ of BT.2100", "bt2100_pq", Peer("OpenImageIO ociofiletransform", pq_by_oiio),
        Peer("OpenColorIO", pq_by_ocio), ask={"max_error": 1e-5},
    ),
    convert(
        "sRGB to Lab", "lab", typed("scikit-image rgb2lab", skimage.color.rgb2lab),
        typed("colour-science", lambda x: colour.XYZ_to_Lab(colour.sRGB_to_XYZ(x), D65)), side=SMALL,
    ),
    Row("matrix, 3 x 3, RGB", "matrix", {"matrix": MATRIX}, (Peer("OpenCV transform", multiplied),), flops=6.0),
    Row("saturation 1.5, RGB", "saturation", {"amount": 1.5}, (
        Peer("OpenImageIO saturate", by_oiio(lambda y, x, v: oiio.ImageBufAlgo.saturate(y, x, 1.5)), same=False),)),
    Row("difference, CIEDE2000, 512 px", "difference", {}, (Peer("scikit-image deltaE_ciede2000", apart, alone=True),),
        pair(3, "image", "reference"), side=SMALL),
)  # fmt: skip
