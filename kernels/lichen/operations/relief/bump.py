"""Bump: normals bent by a relief, as if the surface were raised along them.

Truth, at a pixel of unit normal N, position P and height h, with the changes P_x, P_y, h_x and h_y along rows and
columns of the picture:

    r1 = P_y x N,   r2 = N x P_x,   det = P_x . r1
    result = |det| N - scale sign(det) (h_x r1 + h_y r2), brought to length 1

which is N less the gradient of the height on the surface, with no division: it holds for any parametrization, in
perspective, and however the surface is turned. Heights and positions are of one unit of length; `scale` multiplies
heights, so that stored codes become lengths, and below 0 it presses in. The surface itself stays where it is.

Changes are half of the way from the neighbour before to that behind. A neighbour counts where its position and its
height are finite; where one does not, and where one is more than `jump` times as far away as the other, whose surface
it then is not, the change is that to the other. Where no slope is known (nothing there, no neighbour along an axis, a
normal of no length, or one in the plane of the picture's own steps, of which det is 0) the normal stays as it is, and
so it does, bit for bit and whatever its length, where the height is flat. NaN in a height or a position makes that
pixel NaN and no other; where neighbours' heights are all equal, the position is not asked.

The definition is evaluated in doubles, in one order, and rounded to float32 once; that rounding is part of it, so what
reads the normals inherits no error. Where det is near 0 its sign decides between two opposite slopes, so a method of
fewer digits errs by all of the range there: `single` states that, and is taken only where it is named or time is short.

Sources: J. Blinn, Simulation of wrinkled surfaces, SIGGRAPH 1978; M. Mikkelsen, Bump mapping unparametrized surfaces on
the GPU, Journal of Graphics, GPU, and Game Tools 15 (2010), 49-61.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    EXACT,
    ROUNDING,
    Error,
    Facts,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
    halo,
)
from lichen.operations.compositing.layers import row_blocks
from lichen.operations.relief.bump_cases import CASES

if TYPE_CHECKING:
    from lichen.opencl.device import Device

RUN = 64
"""Pixels of a row in a work-item."""
TYPICAL = 3e-6
"""RMS of `single`: 2.6e-6 was the largest over the pictures that errors are measured on."""


class Parameters(OperationParameters):
    scale: float = Field(1.0, ge=-1e6, le=1e6)
    """factor on heights, which makes them lengths of the positions' unit; negative presses the relief in"""
    jump: float = Field(2.0, ge=1, le=1e6)
    """how many times as far away as the other a neighbour may be and still be of the same surface; 1: slopes are taken
    to the nearer neighbour wherever they differ"""


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    normal = facts["normal"]
    return [
        Flaw(f"/inputs/{name}", f"is {other.width}x{other.height}; normal is {normal.width}x{normal.height}")
        for name, other in facts.items()
        if (other.height, other.width) != (normal.height, normal.width)
    ]


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    height = facts["height"].extent
    if height.nonfinite:
        return None
    if p.scale == 0:
        return "its relief is pressed flat"
    return "the height is the same everywhere" if height.spread == 0 else None


def _result(p: Parameters, facts: InputFacts) -> Facts:
    normal = facts["normal"]
    most = max(normal.extent.magnitude, 1.0)
    spoilt = 3 * normal.pixels if any(each.extent.nonfinite for each in facts.values()) else 0
    return Facts(normal.height, normal.width, 3, Space.DATA, Alpha.NONE, Extent(-most, most, spoilt))


def _single(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """A unit vector against its opposite, or against a normal that stays as it was."""
    most = 1 + max(facts["normal"].extent.magnitude, 1.0) + 16 * ROUNDING
    return Error(min(most, float(np.finfo(np.float32).max)), "bound", 32 * ROUNDING, TYPICAL)


bump = Operation(
    name="bump",
    family="relief",
    summary="Bends normals by a relief on the surface: heights along the normal, in the unit of the positions.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("normal", "which way the surface faces: x, y, z", (3, 3), picture=False),
        Input("position", "where each pixel's point is; infinite where there is nothing", (3, 3), picture=False),
        Input("height", "how far the relief rises along the normal", (1, 1), picture=False),
    ),
    light=Light.STORED,
    footprint=lambda p, facts: halo(1),
    identity=_identity,
    result=_result,
    propagate=lambda p, facts, error: 0.0 if error == 0 else 1 + max(facts["normal"].extent.magnitude, 1.0),
    check=_check,
    examples=({}, {"scale": -0.25, "jump": 1}, {"scale": 40, "jump": 1e6}),
    hard_cases=CASES,
)


class Place(NamedTuple):
    """Points and heights of some pixels, and where both are finite."""

    position: Array
    height: Array
    whole: Array


def _dot(a: Array, b: Array) -> Array:
    """(..., 1), added in the order of the components."""
    x, y, z = (a[..., axis : axis + 1] * b[..., axis : axis + 1] for axis in range(3))
    return np.asarray(x + y + z)


def _cross(a: Array, b: Array) -> Array:
    (ax, ay, az), (bx, by, bz) = (np.moveaxis(each, -1, 0) for each in (a, b))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _change(before: Place, here: Place, after: Place, jump: float) -> tuple[Array, Array]:
    """Of the position and of the height along an axis; 0 where there is no neighbour."""
    back, on = here.position - before.position, after.position - here.position
    behind, ahead, square = _dot(back, back), _dot(on, on), jump * jump
    only_after = after.whole & (~before.whole | ((ahead > 0) & (behind > square * ahead)))
    only_before = before.whole & (~after.whole | ((behind > 0) & (ahead > square * behind)))
    known, made = before.whole | after.whole, []
    for b, h, a in ((before.position, here.position, after.position), (before.height, here.height, after.height)):
        change = np.where(only_after, a - h, np.where(only_before, h - b, (a - b) * 0.5))
        made.append(np.where(known, change, 0.0))
    return made[0], made[1]


def _unit(vectors: Array) -> Array:
    square = _dot(vectors, vectors)
    return np.asarray(vectors * (1.0 / np.where(square == 0, 1.0, np.sqrt(square))))


def _bent(inputs: Inputs, p: Parameters, rows: slice) -> Array:
    """Some rows, float32."""
    normal = inputs["normal"].pixels[rows].astype(np.float64)
    tall, wide = inputs["normal"].height, inputs["normal"].width
    first, last = max(rows.start - 1, 0), min(rows.stop + 1, tall)
    outside = ((int(first == rows.start), int(last == rows.stop)), (1, 1), (0, 0))
    position, height = (
        np.pad(inputs[name].pixels[first:last].astype(np.float64), outside, constant_values=np.nan)
        for name in ("position", "height")
    )
    whole = np.isfinite(position).all(axis=-1, keepdims=True) & np.isfinite(height)

    def at(down: int, across: int) -> Place:
        part = slice(1 + down, 1 + down + len(normal)), slice(1 + across, 1 + across + wide)
        return Place(position[part], height[part], whole[part])

    here, around = at(0, 0), [at(0, -1), at(0, 1), at(-1, 0), at(1, 0)]
    with np.errstate(all="ignore"):
        x, rise = _change(around[0], here, around[1], p.jump)
        y, fall = _change(around[2], here, around[3], p.jump)
        rise, fall, unit = rise * p.scale, fall * p.scale, _unit(normal)
        along, across = _cross(y, unit), _cross(unit, x)
        det = _dot(x, along)
        turned = np.where(det < 0, -1.0, 1.0)
        made = np.abs(det) * unit - turned * (rise * along + fall * across)
        made = made * (1.0 / np.sqrt(_dot(made, made)))
    number = ~np.isnan(here.position).any(axis=-1, keepdims=True)
    nowhere = number & ~np.isfinite(here.position).all(axis=-1, keepdims=True)
    flat = np.logical_and.reduce([(each.height == here.height) | ~np.isfinite(each.height) for each in around])
    flat = np.isfinite(here.height) & (flat | (p.scale == 0))
    kept = nowhere | flat | (here.whole & ((det == 0) | ((rise == 0) & (fall == 0))))
    return np.where(kept, normal, np.where(here.whole, made, np.nan)).astype(np.float32)


@bump.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _bent(inputs, p, slice(0, inputs["normal"].height)).astype(np.float64)


def _launched(device: Device, inputs: Inputs, p: Parameters, kernel: str, kind: type[np.floating[Any]]) -> Array:
    tall, wide = inputs["normal"].height, inputs["normal"].width
    out = aligned_empty((tall, wide, 3))
    with device.session() as session:
        session.launch(
            "relief/bump.cl", kernel, (-(-wide // RUN), tall),
            *(aligned(inputs[name].pixels) for name in ("normal", "position", "height")), session.write(out),
            np.int32(wide), np.int32(tall), kind(p.scale), kind(p.jump), local=(1, 1),
        )  # fmt: skip
    return out


@bump.method(
    "single",
    error=_single,
    work=lambda p, knob, facts: float(facts["normal"].pixels),
    rates={"opencl": Rate(2e-4, 1e-8), "numpy": Rate(1.5e-3, 3.6e-7)},
)
class Single:
    """In float32; NumPy, whose time goes into passes over arrays, takes doubles here, too."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, "bump_single", np.float32)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return Exact.numpy(inputs, p, knob)


@bump.method(
    "exact",
    error=lambda p, knob, facts: EXACT,
    work=lambda p, knob, facts: float(facts["normal"].pixels),
    rates={"opencl": Rate(3e-4, 1.2e-8), "numpy": Rate(1.5e-3, 3.6e-7)},
)
class Exact:
    """In doubles, rounded once; on a device without doubles, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, p, knob)
        return _launched(device, inputs, p, "bump", np.float64)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        tall, wide = inputs["normal"].height, inputs["normal"].width
        out = aligned_empty((tall, wide, 3))
        for rows in row_blocks(tall, wide):
            out[rows] = _bent(inputs, p, rows)
        return out
