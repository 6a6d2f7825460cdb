"""Vignette: how a lens darkens a picture towards its corners, put in or taken out.

Truth. At the radius r from `centre`, as a share of half the diagonal,

    gain = cos^power(angle) x open(2 `mechanical` r)

* Natural: the angle's tangent is that of half `fov` times the distance from the centre over half the height; the
  illumination of a plane by a small pupil falls as cos^4: once for the pupil's slant, once for the plane's, and twice
  for the distance.
* Mechanical: the rims of a lens cut the pupil to what two equal discs share whose centres lie d of their radii apart,
  open(d) = (2 acos(d / 2) - d sqrt(1 - d^2 / 4)) / pi. At `mechanical` 1 nothing is left in the corners.

Colour is multiplied by the gain, or by 1 / gain, at most `largest`, where `remove` is set; coverage stays.

Methods: `exact` evaluates that for every pixel. `table` interpolates between gains at as many radii as the knob says.

Sources: R. Kingslake, Optical system design, 1983; M. Aggarwal, H. Hua and N. Ahuja, On cosine-fourth and vignetting
effects in real lenses, ICCV 2001.
"""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.once import latest
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Degrees,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.compositing.layers import FLOAT_MAX

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from lichen.opencl.device import Device

SHARES = np.arange(1, 16) / 16
"""Where between two entries of a table its error is looked for."""
LENGTHS = (8, 32, 128, 1024)
"""Of tables."""
FIRST = np.multiply.outer([0.0, 0.5, 1.0], 1 / (np.array(LENGTHS) - 1))
"""Of tables of all lengths the first two entries and half way between, over the largest radius."""
WORST = 16
"""Pairs of entries that are looked at so, of many."""


class Parameters(OperationParameters):
    fov: Degrees = Field(40.0, ge=0.1, le=170, description="from the top of the picture to its bottom")
    power: float = Field(4.0, ge=0, le=16, description="of the cosine; 0 where there is no natural fall-off")
    mechanical: float = Field(0.0, ge=0, le=1, description="how far the rims close the corners: 0 not at all, 1 wholly")
    remove: bool = Field(False, description="whether the fall-off is taken out")
    largest: float = Field(16.0, ge=1, le=1000, description="no pixel is made brighter by more, where it is taken out")
    centre: tuple[float, float] = Field((0.5, 0.5), description="of the lens; shares of width and height")


@dataclasses.dataclass(frozen=True)
class Lens:
    """The fall-off in a picture of one size."""

    p: Parameters
    width: int
    height: int

    @property
    def diagonal(self) -> float:
        """Half of it, px."""
        return math.hypot(self.width, self.height) / 2

    @property
    def tangent(self) -> float:
        """Of the angle at radius 1."""
        return math.tan(math.radians(self.p.fov) / 2) * self.diagonal / (self.height / 2)

    @property
    def middle(self) -> tuple[float, float]:
        return self.p.centre[0] * self.width, self.p.centre[1] * self.height

    @property
    def farthest(self) -> float:
        """The largest radius in the picture."""
        x, y = self.middle
        return math.hypot(max(abs(x), abs(self.width - x)), max(abs(y), abs(self.height - y))) / self.diagonal

    def gain(self, r: Array) -> Array:
        """By radius; float64."""
        p, t, d = self.p, r * self.tangent, np.minimum(2 * self.p.mechanical * r, 2)
        made: Array = (1 + t * t) ** (-p.power / 2)
        if p.mechanical > 0:
            made = made * (2 * np.arccos(d / 2) - d * np.sqrt(1 - d * d / 4)) / math.pi
        return np.where(made * p.largest < 1, p.largest, 1 / np.where(made > 0, made, 1)) if p.remove else made

    def radii(self) -> Array:
        """Of the pixels, (height, width)."""
        x, y = self.middle
        across, down = np.arange(self.width) + 0.5 - x, (np.arange(self.height) + 0.5 - y)[:, np.newaxis]
        made: Array = np.sqrt(across * across + down * down) / self.diagonal
        return made

    def table(self, entries: int) -> Array:
        return self.gain(np.linspace(0, self.farthest, entries))


@lru_cache(maxsize=256)
def tabled(lens: Lens, entries: int) -> tuple[float, float]:
    """The largest error at 16 places between two entries, and a tenth more for what lies between those; and the largest
    step between two entries. Of a long table, it is looked for where the entries bend most, and where the gain comes to
    its limit: elsewhere it bends steadily."""
    step, made, cells = lens.farthest / (entries - 1), lens.table(entries), np.arange(entries - 1)
    steps = made[1:] - made[:-1]
    if entries > 2 * WORST:
        most = np.abs(steps[1:] - steps[:-1]).argpartition(-WORST)[-WORST:]
        limited = min(max(int(np.count_nonzero(made < lens.p.largest)) - 1, 0), entries - 2)
        cells = np.concatenate([most, most + 1, [limited]])
    linear = made[cells, np.newaxis] + steps[cells, np.newaxis] * SHARES
    apart = np.abs(linear - lens.gain((cells[:, np.newaxis] + SHARES) * step))
    return 1.1 * float(apart.max()), float(np.abs(steps).max())


def _lens(p: Parameters, facts: InputFacts) -> Lens:
    return Lens(p, facts["image"].width, facts["image"].height)


def _most(p: Parameters) -> float:
    return p.largest if p.remove else 1.0


def _rounding(p: Parameters, facts: InputFacts) -> float:
    """A gain's relative error is the power's times that of the radius; that of the pupil's opening is absolute, and
    grows as its square where it is divided by."""
    relative = (6 * p.power + 12) * ROUNDING * _most(p)
    opening = 12 * ROUNDING * _most(p) ** 2 if p.mechanical > 0 else 0.0
    return min((relative + opening) * facts["image"].extent.magnitude, FLOAT_MAX)


def _exact_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = _rounding(p, facts)
    return Error(value, "estimate", value)


def _tabled_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    entries, image = round(knob), facts["image"].extent.magnitude
    apart, steepest = tabled(_lens(p, facts), entries)
    off = apart + 4 * ROUNDING * entries * steepest  # a place in the table is off by a few roundings of its number
    rounding = _rounding(p, facts)
    return Error(min(off * image + rounding, FLOAT_MAX), "estimate", rounding)


def _tabled_least(p: Parameters, knob: float, facts: InputFacts) -> float:
    return _leasts(p, facts).get(knob, 0.0)


@latest
def _leasts(p: Parameters, facts: InputFacts) -> dict[float, float]:
    """For tables of all lengths: half way between the first two entries."""
    lens, magnitude = _lens(p, facts), facts["image"].extent.magnitude
    first, halfway, second = lens.gain(lens.farthest * FIRST)
    return dict(zip(LENGTHS, (magnitude * np.abs((first + second) / 2 - halfway)).tolist(), strict=True))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    slack, most = _rounding(p, facts), _most(p)
    low, high = min(image.extent.low * most, 0.0) - slack, max(image.extent.high * most, 0.0) + slack
    bad = image.extent.nonfinite or max(abs(low), abs(high)) >= FLOAT_MAX
    extent = Extent(max(low, -FLOAT_MAX), min(high, FLOAT_MAX), image.samples if bad else 0)
    return dataclasses.replace(image, extent=extent)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    return "there is no fall-off of either kind" if p.power == 0 and p.mechanical == 0 else None


def _white(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """Finite, brightest in the middle, and the same at opposite pixels."""
    good = np.isfinite(pixels).all() and np.allclose(pixels, pixels[::-1, ::-1], rtol=1e-5, atol=1e-7)
    middle = pixels[pixels.shape[0] // 2, pixels.shape[1] // 2]
    return None if good and pixels.min() >= 0 and (pixels <= middle + 1e-6).all() else "not a lens's fall-off"


vignette = Operation(
    name="vignette",
    family="lens",
    summary="Darkens a picture towards its corners as a lens does, or takes that out.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture"),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    result=_result,
    propagate=lambda p, facts, error: error * _most(p),
    implied=lambda p, facts: "the fall-off is about the middle of the whole picture",
    examples=(
        {"fov": 60.0},
        {"mechanical": 0.7, "centre": [0.4, 0.55]},
        {"fov": 80.0, "mechanical": 0.4, "remove": True},
    ),
    hard_cases=(
        HardCase(
            name="corners that are closed wholly",
            why="the arc of something above 1, and the root of something below 0",
            inputs=lambda: {"image": np.ones((65, 129, 1), np.float32)},
            parameters={"mechanical": 1.0, "fov": 170.0},
            holds=_white,
        ),
        HardCase(
            name="nothing is divided by nothing",
            why="1 / 0 where the lens lets nothing through",
            inputs=lambda: {"image": np.ones((9, 9, 1), np.float32)},
            parameters={"mechanical": 1.0, "remove": True, "centre": [0.0, 0.0], "largest": 50},
            holds=lambda inputs, pixels: (
                None
                if np.isfinite(pixels).all() and abs(float(pixels.max()) - 50) < 1e-3
                else f"up to {pixels.max():g}"
            ),
        ),
    ),
)


def _gained(inputs: Inputs, gain: Array) -> Array:
    image = inputs["image"]
    made = image.pixels.copy()
    with np.errstate(all="ignore"):
        made[..., : image.colours] *= gain[..., np.newaxis].astype(made.dtype)
    return made


def _of(inputs: Inputs, p: Parameters) -> Lens:
    return Lens(p, inputs["image"].width, inputs["image"].height)


@vignette.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    lens = _of(inputs, p)
    return _gained(inputs, lens.gain(lens.radii()))


def _launched(device: Device, inputs: Inputs, p: Parameters, entries: int) -> Array:
    image, lens = inputs["image"], _of(inputs, p)
    unit = lens.diagonal * (lens.farthest if entries else 1.0)
    numbers = np.array([*lens.middle, 1 / unit, p.power / 2, lens.tangent, 2 * p.mechanical, p.largest], np.float32)
    out = aligned_empty(image.pixels.shape)
    defines: dict[str, int | float | str] = {
        "CHANNELS": image.channels, "COLOURS": image.colours, "TABLE": int(entries > 0), "REMOVE": int(p.remove),
        "FOURTH": int(p.power == 4), "MECHANICAL": int(p.mechanical > 0),
    }  # fmt: skip
    with device.session() as session:
        session.launch(
            "lens/vignette.cl", "vignette", (-(-image.width // 16), image.height),
            aligned(image.pixels), session.write(out), aligned(numbers), aligned(lens.table(max(entries, 2))),
            np.int32(image.width), np.int32(image.height), np.int32(entries),
            local=(1, 16), defines=defines,
        )  # fmt: skip
    return out


def _steps(p: Parameters) -> float:
    """Of a gain, where a channel takes one."""
    return (1.0 if p.power == 4 else 4.0) + 4.0 * (p.mechanical > 0)


@vignette.method(
    "exact",
    error=_exact_error,
    work=lambda p, knob, facts: facts["image"].pixels * (_steps(p) + facts["image"].channels),
    rates={"opencl": Rate(3e-4, 2.4e-10), "numpy": Rate(2e-4, 1e-8)},
)
class Exact:
    """The formula, for every pixel."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, 0)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        lens = _of(inputs, p)
        return aligned(_gained(inputs, lens.gain(lens.radii())))


@vignette.method(
    "table",
    knob=Knob("entries", LENGTHS, "gains along the radius", 2, 65536, order=-2),
    error=_tabled_error,
    least=_tabled_least,
    work=lambda p, knob, facts: facts["image"].pixels * (4.0 + facts["image"].channels) + knob,
    rates={"opencl": Rate(3e-4, 2e-10), "numpy": Rate(2e-4, 8e-9)},
)
class Table:
    """Between gains at even radii."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, round(knob))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        lens, entries = _of(inputs, p), round(knob)
        places = np.linspace(0, lens.farthest, entries)
        return aligned(_gained(inputs, np.interp(lens.radii(), places, lens.table(entries))))
