"""Any image as a picture for the eye: colours as they are, data made visible.

One channel of data is grey, stretched where it leaves [0, 1]; two are a vector, its direction as hue and its length as
brightness; further channels than four are not shown. NaN is magenta and infinity is cyan, colours that no stretching
gives to a number beside them.
"""

from __future__ import annotations

import math

import numpy as np

from lichen.files import encode
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array, aligned

LARGEST = 512
"""px; longer sides are thinned out."""
NOT_A_NUMBER = (1.0, 0.0, 1.0)
INFINITE = (0.0, 1.0, 1.0)


def shown(image: Image) -> Image:
    """The picture, sRGB in [0, 1], three channels, or four where the image has coverage."""
    step = max(1, math.ceil(max(image.height // image.pages, image.width) / LARGEST))
    pixels = image.pixels[: image.height // image.pages : step, ::step]
    coverage = pixels[..., -1:] if image.alpha is not Alpha.NONE else None
    colours = pixels[..., : image.colours]
    with np.errstate(invalid="ignore", over="ignore"):
        if coverage is not None and image.alpha is Alpha.ASSOCIATED:
            colours = np.divide(colours, coverage, out=np.zeros_like(colours), where=coverage > 0)
        made = _vector(colours) if colours.shape[2] == 2 else _colours(colours, image.space)
    infinite = np.isinf(colours).any(axis=2, keepdims=True)
    made = np.where(infinite, INFINITE, made)
    made = np.where(np.isnan(colours).any(axis=2, keepdims=True), NOT_A_NUMBER, made)
    if coverage is not None:
        made = np.concatenate([made, np.clip(np.nan_to_num(coverage, nan=1.0), 0, 1)], axis=2)
    alpha = Alpha.NONE if coverage is None else Alpha.STRAIGHT
    return Image(aligned(made.astype(np.float32)), Space.SRGB, alpha, Storage.UINT8)


def png(image: Image) -> bytes:
    """`shown` as a PNG of 8 bits."""
    return bytes(encode(shown(image), "png", storage=Storage.UINT8).data)


def _colours(pixels: Array, space: Space) -> Array:
    """Three channels in [0, 1]."""
    values = pixels[..., :3].astype(np.float64)
    if space is Space.LINEAR:
        light = np.clip(values, 0, 1)
        values = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    elif space is Space.DATA:
        values = _stretched(values)
    return np.broadcast_to(np.clip(values, 0, 1), (*values.shape[:2], 3))


def _stretched(values: Array) -> Array:
    """From the least to the largest, but for values that lie in [0, 1] and use a part of it."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return values
    low, high = float(finite.min()), float(finite.max())
    if low >= 0 and high <= 1 and high - low > 0.1:
        return values
    return (values - low) / (high - low) if high > low else np.full_like(values, 0.5)


def _vector(pixels: Array) -> Array:
    """Direction as hue, length over the longest as brightness."""
    x, y = (np.nan_to_num(pixels[..., channel].astype(np.float64), posinf=0, neginf=0) for channel in (0, 1))
    length = np.hypot(x, y)
    longest = float(length.max(initial=0.0)) or 1.0
    turn = np.arctan2(y, x) / (2 * np.pi) * 6
    rgb = np.stack([np.abs((turn + shift) % 6 - 3) - 1 for shift in (0.0, 4.0, 2.0)], axis=2)
    return np.asarray(0.12 + 0.88 * np.clip(rgb, 0, 1) * np.sqrt(length / longest)[..., np.newaxis])
