"""Measures the error of a result on this very image, against the truth of its whole plan.

Truth is slow. Where all of it would take too long it is evaluated on tiles: two that every image has, the centre and a
corner, then the other corners and the borders, then ever more spread over the image, as long as a budget of pixels
and of predicted time lasts. Which tiles those are depends on the plan and the size alone, never on the clock.

A tile's truth is that of crops of the sources which are wider by what the footprints on the way add up to. A crop that
meets the image's edge ends there, so borders are real ones; around images that wrap it goes on at the other side.
Where a footprint is the whole image, there are no tiles, and what cannot be afforded is not measured but said.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lichen.accuracy.colour import ciede2000
from lichen.accuracy.metrics import Difference, deviations, difference, steps
from lichen.accuracy.precision import Precision
from lichen.execution import by_definition, exact, walk
from lichen.image import Image, Storage
from lichen.memory import Array
from lichen.operation import Footprint, Inputs
from lichen.planning.graph import Graph, Node, inputs_of

PIXELS = 1 << 18
"""Output pixels that are compared at most."""
SECONDS = 12.0
"""Predicted seconds that truth may take."""
SIDES = (64, 32, 16, 8)
"""px; of tiles, the largest of which enough fit into the budget."""
ENOUGH = 9
"""Tiles: the centre, the corners and the middles of the borders."""
FEWEST = 2

Span = tuple[int, int]
Tile = tuple[Span, Span]
"""Rows and columns, from and to."""


@dataclass(frozen=True, eq=False)
class Verification:
    """What was found, or the reason why nothing could be."""

    measured: Difference | None
    reason: str = ""
    map: Array | None = None
    """the largest difference over the channels of each pixel, float32 (height, width); NaN where none was taken"""
    codes: int | None = None
    """the largest difference in code values, where the output is wanted in integers"""
    seen: float | None = None
    """the largest CIEDE2000, where the output is a picture without NaN and infinity"""


@dataclass(frozen=True)
class Window:
    """The part of one axis that a tile needs, as indices, and where in it the tile begins."""

    indices: npt.NDArray[np.int64]
    offset: int


def verify(graph: Graph, sources: Mapping[str, Image], image: Image) -> Verification:
    """Compare `image`, the output of `graph`, with truth. The graph's precision is what is judged, too."""
    graph = graph.replace(precision=Precision.FLOAT32, fused=(), banded=())
    (output,) = graph.outputs.values()
    height, width = image.height, image.width
    dear = _seconds(graph, height, width)
    reach = _reach(graph, height, width)
    if dear <= SECONDS and (height * width <= PIXELS or _undivided(reach, height, width)):
        return _compared(image, {((0, height), (0, width)): exact(graph, sources)}, output.storage)
    if isinstance(reach, str):
        return Verification(None, f"{reach}, and all of it would take about {dear:.0f} s")
    chosen = _chosen(graph, reach, height, width)
    if len(chosen) < FEWEST:
        return Verification(None, f"truth would take about {dear:.0f} s, and tiles of it not much less")
    return _compared(image, {tile: truth_of_tile(graph, sources, reach, tile) for tile in chosen}, output.storage)


def _undivided(reach: Footprint | str, height: int, width: int) -> bool:
    """Whether every pixel needs all of the image anyway."""
    if isinstance(reach, str):
        return True
    return all(far is None or far >= size for far, size in zip(reach.sides, (height, width), strict=True))


def _compared(image: Image, truths: Mapping[Tile, Array], storage: Storage | None) -> Verification:
    """The tiles taken together as one picture."""
    found = np.full((image.height, image.width), np.nan, np.float32)
    flat_pixels, flat_truth = [], []
    for (rows, columns), truth in truths.items():
        pixels = image.pixels[slice(*rows), slice(*columns)]
        apart, _ = deviations(pixels, truth, image.alpha)
        with np.errstate(over="ignore"):
            found[slice(*rows), slice(*columns)] = np.max(apart, axis=2)
        flat_pixels.append(pixels.reshape(1, -1, image.channels))
        flat_truth.append(truth.reshape(1, -1, image.channels))
    pixels, truth = (np.concatenate(each, axis=1) for each in (flat_pixels, flat_truth))
    measured = difference(pixels, truth, image.alpha)
    share = pixels.shape[1] / (image.height * image.width)
    codes = steps(pixels, truth, storage).largest if storage is not None and storage.integer else None
    seen = ciede2000(image.replace(pixels=pixels), truth).largest
    return Verification(dataclasses.replace(measured, sampled=share), map=found, codes=codes, seen=seen)


# ------------------------------------------------------------------------------------------------------------ tiles


def truth_of_tile(graph: Graph, sources: Mapping[str, Image], reach: Footprint, tile: Tile) -> Array:
    """Truth inside one tile, float64."""
    height, width = next(iter(sources.values())).pixels.shape[:2]
    down = _window(tile[0], reach.rows, height, reach.wraps)
    across = _window(tile[1], reach.columns, width, reach.wraps)

    def cropped(pixels: Array) -> Array:
        return np.ascontiguousarray(pixels[down.indices][:, across.indices])

    facts = graph.facts()

    def compute(node: Node, inputs: Inputs) -> Array:
        further = node.operation.implied(node.parameters, inputs_of(node, facts))
        assert not isinstance(further, str), "graphs with such nodes are not tiled"
        return by_definition(node, {**inputs, **{key: Image(cropped(pixels)) for key, pixels in further.items()}})

    crops = {name: image.replace(pixels=cropped(image.pixels)) for name, image in sources.items()}
    (whole,) = walk(_resized(graph, down.indices.size, across.indices.size), crops, compute).values()
    made = whole.pixels
    rows, columns = tile[0][1] - tile[0][0], tile[1][1] - tile[1][0]
    return made[down.offset : down.offset + rows, across.offset : across.offset + columns].astype(np.float64)


def _window(span: Span, reach: int | None, size: int, wraps: bool) -> Window:
    start, stop = span
    if reach is None or stop - start + 2 * reach >= size:
        return Window(np.arange(size), start)
    if wraps:
        return Window(np.arange(start - reach, stop + reach) % size, reach)
    low = max(start - reach, 0)
    return Window(np.arange(low, min(stop + reach, size)), start - low)


def _reach(graph: Graph, height: int, width: int) -> Footprint | str:
    """What the footprints on the way to the output add up to, or why there can be no tiles."""
    facts = graph.facts()
    if any((each.height, each.width) != (height, width) for each in facts.values()):
        return "the images are not of one size, so tiles of them do not belong together"
    reached = dict.fromkeys(graph.sources, Footprint(0, 0))
    for node in graph.nodes:
        known = inputs_of(node, facts)
        further = node.operation.implied(node.parameters, known)
        if isinstance(further, str):
            return further
        own = node.operation.footprint(node.parameters, known)
        arriving = [reached[source] for source in node.inputs.values()]
        reached[node.name] = Footprint(
            _sum(own.rows, [each.rows for each in arriving]),
            _sum(own.columns, [each.columns for each in arriving]),
            own.wraps or any(each.wraps for each in arriving),
        )
    return reached[graph.output]


def _sum(own: int | None, arriving: list[int | None]) -> int | None:
    """None, the whole extent, swallows everything."""
    far = 0
    for each in arriving:
        if each is None:
            return None
        far = max(far, each)
    return None if own is None else own + far


def _chosen(graph: Graph, reach: Footprint, height: int, width: int) -> list[Tile]:
    """Tiles within the budget, of the largest side of which enough fit, else of the side of which most do."""
    most: list[Tile] = []
    for side in SIDES:
        tiles = _affordable(graph, reach, height, width, side)
        if len(tiles) >= ENOUGH:
            return tiles
        most = max(most, tiles, key=len)
    return most


def _affordable(graph: Graph, reach: Footprint, height: int, width: int, side: int) -> list[Tile]:
    rows, columns = -(-height // side), -(-width // side)
    costs: dict[tuple[int, int], float] = {}
    taken: dict[Tile, None] = {}
    pixels, seconds = 0, 0.0
    for row, column in _cells(rows, columns):
        tile = ((row * side, min((row + 1) * side, height)), (column * side, min((column + 1) * side, width)))
        if tile in taken:
            continue
        size = (
            _window(tile[0], reach.rows, height, reach.wraps).indices.size,
            _window(tile[1], reach.columns, width, reach.wraps).indices.size,
        )
        if size not in costs:
            costs[size] = _seconds(graph, *size)
        pixels += (tile[0][1] - tile[0][0]) * (tile[1][1] - tile[1][0])
        seconds += costs[size]
        if pixels > PIXELS or seconds > SECONDS:
            break
        taken[tile] = None
    return list(taken)


def _cells(rows: int, columns: int) -> Iterator[tuple[int, int]]:
    """Cells of a grid: centre, corners, borders, then as many as it has, spread evenly (by the plastic number)."""
    middle, right, centre, bottom = rows // 2, columns - 1, columns // 2, rows - 1
    yield from ((middle, centre), (0, 0), (bottom, right), (middle, 0), (0, centre), (0, right), (bottom, 0))
    yield from ((middle, right), (bottom, centre))
    plastic = 1.324717957244746
    for n in range(1, rows * columns + 1):
        yield int(math.modf(n / plastic)[0] * rows), int(math.modf(n / plastic**2)[0] * columns)


def _resized(graph: Graph, height: int, width: int) -> Graph:
    sources = {name: dataclasses.replace(each, height=height, width=width) for name, each in graph.sources.items()}
    return graph.replace(sources=sources)


def _seconds(graph: Graph, height: int, width: int) -> float:
    """Predicted time of truth for sources of this size, by the declared rates: the same on every machine."""
    resized = _resized(graph, height, width) if graph.sources else graph
    facts = resized.facts()
    return sum(node.operation.truth_seconds(node.parameters, inputs_of(node, facts)) for node in graph.nodes)
