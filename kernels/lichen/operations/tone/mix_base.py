"""What a picture is mixed with: the parameters of mix, and the bases that its presets make of the image itself."""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Image
from lichen.memory import Array
from lichen.once import latest
from lichen.operation import Border, OperationParameters, Pixels
from lichen.operations.convolution import gaussian as blur

MOST = 16.0
"""The average light over coverage, in largest values: what lies under hardly any coverage has no measure of its own."""


class Preset(StrEnum):
    """What the image is mixed with."""

    BRIGHTNESS = "brightness"
    CONTRAST = "contrast"
    SATURATION = "saturation"
    SHARPEN = "sharpen"


class Parameters(OperationParameters):
    amount: float = Field(0.5, ge=-100, le=100)
    """0 is the base, 1 the image; beyond either extrapolates"""
    preset: Preset | None = None
    """a base made of the image itself, in place of the input base"""
    weights: tuple[float, float, float] = (0.2126, 0.7152, 0.0722)
    """of red, green and blue in luminance, for contrast and saturation: not negative, together 1; those of BT.709"""
    sigma: Pixels = Field(1.0, ge=0, le=1000)
    """standard deviation of the blur, for preset=sharpen"""
    border: Border = Border.REFLECT
    """how the image continues, for preset=sharpen; constant is 0"""

    @property
    def of_base(self) -> float:
        return 1 - self.amount

    @property
    def scale(self) -> float:
        return max(abs(self.of_base), abs(self.amount))

    @property
    def blur(self) -> blur.Parameters:
        return _blur(self)


@latest
def _blur(p: Parameters) -> blur.Parameters:
    return blur.Parameters(sigma=p.sigma, border=p.border, value=0.0)


def average(image: Image, weights: tuple[float, float, float]) -> float:
    """Average luminance over finite pixels, light over coverage, at most MOST times the largest value; 0 for none."""
    pixels = image.pixels.reshape(-1, image.channels)
    if image.extent.nonfinite:
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
    if not len(pixels):
        return 0.0
    means = np.array([np.add.reduce(pixels[:, c], dtype=np.float64) / len(pixels) for c in range(image.channels)])
    light = float(means[: image.colours] @ np.array(weights if image.colours == 3 else [1.0]))
    most = MOST * image.extent.magnitude
    if image.alpha is not Alpha.NONE:
        if abs(light) >= most * abs(means[-1]):
            return math.copysign(most, light) if light and means[-1] else 0.0
        light /= float(means[-1])
    return light


def made(image: Image, p: Parameters) -> Array:
    """The base in float64, but for its coverage, which is the image's."""
    coverage = image.pixels[..., -1:] if image.alpha is not Alpha.NONE else np.ones(())
    colour = image.pixels[..., : image.colours]
    if p.preset is Preset.BRIGHTNESS:
        return np.zeros_like(colour)
    if p.preset is Preset.CONTRAST:
        return np.broadcast_to(average(image, p.weights) * coverage, colour.shape)
    weights = np.array(p.weights if image.colours == 3 else [1.0])
    return np.broadcast_to((colour @ weights)[..., np.newaxis], colour.shape)
