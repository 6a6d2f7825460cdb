"""Runs plans on a device: the one door for the library, the service and batches.

A single operation is a graph of one node. It goes through the planner like any larger graph, and what the plan says is
what runs. Work goes to OpenCL where a device passed its start-up probe, else to NumPy; a device that fails in the
middle of a run costs that run a repetition on NumPy, stated among its decisions, unless the caller named the device.
"""

from __future__ import annotations

import dataclasses
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from lichen.accuracy import times
from lichen.accuracy.metrics import Difference
from lichen.accuracy.precision import Precision
from lichen.errors import DeviceFailure, Flaw, InvalidRequest, nearest
from lichen.execution import Before, computed, exact, unheard
from lichen.image import Alpha, Image, Space, Storage, StoredImage, as_image
from lichen.memory import Array
from lichen.opencl.device import Device, default_device, status
from lichen.opencl.extent import measured
from lichen.operation import Error, Facts
from lichen.order import Order, Picture, read_order, read_pipeline_order
from lichen.planning.graph import RESULT, Decision, Graph
from lichen.planning.hidden import thin
from lichen.planning.pipeline import Pipeline
from lichen.planning.plan import Plan, make_plan
from lichen.planning.remember import remembered
from lichen.sharing import Shared
from lichen.verification import Verification, verify

if TYPE_CHECKING:
    from lichen.scene.description import Scene
    from lichen.scene.heat import TileMap

log = logging.getLogger("lichen")


@dataclass(frozen=True, eq=False)
class Result:
    """What a run gives back."""

    image: Image
    plan: Plan
    device: str
    """where the operation was computed, opencl or numpy: definitions are NumPy's"""
    timing: Mapping[str, float]
    """seconds by stage: `plan`, `kernel` and `kernel.<node>` for each node, `findings`, `verify`"""
    decisions: tuple[Decision, ...]
    verification: Verification | None = None
    """what comparing with truth found, where that was asked for"""
    findings: Mapping[str, Any] = field(default_factory=dict)
    """what the operation reports beside its pixels; of a pipeline by the names of its nodes; empty for most"""
    output: str = RESULT
    """which of the plan's outputs this is"""

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
        return self.plan.errors[self.output]

    @cached_property
    def nonfinite(self) -> int:
        """How many values of the output are NaN or infinite."""
        if isinstance(self.image, StoredImage):
            return self.image.codes.moved[1]
        return measured(self.image, default_device() if self.device == "opencl" else None).extent.nonfinite


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
    (result,) = prepare(name, image, device=device, **arguments).run().values()
    return result


def run_pipeline(
    pipeline: Pipeline | Mapping[str, Any] | str,
    image: Picture | None = None,
    /,
    *,
    images: Mapping[str, Picture] | None = None,
    device: str | None = None,
    **wishes: Any,
) -> dict[str, Result]:
    """Run a pipeline: a mapping of nodes and outputs, its JSON, or its text form (`lichen.planning.pipeline`, `.text`).

    `image` is the picture that nodes read as `input.image`, `images` holds all of them by name. `wishes` are those of
    `run`: `max_error` holds for every output, `space`, `alpha` and `storage` where an output says nothing else.

    Results come by the outputs' names. They share plan, timing and findings, which come by the nodes' names. Raises as
    `run`, every flaw of every node at once.

    >>> import numpy as np
    >>> found = run_pipeline("gaussian:sigma=1.5|levels:black=1,white=0", np.ones((4, 4)))
    >>> bool(np.allclose(found["result"].image.pixels, 0, atol=1e-5))
    True
    """
    return prepare_pipeline(pipeline, image, images=images, device=device, **wishes).run()


def render(
    scene: Scene | Mapping[str, Any] | str,
    /,
    *,
    images: Mapping[str, Picture] | None = None,
    device: str | None = None,
    **wishes: Any,
) -> Result:
    """Render a scene (`lichen.scene.description`): a mapping or its JSON. `images` holds its buffers by their names.

    `wishes` are those of `run`. With `prune=False` effects that cannot be seen are computed, too. Raises as `run`.

    >>> ball = {"shape": "sphere", "centre": [0, 0, -4]}
    >>> render({"objects": [ball], "lights": [{}], "camera": {"width": 32, "height": 24}}).image.pixels.shape
    (24, 32, 3)
    """
    (result,) = prepare_scene(scene, images=images, device=device, **wishes).run().values()
    return result


def explain_scene(
    scene: Scene | Mapping[str, Any] | str,
    /,
    *,
    images: Mapping[str, Picture] | None = None,
    device: str | None = None,
    **wishes: Any,
) -> Plan:
    """The plan that `render` with the same arguments would follow. No pixel is computed."""
    return prepare_scene(scene, images=images, device=device, **wishes).plan


def map_scene(scene: Scene | Mapping[str, Any] | str, /, **further: Any) -> TileMap:
    """Which lamps `render` with the same arguments would look at in each tile, and why not the others.

    Only positions and normals are computed. Raises as `render`, and `InvalidRequest` where no lamp lights anything.
    """
    from lichen.scene.description import read
    from lichen.scene.heat import mapped, told

    wanted = mapped(read(scene))
    result = render(wanted, **further)
    return told(wanted, result.plan.graph, result.image.pixels, result.decisions)


def explain(name: str, image: Picture | None = None, /, *, device: str | None = None, **arguments: Any) -> Plan:
    """The plan that `run` with the same arguments would follow. No pixel is computed; ranges of inputs are measured."""
    return prepare(name, image, device=device, **arguments).plan


def explain_pipeline(
    pipeline: Pipeline | Mapping[str, Any] | str,
    image: Picture | None = None,
    /,
    *,
    images: Mapping[str, Picture] | None = None,
    device: str | None = None,
    **wishes: Any,
) -> Plan:
    """The plan that `run_pipeline` with the same arguments would follow. No pixel is computed."""
    return prepare_pipeline(pipeline, image, images=images, device=device, **wishes).plan


def evaluate_truth(name: str, image: Picture | None = None, /, *, device: str | None = None, **arguments: Any) -> Array:
    """The exact result of `run` with the same arguments, float64: every node of its plan by definition. Slow."""
    prepared = prepare(name, image, device=device, **arguments)
    return exact(prepared.plan.graph, prepared.order.images)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A plan with the pictures it is for, ready to be carried out."""

    order: Order
    plan: Plan
    seconds: float
    """that planning took"""
    device: Device | None
    fallback: Prepare | None = None
    """makes the same for NumPy, where no device was named"""

    def run(
        self, *further: Decision, shared: Shared | None = None, before: Before = unheard, stored: bool = False
    ) -> dict[str, Result]:
        """The results by the outputs' names; on NumPy where a device fails that nobody named. Runs that share take
        over steps from one another (`lichen.sharing`). `before` hears of each step, and may end the run by raising.
        Where they will only be `stored`, those of 8 bits may come as codes (`lichen.image.StoredImage`)."""
        try:
            return _run(self, further, shared, before, stored and not self.order.verify)
        except DeviceFailure as failure:
            if self.fallback is None or self.device is None:
                raise
            log.warning("OpenCL failed, NumPy repeats the work: %s", failure)
            decision = Decision("device", "*", "ran on numpy", f"opencl failed: {failure.detail}")
            return self.fallback(None).run(decision, before=before)


Prepare = Callable[["Device | None"], Prepared]


def prepare(name: str, image: Picture | None = None, /, *, device: str | None = None, **arguments: Any) -> Prepared:
    """What `run` with the same arguments would carry out."""
    return _prepared(lambda backend: read_order(name, image, arguments, backend), device)


def prepare_pipeline(
    pipeline: Pipeline | Mapping[str, Any] | str,
    image: Picture | None = None,
    /,
    *,
    images: Mapping[str, Picture] | None = None,
    device: str | None = None,
    **wishes: Any,
) -> Prepared:
    """What `run_pipeline` with the same arguments would carry out."""
    given = _named(image, images)
    return _prepared(lambda backend: read_pipeline_order(pipeline, given, wishes, backend), device)


def prepare_scene(
    scene: Scene | Mapping[str, Any] | str,
    /,
    *,
    images: Mapping[str, Picture] | None = None,
    device: str | None = None,
    **wishes: Any,
) -> Prepared:
    """What `render` with the same arguments would carry out."""
    from lichen.scene.conventions import converted
    from lichen.scene.description import read, refuse
    from lichen.scene.layers import spread
    from lichen.scene.lowering import lower
    from lichen.scene.materials import applied
    from lichen.scene.tiling import allowed

    said = read(scene)
    unknown = [name for name in images or () if name not in said.names]
    if unknown:
        flaws = [Flaw(f"/inputs/{name}", f"is not read; {nearest(name, said.names)}") for name in unknown]
        raise InvalidRequest("The scene reads no such pictures.", flaws)
    said, sent = spread(
        said, {name: as_image(each, pointer=f"/inputs/{name}") for name, each in (images or {}).items()}
    )
    refuse(said)
    said, sent = applied(*converted(said, sent))
    lowered = lower(said, prune=bool(wishes.get("prune", True)), faint=allowed(wishes), images=sent)
    given = {name: image for name, image in sent.items() if name in lowered.pipeline.inputs}
    try:
        return _prepared(
            lambda backend: read_pipeline_order(lowered.pipeline, given, wishes, backend), device, lowered.decisions
        )
    except InvalidRequest as invalid:
        raise InvalidRequest(invalid.detail, lowered.relocated(invalid.flaws)) from None


def _named(image: Picture | None, images: Mapping[str, Picture] | None) -> dict[str, Picture]:
    given = dict(images or {})
    if image is not None and given.setdefault("image", image) is not image:
        raise InvalidRequest("The picture is given twice.", [Flaw("/inputs/image", "is given twice")])
    return given


def select_device(name: str | None) -> Device | None:
    """The OpenCL device a run will use; None means NumPy.

    Raises `InvalidRequest` for a name that is none, `DeviceFailure` where OpenCL was named and cannot be had.
    """
    if name is not None and name not in times.BACKENDS:
        flaw = Flaw("/device", f"{name!r} is none; {nearest(name, times.BACKENDS)}")
        raise InvalidRequest("The device is not known.", [flaw])
    found = None if name == "numpy" else default_device()
    if found is None and name == "opencl":
        raise DeviceFailure(f"OpenCL cannot be used: {status().reason}")
    return found


def _backend(device: Device | None) -> str:
    return "opencl" if device else "numpy"


def _prepared(read: Callable[[str], Order], named: str | None, decided: tuple[Decision, ...] = ()) -> Prepared:
    """A plan for the order that `read` makes for a backend; `decided` is what was left out before there was a graph."""
    found, on = select_device(named), partial(_prepared_on, read, decided)
    try:
        return on(found, None if named else on)
    except DeviceFailure:  # while the range of a picture was measured
        if named is not None or found is None:
            raise
        return on(None)


def _prepared_on(
    read: Callable[[str], Order], decided: tuple[Decision, ...], device: Device | None, fallback: Prepare | None = None
) -> Prepared:
    started = time.perf_counter()
    order = read(_backend(device))
    facts = {key: Facts.of(measured(value, device)) for key, value in order.images.items()}
    rates = times.current(order.request.backend)
    hiding = thin(order.nodes, order.images, prune=order.request.prune)

    def made() -> Plan:
        order.refuse_flaws(facts)
        graph = Graph(facts, order.nodes, order.outputs, decided, order.precision, thin=hiding)
        return make_plan(graph, dataclasses.replace(order.request, rates=rates))

    told = None if order.key is None else (order.key, tuple(facts.items()), tuple(hiding.items()), decided)
    plan = remembered(told, rates, made)
    return Prepared(order, plan, time.perf_counter() - started, device, fallback)


def _run(
    prepared: Prepared, further: Sequence[Decision], shared: Shared | None, before: Before, stored: bool
) -> dict[str, Result]:
    order, plan = prepared.order, prepared.plan
    timing = {"plan": prepared.seconds}
    images, findings = computed(plan, order.images, prepared.device, timing, shared, before, stored=stored)
    further = (*further, *_skipped(findings))
    found: dict[str, Verification] = {}
    if order.verify:
        started = time.perf_counter()
        found = {name: verify(plan.graph.only(name), order.images, image) for name, image in images.items()}
        timing["verify"] = time.perf_counter() - started
        unmeasured = [(name, each) for name, each in found.items() if each.measured is None]
        further = (*further, *(Decision("verify", name, "left out", each.reason) for name, each in unmeasured))
    reported = findings.get(order.request.target, {}) if order.request.target else findings
    decisions = (*plan.decisions, *further)
    device = _backend(None if plan.by_definition else prepared.device)
    return {
        name: Result(image, plan, device, timing, decisions, found.get(name), reported, name)
        for name, image in images.items()
    }


def _skipped(findings: Mapping[str, Mapping[str, Any]]) -> Iterator[Decision]:
    """What nodes found that others need not compute."""
    for name, found in findings.items():
        for each in found.get("skipped", ()):
            share = f"{each['reason']}: {each['pairs']} of {found['pairs']} pairs of an effect and a tile"
            yield Decision("tiles", name, "skipped", share, each["bound"])
