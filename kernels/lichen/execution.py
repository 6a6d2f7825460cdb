"""Carries a plan out, node by node: by the methods it chose on a device, or by definition.

Sources are given by their names in the plan's graph. Every source and every result is kept in the precision that the
graph names, and dropped after its last reader.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, MutableMapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from typing import Any

import numpy as np

from lichen.accuracy.precision import Precision, kept
from lichen.errors import LichenError
from lichen.image import Codes, Image, Storage, StoredImage
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.programs import compose
from lichen.opencl.samples import WORTH, looked_up, widened
from lichen.opencl.watching import watched
from lichen.operation import Facts, Inputs
from lichen.planning.bands import spans
from lichen.planning.fuse import FEWEST, head_of, samplewise, steps_of, tail_of, text_of
from lichen.planning.graph import TRUTH, Banded, Graph, Node
from lichen.planning.memory import last_readers
from lichen.planning.plan import Plan
from lichen.sharing import Shared
from lichen.stage import Tail

Compute = Callable[[Node, Inputs], Array | Codes]
Before = Callable[[str], None]
"""Hears of a node before a step of it is begun, and every so often while a long one is at work on a device; what it
raises ends the work there."""
LONG = 0.5
"""Predicted seconds from which on a step is ended within."""
Observe = Callable[[Node, Inputs, Array], None]
Findings = dict[str, Mapping[str, Any]]
"""What nodes report beside their pixels, by their names."""


def unheard(_node: str) -> None:
    pass


def computed(
    plan: Plan,
    sources: Mapping[str, Image],
    device: Device | None,
    timing: MutableMapping[str, float],
    shared: Shared | None = None,
    before: Before = unheard,
    *,
    stored: bool = False,
) -> tuple[dict[str, Image], Findings]:
    """What the plan gives on `device` (None: NumPy), by output. Adds to `timing` the seconds of nodes, all and each.
    Steps that another run with the same `shared.sharing` is at work on are taken over from it. `before` hears of all
    others, and of each band. What is `stored` may come as codes of its storage, where a kernel writes those at once."""
    timing["kernel"] = 0.0
    findings: Findings = {}
    chains = {chain[-1]: [plan.graph.named(name) for name in chain] for chain in plan.graph.fused}
    banded = {each.steps[-1]: each for each in plan.graph.banded}
    identities = plan.identities(shared.origins) if shared is not None else {}
    codes = _stored_alone(plan.graph) if stored else set[str]()

    def step(node: Node, inputs: Inputs, moved: Array | None = None) -> Array:
        before(node.name)
        with _watched(chains.get(node.name, [node]), before):
            if node.name in chains and device is not None:
                values = {node.inputs[key]: image for key, image in inputs.items()}
                return by_chain(chains[node.name], plan.graph, values, device, moved)
            both = in_one_pass(node, inputs, device)
            if both is None:
                return by_method(node, inputs, device)
            pixels, findings[node.name] = both
            return pixels

    def made(node: Node, inputs: Inputs) -> Array | Codes:
        if plan.graph.precision is Precision.FLOAT64:
            before(node.name)
            return by_definition(node, inputs)
        if node.name in banded:
            return by_bands(banded[node.name], plan.graph, inputs, step)
        if device is None or node.name not in codes:
            return step(node, inputs)
        moved = np.zeros(2, np.int32)
        found = step(node, inputs, moved)
        if found.dtype == np.float32:
            return found
        return Codes(found, partial(widened, device), moved=(int(moved[0]), int(moved[1])))

    whole = {*chains, *banded}
    wanted = {output.source for output in plan.graph.outputs.values()}

    def timed(node: Node, inputs: Inputs) -> Array | Codes:
        started = time.perf_counter()
        found: Array | Codes
        if device is not None and node.name not in whole and _tabled(node, plan.graph, inputs, device):
            before(node.name)
            found = by_table(node, inputs, device)  # which is done sooner than taken over
            found = found.floats if node.name in wanted else found
        elif shared is not None and node.name in identities:
            form = ", stored" if node.name in codes else ""
            found = shared.sharing.of(identities[node.name] + form, partial(made, node, inputs))
        else:
            found = made(node, inputs)
        timing[f"kernel.{node.name}"] = time.perf_counter() - started
        timing["kernel"] += timing[f"kernel.{node.name}"]
        if not isinstance(found, Codes):
            observed(node, inputs, found)
        return found

    def observed(node: Node, inputs: Inputs, pixels: Array) -> None:
        if node.operation.finds and node.name not in findings:
            started = time.perf_counter()
            with np.errstate(all="ignore"):  # as where the pixels were made
                findings[node.name] = node.operation.find(inputs, node.parameters, pixels, device)
            timing["findings"] = timing.get("findings", 0.0) + time.perf_counter() - started

    return walk(plan.graph, sources, timed, observed), findings


def _stored_alone(graph: Graph) -> set[str]:
    """The steps whose results nobody reads, but they are stored in 8 bits."""
    read = {source for node in (*graph.nodes, *graph.observers) for source in node.inputs.values()}
    read |= {output.source for output in graph.outputs.values() if output.storage is not Storage.UINT8}
    return {output.source for output in graph.outputs.values()} - read


def _watched(nodes: Sequence[Node], before: Before) -> AbstractContextManager[None]:
    """Lets a step that takes long be ended within, if anybody hears of it at all."""
    predicted = sum(node.choice.seconds for node in nodes if node.choice is not None)
    if before is unheard or predicted < LONG:
        return nullcontext()
    return watched(partial(before, nodes[-1].name))


def exact(graph: Graph, sources: Mapping[str, Image]) -> Array:
    """The exact output of a graph that has one, float64: every node by definition, nothing rounded between. Slow."""
    (made,) = walk(graph.replace(precision=Precision.FLOAT64, fused=(), banded=()), sources, by_definition).values()
    return made.pixels.astype(np.float64, copy=False)


def by_definition(node: Node, inputs: Inputs) -> Array:
    with np.errstate(all="ignore"):  # NaN and infinity are values here; they are counted, not warned of
        return node.operation.evaluate_truth(inputs, node.parameters)


def by_method(node: Node, inputs: Inputs, device: Device | None) -> Array:
    """One node by its chosen method. Raises `LichenError`; whatever else escapes a method is its author's defect."""
    choice = node.choice
    if choice is None:
        raise LichenError(f"The plan chose no method for {node.name}.")
    if choice.method == TRUTH:
        return aligned(by_definition(node, inputs), np.float32)
    body = node.operation.methods[choice.method].implementation
    knob = choice.knob if choice.knob is not None else 0.0
    single = _given(node, inputs, device)
    with np.errstate(all="ignore"):
        if device is None:
            return body.numpy(single, node.parameters, knob)
        return body.opencl(device, single, node.parameters, knob)


def in_one_pass(node: Node, inputs: Inputs, device: Device | None) -> tuple[Array, Mapping[str, Any]] | None:
    """What a node makes by its chosen method and what it reports of it, where a device finds both at once."""
    choice = node.choice
    if device is None or choice is None or choice.method == TRUTH:
        return None
    finding = node.operation.methods[choice.method].finding
    if finding is None:
        return None
    with np.errstate(all="ignore"):
        return finding(device, _given(node, inputs, device), node.parameters, choice.knob or 0.0)


def _tabled(node: Node, graph: Graph, inputs: Inputs, device: Device) -> bool:
    """Whether a step does the same to all samples, of a picture that has few different ones."""
    if graph.precision is not Precision.FLOAT32 or len(inputs) != 1:
        return False
    return all(_coded(image, device) for image in inputs.values()) and samplewise(node, graph.facts())


def by_table(node: Node, inputs: Inputs, device: Device) -> Codes:
    """What such a step makes: it is done once to each of 256 samples."""
    ((key, image),) = inputs.items()
    assert isinstance(image, StoredImage)
    every = np.repeat(image.codes.numbers[np.newaxis, :, np.newaxis], image.channels, axis=2)
    table = aligned(by_method(node, {key: image.replace(pixels=every)}, device)[0, :, 0])
    return Codes(image.codes.samples, partial(looked_up, device, table), table)


def by_chain(
    nodes: Sequence[Node], graph: Graph, values: Mapping[str, Image], device: Device, moved: Array | None = None
) -> Array:
    """A chain of nodes by one generated kernel, or one after the other where there are too many kernels or few pixels.
    `values` are the pictures that it reads by their names in the graph. With `moved`, of a chain that has a head, codes
    of 8 bits (`Tail`), unless they come one after the other."""
    facts = graph.facts()
    if (head := head_of(nodes[0], facts)) is not None:
        text, numbers = tail_of(nodes[1:], facts, head.source)
        # Where items step together other kernels do the work of heads.
        if device.in_step or (source := compose(text)) is None:
            return _in_turn(nodes, facts, values, device)
        read = {key: values[each] for key, each in nodes[0].inputs.items()}
        return head.run(device, _given(nodes[0], read, device), Tail(source, _numbers(numbers), moved))
    steps = steps_of(nodes, facts)
    image = values[steps[0].sources[0]]
    count = image.height * image.width
    if count < FEWEST or (source := compose(text_of(steps, image.channels))) is None:
        return _in_turn(nodes, facts, values, device)
    pixels = aligned(image.pixels, np.float32)
    beside = [aligned(values[step.beside].pixels, np.float32) for step in steps if step.beside is not None]
    out = aligned_empty(pixels.shape)
    given = _numbers(number for step in steps for number in step.stage.numbers)
    with device.session() as session:
        session.sweep(source, "fused", -(-count // 16), pixels, session.write(out), given, np.int32(count), *beside)
    return out


def _numbers(given: Iterable[float]) -> Array:
    """As a kernel reads them, which must have one at least."""
    return aligned(np.array([*given, 0], np.float32))


def by_bands(banded: Banded, graph: Graph, inputs: Inputs, step: Callable[[Node, Inputs], Array]) -> Array:
    """What a chain of steps makes, a band of rows after the other. Of each step no more is made than the next reads."""
    facts = graph.facts()
    found = {node.name: node for node in graph.steps()}
    steps = [found[name] for name in banded.steps]
    (image,) = inputs.values()
    made = facts[banded.steps[-1]]
    out = aligned_empty((made.height, made.width, made.channels))
    for start in range(0, made.height, banded.rows):
        (top, end), *rows = spans(banded, start, made.height)
        band = image.replace(pixels=image.pixels[top:end])
        for node, (first, last) in zip(steps, rows, strict=True):
            known = facts[node.name]
            pixels = step(node, {next(iter(node.inputs)): band})[first - top : last - top]
            band, top = Image(pixels, known.space, known.alpha, image.storage, image.metadata), first
        out[start : start + len(band.pixels)] = band.pixels
    return out


def _in_turn(nodes: Sequence[Node], facts: Mapping[str, Facts], values: Mapping[str, Image], device: Device) -> Array:
    found = dict(values)
    for node in nodes:
        pixels = by_method(node, {key: found[source] for key, source in node.inputs.items()}, device)
        found[node.name] = Image(pixels, facts[node.name].space, facts[node.name].alpha)
    return pixels


def _given(node: Node, inputs: Inputs, device: Device | None) -> Inputs:
    """Pictures as the chosen method takes them: as codes where it looks them up, else as floats."""
    if device is None or node.choice is None or not node.operation.methods[node.choice.method].coded:
        return {key: _single(image) for key, image in inputs.items()}
    return {key: image if _coded(image, device) else _single(image) for key, image in inputs.items()}


def _single(image: Image) -> Image:
    """The image in aligned float32, and no longer as it was stored; itself, with all that is known of it, where it is
    that already."""
    image = image.floats() if isinstance(image, StoredImage) else image
    pixels = aligned(image.pixels, np.float32)
    return image if pixels is image.pixels else image.replace(pixels=pixels)


def _coded(image: Image, device: Device) -> bool:
    """Whether it is so many samples of 8 bits that a kernel looks up what they mean."""
    if not isinstance(image, StoredImage) or image.widened or not device.in_place or device.in_step:
        return False
    return image.codes.samples.dtype == np.uint8 and image.codes.samples.size >= WORTH


def _own(image: Image) -> Image:
    return image.again() if isinstance(image, StoredImage) and not image.widened else image


def walk(
    graph: Graph, sources: Mapping[str, Image], compute: Compute, observe: Observe = lambda *seen: None
) -> dict[str, Image]:
    """Run the nodes in order and return the outputs. Values are dropped after their last reader, and floats of stored
    samples with them."""
    values = {name: kept(_own(image), graph.precision) for name, image in sources.items()}
    facts_of = graph.facts()
    last = last_readers(graph)
    for node in graph.running():
        inputs = {key: values[source] for key, source in node.inputs.items()}
        facts = facts_of[node.name]
        model = next(iter(inputs.values()), None)
        known: Any = {
            "space": facts.space,
            "alpha": facts.alpha,
            "storage": model.storage if model else Storage.FLOAT32,
            "metadata": model.metadata if model else {},
            "pages": facts.pages,
        }
        found = compute(node, inputs)
        made = StoredImage(found, **known) if isinstance(found, Codes) else Image(found, **known)
        values[node.name] = kept(made, graph.precision)
        del inputs, model, found, made
        for source in {node.name, *node.inputs.values()}:
            if last.get(source) == node.name:
                del values[source]
    for node in graph.observers:
        seen = {key: values[source] for key, source in node.inputs.items()}
        observe(node, seen, next(iter(seen.values())).pixels)
    return {name: values[output.source] for name, output in graph.outputs.items()}
