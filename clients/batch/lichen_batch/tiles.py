"""Images larger than memory: a pipeline computed tile by tile, with as much memory as it is given.

The pipeline is planned once, for the whole picture and with the whole picture's range of values, so every tile is
computed by the same methods with the same knobs as an untiled run would be. A tile reads its part of the
inputs wider by what the footprints of all operations on the way add up to, computes, and keeps its own part. Where the
part meets the edge of the picture it ends there, so borders are real ones. All tiles read the same number of
pixels: those at an edge reach further inwards.

Operations that need the whole picture, keep no size, depend on where a pixel lies, or report findings are refused with
the reason. A method whose every output pixel is computed from its footprint alone (`fir`) gives the untiled pixels bit
for bit on OpenCL, and with NumPy where it multiplies no matrices, whose rounding depends on their size. One that sums
over all it is given (`dct`, the recursions) gives them within its stated error.

Tiles are blocks of a `dask.array`: threads of this process compute them, or the workers of a cluster that see the
same files. Neighbours exchange nothing; each reads its own halo, so what is held is what is being computed.
"""

from __future__ import annotations

import dataclasses
import json
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from lichen import engine
from lichen.accuracy import times
from lichen.engine import Prepared
from lichen.errors import Flaw, InvalidRequest
from lichen.files.samples import to_floats, to_storage
from lichen.image import Extent, Image, Space, Storage, measure_extent
from lichen.memory import Array
from lichen.operation import Facts
from lichen.planning.graph import Graph, inputs_of
from lichen.planning.memory import peak_bytes
from lichen.planning.plan import Plan
from lichen_batch import places, rasters
from lichen_batch.rasters import Raster
from lichen_batch.told import Told

SMALLEST, LARGEST = 256, 8192
"""Pixels; side of a tile."""
WAITING = 60.0
"""Seconds until a cluster that is not there is given up."""
FIXED = 320 << 20
"""Bytes that a process holds beside tiles: libraries, compiled kernels, files in transit."""


@dataclass(frozen=True)
class Task:
    """What is to be computed; hashable, so a worker makes its plan once."""

    pipeline: str
    """JSON"""
    inputs: tuple[tuple[str, str], ...]
    """places by name"""
    wishes: tuple[tuple[str, Any], ...]
    extents: tuple[tuple[str, Extent], ...]
    spaces: tuple[tuple[str, Space], ...] = ()
    times: str = "{}"
    """by which methods are chosen, as JSON: every process makes the same plan"""


@dataclass(frozen=True)
class Layout:
    """Where tiles lie: `tile` of height and width, `reach` of rows and columns around each."""

    shape: tuple[int, int, int]
    tile: tuple[int, int]
    reach: tuple[int, int]

    @property
    def read(self) -> tuple[int, int]:
        """Height and width of what each tile reads."""
        return tuple(min(t + 2 * r, s) for t, r, s in zip(self.tile, self.reach, self.shape[:2], strict=True))  # type: ignore[return-value]

    def start(self, row: int, column: int) -> tuple[int, int]:
        """Top and left of what a tile reads."""
        both = zip((row, column), self.tile, self.reach, self.read, self.shape[:2], strict=True)
        return tuple(max(0, min(at * t - r, s - size)) for at, t, r, size, s in both)  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Planned:
    """A task with its plan for the whole picture."""

    sources: Mapping[str, Raster]
    whole: Prepared

    @property
    def plan(self) -> Plan:
        return self.whole.plan

    @cached_property
    def result(self) -> Facts:
        return self.plan.graph.facts()[self.plan.graph.output]

    @cached_property
    def reach(self) -> tuple[int, int]:
        """How far a pixel of the result looks, in rows and columns. Raises `InvalidRequest` where tiles cannot do."""
        return reach_of(self.plan.graph)

    def bytes_of(self, height: int, width: int) -> int:
        """What computing a part of this size holds: its pictures, what was read for them, and what comes out."""
        graph = self.plan.graph
        facts = {name: dataclasses.replace(each, height=height, width=width) for name, each in graph.sources.items()}
        small = graph.replace(sources=facts)
        stored = sum(np.dtype(each.storage.value).itemsize * each.shape[2] for each in self.sources.values())
        return peak_bytes(small, small.facts()) + height * width * (stored + 8 * self.result.channels)

    def compute(self, layout: Layout, row: int, column: int, storage: Storage) -> Array:
        """One tile, as it is to be stored."""
        top, left = layout.start(row, column)
        height, width = layout.read
        images = {}
        for name, whole in self.whole.order.images.items():
            raster = self.sources[name.removeprefix("input.")]
            part = whole.replace(pixels=to_floats(raster.read(top, left, height, width)))
            vars(part)["extent"] = whole.extent
            images[name] = part
        order = dataclasses.replace(self.whole.order, images=images)
        graph = self.plan.graph
        facts = {name: dataclasses.replace(each, height=height, width=width) for name, each in graph.sources.items()}
        plan = Plan(graph.replace(sources=facts), self.plan.request)
        (result,) = dataclasses.replace(self.whole, order=order, plan=plan).run().values()
        y, x = row * layout.tile[0] - top, column * layout.tile[1] - left
        own = result.image.pixels[y : y + layout.tile[0], x : x + layout.tile[1]]
        return to_storage(own, storage)[0]


def reach_of(graph: Graph) -> tuple[int, int]:
    """As `Planned.reach`, with every reason against tiles at once."""
    facts = graph.facts()
    reach = dict.fromkeys(graph.sources, (0, 0))
    flaws = [
        Flaw(f"/nodes/{node.name}", f"{node.operation.name} reports what it finds in a whole picture")
        for node in graph.observers
    ]
    for node in graph.nodes:
        known, made = inputs_of(node, facts), facts[node.name]
        if reason := _against(node.operation, node.parameters, known, made):
            flaws.append(Flaw(f"/nodes/{node.name}", f"{node.operation.name} cannot be computed in tiles: {reason}"))
            reach[node.name] = (0, 0)
            continue
        rows, columns = node.operation.footprint(node.parameters, known).sides
        before = [reach[source] for source in node.inputs.values()]
        reach[node.name] = (
            max(each[0] for each in before) + (rows or 0),
            max(each[1] for each in before) + (columns or 0),
        )
    if flaws:
        raise InvalidRequest("This cannot be computed in tiles.", flaws)
    return reach[graph.output]


def _against(operation: Any, parameters: Any, known: Mapping[str, Facts], made: Facts) -> str | None:
    if not known:
        return "it makes a picture from none"
    if len({(each.height, each.width) for each in (*known.values(), made)}) > 1 or made.pages > 1:
        return "its result has another size than what it reads"
    if operation.finds:
        return "it reports what it finds in a whole picture"
    implied = operation.implied(parameters, known)
    if implied:
        return implied if isinstance(implied, str) else "its result depends on where a pixel lies"
    footprint = operation.footprint(parameters, known)
    if None in footprint.sides:
        return "every pixel depends on the whole picture"
    if footprint.wraps and any(footprint.sides):
        return "it looks around the edges of the picture"
    return None


@lru_cache(maxsize=8)
def _planned(task: Task) -> Planned:
    spaces = dict(task.spaces)
    sources = {name: rasters.open_raster(place, space=spaces.get(name)) for name, place in task.inputs}
    images = {name: _stand_in(raster, dict(task.extents)[name]) for name, raster in sources.items()}
    with times.held(json.loads(task.times)):
        return Planned(sources, engine.prepare_pipeline(json.loads(task.pipeline), images=images, **dict(task.wishes)))


_lock = threading.Lock()


def planned(task: Task) -> Planned:
    """The task's plan, made once in a process. Raises as `engine.prepare_pipeline`."""
    with _lock:
        return _planned(task)


def _stand_in(raster: Raster, extent: Extent) -> Image:
    """The whole picture without its pixels: no memory lies behind it."""
    nothing = np.broadcast_to(np.float32(0), raster.shape)
    image = Image(nothing, raster.space, raster.alpha, raster.storage)
    vars(image)["extent"] = extent
    return image


# ------------------------------------------------------------------------------------------------------------ the whole


def extent_of(place: str, side: int) -> Extent:
    """The range of a whole picture, found in parts."""
    import dask.array as da

    raster = rasters.open_raster(place)
    height, width, _ = raster.shape
    blocks = da.map_blocks(
        _extents,
        chunks=(_parts(height, side), _parts(width, side), (3,)),
        dtype=np.float64,
        meta=np.empty((0, 0, 3)),
        place=place,
        side=side,
        shape=(height, width),
    )
    found = np.asarray(blocks.compute()).reshape(-1, 3)
    return Extent(float(found[:, 0].min()), float(found[:, 1].max()), int(found[:, 2].sum()))


def _extents(place: str, side: int, shape: tuple[int, int], block_info: Any = None) -> Array:
    row, column, _ = block_info[None]["chunk-location"]
    raster = rasters.open_raster(place)
    size = min(side, shape[0] - row * side), min(side, shape[1] - column * side)
    found = measure_extent(to_floats(raster.read(row * side, column * side, *size)))
    return np.array([[[found.low, found.high, found.nonfinite]]])


def _parts(length: int, side: int) -> tuple[int, ...]:
    """One for each part of a length."""
    return (1,) * -(-length // side)


def _block(task: Task, layout: Layout, storage: Storage, block_info: Any = None) -> Array:
    row, column, _ = block_info[None]["chunk-location"]
    return planned(task).compute(layout, row, column, storage)


def layout_for(made: Planned, memory: int, workers: int, *, bands: bool) -> Layout:
    """The largest tiles that `workers` of them fit into `memory` with; with `bands` as wide as the picture.

    Raises `InvalidRequest` where not even the smallest do.
    """
    height, width, channels = (made.result.height, made.result.width, made.result.channels)
    room = (memory - FIXED) // (workers + 1)
    side = LARGEST
    while side >= SMALLEST:
        tile = (min(side, _rounded(height)), width if bands else min(side, _rounded(width)))
        layout = Layout((height, width, channels), tile, made.reach)
        if made.bytes_of(*layout.read) <= room:
            return layout
        side -= SMALLEST
    smallest = made.bytes_of(
        *Layout((height, width, channels), (SMALLEST, width if bands else SMALLEST), made.reach).read
    )
    needed = smallest * (workers + 1) + FIXED
    raise InvalidRequest("The memory is too small.", [Flaw("/memory", f"is {memory} bytes; {needed} are needed")])


def run(
    pipeline: Mapping[str, Any],
    inputs: Mapping[str, str],
    output: str,
    *,
    memory: int = 2 << 30,
    workers: int = 2,
    storage: Storage | None = None,
    wishes: Mapping[str, Any] | None = None,
    engine: str = "local",
    tell: Callable[[int, int], None] = lambda done, count: None,
) -> dict[str, Any]:
    """Computes a pipeline of one output into a TIFF, an EXR or a Zarr array; returns an account.

    `memory` is what the process may hold; with `engine` dask://HOST:PORT, each of that cluster's. `tell` hears how many
    tiles of how many are written (of a Zarr array that a cluster writes, only when all are). Raises `InvalidRequest`
    for what cannot be computed in tiles, OSError where there is no cluster.
    """
    import dask.array as da

    inputs = {name: places.absolute(place) for name, place in inputs.items()}
    output = places.absolute(output)

    raster = {name: rasters.open_raster(place) for name, place in inputs.items()}
    kept = storage or next(iter(raster.values())).storage
    wanted = {"storage": kept, **(wishes or {})}
    said = json.dumps(pipeline), tuple(inputs.items()), tuple(wanted.items())
    with _scheduler(engine, workers) as hands:
        workers = hands.threads
        known = json.dumps(times.known())
        early = Task(*said, tuple((name, Extent(0.0, 1.0, 0)) for name in inputs), times=known)
        planned(early).reach  # noqa: B018  (refused early)
        side = min(LARGEST, max(SMALLEST, int(((memory - FIXED) / (workers + 1) / 40) ** 0.5) // 256 * 256))
        task = Task(*said, tuple((name, extent_of(place, side)) for name, place in inputs.items()), times=known)
        made = planned(task)
        if len(made.plan.graph.outputs) != 1:
            raise InvalidRequest("Tiles make one picture.", [Flaw("/outputs", "are several")])
        bands = rasters.in_bands(output)
        layout = layout_for(made, memory, 1 if bands and hands.client is None else workers, bands=bands)
        facts = made.result
        told = Told(len(_parts(facts.height, layout.tile[0])) * len(_parts(facts.width, layout.tile[1])), tell)
        target = Raster(None, facts.space, facts.alpha, kept)
        if bands:
            count = len(_parts(facts.height, layout.tile[0]))
            rows: Iterator[Array] = (made.compute(layout, row, 0, kept) for row in range(count))
            if hands.client is not None:
                rows = hands.rows(task, layout, kept, count)
            rasters.write_bands(output, layout.shape, target, told.each(rows))
        else:
            blocks = da.map_blocks(
                _block,
                chunks=(
                    _lengths(facts.height, layout.tile[0]),
                    _lengths(facts.width, layout.tile[1]),
                    (facts.channels,),
                ),
                dtype=kept.value,
                meta=np.empty((0, 0, 0), kept.value),
                task=task,
                layout=layout,
                storage=kept,
            )
            with rasters.zarr_target(output, layout.shape, layout.tile, target) as array:
                da.store(blocks, array if hands.client is not None else told.writing(array), lock=False)
        told.all()
    return {
        "method": made.plan.method,
        "error": {"value": made.plan.error.value, "kind": made.plan.error.kind},
        "tile": layout.tile,
        "reach": layout.reach,
        "tiles": told.count,
        "shape": layout.shape,
        "storage": kept,
    }


@dataclass(frozen=True)
class _Hands:
    """Who computes tiles: threads of this process, or those of a cluster's workers."""

    threads: int
    """of one process"""
    client: Any = None
    ahead: int = 2
    """bands that are computed or wait to be written"""

    def rows(self, task: Task, layout: Layout, storage: Storage, count: int) -> Iterator[Array]:
        """All bands from top to bottom, computed by workers, few of them ahead of the one that is written."""
        waiting: deque[Any] = deque()
        for row in range(count):
            waiting.append(self.client.submit(_band, task, layout, row, storage, pure=False))
            if len(waiting) > self.ahead:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def _band(task: Task, layout: Layout, row: int, storage: Storage) -> Array:
    return planned(task).compute(layout, row, 0, storage)


@contextmanager
def _scheduler(engine: str, workers: int) -> Iterator[_Hands]:
    import dask

    if engine == "local":
        with dask.config.set(scheduler="threads", num_workers=workers):
            yield _Hands(workers)
        return
    if not engine.startswith("dask://"):
        raise InvalidRequest(
            "The engine is not known.", [Flaw("/engine", f"{engine!r} is none; local, dask://HOST:PORT")]
        )
    from distributed import Client

    with Client(f"tcp://{engine.removeprefix('dask://')}", timeout=WAITING, set_as_default=False) as client:
        client.wait_for_workers(1, timeout=WAITING)
        threads = list(client.nthreads().values())
        with client.as_current(), dask.config.set(scheduler=client):
            yield _Hands(max(threads), client, 2 * sum(threads))


def _rounded(length: int) -> int:
    """The least side of a tile that holds a whole length."""
    return -(-length // SMALLEST) * SMALLEST


def _lengths(length: int, side: int) -> tuple[int, ...]:
    whole, rest = divmod(length, side)
    return (side,) * whole + ((rest,) if rest else ())
