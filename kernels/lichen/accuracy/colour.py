"""What a viewer sees of a difference: CIEDE2000 for single colours, FLIP for pictures that alternate before the eye.

Both are defined for display-referred colour. Scene-linear pictures are taken as a display shows them: clipped to
[0, 1] and sRGB-encoded; grey ones are neutral; coverage shows colour over black. Data has no colour, and a picture
with a NaN or infinity has no score: the comparison inside such formulas drops NaN silently, and a spoilt picture comes
out perfect. Either way the answer is a `Seen` that says why it holds no numbers.

Sources: Sharma, Wu and Dalal, The CIEDE2000 color-difference formula: implementation notes, supplementary test data and
mathematical observations, Color Research and Application 30 (2005); Andersson, Nilsson, Akenine-Möller, Oskarsson,
Åström and Fairchild, FLIP: a difference evaluator for alternating images, HPG 2020.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lichen.accuracy.metrics import visible
from lichen.image import Image, Space
from lichen.memory import Array
from lichen.once import once

PIXELS_PER_DEGREE = 67.0
"""Of visual angle: a screen of 3840 pixels over 0.7 m, seen from 0.7 m."""

TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
"""From linear light with BT.709 primaries; white is D65."""
WHITE = TO_XYZ.sum(axis=1)


@dataclass(frozen=True, slots=True)
class Seen:
    """A perceived difference over a picture, or the reason why there is none."""

    mean: float | None = None
    largest: float | None = None
    refused: str = ""


def ciede2000(image: Image, truth: Array) -> Seen:
    """Colour difference of every pixel, in units of which 1 is about what can just be noticed. `truth` means what
    `image` means."""
    light = _lights(image, truth)
    if isinstance(light, str):
        return Seen(refused=light)
    return _seen(delta_e(*(lab(each) for each in light)))


def flip(image: Image, truth: Array, pixels_per_degree: float = PIXELS_PER_DEGREE) -> Seen:
    """LDR-FLIP, 0 (alike) to 1, at a stated viewing distance. `truth` means what `image` means."""
    light = _lights(image, truth)
    if isinstance(light, str):
        return Seen(refused=light)
    return _seen(flip_map(*light, pixels_per_degree))


def _seen(values: Array) -> Seen:
    return Seen(float(values.mean()), float(values.max()))


def _lights(image: Image, truth: Array) -> tuple[Array, Array] | str:
    """What a display emits for both, linear light (height, width, 3) in [0, 1]; or why nothing can be seen."""
    if image.space is Space.DATA:
        return "data has no colour"
    if image.colours not in (1, 3):
        return f"a picture has 1 or 3 colours, this one {image.colours}"
    if not (np.isfinite(image.pixels).all() and np.isfinite(truth).all()):
        return "NaN or infinity has no colour"
    return emitted(image, image.pixels), emitted(image, truth)


def emitted(image: Image, pixels: Array) -> Array:
    shown = visible(pixels, image.alpha)[..., : image.colours]
    clipped: Array = np.broadcast_to(np.clip(shown, 0, 1), (*shown.shape[:2], 3))
    if image.space is Space.SRGB:
        return np.where(clipped <= 0.04045, clipped / 12.92, ((clipped + 0.055) / 1.055) ** 2.4)
    return clipped


def lab(light: Array) -> Array:
    """CIE L*a*b* of linear light, for its own white."""
    return lab_of_xyz(light @ TO_XYZ.T / WHITE)


def lab_of_xyz(ratio: Array) -> Array:
    """CIE L*a*b* of tristimulus values over those of white."""
    bend = 6 / 29
    f = np.where(ratio > bend**3, np.cbrt(ratio), ratio / (3 * bend**2) + 4 / 29)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


# -------------------------------------------------------------------------------------------------------- CIEDE2000


HALF_TURN = math.pi + 1e-12
"""Hues no farther apart count as opposite at most: which of two that are is the farther must not be left to the last
digit of an arc tangent, which differs from one library to another."""


def delta_e(first: Array, second: Array) -> Array:
    """CIEDE2000 between L*a*b* colours (..., 3), symmetric; weights kL = kC = kH = 1.

    >>> import numpy as np
    >>> float(delta_e(np.array([50.0, 2.5, 0.0]), np.array([73.0, 25.0, -18.0])).round(4))
    27.1492
    """
    (l1, a1, b1), (l2, a2, b2) = (np.moveaxis(np.asarray(each, np.float64), -1, 0) for each in (first, second))
    stretch = 1.5 - 0.5 * _saturation((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2)
    a1, a2 = a1 * stretch, a2 * stretch
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = (np.arctan2(b, a) % (2 * np.pi) for a, b in ((a1, b1), (a2, b2)))
    grey = c1 * c2 == 0
    turn = h2 - h1
    turn = np.where(turn > HALF_TURN, turn - 2 * np.pi, np.where(turn < -HALF_TURN, turn + 2 * np.pi, turn))
    turn = np.where(grey, 0.0, turn)
    hue = 2 * np.sqrt(c1 * c2) * np.sin(turn / 2)
    middle = (h1 + h2) / 2
    other = np.where(h1 + h2 < 2 * np.pi, middle + np.pi, middle - np.pi)
    middle = np.where(np.abs(h1 - h2) > HALF_TURN, other, middle)
    middle = np.where(grey, h1 + h2, middle)
    lightness, chroma = (l1 + l2) / 2, (c1 + c2) / 2
    t = (
        1
        - 0.17 * np.cos(middle - math.radians(30))
        + 0.24 * np.cos(2 * middle)
        + 0.32 * np.cos(3 * middle + math.radians(6))
        - 0.20 * np.cos(4 * middle - math.radians(63))
    )
    blue = math.radians(60) * np.exp(-np.square((np.degrees(middle) - 275) / 25))
    twist = -2 * _saturation(chroma) * np.sin(blue)
    off = np.square(lightness - 50)
    dl = (l2 - l1) / (1 + 0.015 * off / np.sqrt(20 + off))
    dc = (c2 - c1) / (1 + 0.045 * chroma)
    dh = hue / (1 + 0.015 * chroma * t)
    squares: Array = dl * dl + dc * dc + dh * dh + twist * dc * dh
    return np.sqrt(np.maximum(squares, 0))


def _saturation(chroma: Array) -> Array:
    """sqrt(C^7 / (C^7 + 25^7)), written so that C^7 cannot overflow and 0 / 0 does not come up."""
    with np.errstate(over="ignore", divide="ignore"):
        share: Array = 1 / np.sqrt(1 + (25 / chroma) ** 7)
    return share


# ------------------------------------------------------------------------------------------------------------- FLIP

# The paper's names. Gaussians of the eye's contrast sensitivity: (height, width) by channel of YCxCz.
CSF = {"A": ((1.0, 0.0047),), "RG": ((1.0, 0.0053),), "BY": ((34.1, 0.04), (13.5, 0.025))}
Q_C, P_C, P_T, WIDTH, Q_F = 0.7, 0.4, 0.95, 0.082, 0.5


def flip_map(light: Array, truth: Array, ppd: float) -> Array:
    """The difference seen at every pixel (height, width) between two pictures in linear light (height, width, 3)."""
    return flip_between(Viewed(light, ppd), Viewed(truth, ppd))


def flip_between(first: Viewed, second: Viewed) -> Array:
    """`flip_map` of two pictures at one distance."""
    colour = _redistributed(_hyab(first.adapted, second.adapted))
    changes = [np.abs(one - other) for one, other in zip(first.strengths, second.strengths, strict=True)]
    feature = (np.maximum(*changes) / math.sqrt(2)) ** Q_F
    seen: Array = colour ** (1 - feature)
    return seen


class Viewed:
    """Linear light (height, width, 3) as the metrics take it. What is found of it is kept: many results are compared
    with one truth."""

    def __init__(self, light: Array, ppd: float = PIXELS_PER_DEGREE) -> None:
        self._light, self._ppd = light, ppd

    @once
    def lab(self) -> Array:
        return lab(self._light)

    @once
    def _opponent(self) -> Array:
        return _ycxcz(self._light)

    @once
    def adapted(self) -> Array:
        """What the eye resolves of its colours."""
        return _hunt(_filtered(self._opponent, self._ppd))

    @once
    def strengths(self) -> tuple[Array, Array]:
        """How much edges and points stand out."""
        return _features(self._opponent[..., 0], self._ppd)


def _ycxcz(light: Array) -> Array:
    x, y, z = np.moveaxis(light @ TO_XYZ.T / WHITE, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def _light_of(opponent: Array) -> Array:
    y = (opponent[..., 0] + 16) / 116
    ratio = np.stack([y + opponent[..., 1] / 500, y, y - opponent[..., 2] / 200], axis=-1)
    light: Array = np.clip((ratio * WHITE) @ np.linalg.inv(TO_XYZ).T, 0, 1)
    return light


def _filtered(opponent: Array, ppd: float) -> Array:
    """YCxCz without what the eye does not resolve, as linear light."""
    widest = max(width for terms in CSF.values() for _, width in terms)
    radius = math.ceil(3 * math.sqrt(widest / (2 * math.pi**2)) * ppd)
    z = np.arange(-radius, radius + 1) / ppd
    blurred = np.empty_like(opponent)
    for channel, terms in enumerate(CSF.values()):
        # Each term, height sqrt(pi / width) exp(-pi^2 (x^2 + y^2) / width), is a product of two like profiles.
        profiles = [
            math.sqrt(height) * (math.pi / width) ** 0.25 * np.exp(-np.square(math.pi * z) / width)
            for height, width in terms
        ]
        total = sum(float(profile.sum()) ** 2 for profile in profiles)
        blurred[..., channel] = sum(_separable(opponent[..., channel], each, each) for each in profiles) / total
    return _light_of(blurred)


def _separable(plane: Array, across: Array, down: Array) -> Array:
    """Correlation with an outer product, edges continued."""
    import cv2

    plane = np.ascontiguousarray(plane)
    blurred: Array = cv2.sepFilter2D(plane, cv2.CV_64F, across, down, borderType=cv2.BORDER_REPLICATE)
    return blurred


def _hunt(light: Array) -> Array:
    """L*a*b* whose chroma fades with lightness."""
    colour = lab(light)
    colour[..., 1:] *= 0.01 * colour[..., :1]
    return colour


def _hyab(first: Array, second: Array) -> Array:
    apart = first - second
    distance: Array = np.abs(apart[..., 0]) + np.hypot(apart[..., 1], apart[..., 2])
    return distance


def _redistributed(distance: Array) -> Array:
    """To [0, 1]: most of the range for the differences below P_C of the largest there is, green against blue."""
    green, blue = (_hunt(np.array([[each]])) for each in ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    most = float(_hyab(green, blue)[0, 0]) ** Q_C
    raised, knee = distance**Q_C, P_C * most
    small = P_T / knee * raised
    spread: Array = np.where(raised < knee, small, P_T + (raised - knee) / (most - knee) * (1 - P_T))
    return spread


def _features(plane: Array, ppd: float) -> tuple[Array, Array]:
    """How much edges and points stand out."""
    sigma = 0.5 * WIDTH * ppd
    radius = math.ceil(3 * sigma)
    x = np.arange(-radius, radius + 1)
    bell = np.exp(-x * x / (2 * sigma**2))
    mean, bright = bell / bell.sum(), (plane + 16) / 116

    def strength(kernel: Array) -> Array:
        found: Array = np.hypot(_separable(bright, kernel, mean), _separable(bright, mean, kernel))
        return found

    return strength(_balanced(-x * bell)), strength(_balanced((x * x / sigma**2 - 1) * bell))


def _balanced(kernel: Array) -> Array:
    """Positive weights that sum to 1 and negative ones that sum to -1."""
    sides: Array = np.where(kernel > 0, kernel / kernel[kernel > 0].sum(), -kernel / kernel[kernel < 0].sum())
    return sides
