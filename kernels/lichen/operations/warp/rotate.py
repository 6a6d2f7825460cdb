"""Rotation about the middle of the image.

Truth: the image turned by `angle` degrees, counterclockwise as it is seen (y is down), about its middle; the result has
the image's size, or with `expand` that of the rectangle around it. Resampled as all warps are (see
`lichen.operations.warp.reference`): a rotation shrinks nothing, so truth is the Lanczos interpolation of radius 3.

Quarter turns are exact: their sines are taken as the whole numbers they are, and where the turned grid falls on the
grid of the result (always with `expand`, and for sides that are both even or both odd without), every method but
`mitchell` moves samples as they are.

`shears` turns by three passes along rows, columns and rows, each a shift of whole lines by the interpolating kernel of
radius 3 or `size` more: (x, y) -> (x + y tan(a / 2), y) twice, with (x, y) -> (x, y - x sin a) between. The angle is
first brought to within an eighth turn by whole quarter turns. What a shear moves out of the picture comes back with the
next, so passes are wide enough to hold it.

Source: Paeth, A fast algorithm for general raster rotation, Graphics Interface 1986. The factor of the outer shears is
-tan(a / 2); where it is printed as tan(a) / 2, areas keep their size but circles do not stay circles.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from lichen.memory import Array, aligned
from lichen.opencl.device import Device
from lichen.operation import Degrees, HardCase, InputFacts, Inputs, Knob, Rate
from lichen.operations.warp import cases
from lichen.operations.warp.maps import Projective
from lichen.operations.warp.prediction import Size, shears_error
from lichen.operations.warp.resampling import Warp, WarpParameters, declare, own_size
from lichen.operations.warp.shears import turned_by_shears
from lichen.part import place_of


class Parameters(WarpParameters):
    angle: Degrees = Field(30.0, ge=-1e6, le=1e6, description="counterclockwise", json_schema_extra={"unit": "deg"})
    expand: bool = Field(False, description="whether the result is as large as the turned image needs")


def direction(angle: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees; exact at quarter turns."""
    turns, rest = divmod(angle, 90.0)
    c, s = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    for _ in range(int(turns) % 4):
        c, s = -s, c
    return c, s


def _size(p: Parameters, facts: InputFacts) -> Size:
    image = facts["image"]
    if not p.expand or p.width or p.height:
        return own_size(p, facts)
    c, s = map(abs, direction(p.angle))
    sides = c * image.width + s * image.height, s * image.width + c * image.height
    return math.ceil(sides[0] - 1e-9), math.ceil(sides[1] - 1e-9)


def projective(p: Parameters, source: Size, target: Size) -> Projective:
    """About the middles of both: x = c u - s v, y = s u + c v, from the middles, undoes a turn to the left."""
    c, s = direction(p.angle)
    (w, h), (wide, tall) = source, target
    left, top = w / 2 - c * wide / 2 + s * tall / 2, h / 2 - s * wide / 2 - c * tall / 2
    return Projective.of(np.array([[c, -s, left], [s, c, top], [0, 0, 1.0]]))


def _map(p: Parameters, inputs: Inputs) -> Projective:
    image, place = inputs["image"], place_of(p)
    return projective(p, place.source_size if place else (image.width, image.height), WARP.extent_of(inputs, p))


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    same = p.angle % 360 == 0 and _size(p, facts) == (image.width, image.height)
    return "a whole turn brings every pixel back" if same else None


# A turn shrinks by 1 exactly; what rounding makes of that is no shrinking.
WARP = Warp[Parameters](_map, _size, largest=lambda p, facts: 1.0, projective=projective)

rotate = declare(
    WARP,
    name="rotate",
    summary="Turns an image about its middle.",
    description=__doc__ or "",
    parameters=Parameters,
    identity=_identity,
    examples=(
        {"angle": 33.0},
        {"angle": -104.5, "expand": True, "border": "clamp"},
        {"angle": 90, "expand": True},
    ),
    hard_cases=(
        HardCase(
            name="quarter turn",
            why="the cosine of a quarter turn is 6e-17, and a weight beside a sample is not 0",
            inputs=cases.noise_with_nan,
            parameters={"angle": -90, "expand": True},
            holds=cases.turned,
            methods=("nearest", "bilinear", "bicubic", "lanczos2", "lanczos3", "supersampled", "ewa", "mip", "shears"),
        ),
        HardCase(
            name="constant",
            why="weights that do not sum to one show as a pattern",
            inputs=cases.constant,
            parameters={"angle": 27.3, "border": "clamp"},
            holds=cases.stays_constant,
        ),
        HardCase(
            name="nearly a quarter turn",
            why="a shear by tan of a quarter turn is endless",
            inputs=cases.constant,
            parameters={"angle": 89.999999, "border": "clamp"},
            holds=cases.stays_constant,
        ),
    ),
)


@rotate.method(
    "shears",
    knob=Knob("size", (3.0, 6.0), "samples on either side of a shifted one", 2, 16),
    error=lambda p, knob, facts: shears_error(p, knob, facts),
    work=lambda p, knob, facts: facts["image"].samples * 6 * round(knob),
    rates={"opencl": Rate(2e-3, 8e-9), "numpy": Rate(2e-3, 8e-9)},
    unfit=lambda p, facts: None if place_of(p) is None else "turns whole pictures about their middle",
)
class Shears:
    """Three shears, each a shift of whole lines by a fraction: one dimension at a time, on the processor."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return Shears.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        width, height = WARP.extent_of(inputs, p)
        made = turned_by_shears(WARP.source(inputs, p), p.angle, width, height, round(knob))
        return aligned(made.astype(np.float32))
