"""Colour conversions against OpenCV, scikit-image and colour-science: 2048 x 2048 RGB float32, interleaved.

Errors are largest absolute differences from float64. The slow peers get a picture of 512 x 512, and ours the same one.
Run as a script to print the table.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import colour
import cv2
import numpy as np
import PyOpenColorIO as ocio
import skimage.color
from interleaved import Row, medians, table

from lichen.image import Image, Space
from lichen.memory import Array, aligned
from lichen.opencl.device import default_device
from lichen.operations.colour.convert import Parameters, convert
from lichen.operations.colour.primaries import Primaries, to_xyz
from lichen.operations.colour.spaces import Model


def picture(side: int) -> Image:
    """Noise; sRGB."""
    return Image(aligned(np.random.default_rng(1).random((side, side, 3), dtype=np.float32)), Space.SRGB)


def ours(image: Image, target: Model) -> Array:
    device = default_device()
    assert device is not None
    return convert.methods["single"].implementation.opencl(device, {"image": image}, Parameters(target=target), 0.0)


def row(work: str, target: Model, image: Image, peer: str, job: object, wanted: float | None) -> Row:
    """`job` takes the pixels and returns the peer's result."""
    pixels = image.pixels
    mine, theirs = medians([lambda: ours(image, target), lambda: job(pixels)])  # type: ignore[operator]
    truth = convert.evaluate_truth({"image": image}, Parameters(target=target))
    found = np.asarray(job(pixels), np.float64)  # type: ignore[operator]
    errors = [float(np.abs(each - truth).max()) for each in (ours(image, target), found)]
    return Row(work, "single", mine, errors[0], peer, theirs, errors[1], wanted)


def by_colour(x: Array) -> Array:
    """Decode, matrix and encode, one after the other."""
    matrix = np.linalg.solve(to_xyz(Primaries.BT2020), to_xyz(Primaries.BT709))
    return np.asarray(colour.models.eotf_inverse_ST2084(203 * (colour.models.eotf_sRGB(x) @ matrix.T)))


def by_ocio() -> Callable[[Array], Array]:
    """The same three steps as OpenColorIO fuses them, with its own fast mathematics, rows shared out to two threads."""
    matrix = np.eye(4)
    matrix[:3, :3] = 2.03 * np.linalg.solve(to_xyz(Primaries.BT2020), to_xyz(Primaries.BT709))
    group = ocio.GroupTransform([
        ocio.ExponentWithLinearTransform([2.4, 2.4, 2.4, 1], [0.055, 0.055, 0.055, 0]),
        ocio.MatrixTransform(matrix.reshape(-1).tolist()),
        ocio.BuiltinTransform("CURVE - ST-2084_to_LINEAR", ocio.TRANSFORM_DIR_INVERSE),
    ])  # fmt: skip
    processor = ocio.Config.CreateRaw().getProcessor(group).getDefaultCPUProcessor()
    spare: dict[int, Array] = {}
    pool = ThreadPoolExecutor(2)

    def convert_rows(x: Array, made: Array) -> None:
        source = ocio.PackedImageDesc(x, x.shape[1], x.shape[0], 3)
        processor.apply(source, ocio.PackedImageDesc(made, x.shape[1], x.shape[0], 3))

    def job(x: Array) -> Array:
        made = spare.setdefault(x.size, np.empty_like(x))
        half = len(x) // 2
        list(pool.map(convert_rows, (x[:half], x[half:]), (made[:half], made[half:])))
        return made

    return job


def run() -> list[Row]:
    large, small = picture(2048), picture(512)
    spare = np.empty_like(large.pixels)
    return [
        row("RGB to Lab", Model.LAB, large, "cv2", lambda x: cv2.cvtColor(x, cv2.COLOR_RGB2Lab, dst=spare), 0.7),
        row("RGB to Luv", Model.LUV, large, "cv2", lambda x: cv2.cvtColor(x, cv2.COLOR_RGB2Luv, dst=spare), None),
        row("RGB to HSV", Model.HSV, large, "cv2",
            lambda x: cv2.cvtColor(x, cv2.COLOR_RGB2HSV, dst=spare), None),
        row("sRGB to PQ", Model.BT2100_PQ, large, "OpenColorIO, 2 threads", by_ocio(), 0.05),
        row("sRGB to PQ, 512", Model.BT2100_PQ, small, "colour", by_colour, 0.03),
        row("RGB to Lab, 512", Model.LAB, small, "scikit-image", skimage.color.rgb2lab, 0.07),
        row("RGB to Lab, 512", Model.LAB, small, "colour",
            lambda x: colour.XYZ_to_Lab(colour.sRGB_to_XYZ(x), colour.CCS_ILLUMINANTS[
                "CIE 1931 2 Degree Standard Observer"]["D65"]), 0.03),
    ]  # fmt: skip


if __name__ == "__main__":
    print(table("colour", run()))
