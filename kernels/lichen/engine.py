"""Runs plans on a device: the one door for the library, the service and batches.

A single operation is a graph of one node. It goes through the planner like any larger graph, and what the plan says is
what runs. Work goes to OpenCL where a device passed its start-up probe, else to NumPy; a device that fails in the
middle of a run costs that run a repetition on NumPy, stated among its decisions, unless the caller named the device.
"""

from __future__ import annotations

import dataclasses
import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from lichen.accuracy import times
from lichen.accuracy.metrics import Difference
from lichen.accuracy.precision import Precision
from lichen.errors import DeviceFailure, Flaw, InvalidRequest, nearest
from lichen.execution import computed, exact
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array
from lichen.opencl.device import Device, default_device, status
from lichen.opencl.extent import extent as device_extent
from lichen.operation import Error, Facts
from lichen.order import BACKENDS, Order, Picture, read_order
from lichen.planning.graph import Decision, Graph, Node
from lichen.planning.plan import Plan, make_plan
from lichen.verification import Verification, verify

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
    """seconds by stage: `plan`, `kernel` and `kernel.<node>` for each node, `findings`, `verify`"""
    decisions: tuple[Decision, ...]
    verification: Verification | None = None
    """what comparing with truth found, where that was asked for"""
    findings: Mapping[str, Any] = field(default_factory=dict)
    """what the operation reports beside its pixels; empty for most"""

    @property
    def measured(self) -> Difference | None:
        """How far this very image is from truth; None where that was not asked for, or not affordable."""
        return self.verification.measured if self.verification else None

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
    precision: Precision | str | None = None,
    verify: bool = False,
    **values: Any,
) -> Result:
    """Run one operation.

    `image` is its first input: an `Image`, or an array of shape (height, width) or (height, width, channels). `values`
    holds parameters, further inputs and knobs by name. `device` is "opencl" or "numpy" (None: the best that works).
    `space` and `alpha` ask for the output's; by default it comes in those of the first input. `storage` is how the
    result will be stored, which sets the error accepted when neither `max_error` nor `max_ms` is given. `nonfinite`
    (propagate, reject, repair) says what to do with NaN and infinity in the inputs. `prune=False` runs nodes that
    change nothing, too. `precision` (fixed8, fixed12, fixed16, float16, float32, float64) is how inputs and results of
    every step are kept; float64 evaluates definitions instead of methods. `verify` compares the result with truth,
    whole or on tiles, which is slow: `measured`, `verification`.

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
        "precision": precision,
        "verify": verify,
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
    return exact(plan.graph, _sources(order))


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
    request = dataclasses.replace(order.request, rates=times.current(order.request.backend))
    plan = make_plan(Graph(sources, (node,), name, precision=order.precision), request)
    return order, plan, time.perf_counter() - started


def _execute(order: Order, plan: Plan, planning: float, device: Device | None, *further: Decision) -> Result:
    timing = {"plan": planning}
    sources = _sources(order)
    image, reported = computed(plan, sources, device, timing)
    findings = reported.get(order.operation.name)
    if findings is None:  # dropped, since it returns its first input
        unchanged = next(iter(order.images.values()), image).pixels
        findings = order.operation.find(order.images, order.parameters, unchanged)
    found = None
    if order.verify:
        started = time.perf_counter()
        found = verify(plan.graph, sources, image)
        timing["verify"] = time.perf_counter() - started
        if found.measured is None:
            further = (*further, Decision("verify", "*", "left out", found.reason))
    return Result(image, plan, "opencl" if device else "numpy", timing, (*plan.decisions, *further), found, findings)


def _sources(order: Order) -> dict[str, Image]:
    """The images by their names in the plan's graph."""
    return {f"input.{key}": image for key, image in order.images.items()}


def _measured(image: Image, device: Device | None) -> Image:
    """`image` with its extent known, found by the device where that is quicker."""
    worthwhile = image.pixels.dtype == np.float32 and image.pixels.size >= MEASURED_ON_DEVICE
    if device is not None and worthwhile and "extent" not in vars(image):
        vars(image)["extent"] = device_extent(device, image.pixels)
    return image
