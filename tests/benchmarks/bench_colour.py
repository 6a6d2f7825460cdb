"""Colour conversions against OpenCV, scikit-image and colour-science: 2048 x 2048 RGB float32, interleaved.

Errors are largest absolute differences from float64. The slow peers get a picture of 512 x 512, and ours the same one.
Run as a script to print the table.
"""

from __future__ import annotations

import colour
import cv2
import numpy as np
import skimage.color
from interleaved import Row, medians, table

from lichen.image import Image, Space
from lichen.memory import Array, aligned
from lichen.opencl.device import default_device
from lichen.operations.colour.convert import Parameters, convert
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


def run() -> list[Row]:
    large, small = picture(2048), picture(512)
    spare = np.empty_like(large.pixels)
    return [
        row("RGB to Lab", Model.LAB, large, "cv2", lambda x: cv2.cvtColor(x, cv2.COLOR_RGB2Lab, dst=spare), 0.7),
        row("RGB to Luv", Model.LUV, large, "cv2", lambda x: cv2.cvtColor(x, cv2.COLOR_RGB2Luv, dst=spare), None),
        row("RGB to HSV", Model.HSV, large, "cv2",
            lambda x: cv2.cvtColor(x, cv2.COLOR_RGB2HSV, dst=spare), None),
        row("RGB to Lab, 512", Model.LAB, small, "scikit-image", skimage.color.rgb2lab, 0.07),
        row("RGB to Lab, 512", Model.LAB, small, "colour",
            lambda x: colour.XYZ_to_Lab(colour.sRGB_to_XYZ(x), colour.CCS_ILLUMINANTS[
                "CIE 1931 2 Degree Standard Observer"]["D65"]), 0.03),
    ]  # fmt: skip


if __name__ == "__main__":
    print(table("colour", run()))
