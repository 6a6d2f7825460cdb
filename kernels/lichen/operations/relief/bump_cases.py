"""What breaks naive bump mapping: silhouettes, nothing, sizes, flat heights and numbers that are none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

STEP, SLOPES = 0.125, (0.75, -0.5)
"""How far pixels of the plane are apart, and how its relief rises along x and along y, which is up."""
BENT = np.array([-SLOPES[0], -SLOPES[1], 1.0]) / np.sqrt(SLOPES[0] ** 2 + SLOPES[1] ** 2 + 1)


def _plane(size: float = 1.0, turn: tuple[int, int] = (1, 1), wide: int = 11) -> dict[str, Array]:
    """Normals of length 3, along z; turned by -1, columns run to the left or rows up."""
    row, column = np.mgrid[0:9, 0:wide]
    x, y = turn[0] * STEP * column, -turn[1] * STEP * row
    position = np.stack([x, y, 0 * x], axis=-1) * size
    height = (SLOPES[0] * x + SLOPES[1] * y)[..., None] * size
    made = {"normal": np.broadcast_to([0.0, 0.0, 3.0], position.shape), "position": position, "height": height}
    return {name: each.astype(np.float32) for name, each in made.items()}


def _torn() -> dict[str, Array]:
    """Nothing to the right, something much nearer to the left; heights that do not go on behind them."""
    given = _plane()
    given["position"][:, 8:], given["height"][:, 8:] = np.inf, 1e4
    given["position"][:, :3, 2], given["height"][:, :3] = 50.0, -7.0
    return given


def _sizes() -> dict[str, Array]:
    """Pieces of the plane from tiny to huge, with nothing between them."""
    pieces = []
    for size in (1e-30, 1.0, 1e30):
        piece = _plane(size, wide=4)
        piece["position"][:, -1] = np.inf
        pieces.append(piece)
    return {name: np.concatenate([each[name] for each in pieces], axis=1) for name in pieces[0]}


def _flat() -> dict[str, Array]:
    given = _plane()
    given["height"][:] = 0.1
    given["normal"][0, 0], given["normal"][0, 1], given["normal"][0, 2] = 0, (1e30, 0, 1e-30), (np.nan, 0, 1)
    given["position"][1, 1], given["position"][2, 2] = np.inf, np.nan
    return given


def _unknown() -> dict[str, Array]:
    given = _plane()
    given["height"][4, 5], given["height"][0, 0] = np.nan, np.inf
    given["position"][6, 2, 1] = np.nan
    return given


def _dots() -> dict[str, Array]:
    """One row, whose slope down is not known."""
    return {name: each[:1] for name, each in _plane().items()}


def _edge_on() -> dict[str, Array]:
    given = _plane()
    given["normal"][:, :5], given["normal"][:, 5:] = 0, (1, 0, 0)
    return given


Held = Callable[[Mapping[str, Any], Array], str | None]


def _faces(normal: Array, columns: slice = slice(None), apart: float = 1e-6) -> Held:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        there = np.isfinite(inputs["position"][:, columns]).all(axis=-1)
        found = pixels[:, columns][there]
        off = float(np.abs(found - normal).max())
        return None if off <= apart else f"off by {off:.3g}: {found[0].tolist()}"

    return holds


def _stays(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    same = np.array_equal(pixels.view(np.uint32), inputs["normal"].view(np.uint32))
    return None if same else "a normal was changed"


def _only_there(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    nan: Array = np.asarray(np.isnan(pixels).all(axis=-1))
    if sorted(map(tuple, np.argwhere(nan).tolist())) != [(0, 0), (4, 5), (6, 2)]:
        return f"NaN at {np.argwhere(np.isnan(pixels).any(axis=-1)).tolist()}"
    off = float(np.abs(pixels[~nan] - BENT).max())
    return None if off <= 1e-6 else f"off by {off:.3g} beside them"


CASES = (
    HardCase(
        "a plane, its edges, and normals of any length",
        "slopes halved at edges; lengths taken for 1",
        _plane,
        {},
        _faces(BENT),
    ),
    HardCase(
        "a picture whose columns run to the left",
        "the sign of the determinant is forgotten, and bumps become dents",
        lambda: _plane(turn=(-1, 1)),
        {},
        _faces(BENT),
    ),
    HardCase(
        "silhouettes: nothing on one side, something nearer on the other",
        "central differences across an edge find slopes of another surface; infinity less infinity",
        _torn,
        {},
        _faces(BENT, slice(3, 8)),
    ),
    HardCase(
        "pixels of 1e-31 and of 1e29", "products of three lengths overflow or underflow", _sizes, {}, _faces(BENT)
    ),
    HardCase(
        "a flat height over normals of no length, of great length and of none",
        "0 / 0; lengths brought to 1 although nothing is bent",
        _flat,
        {},
        _stays,
    ),
    HardCase("missing heights and positions", "they spread to the neighbours", _unknown, {}, _only_there),
    HardCase("one row", "there is no neighbour below", _dots, {}, _stays),
    HardCase("one pixel", "there is no neighbour", lambda: {k: v[:, :1] for k, v in _dots().items()}, {}, _stays),
    HardCase("no normal, and one in the plane of the pixels", "the determinant is 0", _edge_on, {}, _stays),
)
