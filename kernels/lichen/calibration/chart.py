"""The furniture of a chart with two logarithmic axes: scales, ticks, and labels that find a free place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from lichen.calibration.drawing import Text

Box = tuple[float, float, float, float]
"""Left, top, right, bottom, px."""
SPACE = 6.0


@dataclass(frozen=True, slots=True)
class Scale:
    """log10 from [low, high] to [start, end], px. `start` may lie beyond `end`: the axis then runs the other way."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        """Where it stands, px. Raises ValueError where it is not above 0."""
        share = (math.log10(value) - math.log10(self.low)) / (math.log10(self.high) - math.log10(self.low))
        return self.start + share * (self.end - self.start)

    def ticks(self, steps: Sequence[int] = (1,)) -> list[float]:
        """Round numbers in the range: 1, 10, 100 times each of `steps`."""
        powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        found = [float(f"{step}e{power}") for power in powers for step in steps]
        return [each for each in found if self.low * (1 - 1e-9) <= each <= self.high * (1 + 1e-9)]

    @property
    def decades(self) -> float:
        return math.log10(self.high / self.low)


@dataclass(frozen=True, slots=True)
class Signed:
    """asinh(x / `unit`) from [low, high] to [start, end], px: logarithmic on both sides of 0, straight within units."""

    low: float
    high: float
    unit: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        """Where it stands, px."""
        low, high, at = (math.asinh(each / self.unit) for each in (self.low, self.high, value))
        return self.start + (at - low) / (high - low) * (self.end - self.start)

    def ticks(self, steps: Sequence[int] = (1,)) -> list[float]:
        """0 and, from ten units on, powers of ten on both sides of it, ascending. `steps` between them are left out."""
        powers = range(math.ceil(math.log10(10 * self.unit)), math.ceil(math.log10(self.high)) + 1)
        found = [0.0, *(sign * 10.0**power for power in powers for sign in (1, -1))]
        return sorted(each for each in found if self.low <= each <= self.high)


def spanning(values: Iterable[float], start: float, end: float, *, least: float, margin: float) -> Scale:
    """A scale over all positive finite values, `margin` decades beyond them, `least` decades long at least."""
    logs = [math.log10(value) for value in values if math.isfinite(value) and value > 0] or [0.0]
    low, high = min(logs) - margin, max(logs) + margin
    more = max(0.0, least - (high - low)) / 2
    return Scale(10 ** (low - more), 10 ** (high + more), start, end)


class Labels:
    """Places texts so that they cover no mark and no other text, inside the frame; one that cannot is left out."""

    def __init__(self, frame: Box, marks: Iterable[tuple[float, float, float]]) -> None:
        """`marks` are circles to keep clear: x, y, radius."""
        self._frame = frame
        self._taken: list[Box] = [(x - r, y - r, x + r, y + r) for x, y, r in marks]
        self.placed: list[Text] = []

    def reserve(self, box: Box) -> None:
        self._taken.append(box)

    def put(self, x: float, y: float, text: str, *, role: str, size: float, bold: bool = False, gap: float = 7) -> bool:
        """Beside the mark at (x, y); True if there was a place. `gap` is how far the text stays from its centre."""
        high = 0.36 * size
        places: tuple[tuple[Literal["start", "middle", "end"], float, float], ...] = (
            ("middle", 0.0, -gap - 1),
            ("start", gap, high),
            ("middle", 0.0, gap + 0.85 * size),
            ("end", -gap, high),
            ("start", 0.7 * gap, -0.7 * gap),
            ("end", -0.7 * gap, -0.7 * gap),
            ("start", 0.7 * gap, 0.7 * gap + 0.8 * size),
            ("end", -0.7 * gap, 0.7 * gap + 0.8 * size),
        )
        for anchor, dx, dy in places:
            trial = Text(x + dx, y + dy, text, role, size, anchor, bold, "panel")
            if self._free(trial.box):
                self._taken.append(trial.box)
                self.placed.append(trial)
                return True
        return False

    def _free(self, box: Box) -> bool:
        left, top, right, bottom = self._frame
        if box[0] < left or box[1] < top or box[2] > right or box[3] > bottom:
            return False
        return not any(_meet(box, other) for other in self._taken)


def _meet(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def nearest(box: Box, x: float, y: float) -> tuple[float, float]:
    """The point of a box that is nearest to (x, y)."""
    left, top, right, bottom = box
    return min(max(x, left), right), min(max(y, top), bottom)


def apart(texts: Iterable[Text]) -> list[Text]:
    """Those that stay `SPACE` px beside the texts kept before them: the most important come first."""
    kept: list[Text] = []
    for text in texts:
        left, top, right, bottom = text.box
        if not any(_meet((left - SPACE, top, right + SPACE, bottom), other.box) for other in kept):
            kept.append(text)
    return kept


def wrapped(text: str, width: float, size: float, *, bold: bool = False) -> list[str]:
    """The text in lines no wider than `width` px, but for words that are. `size` is that of the font, px."""
    lines: list[str] = []
    for word in text.split():
        joined = f"{lines[-1]} {word}" if lines else word
        if lines and Text(0, 0, joined, size=size, bold=bold).box[2] <= width:
            lines[-1] = joined
        else:
            lines.append(word)
    return lines
