"""Z composite: of two pictures with depth, what is nearer at every pixel.

Truth: with z = scale x depth + bias, and `apart` = z - base_depth, or its negative where larger depths are nearer,

    apart < -tolerance    the image is in front
    apart > tolerance     the base is
    otherwise             they are coplanar, and `coplanar` decides: image, base, their mean, or image over base

A picture whose depth is NaN is not there at that pixel; where neither is, they count as coplanar, as do two infinite
depths. What is in front hides the other wholly, or, where `partial`, as far as it covers (associated coverage, `over`):
edges that cover pixels in part then show what lies behind them. The result is the picture, or the depth of what was
taken: the nearer of coplanar ones, unless one of them is chosen by name.

Scale and bias bring another renderer's depths to the base's. Depths are compared in doubles, by the definition as by
the method, so that rounding decides nothing.

Sources: McReynolds et al., Programming with OpenGL: advanced rendering, SIGGRAPH course 1997, section 14.4; T. Duff,
Compositing 3-D rendered images, SIGGRAPH 1985.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.compositing.blending import part
from lichen.operations.compositing.layers import FLOAT_MAX, same_size

if TYPE_CHECKING:
    from lichen.opencl.device import Device


class Nearer(StrEnum):
    """Which depths are nearer."""

    SMALLER = "smaller"
    LARGER = "larger"


class Coplanar(StrEnum):
    """What is taken where depths agree."""

    IMAGE = "image"
    BASE = "base"
    MEAN = "mean"
    OVER = "over"


class Output(StrEnum):
    """What the result is."""

    PICTURE = "picture"
    DEPTH = "depth"


class Parameters(OperationParameters):
    nearer: Nearer = Nearer.SMALLER
    """whether smaller or larger depths are nearer"""
    tolerance: float = Field(0.0, ge=0, le=1e30)
    """depths that differ by no more are coplanar"""
    coplanar: Coplanar = Coplanar.BASE
    """what is taken of coplanar pictures: image, base, mean, or over (the image over the base)"""
    scale: float = Field(1.0, ge=-1e6, le=1e6)
    """what the image's depth is multiplied by"""
    bias: float = Field(0.0, ge=-1e6, le=1e6)
    """what is added to it then"""
    partial: bool = False
    """whether what is farther shows as far as what is nearer does not cover it"""
    output: Output = Output.PICTURE
    """the picture, or its depth"""


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, base = facts["image"], facts["base"]
    flaws = same_size(facts, "image", "depth", "base", "base_depth")
    if (image.channels, image.alpha is Alpha.NONE) != (base.channels, base.alpha is Alpha.NONE):
        flaws.append(
            Flaw(
                "/inputs/base",
                f"has {base.channels} channels, alpha {base.alpha}; the image {image.channels}, {image.alpha}",
            )
        )
    return flaws


def _far(p: Parameters, facts: InputFacts) -> float:
    """Largest depth that may be written."""
    # Facts are asked for before the inputs are checked, so some may not be there yet.
    first = facts["image"]
    depth, base = facts.get("depth", first).extent, facts.get("base_depth", first).extent
    return min(max(depth.magnitude * abs(p.scale) + abs(p.bias), base.magnitude), FLOAT_MAX)


def _largest(facts: InputFacts) -> float:
    first = facts["image"]
    return max(first.extent.magnitude, facts.get("base", first).extent.magnitude)


def _most(p: Parameters, facts: InputFacts) -> float:
    """Of the picture: what is over another adds what shows of it."""
    largest = _largest(facts)
    over = p.partial or p.coplanar is Coplanar.OVER
    return min(largest * (2 + largest) if over and facts["image"].alpha is not Alpha.NONE else largest, FLOAT_MAX)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = 2 * ROUNDING * _far(p, facts) if p.output is Output.DEPTH else 3 * ROUNDING * _most(p, facts)
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    slack = _error(p, 0.0, facts).value
    spoilt = any(each.extent.nonfinite for each in facts.values())
    if p.output is Output.DEPTH:
        most = min(_far(p, facts) + slack, FLOAT_MAX)
        extent = Extent(-most, most, image.pixels if spoilt or most >= FLOAT_MAX else 0)
        return Facts(image.height, image.width, 1, Space.DATA, Alpha.NONE, extent)
    most = min(_most(p, facts) + slack, FLOAT_MAX)
    low = min(image.extent.low, facts.get("base", image).extent.low)
    low = -most if low < 0 or p.partial or p.coplanar is Coplanar.OVER else -slack
    return dataclasses.replace(image, extent=Extent(low, most, image.samples if spoilt or most >= FLOAT_MAX else 0))


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """Depths are data, which no error reaches; of pictures, a choice is as wrong as they are."""
    if p.output is Output.DEPTH:
        return 0.0
    return error * (2 + 2 * _largest(facts) + error if p.partial or p.coplanar is Coplanar.OVER else 1.0)


def _planes(*depths: tuple[float, ...]) -> Callable[[], Mapping[str, Any]]:
    def made() -> Mapping[str, Any]:
        first, second = (np.array(each, np.float32).reshape(1, -1, 1) for each in depths)
        ones = np.ones_like(first)
        return {"image": ones, "depth": first, "base": 2 * ones, "base_depth": second}

    return made


def _took(*expected: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1).tolist()
        return None if got == list(expected) else f"expected {list(expected)}, got {got}"

    return holds


z_composite = Operation(
    name="z_composite",
    family="compositing",
    summary="Takes of two pictures with depth what is nearer, with a rule for what is coplanar.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "a picture"),
        Input("depth", "its depth", (1, 1), picture=False),
        Input("base", "another picture of the same size and channels"),
        Input("base_depth", "its depth", (1, 1), picture=False),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    propagate=_propagate,
    check=_check,
    examples=(
        {},
        {"tolerance": 0.1, "coplanar": "mean"},
        {"nearer": "larger", "scale": 0.5, "bias": 0.1, "partial": True, "coplanar": "over"},
        {"output": "depth", "tolerance": 0.05},
    ),
    hard_cases=(
        HardCase(
            name="equal, infinite and missing depths",
            why="inf - inf is NaN, and comparisons with NaN choose silently",
            inputs=_planes((1, np.inf, np.nan, 2, np.nan, -np.inf), (1, np.inf, 3, np.nan, np.nan, -1)),
            parameters={"coplanar": "mean"},
            holds=_took(1.5, 1.5, 2, 1, 1.5, 1),
        ),
        HardCase(
            name="coplanar within the depth's quantum",
            why="two renderings of one plane differ in the last bit and fight for every pixel",
            inputs=_planes((0.1, 0.10000001, 0.2), (0.10000001, 0.1, 0.1)),
            parameters={"tolerance": 2e-8, "coplanar": "image"},
            holds=_took(1, 1, 2),
        ),
    ),
)


def _chosen(inputs: Inputs, p: Parameters) -> Array:
    """The definition, in the precision of the pictures; decisions in doubles."""
    image, base = inputs["image"], inputs["base"]
    with np.errstate(all="ignore"):
        own = inputs["depth"].pixels.astype(np.float64) * p.scale + p.bias
        other = inputs["base_depth"].pixels.astype(np.float64)
        apart = (own - other) * (1 if p.nearer is Nearer.SMALLER else -1)
        none, nothing = np.isnan(own), np.isnan(other)
        image_first, base_first = (nothing & ~none) | (apart < -p.tolerance), (none & ~nothing) | (apart > p.tolerance)
        tie = ~image_first & ~base_first
        if p.output is Output.DEPTH:
            nearest = np.minimum(own, other) if p.nearer is Nearer.SMALLER else np.maximum(own, other)
            of_tie = {Coplanar.IMAGE: own, Coplanar.BASE: other}.get(p.coplanar, nearest)
            return np.where(image_first, own, np.where(base_first, other, of_tie))
        top = image_first | (tie & (p.coplanar is not Coplanar.BASE))
        x, y = image.pixels, base.pixels
        above, below = np.where(top, x, y), np.where(top, y, x)
        half = x.dtype.type(0.5)
        mean = tie & (p.coplanar is Coplanar.MEAN)
        over = ~mean if p.partial else tie & (p.coplanar is Coplanar.OVER)
        covers = above[..., -1:] if image.alpha is not Alpha.NONE else np.ones_like(above[..., -1:])
        shown = above + part(below, np.broadcast_to(1 - covers, below.shape))
        return np.where(over, shown, np.where(mean, half * x + half * y, above))


@z_composite.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _chosen(inputs, p)


@z_composite.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples,
    rates={"opencl": Rate(3e-4, 1.5e-9), "numpy": Rate(1e-4, 4e-8)},
)
class Exact:
    """Depths compared in doubles; on a device without double precision, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, p, knob)
        image = inputs["image"]
        depth = p.output is Output.DEPTH
        out = aligned_empty((image.height, image.width, 1 if depth else image.channels))
        pixels = image.height * image.width
        sign = 1.0 if p.nearer is Nearer.SMALLER else -1.0
        defines: dict[str, int | float | str] = {
            "CHANNELS": image.channels, "COVERAGE": int(image.alpha is not Alpha.NONE), "DEPTH": int(depth),
            "TIE": list(Coplanar).index(p.coplanar), "OVER": int(p.partial),
        }  # fmt: skip
        with device.session() as session:
            session.launch(
                "compositing/z_composite.cl", "nearer", (-(-pixels // 64),),
                *(aligned(inputs[name].pixels) for name in ("image", "depth", "base", "base_depth")),
                session.write(out), aligned(np.array([p.scale, p.bias, p.tolerance, sign]), np.float64),
                np.uint64(pixels),
                defines=defines,
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_chosen(inputs, p).astype(np.float32))
