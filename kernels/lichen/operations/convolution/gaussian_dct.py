"""A wide Gaussian by the few low frequencies that it passes, of an image that continues by reflection."""

from __future__ import annotations

import numpy as np

from lichen.memory import Array, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import Border
from lichen.operations.convolution.gaussian_weights import dct_bases
from lichen.operations.convolution.passes import Steps


def dct_opencl(device: Device, pixels: Array, deviations: tuple[float, float], border: Border, tail: float) -> Array:
    """Down the image to K rows, those to K x K modes and back, up to the image: four products and two flips."""
    height, width, channels = pixels.shape
    down, up = dct_bases(deviations[0], height, tail)
    left, right = dct_bases(deviations[1], width, tail)
    out = aligned_empty(pixels.shape)
    with device.session() as session:
        steps = Steps(session, border)
        few, again = (session.scratch((len(down), width, channels)) for _ in range(2))
        turned, back = (session.scratch((width, len(down), channels)) for _ in range(2))
        modes = session.scratch((len(left), len(down), channels))
        steps.multiply(down, None, pixels, few)
        steps.flip(few, turned)
        steps.multiply(left, None, turned, modes)
        steps.multiply(right, None, modes, back)
        steps.flip(back, again)
        steps.multiply(up, None, again, out)
    return out


def dct_numpy(pixels: Array, deviations: tuple[float, float], tail: float) -> Array:
    """The same."""
    height, width, channels = pixels.shape
    down, up = dct_bases(deviations[0], height, tail)
    left, right = dct_bases(deviations[1], width, tail)
    few = down @ pixels.reshape(height, -1)
    few = few.reshape(-1, width, channels).transpose(1, 0, 2).reshape(width, -1)
    few = right @ (left @ few)
    few = few.reshape(width, -1, channels).transpose(1, 0, 2).reshape(-1, width * channels)
    out = aligned_empty(pixels.shape)
    np.matmul(up, few, out=out.reshape(height, -1))
    return out
