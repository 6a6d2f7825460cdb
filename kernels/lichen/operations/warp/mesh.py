"""Mesh: an image bent by a grid of control points.

Truth: the nodes of `grid`, rows of [x, y], lie evenly over the result from edge to edge; each tells which place of the
source is seen there, in pixels, or with `relative` how far from the place that a plain stretch shows. Between nodes,
places are interpolated by `patches`: bilinear, straight along the lines of the grid and with a kink at each; or
bicubic, the Catmull-Rom spline along rows and columns, smooth across them, with nodes beyond the edge continued in a
straight line. The source is resampled as all warps are (see `lichen.operations.warp.reference`).

Where the grid folds over itself, the source is seen more than once; it is never seen from both sides of a node.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.operation import HardCase, InputFacts, Inputs
from lichen.operations.warp import cases
from lichen.operations.warp.kernels import CATMULL_ROM
from lichen.operations.warp.maps import Doubles, Map, Recipe
from lichen.operations.warp.prediction import Size
from lichen.operations.warp.resampling import Warp, WarpParameters, declare, own_size

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Line = Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=2, max_length=256)]


class Patches(StrEnum):
    """How places between nodes follow from them."""

    BILINEAR = "bilinear"
    BICUBIC = "bicubic"


class Parameters(WarpParameters):
    grid: Annotated[tuple[Line, ...], Field(min_length=2, max_length=256)] = Field(
        (((0.0, 0.0), (0.0, 0.0)), ((0.0, 0.0), (0.0, 0.0))), description="rows of [x, y], all of one length, px"
    )
    relative: bool = Field(True, description="whether x and y count from where a plain stretch looks")
    patches: Patches = Field(Patches.BICUBIC, description="how places between nodes follow from them")


class Nodes(Map):
    """Nodes of shape (rows, columns, 2) over a result of (width, height)."""

    def __init__(self, nodes: Doubles, size: Size, patches: Patches) -> None:
        self.size, self.patches = size, patches
        nodes = np.concatenate([2 * nodes[:1] - nodes[1:2], nodes, 2 * nodes[-1:] - nodes[-2:-1]])
        self.nodes = np.concatenate(
            [2 * nodes[:, :1] - nodes[:, 1:2], nodes, 2 * nodes[:, -1:] - nodes[:, -2:-1]], axis=1
        )

    def recipe(self) -> Recipe:
        rows, columns, _ = self.nodes.shape
        start = columns - 2, rows - 2, *self.size, self.patches is Patches.BICUBIC
        return Recipe("warp/mesh.cl", np.concatenate([start, self.nodes.ravel()]))

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        u, v = np.broadcast_arrays(u, v)
        rows, columns = self.nodes.shape[0] - 2, self.nodes.shape[1] - 2
        across, down = u / self.size[0] * (columns - 1), v / self.size[1] * (rows - 1)
        i, j = np.clip(np.floor(across), 0, columns - 2), np.clip(np.floor(down), 0, rows - 2)
        wx, wy = self._weights(across - i), self._weights(down - j)
        first, second = i.astype(np.int64), j.astype(np.int64)  # of the node before, which has one more before it
        out = np.zeros((*u.shape, 2))
        for b in range(4):
            for a in range(4):
                out += (wy[b] * wx[a])[..., np.newaxis] * self.nodes[second + b, first + a]
        return out[..., 0], out[..., 1]

    def _weights(self, t: Doubles) -> Doubles:
        """Of nodes -1 to 2. Beyond the edge, where footprints reach by half a pixel, patches go on as they are."""
        if self.patches is Patches.BILINEAR:
            return np.stack([np.zeros_like(t), 1 - t, t, np.zeros_like(t)])
        inside = np.clip(t, 0, 1)
        whole = CATMULL_ROM.weights(np.where(inside == 1, 0.0, inside))
        last = np.array([0.0, 0.0, 1.0, 0.0]).reshape(4, *(1,) * t.ndim)
        before = np.array([-0.5, 0.0, 0.5, 0.0]).reshape(last.shape)
        after = np.array([0.0, -0.5, 0.0, 0.5]).reshape(last.shape)
        made: Doubles = np.where(inside == 1, last, whole) + (t - inside) * np.where(inside == 0, before, after)
        return made


def _map(p: Parameters, inputs: Inputs) -> Nodes:
    image = inputs["image"]
    nodes = np.array(p.grid, np.float64)
    if p.relative:
        rows, columns, _ = nodes.shape
        x, y = np.meshgrid(np.linspace(0, image.width, columns), np.linspace(0, image.height, rows))
        nodes = nodes + np.stack([x, y], axis=-1)
    return Nodes(nodes, WARP.extent_of(inputs, p), p.patches)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    lengths = {len(row) for row in p.grid}
    return [Flaw("/parameters/grid", f"has rows of {sorted(lengths)} nodes")] if len(lengths) > 1 else []


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    still = p.relative and all(x == y == 0 for row in p.grid for x, y in row)
    same = own_size(p, facts) == (image.width, image.height)
    return "no node is moved" if still and same else None


WARP = Warp[Parameters](_map)
EXAMPLE = [[[0, 0], [2, -3], [0, 0]], [[-2, 1], [6, 5], [3, 0]], [[0, 0], [-1, 4], [0, 0]]]

mesh = declare(
    WARP,
    name="mesh",
    summary="Bends an image by a grid of control points, with bilinear or bicubic patches.",
    description=__doc__ or "",
    parameters=Parameters,
    check=_check,
    identity=_identity,
    examples=(
        {"grid": EXAMPLE, "border": "clamp"},
        {"grid": EXAMPLE, "patches": "bilinear"},
    ),
    hard_cases=(
        HardCase(
            name="all nodes in one place",
            why="a footprint of nothing has no longer axis",
            inputs=cases.constant,
            parameters={"grid": [[[9, 9]] * 3] * 4, "relative": False, "border": "clamp"},
            holds=cases.stays_constant,
        ),
        HardCase(
            name="folded over",
            why="a map that turns back has a line without any extent",
            inputs=cases.constant,
            parameters={"grid": [[[0, 0], [40, 0], [-40, 0]]] * 2, "border": "reflect"},
            holds=cases.stays_constant,
        ),
    ),
)
