"""Runs plans on a device: the one door for the library, the service and batches.

A single operation is a graph of one node. It goes through the planner like any larger graph, and what the plan says is
what runs. Work goes to OpenCL where a device passed its start-up probe, else to NumPy; a device that fails in the
middle of a run costs that run a repetition on NumPy, stated among its decisions, unless the caller named the device.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lichen.errors import DeviceFailure, Flaw, InvalidRequest, LichenError, nearest
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array, aligned
from lichen.opencl.device import Device, default_device, status
from lichen.opencl.extent import extent as device_extent
from lichen.operation import Error, Facts, Inputs
from lichen.order import BACKENDS, Order, Picture, read_order
from lichen.planning.graph import Decision, Graph, Node
from lichen.planning.plan import Plan, make_plan

log = logging.getLogger("lichen")

MEASURED_ON_DEVICE = 1 << 18
"""Samples from which a device finds the range of an image sooner than NumPy."""


@dataclass(frozen=True, eq=False)
class Result:
    """What a run gives back."""

    image: Image
    plan: Plan
    device: str
    """opencl or numpy"""
    timing: Mapping[str, float]
    """seconds by stage: `plan`, `kernel`, and `kernel.<node>` for each node"""
    decisions: tuple[Decision, ...]

    @property
    def method(self) -> str:
        return self.plan.method

    @property
    def error(self) -> Error:
        """What the result can be wrong by, in output units: proved or estimated, as it says."""
        return self.plan.error

    @cached_property
    def nonfinite(self) -> int:
        """How many values of the output are NaN or infinite."""
        return _measured(self.image, default_device() if self.device == "opencl" else None).extent.nonfinite


def run(
    name: str,
    image: Picture | None = None,
    /,
    *,
    method: str | None = None,
    max_error: float | None = None,
    max_ms: float | None = None,
    device: str | None = None,
    nonfinite: str = "propagate",
    space: Space | str | None = None,
    alpha: Alpha | str | None = None,
    storage: Storage | str | None = None,
    prune: bool = True,
    **values: Any,
) -> Result:
    """Run one operation.

    `image` is its first input: an `Image`, or an array of shape (height, width) or (height, width, channels). `values`
    holds parameters, further inputs and knobs by name. `device` is "opencl" or "numpy" (None: the best that works).
    `space` and `alpha` ask for the output's; by default it comes in those of the first input. `storage` is how the
    result will be stored, which sets the error accepted when neither `max_error` nor `max_ms` is given. `nonfinite`
    (propagate, reject, repair) says what to do with NaN and infinity in the inputs. `prune=False` runs nodes that
    change nothing, too.

    Raises `UnknownOperation`, `InvalidRequest` (every flaw at once), `NonfiniteInput`, `Unattainable`, `DeviceFailure`.

    >>> import numpy as np
    >>> result = run("gaussian", np.ones((4, 4)), sigma=1.5, method="fir")
    >>> bool(np.allclose(result.image.pixels, 1)), result.error.kind
    (True, 'bound')
    """
    arguments: dict[str, Any] = {
        **values,
        "method": method,
        "max_error": max_error,
        "max_ms": max_ms,
        "nonfinite": nonfinite,
        "space": space,
        "alpha": alpha,
        "storage": storage,
        "prune": prune,
    }
    found = select_device(device)
    try:
        return _execute(*_prepare(name, image, arguments, found), found)
    except DeviceFailure as failure:
        if device is not None or found is None:
            raise
        log.warning("OpenCL failed, NumPy repeats the work: %s", failure)
        decision = Decision("device", "*", "ran on numpy", f"opencl failed: {failure.detail}")
        return _execute(*_prepare(name, image, arguments, None), None, decision)


def explain(name: str, image: Picture | None = None, /, *, device: str | None = None, **arguments: Any) -> Plan:
    """The plan that `run` with the same arguments would follow. No pixel is computed; ranges of inputs are measured."""
    return _prepare(name, image, arguments, select_device(device))[1]


def evaluate_truth(name: str, image: Picture | None = None, /, *, device: str | None = None, **arguments: Any) -> Array:
    """The exact result of `run` with the same arguments, float64: every node of its plan by definition. Slow."""
    order, plan, _ = _prepare(name, image, arguments, select_device(device))

    def exactly(node: Node, inputs: Inputs) -> Array:
        return node.operation.evaluate_truth(inputs, node.parameters)

    return _walk(plan, order.images, exactly).pixels


def select_device(name: str | None) -> Device | None:
    """The OpenCL device a run will use; None means NumPy.

    Raises `InvalidRequest` for a name that is none, `DeviceFailure` where OpenCL was named and cannot be had.
    """
    if name is not None and name not in BACKENDS:
        raise InvalidRequest(
            "The device is not known.", [Flaw("/device", f"{name!r} is none; {nearest(name, BACKENDS)}")]
        )
    found = None if name == "numpy" else default_device()
    if found is None and name == "opencl":
        raise DeviceFailure(f"OpenCL cannot be used: {status().reason}")
    return found


def _prepare(
    name: str, image: Picture | None, arguments: Mapping[str, Any], device: Device | None
) -> tuple[Order, Plan, float]:
    """An order, its plan, and the seconds both took."""
    started = time.perf_counter()
    order = read_order(name, image, arguments, "opencl" if device else "numpy")
    facts = {key: Facts.of(_measured(value, device)) for key, value in order.images.items()}
    flaws = order.operation.check(order.parameters, facts)
    if flaws:
        raise InvalidRequest(f"This request for {name} is not valid.", flaws)
    node = Node(name, order.operation, order.parameters, {key: f"input.{key}" for key in order.images})
    sources = {f"input.{key}": known for key, known in facts.items()}
    plan = make_plan(Graph(sources, (node,), name), order.request)
    return order, plan, time.perf_counter() - started


def _execute(order: Order, plan: Plan, planning: float, device: Device | None, *further: Decision) -> Result:
    timing = {"plan": planning, "kernel": 0.0}

    def timed(node: Node, inputs: Inputs) -> Array:
        started = time.perf_counter()
        pixels = _compute(node, inputs, device)
        timing[f"kernel.{node.name}"] = time.perf_counter() - started
        timing["kernel"] += timing[f"kernel.{node.name}"]
        return pixels

    image = _walk(plan, order.images, timed)
    return Result(image, plan, "opencl" if device else "numpy", timing, (*plan.decisions, *further))


def _compute(node: Node, inputs: Inputs, device: Device | None) -> Array:
    """One node by its chosen method. Raises `LichenError`; whatever else escapes a method is its author's defect."""
    choice = node.choice
    if choice is None:
        raise LichenError(f"The plan chose no method for {node.name}.")
    body = node.operation.methods[choice.method].implementation
    single = {key: image.replace(pixels=aligned(image.pixels, np.float32)) for key, image in inputs.items()}
    knob = choice.knob if choice.knob is not None else 0.0
    with np.errstate(all="ignore"):  # NaN and infinity are values here; they are counted, not warned of
        if device is None:
            return body.numpy(single, node.parameters, knob)
        return body.opencl(device, single, node.parameters, knob)


def _measured(image: Image, device: Device | None) -> Image:
    """`image` with its extent known, found by the device where that is quicker."""
    worthwhile = image.pixels.dtype == np.float32 and image.pixels.size >= MEASURED_ON_DEVICE
    if device is not None and worthwhile and "extent" not in vars(image):
        vars(image)["extent"] = device_extent(device, image.pixels)
    return image


def _walk(plan: Plan, images: Inputs, compute: Callable[[Node, Inputs], Array]) -> Image:
    """Run the nodes in order; each value is dropped after its last reader."""
    graph = plan.graph
    values = {f"input.{key}": image for key, image in images.items()}
    known = graph.facts()
    last = {source: node.name for node in graph.nodes for source in node.inputs.values()}
    for node in graph.nodes:
        inputs = {key: values[source] for key, source in node.inputs.items()}
        facts = known[node.name]
        model = next(iter(inputs.values()), None)
        values[node.name] = Image(
            compute(node, inputs),
            facts.space,
            facts.alpha,
            model.storage if model else Storage.FLOAT32,
            model.metadata if model else {},
        )
        for source in set(node.inputs.values()):
            if last[source] == node.name and source != graph.output:
                del values[source]
    return values[graph.output]
