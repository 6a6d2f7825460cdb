"""Normal map: which way a relief faces, from its heights.

Truth: with the slopes p and q of the heights along x and y (down), times `scale`,

    n = (-p, q, 1) / sqrt(p^2 + q^2 + 1)

x to the right, y up and z towards the viewer, as OpenGL has it; `directx` turns y down. `scale` is the height of the
value 1 in pixels, so a ramp that rises by 1 / scale a pixel is tilted by 45 degrees. Slopes are correlations with

    central   (-1, 0, 1) / 2 along the axis
    sobel     the same, smoothed by (1, 2, 1) / 4 across
    gaussian  the derivative of a Gaussian of `sigma` over seven pixels, and the Gaussian across (7 x 7 in all)

each scaled so that a ramp keeps its slope. `encoding` unit stores (n + 1) / 2, as files of normal maps do.

There is no trade to be made: the only method does what is asked to rounding. A steep relief loses nothing, because the
vector is brought near 1 before its length is taken; NaN reaches as far as the masks do.

Sources: J. Blinn, Simulation of wrinkled surfaces, SIGGRAPH 1978; M. Peercy et al., Efficient bump mapping hardware,
SIGGRAPH 1997, section 3 (the mask of 7 x 7).
"""

from __future__ import annotations

from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent, Space
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    ROUNDING,
    Border,
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
from lichen.operations.convolution.stencil import Stencil, correlate, correlated, reach_of_values, sum_of_taps
from lichen.operations.relief.directions import Convention, Encoding, encoded, unit

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from lichen.opencl.device import Device


class Mask(StrEnum):
    """How slopes are found."""

    CENTRAL = "central"
    SOBEL = "sobel"
    GAUSSIAN = "gaussian"


class Parameters(OperationParameters):
    mask: Mask = Mask.SOBEL
    """central differences, sobel, or the derivative of a gaussian over 7 x 7"""
    sigma: Pixels = Field(1.0, ge=0.3, le=3)
    """standard deviation of the gaussian"""
    scale: float = Field(4.0, ge=-1e6, le=1e6)
    """px; how high the value 1 is; negative presses the relief in"""
    encoding: Encoding = Encoding.SIGNED
    """signed: components from -1 to 1; unit: from 0 to 1"""
    convention: Convention = Convention.OPENGL
    """opengl: y points up; directx: down"""
    border: Border = Border.CLAMP
    """how heights continue beyond the edges"""
    value: float = Field(0.0, ge=-1e6, le=1e6)
    """height beyond a constant border"""


@lru_cache(maxsize=64)
def masks(mask: Mask, sigma: float) -> tuple[Stencil, Stencil]:
    """Of the slopes along x and along y."""
    if mask is Mask.GAUSSIAN:
        at = np.arange(-3.0, 4.0)
        across = np.exp(-(at**2) / (2 * sigma**2))
        slope = at * across / (at**2 * across).sum()
        across /= across.sum()
    else:
        across = np.array([0.25, 0.5, 0.25]) if mask is Mask.SOBEL else np.array([0.0, 1.0, 0.0])
        slope = np.array([-0.5, 0.0, 0.5])
    taps, middle = np.outer(across, slope), len(slope) // 2
    return Stencil(taps, middle, middle), Stencil(taps.T, middle, middle)


def _slopes(p: Parameters) -> tuple[Stencil, Stencil]:
    """Of the first two components of n."""
    x, y = masks(p.mask, p.sigma)
    up = p.scale if p.convention is Convention.OPENGL else -p.scale
    return Stencil(-p.scale * x.taps, x.top, x.left), Stencil(up * y.taps, y.top, y.left)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """A direction (a, b, 1) turns by no more than a and b change together."""
    low, high = reach_of_values(facts["height"], p.border, p.value)
    slopes = sum(mask.rounding(max(abs(low), abs(high))) for mask in _slopes(p))
    value = min(slopes, 2.0) + 8 * ROUNDING
    value /= 2 if p.encoding is Encoding.UNIT else 1
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    height, slack = facts["height"], 8 * ROUNDING
    low = 0.0 if p.encoding is Encoding.UNIT else -1.0
    spoilt = height.pixels * 3 if height.extent.nonfinite else 0
    return Facts(height.height, height.width, 3, Space.DATA, Alpha.NONE, Extent(low - slack, 1 + slack, spoilt))


def _plane(*slopes: float) -> Callable[[], Mapping[str, Any]]:
    def made() -> Mapping[str, Any]:
        y, x = np.mgrid[0:9, 0:11]
        return {"height": (slopes[0] * x + slopes[1] * y)[..., None].astype(np.float32)}

    return made


def _faces(*expected: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    """Inside, where no border takes part."""

    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        apart = float(np.abs(pixels[3:-3, 3:-3] - np.array(expected)).max())
        return None if apart <= 1e-6 else f"off by {apart:.3g}: {pixels[4, 5].tolist()}"

    return holds


def _only_around(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    nan: Array = np.asarray(np.isnan(pixels).any(axis=2))
    return None if nan[3:6, 4:7].any() and not nan[:3].any() and not nan[:, :4].any() else "NaN left the mask"


def _spoilt() -> Mapping[str, Any]:
    heights = np.zeros((9, 11, 1), np.float32)
    heights[4, 5] = np.nan
    return {"height": heights}


normal_map = Operation(
    name="normal_map",
    family="relief",
    summary="Makes a normal map of heights: central differences, Sobel, or the derivative of a Gaussian.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("height", "heights, in one channel", (1, 1), picture=False),),
    light=Light.STORED,
    footprint=lambda p, facts: masks(p.mask, p.sigma)[0].footprint(p.border),
    result=_result,
    propagate=lambda p, facts, error: 0.0,
    examples=(
        {},
        {"mask": "gaussian", "sigma": 1.2, "scale": 12, "encoding": "unit", "border": "wrap"},
        {"mask": "central", "scale": -3, "convention": "directx", "border": "constant", "value": 0.5},
    ),
    hard_cases=(
        HardCase(
            "a plane",
            "masks that are not divided by their weight make slopes of 8 from 1; y runs down, and normals up",
            _plane(0.25, -0.5),
            {"scale": 4, "mask": "gaussian"},
            _faces(-1 / 6**0.5, -2 / 6**0.5, 1 / 6**0.5),
        ),
        HardCase(
            "a relief as steep as numbers go",
            "squares of slopes overflow",
            _plane(1e25, 0.0),
            {"scale": 1e6},
            _faces(-1, 0, 0),
        ),
        HardCase("a missing height", "comparisons and lengths hide NaN", _spoilt, {}, _only_around),
    ),
)


def _turned(p: Parameters, a: Array, b: Array) -> Array:
    """Normals of the first two components, before their length is taken; in their precision."""
    return encoded(unit(np.concatenate([a, b, np.ones_like(a)], axis=-1)), p.encoding)


@normal_map.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    heights = inputs["height"].pixels
    with np.errstate(all="ignore"):
        return _turned(p, *(sum_of_taps(heights, mask, p.border, p.value) for mask in _slopes(p)))


@normal_map.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["height"].pixels * sum(mask.count + 10.0 for mask in _slopes(p)),
    rates={"opencl": Rate(5e-4, 1e-10), "numpy": Rate(3e-4, 2e-9)},
)
class Exact:
    """One multiply-add for every tap of both masks that is not zero, then the direction."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        heights = aligned(inputs["height"].pixels)
        tall, wide, _ = heights.shape
        out, slopes = aligned_empty((tall, wide, 3)), [aligned_empty(heights.shape) for _ in "xy"]
        with device.session() as session:
            for made, mask in zip(slopes, _slopes(p), strict=True):
                correlate(session, heights, made, mask, p.border, p.value)
            session.launch(
                "relief/normal_map.cl", "normals", (-(-heights.size // 16),),
                *(session.readwrite(each) for each in slopes), session.write(out), np.uint64(heights.size),
                np.int32(p.encoding is Encoding.UNIT),
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        heights = inputs["height"].pixels
        with np.errstate(all="ignore"):
            return aligned(_turned(p, *(correlated(heights, mask, p.border, p.value) for mask in _slopes(p))))
