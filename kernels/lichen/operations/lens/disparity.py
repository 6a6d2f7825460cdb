"""Disparity: how far apart two eyes see what lies at a depth.

Truth. Two cameras look the same way, `baseline` apart; their pictures are shifted so that what lies at `convergence`
coincides. With f the focal length in pixels, half the height over the tangent of half `fov`,

    disparity(z) = baseline f (1 / z - 1 / convergence)    px, within `largest` either way

is how much farther to the right the left eye's picture shows it: above 0 before the plane of convergence, below
behind it, and 0 everywhere at infinity for eyes that do not converge. Infinity is a depth like any other; 0 and what
is nearer than what `largest` allows is `largest`; what lies behind the camera, and NaN, have none: NaN.

Each eye's picture is displaced by half of it (`displace` with this as its map); for toe-in cameras the pictures have
keystones besides (`homography`).

There is no trade here: one division a pixel. The one method is exact but for rounding.

Source: McReynolds et al., Programming with OpenGL: advanced rendering, SIGGRAPH course 1997, section 4.1.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent, Space
from lichen.memory import Array, aligned, aligned_empty
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
    Light,
    Operation,
    OperationParameters,
    Pixels,
    Rate,
)

if TYPE_CHECKING:
    from lichen.opencl.device import Device


class Parameters(OperationParameters):
    baseline: float = Field(0.065, ge=-1e6, le=1e6, description="between the eyes, in the units of the depths")
    convergence: float | None = Field(
        None, gt=1e-6, le=1e9, description="the depth that coincides; infinity if left out"
    )
    fov: Degrees = Field(40.0, ge=0.01, le=179, description="of the cameras, from top to bottom")
    largest: Pixels = Field(1e4, ge=0, le=1e6, description="no disparity is larger, either way")

    def scale(self, height: int) -> float:
        """baseline times focal length, px."""
        return self.baseline * (height / 2) / math.tan(math.radians(self.fov) / 2)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Evaluated in doubles, rounded once."""
    value = 1.01 * ROUNDING * p.largest
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    depth = facts["depth"]
    lost = depth.pixels if depth.extent.nonfinite or depth.extent.low < 0 else 0
    return Facts(depth.height, depth.width, 1, Space.DATA, Alpha.NONE, Extent(-p.largest, p.largest, lost))


def apart(depth: Array, p: Parameters, height: int, largest: float) -> Array:
    """Of depths in a picture of this height, within `largest`; float64."""
    z = depth.astype(np.float64)
    scale, back = p.scale(height), 1 / p.convergence if p.convergence else 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.where(scale == 0, 0.0, scale * (1 / np.abs(z) - back))
        return np.where(z >= 0, np.clip(found, -largest, largest), np.nan)


def _disparity(depth: Array, p: Parameters) -> Array:
    return apart(depth, p, depth.shape[0], p.largest)


def _known(pixels: Array, *expected: float) -> str | None:
    good = np.allclose(pixels.reshape(-1), expected, rtol=1e-6, atol=1e-6, equal_nan=True)
    return None if good else f"expected {expected}, got {pixels.reshape(-1).tolist()}"


disparity = Operation(
    name="disparity",
    family="lens",
    summary="Tells from depths how far apart two eyes see each pixel.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("depth", "distances along the view", (1, 1), picture=False),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    implied=lambda p, facts: "a focal length in pixels is a share of the whole height",
    examples=({}, {"convergence": 2.0, "fov": 60}, {"baseline": -0.5, "largest": 20}),
    hard_cases=(
        HardCase(
            name="depths of 0, infinity, behind the camera and none",
            why="1 / 0, and 1 / -0 on the other side",
            inputs=lambda: {"depth": np.array([0, -0.0, np.inf, -1, np.nan, 2], np.float32).reshape(1, -1, 1)},
            parameters={"baseline": 2.0, "fov": 90, "convergence": 4.0, "largest": 9},
            holds=lambda inputs, pixels: _known(pixels, 9, 9, -0.25, np.nan, np.nan, 0.25),
        ),
        HardCase(
            name="one eye",
            why="0 x inf",
            inputs=lambda: {"depth": np.array([0, 1, np.inf], np.float32).reshape(1, -1, 1)},
            parameters={"baseline": 0},
            holds=lambda inputs, pixels: _known(pixels, 0, 0, 0),
        ),
    ),
)


@disparity.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _disparity(inputs["depth"].pixels, p)


@disparity.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: float(facts["depth"].pixels),
    rates={"opencl": Rate(2e-4, 1.5e-9), "numpy": Rate(5e-5, 1.5e-8)},
)
class Exact:
    """In doubles, rounded once."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        depth = inputs["depth"].pixels
        if not device.has_fp64:
            return Exact.numpy(inputs, p, knob)
        out = aligned_empty(depth.shape)
        back = 1 / p.convergence if p.convergence else 0.0
        numbers = aligned(np.array([p.scale(depth.shape[0]), back, p.largest]), np.float64)
        with device.session() as session:
            session.launch(
                "lens/disparity.cl", "disparity", (-(-depth.size // 64),),
                aligned(depth), session.write(out), numbers, np.uint64(depth.size),
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_disparity(inputs["depth"].pixels, p).astype(np.float32))
