"""Where the lamps of a scene and its environment are looked at: which in every tile, why not the others, and a picture
of how many."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array, aligned
from lichen.operations.lookup.colour_map import Map, table
from lichen.operations.scene.lists import TILE, by_pixel
from lichen.operations.scene.reaching import REASONS
from lichen.planning.graph import Decision, Graph
from lichen.scene.description import Output, Scene
from lichen.scene.lowering import lower

MOST_PAIRS = 1 << 20
"""Pairs of an effect and a tile that are told one by one."""


@dataclass(frozen=True, eq=False)
class TileMap:
    """What the operation `tiles` said of a scene."""

    effects: tuple[str, ...]
    """names of the lights, and environment, in the order of the lists"""
    lists: Array
    """reasons and bounds, (rows, columns, 2 effects)"""
    width: int
    height: int
    """px, of the scene's picture"""
    decisions: tuple[Decision, ...]
    """what was left out everywhere, and what in some tiles"""

    @property
    def why(self) -> Array:
        made: Array = self.lists[..., : len(self.effects)].astype(np.int64)
        return made

    @property
    def bounds(self) -> Array:
        return self.lists[..., len(self.effects) :]

    @property
    def shares(self) -> Array:
        """The share of lamps that are looked at in each tile, (rows, columns)."""
        return np.asarray((self.why == 0).mean(axis=-1))

    def picture(self) -> Image:
        """From dark, where nothing is computed, to bright, where everything is; as large as the scene's picture."""
        levels = np.rint(self.shares * 255).astype(np.int64)
        colours = by_pixel(table(Map.INFERNO)[levels], self.height, self.width)
        return Image(aligned(np.ascontiguousarray(colours), np.float32), Space.SRGB, Alpha.NONE, Storage.UINT8)

    def to_json(self) -> dict[str, Any]:
        """All of it; pair by pair where they are not too many."""
        pairs = self.why.size <= MOST_PAIRS
        return {
            "tile": TILE,
            "width": self.width,
            "height": self.height,
            "effects": list(self.effects),
            "reasons": list(REASONS),
            "shares": self.shares.round(4).tolist(),
            "why": self.why.tolist() if pairs else None,
            "bounds": self.bounds.tolist() if pairs else None,
            "decisions": [each.to_json() for each in self.decisions],
        }


def mapped(scene: Scene) -> Scene:
    """The scene as what it is rendered to for a map."""
    return scene.model_copy(update={"output": Output.TILES})


def told(scene: Scene, graph: Graph, lists: Array, decisions: Iterable[Decision]) -> TileMap:
    """The map, from what was planned and rendered."""
    position = graph.facts()[graph.named("tiles").inputs["position"]]
    effects = [f"light_{number}" for number in lower(scene).lamps]
    if lists.shape[-1] > 2 * len(effects):
        effects.append("environment")
    return TileMap(tuple(effects), lists, position.width, position.height, tuple(decisions))
