"""Tiles: which lamps give something where, so that what shades need not look at the others; and an environment.

Truth: a picture of one pixel for each tile of 32 px (see `lichen.operations.scene.lists`), and two channels for each of
the `lights`: why the lamp is left out in the tile, and how much it may have given there at most. A reason of 0 means
that it is to be computed; `lichen.operations.scene.reaching` has the others, with the bounds that prove them. All that
is left out of a tile amounts to `faint` together at most: it is no larger than that in any pixel, in units of the light
that reaches the eye through the `fog`. Where `surroundings` say that there is an environment, it comes after the lamps,
as one more effect.

A tile in which a position or a normal is not a number has nothing left out.

One pass over both pictures finds a box around the points of each tile and one around their normals; nothing else
depends on their size. Boxes are found without a rounding, so there is one method and no trade. Where `worth` is set
some tiles are looked at before, so that lists that would not pay are not made. On a device boxes are kept as long as
both pictures are, since frames with other lamps ask for the same, and so are the last lists of the same lamps.

Sources: O. Olsson and U. Assarsson, Tiled shading, Journal of Graphics, GPU, and Game Tools 15, 2011; W. Heidrich,
High-quality shading and lighting, dissertation, Erlangen 1999.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Extent, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    EXACT,
    WHOLE,
    Facts,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.compositing.layers import same_size
from lichen.operations.fog.parameters import Parameters as Fog
from lichen.operations.lighting.lamps import Lamp
from lichen.operations.scene.lists import TILE, tiles_of
from lichen.operations.scene.reaching import NOTHING, REASONS, Boxes, Lamps, Sky, reached
from lichen.operations.scene.tiles_cases import CASES, EXAMPLES

if TYPE_CHECKING:
    from lichen.opencl.device import Device

PROBED, FEW = 4, 64
"""Of so many tiles in both directions one is looked at first; of fewer than so many together all are."""
LISTS = 4
"""Lists that are kept of two pictures."""
BOUNDS = 16
"""Numbers of a tile: twelve bounds, whether it is spoilt, and three that are not used."""


class Surroundings(StrEnum):
    """Where an environment is looked at."""

    NONE = "none"
    SURFACES = "surfaces"
    EVERYWHERE = "everywhere"
    """where there is no surface, too"""


class Parameters(OperationParameters):
    lights: Annotated[tuple[Lamp, ...], Field(min_length=1, max_length=256)] = (Lamp.model_validate({}),)
    """the lamps, as of lighting"""
    fog: Fog | None = None
    """parameters of the operation fog; what it hides needs no light"""
    reflected: float | None = Field(None, ge=0, le=1e30)
    """the largest radiance that a surface sends of a lamp's 1; none: it has no bound"""
    surroundings: Surroundings = Surroundings.NONE
    """none, or where surfaces, or all pixels, show an environment: one more effect, after the lamps"""
    brightest: float | None = Field(None, ge=0, le=1e30)
    """the largest light that an environment adds to a pixel; none: it has no bound"""
    faint: float = Field(0.0, ge=0, le=1e6)
    """the largest light of a pixel that may be left out"""
    worth: float = Field(0.0, ge=0, le=1)
    """the share of pairs of a lamp and a tile that must be left out in every fourth tile of every fourth row (of fewer
    than 64 tiles in all), those aside where nothing is; where it is less, nothing is left out anywhere"""

    @property
    def effects(self) -> int:
        return len(self.lights) + (self.surroundings is not Surroundings.NONE)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = same_size(facts, "position", "normal")
    if p.fog is not None and len(p.fog.heights) != len(p.fog.densities):
        flaws.append(Flaw("/parameters/fog/densities", "must be as many as heights"))
    if p.fog is not None and not p.fog.end > p.fog.start:
        flaws.append(Flaw("/parameters/fog/end", "must lie beyond start"))
    return flaws


def _result(p: Parameters, facts: InputFacts) -> Facts:
    down, across = tiles_of(facts["position"].height, facts["position"].width)
    most = max(len(REASONS) - 1.0, p.faint * (1 + 1e-6))
    return Facts(down, across, 2 * p.effects, extent=Extent(0.0, most, 0))


tiles = Operation(
    name="tiles",
    family="scene",
    summary="Tells for every tile of a picture which lamps, and whether an environment, give nothing there, and why.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("position", "where surfaces are: x, y, z; infinite where there is nothing", (3, 3), picture=False),
        Input("normal", "which way they face, of any length", (3, 3), picture=False),
    ),
    light=Light.STORED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    propagate=lambda p, facts, error: 0.0 if error == 0 else float(len(REASONS)),
    implied=lambda p, facts: "tiles are counted from the picture's corner",
    check=_check,
    examples=EXAMPLES,
    hard_cases=CASES,
)


def _bounds(inputs: Inputs) -> Array:
    """Of every tile, float32 (tiles, 13), as the kernel has them."""
    position, normal = (inputs[name].pixels.astype(np.float32) for name in ("position", "normal"))
    there = np.isfinite(position)
    spoilt = np.isnan(position) | ~np.isfinite(normal)
    down, across = (np.arange(0, size, TILE) for size in position.shape[:2])

    def over(pick: np.ufunc, values: Array) -> Array:
        made: Array = pick.reduceat(pick.reduceat(values, down, axis=0), across, axis=1)
        return made.reshape(-1, 3)

    infinite = np.float32(np.inf)
    parts = [
        over(np.minimum, np.where(there, position, infinite)), over(np.maximum, np.where(there, position, -infinite)),
        over(np.minimum, np.where(there & ~spoilt, normal, infinite)),
        over(np.maximum, np.where(there & ~spoilt, normal, -infinite)),
        over(np.maximum, spoilt.astype(np.float32)).max(axis=1, keepdims=True),
    ]  # fmt: skip
    return np.concatenate(parts, axis=1)


@dataclass(frozen=True, slots=True)
class Taken:
    """Every `step`th tile from a row and a column on; `down` and `across` of them."""

    row: int
    column: int
    step: int
    down: int
    across: int

    @classmethod
    def of(cls, image: Image, step: int) -> Taken:
        """Not from the first row and column on, which show the sky as a rule."""
        sizes = tiles_of(image.height, image.width)
        row, column = (min(step // 3, size - 1) for size in sizes)
        down, across = (-(-(size - first) // step) for size, first in zip(sizes, (row, column), strict=True))
        return cls(row, column, step, down, across)


def _lists(bounds: Callable[[Taken], Array], inputs: Inputs, p: Parameters) -> Array:
    """The picture, from what finds the bounds of tiles."""
    every, some = (Taken.of(inputs["position"], step) for step in (1, PROBED))
    some = some if every.down * every.across >= FEW else every
    lamps = Lamps.of(p.lights)
    if p.worth and share_left_out(bounds(some), p) < p.worth:
        return np.zeros((every.down, every.across, 2 * p.effects), np.float32)
    made = reached(Boxes.of(bounds(every)), lamps, p.fog, p.reflected, p.faint, _sky(p))
    return made.reshape(every.down, every.across, -1).astype(np.float32)


def _sky(p: Parameters) -> Sky | None:
    if p.surroundings is Surroundings.NONE:
        return None
    most = math.inf if p.brightest is None else p.brightest
    return Sky(most, behind=p.surroundings is Surroundings.EVERYWHERE)


def share_left_out(found: Array, p: Parameters) -> float:
    """Of the pairs of an effect and a tile with these bounds, those aside where nothing is."""
    why = reached(Boxes.of(found), Lamps.of(p.lights), p.fog, p.reflected, p.faint, _sky(p))[:, : p.effects]
    there = np.count_nonzero(why != NOTHING)
    return np.count_nonzero(why > NOTHING) / there if there else 1.0


def bounds_of_points(position: Array, normal: Array) -> Array:
    """The bounds of tiles of one point each, float32 (points, 13); both are (points, 3)."""
    found = np.isfinite(position)
    spoilt = (np.isnan(position) | ~np.isfinite(normal)).any(axis=1, keepdims=True)
    ends = [np.where(found, position, end) for end in (np.inf, -np.inf)]
    return np.concatenate([*ends, normal, normal, spoilt], axis=1, dtype=np.float32)


def _on_numpy(inputs: Inputs, p: Parameters) -> Array:
    found = _bounds(inputs)
    position = inputs["position"]
    square = found.reshape(*tiles_of(position.height, position.width), -1)
    return _lists(
        lambda taken: square[taken.row :: taken.step, taken.column :: taken.step].reshape(-1, found.shape[1]), inputs, p
    )


def _kept(device: Device, inputs: Inputs, taken: Taken) -> Array:
    """The bounds of tiles, kept as long as both pictures are: frames with other lamps ask for the same."""
    position, normal = inputs["position"], inputs["normal"]
    held: dict[Taken, tuple[weakref.ref[Image], Array]] = vars(position).setdefault("bounds", {})
    beside, found = held.get(taken, (None, None))
    if beside is None or found is None or beside() is not normal:
        found = _launched(device, inputs, taken)
        held[taken] = weakref.ref(normal), found
    return found


def _listed(device: Device, inputs: Inputs, p: Parameters) -> Array:
    """The lists; those that were made last of the same pictures are kept, for the next frame."""
    position, normal = inputs["position"], inputs["normal"]
    held: list[tuple[Parameters, weakref.ref[Image], Array]] = vars(position).setdefault("lists", [])
    for known, beside, made in list(held):
        if beside() is normal and known == p:
            return aligned(made.copy())
    made = aligned(_lists(partial(_kept, device, inputs), inputs, p))
    held[:] = [*held[1 - LISTS :], (p, weakref.ref(normal), made)]
    return aligned(made.copy())


def _launched(device: Device, inputs: Inputs, taken: Taken) -> Array:
    """The bounds of tiles, by the kernel."""
    position, normal = (aligned(inputs[name].pixels) for name in ("position", "normal"))
    height, width, _ = position.shape
    count = taken.down * taken.across
    found = aligned_empty((count, BOUNDS))
    with device.session() as session:
        session.launch(
            "scene/tiles.cl", "bounds", (count,),
            position, normal, session.write(found), np.int32(width), np.int32(height), np.int32(taken.across),
            np.int32(count), np.int32(taken.column), np.int32(taken.row), np.int32(taken.step),
            local=(1,),
        )  # fmt: skip
    return found


@tiles.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _on_numpy(inputs, p).astype(np.float64)


@tiles.method(
    "exact",
    error=lambda p, knob, facts: EXACT,
    work=lambda p, knob, facts: facts["position"].pixels + 40.0 * len(p.lights),
    rates={"opencl": Rate(4e-4, 1e-9), "numpy": Rate(6e-4, 3e-8)},
)
class Exact:
    """Boxes on the device, the few numbers that follow from them on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _listed(device, inputs, p)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_on_numpy(inputs, p))


@tiles.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    """How many pairs of a lamp and a tile are left out for each reason, and what they amount to in a tile at most."""
    count = p.effects
    why, bounds = pixels[..., :count], pixels[..., count:]
    found = np.bincount(why.astype(int).ravel(), minlength=len(REASONS))
    return {
        "pairs": why.size,
        "skipped": [
            {
                "reason": REASONS[each],
                "pairs": int(found[each]),
                "bound": float(np.where(why == each, bounds, 0).sum(axis=-1).max()),
            }
            for each in range(1, len(REASONS))
            if found[each]
        ],
    }
