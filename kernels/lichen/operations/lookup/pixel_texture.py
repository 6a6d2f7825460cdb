"""Pixel texture: every pixel's channels are coordinates into a texture.

Truth, for the first four channels c of a pixel, those that it lacks being 0:

    c <- scale c + bias                          one number, or one for each channel
    c <- before(c)                               tables of colour, linear between entries over [0, 1]
    (s, t, r, q, ...) <- matrix (c, 1)           one row for each coordinate; the identity unless given
    ... <- after(...)                            tables again
    (s, t, ...) <- (s, t, ...) / last            where projective; what lies behind (last <= 0) is `background`
    result = texture at (s, t, r, q)

That is the pixel path of OpenGL's imaging subset with pixel textures behind it, in one request and one kernel, without
what limited them: any number of channels in and out, a projective divide, signed and bright values, wrapping by axis.

The texture has 1 to 4 axes x, y, z, w. Its image holds slices from top to bottom: the texel (i, j, k, l) is the pixel
in column i and row (l depth + k) rows + j, where `depth` is the size of z, `fourth` that of w, and rows, that of y, is
as many as fit, the image's height over depth x fourth. Rows that remain are not read. One axis reads the first row.

Coordinates run over [0, 1] along each axis (units = unit) or count texels; centres lie at +0.5. Beyond the ends each
axis goes on as its border says. Filters: nearest; linear (2 texels along each axis); cubic (4, Catmull and Rom's).
A coordinate that is NaN makes its pixel NaN; an infinite one lies as far as 2^30 texels.

Methods: `exact` computes coordinates in doubles, as truth does, so that no pixel meets another texel; `single` computes
them in float32, which moves them by some millionths and by `nearest` may choose the neighbour. It is meant for devices
whose doubles are slow.

Sources: W. Heidrich et al., Applications of pixel textures in visualization and realistic image synthesis, I3D 1999,
section 2; W. Heidrich, High-quality shading and lighting for hardware-accelerated rendering, dissertation, 1999,
section 4.4 (projective pixel textures); P. Haeberli and M. Segal, Texture mapping as a fundamental drawing primitive,
1993.
"""

from __future__ import annotations

import dataclasses
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, field_validator

from lichen.errors import Flaw
from lichen.image import Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    WHOLE,
    Border,
    Error,
    Facts,
    Footprint,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.lookup.pixel_path import MOST, TAPS, Path, Texture
from lichen.operations.lookup.pixel_texture_cases import CASES, EXAMPLES

if TYPE_CHECKING:
    from lichen.opencl.device import Device

FLOAT_MAX = float(np.finfo(np.float32).max)
SEGMENT, GROUP, ROWS = 64, 16, 16
"""Pixels of a segment, segments of a work-group, and of an item on a processor: while it sums one, texels of the next
are on their way. Where thousands of items run at once, they wait for one another's, and each does one."""
NARROW = 256
"""Columns below which an image is taken as one row, so that segments are whole."""
BLOCK = 1 << 14
"""Pixels that the NumPy body takes at once."""
Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Each = Number | Annotated[tuple[Number, ...], Field(min_length=1, max_length=MOST)]
Table = Annotated[tuple[Number, ...], Field(min_length=1, max_length=4096)]
Tables = Annotated[tuple[Table, ...], Field(min_length=1, max_length=MOST)]


class Filter(StrEnum):
    """Which texels around a place are taken."""

    NEAREST = "nearest"
    LINEAR = "linear"
    CUBIC = "cubic"


class Units(StrEnum):
    """What coordinates count."""

    UNIT = "unit"
    TEXEL = "texel"


class Parameters(OperationParameters):
    dimensions: int = Field(2, ge=1, le=MOST)
    """axes of the texture"""
    depth: int = Field(1, ge=1, le=4096)
    """size of the third axis: slices that lie one below the other"""
    fourth: int = Field(1, ge=1, le=4096)
    """size of the fourth axis: stacks of slices that lie one below the other"""
    filter: Filter = Filter.LINEAR
    """nearest, linear or cubic"""
    border: Border | Annotated[tuple[Border, ...], Field(min_length=1, max_length=MOST)] = Border.CLAMP
    """how the texture goes on beyond its ends; one, or one for each axis"""
    background: float = Field(0.0, ge=-1e6, le=1e6)
    """the value beyond a constant border, and behind the projector"""
    units: Units = Units.UNIT
    """unit: coordinates run from 0 to 1 over the texture; texel: they count texels"""
    scale: Each = 1.0
    """what channels are multiplied by"""
    bias: Each = 0.0
    """what is added to them"""
    before: Tables | None = None
    """tables before the matrix, of one length: one for all channels, or one for each"""
    matrix: (
        Annotated[
            tuple[Annotated[tuple[Number, ...], Field(min_length=1, max_length=MOST + 1)], ...],
            Field(min_length=1, max_length=MOST),
        ]
        | None
    ) = None
    """a row for each coordinate: factors of up to 4 channels; a fifth number is added"""
    after: Tables | None = None
    """tables after the matrix: one for all coordinates, or one for each"""
    projective: bool = False
    """whether the coordinate after the last divides the others; up to 3 axes"""

    @field_validator("before", "after")
    @classmethod
    def _even(cls, tables: Tables | None) -> Tables | None:
        if tables is not None and len({len(each) for each in tables}) > 1:
            raise ValueError("tables must be of one length")
        return tables

    def sizes(self, facts: Facts) -> tuple[int, ...]:
        """Of the axes; 0 where the image holds too few rows."""
        depth = self.depth if self.dimensions > 2 else 1
        fourth = self.fourth if self.dimensions > 3 else 1
        rows = facts.height // (depth * fourth)
        return (facts.width, rows, depth, fourth)[: self.dimensions]

    @property
    def path(self) -> Path:
        scale, bias = (_for_each(each if isinstance(each, tuple) else (each,)) for each in (self.scale, self.bias))
        matrix = np.zeros((MOST, MOST + 1))
        if self.matrix is None:
            matrix[:, :MOST] = np.eye(MOST)
        else:
            for row, factors in enumerate(self.matrix):
                matrix[row, : len(factors)] = factors
        before, after = (None if each is None else _for_each(each) for each in (self.before, self.after))
        return Path(scale, bias, before, matrix, after, self.projective, self.dimensions)

    @property
    def borders(self) -> tuple[Border, ...]:
        return self.border if isinstance(self.border, tuple) else (self.border,) * self.dimensions


def _for_each(parts: tuple[Any, ...]) -> Array:
    """For every channel or coordinate one of them, again and again."""
    return np.array([parts[at % len(parts)] for at in range(MOST)], np.float64)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = []
    wanted = p.dimensions + p.projective
    if wanted > MOST:
        flaws.append(Flaw("/parameters/projective", f"needs a coordinate beyond {p.dimensions} axes; 4 is the most"))
    if p.matrix is not None and len(p.matrix) < wanted:
        flaws.append(Flaw("/parameters/matrix", f"has {len(p.matrix)} row(s) for {wanted} coordinate(s)"))
    for name in ("scale", "bias", "before", "after"):
        value = getattr(p, name)
        if isinstance(value, tuple) and len(value) not in (1, MOST) and len(value) < wanted:
            flaws.append(Flaw(f"/parameters/{name}", f"has {len(value)} part(s) for {wanted} coordinate(s)"))
    if len(p.borders) < p.dimensions:
        flaws.append(Flaw("/parameters/border", f"has {len(p.borders)} part(s) for {p.dimensions} axes"))
    if 0 in p.sizes(facts["texture"]):
        flaws.append(Flaw("/inputs/texture", f"has {facts['texture'].height} row(s), too few for depth and fourth"))
    return flaws


def _spread(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    """Range of what is weighted."""
    extent = facts.get("texture", facts["image"]).extent
    low, high = extent.low, extent.high
    if p.projective or Border.CONSTANT in p.borders:
        low, high = min(low, p.background), max(high, p.background)
    return low, high


def _sums(p: Parameters, facts: InputFacts) -> float:
    """Roundings of the weights and of the sum, relative to the weights' magnitudes: 1.25 along an axis of cubics."""
    low, high = _spread(p, facts)
    taps = TAPS[p.filter] ** p.dimensions
    over = 1.25**p.dimensions if p.filter is Filter.CUBIC else 1.0
    own = ROUNDING * abs(p.background)
    return own if taps == 1 else own + ROUNDING * (taps + 8 * p.dimensions) * over * max(abs(low), abs(high))


def _exact_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = min(_sums(p, facts), FLOAT_MAX)
    return Error(value, "bound", value)


def _moved(p: Parameters, facts: InputFacts) -> float:
    """Texels by which coordinates in float32 may be off, all axes together; infinite where they are divided."""
    path = p.path
    size = np.abs(path.scale) * facts["image"].extent.magnitude + np.abs(path.bias)
    off = 4 * ROUNDING * size

    def through(tables: Array | None, size: Array, off: Array) -> tuple[Array, Array]:
        if tables is None:
            return size, off
        entries, largest = tables.shape[1], np.abs(tables).max(axis=1)
        steepest = np.abs(np.diff(tables, axis=1)).max(axis=1, initial=0.0)
        return largest, steepest * (entries * off + 3 * ROUNDING * entries) + 4 * ROUNDING * largest

    size, off = through(path.before, size, off)
    factors = np.abs(path.matrix[:, :MOST])
    off = factors @ off + 7 * ROUNDING * (factors @ size + np.abs(path.matrix[:, MOST]))
    size, off = through(path.after, factors @ size + np.abs(path.matrix[:, MOST]), off)
    if p.projective:
        return float("inf")
    sizes = np.array(p.sizes(facts.get("texture", facts["image"])))
    count = sizes if p.units is Units.UNIT else np.ones_like(sizes)
    axes = slice(None, p.dimensions)
    return float(np.sum(count * off[axes] + 3 * ROUNDING * count * size[axes] + ROUNDING))


def _single_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Along an axis, neighbours differ by the range at most; a cubic's slope is 1.5 times that, times its weights'."""
    low, high = _spread(p, facts)
    over = 1.25**p.dimensions if p.filter is Filter.CUBIC else 1.0
    moved = 1.0 if p.filter is Filter.NEAREST else _moved(p, facts)
    steep = 3.0 * over if p.filter is Filter.CUBIC else 1.0
    most = (high - low) * (2 * over - 1)
    rounding = _sums(p, facts)
    value = min(min(most, steep * (high - low) * moved) + rounding, FLOAT_MAX)
    return Error(value, "bound", min(rounding, value))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, texture = facts["image"], facts.get("texture", facts["image"])
    low, high = _spread(p, facts)
    over = (high - low) * (1.25**p.dimensions - 1) if p.filter is Filter.CUBIC else 0.0
    slack = over + _sums(p, facts)
    bad = image.pixels * texture.channels if image.extent.nonfinite or texture.extent.nonfinite else 0
    low, high = max(low - slack, -FLOAT_MAX), min(high + slack, FLOAT_MAX)
    return dataclasses.replace(texture, height=image.height, width=image.width, extent=Extent(low, high, bad))


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    """Of a pixel of the image; a texel may be read from anywhere."""
    return POINTWISE if not facts["texture"].extent.nonfinite else WHOLE


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """A change of the texture comes through as a weighted mean of itself."""
    return error * (1.25**p.dimensions if p.filter is Filter.CUBIC else 1)


pixel_texture = Operation(
    name="pixel_texture",
    family="lookup",
    summary="Takes every pixel's channels as coordinates into a texture of one to four dimensions.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "coordinates, as they are stored; channels after the fourth are not read", picture=False),
        Input("texture", "what is looked up: slices one below the other"),
    ),
    light=Light.LINEAR,
    footprint=_footprint,
    result=_result,
    propagate=_propagate,
    implied=lambda p, facts: "any texel may be read, so tiles of the texture are none of the result",
    check=_check,
    examples=EXAMPLES,
    hard_cases=CASES,
)


def _texture(inputs: Inputs, p: Parameters) -> Texture:
    image = inputs["texture"]
    sizes = p.sizes(Facts.of(image))
    texels = image.pixels.reshape(-1, image.channels)
    return Texture(texels, sizes, p.borders, TAPS[p.filter], p.units is Units.UNIT, p.background)


def _found(inputs: Inputs, p: Parameters, real: type[np.floating], kind: type[np.floating]) -> Array:
    """The definition, coordinates in `real` and sums in `kind`."""
    image, texture, path = inputs["image"], _texture(inputs, p), p.path
    flat = image.pixels.reshape(-1, image.channels)
    out = aligned_empty((len(flat), inputs["texture"].channels), kind)
    with np.errstate(all="ignore"):
        for start in range(0, len(flat), BLOCK):
            coordinates, before = path.coordinates(flat[start : start + BLOCK], real)
            made = texture.sample(coordinates, kind)
            nan = np.isnan(coordinates).any(axis=1)
            made[~before & ~nan] = p.background
            out[start : start + BLOCK] = made
    return out.reshape(image.height, image.width, -1)


@pixel_texture.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _found(inputs, p, np.float64, np.float64)


def _launched(device: Device, inputs: Inputs, p: Parameters, real: type[np.floating]) -> Array:
    image, texture = inputs["image"], inputs["texture"]
    path, sizes = p.path, p.sizes(Facts.of(texture))
    tables = [each for each in (path.before, path.after) if each is not None]
    numbers = np.concatenate(
        [path.scale, path.bias, path.matrix.reshape(-1), [p.background], *(each.reshape(-1) for each in tables)]
    )
    borders = [list(Border).index(each) for each in p.borders]
    shape = np.zeros(2 * MOST, np.int32)
    shape[: len(sizes)], shape[MOST : MOST + len(borders)] = sizes, borders
    entries = [0 if each is None else each.shape[1] for each in (path.before, path.after)]
    flat = image.width < NARROW
    width, height = (image.width * image.height, 1) if flat else (image.width, image.height)
    out, own = aligned_empty((image.height, image.width, texture.channels)), ROWS if device.is_cpu else 1
    defines: dict[str, int | float | str] = {
        "REAL": "double" if real is np.float64 else "float", "DIMENSIONS": p.dimensions, "TAPS": TAPS[p.filter],
        "MADE": texture.channels if texture.channels in (1, 3, 4) else 0, "ROWS": own,
    }  # fmt: skip
    with device.session() as session:
        session.launch(
            "lookup/pixel_texture.cl", "lookup", (-(-width // SEGMENT), -(-height // own)),
            aligned(image.pixels), aligned(texture.pixels), session.write(out), aligned(numbers, real),
            aligned(shape, np.int32), np.int32(image.channels), np.int32(texture.channels),
            np.int32(p.units is Units.UNIT), np.int32(p.projective), *(np.int32(each) for each in entries),
            np.int32(width), np.int32(height), local=(1, GROUP // own), defines=defines,
        )  # fmt: skip
    return out


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Coordinates, then texels of every channel."""
    texels: int = TAPS[p.filter] ** p.dimensions * facts.get("texture", facts["image"]).channels
    return facts["image"].pixels * (8.0 + texels)


@pixel_texture.method(
    "exact",
    error=_exact_error,
    work=_work,
    rates={"opencl": Rate(3e-4, 6e-10), "numpy": Rate(5e-4, 4e-8)},
)
class Exact:
    """Coordinates in doubles, sums in float32; on a device without double precision, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, np.float64) if device.has_fp64 else Exact.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _found(inputs, p, np.float64, np.float32)


@pixel_texture.method(
    "single",
    error=_single_error,
    work=_work,
    rates={"opencl": Rate(3e-4, 6e-10), "numpy": Rate(5e-4, 4e-8)},
)
class Single:
    """Coordinates and sums in float32."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, np.float32)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _found(inputs, p, np.float32, np.float32)
