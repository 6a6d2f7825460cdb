"""The choice for one node is what sorting all of its candidates finds."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import lichen
from lichen.calibration.corpus import typical
from lichen.errors import InvalidRequest, Unattainable
from lichen.operation import Operation, Rate
from lichen.planning.candidates import Candidate
from lichen.planning.choose import choose, measures, target_error
from lichen.planning.graph import TRUTH, Graph, Node, Request

OPERATIONS = dict(lichen.operations())


def sorted_out(chosen: Graph, request: Request) -> Candidate | None:
    """The first of all candidates, the quickest first and of equally quick ones the most accurate, that is accurate
    enough; None where none is."""
    (node,), (output,) = chosen.nodes, chosen.outputs.values()
    able = [offer for offer in node.alternatives if offer.unfit is None and offer.method != TRUTH]
    able.sort(key=lambda offer: (offer.seconds, offer.error.value))
    target = target_error(chosen.facts()[output.source], output, request)
    meeting = (offer for _, measure in measures(request) for offer in able if measure(offer.error) <= target)
    return next(meeting, None)


def drawn(operation: Operation[Any], rng: np.random.Generator) -> tuple[Graph, Request] | None:
    """An operation at parameters near an example, on pictures of some size, with some error asked for, on a machine
    where methods are faster and slower than declared, and where constant costs may be nothing."""
    example = dict(operation.examples[rng.integers(len(operation.examples))])
    height, width = (int(side) for side in np.exp(rng.uniform(np.log(16), np.log(3000), 2)))
    known = typical(operation, operation.validate(example), 32).facts
    facts = {name: dataclasses.replace(each, height=height, width=width) for name, each in known.items()}
    varied = {k: v * float(np.exp(rng.uniform(-2, 2))) if isinstance(v, float) else v for k, v in example.items()}
    try:
        parameters = operation.sized(operation.validate(varied), height, width)
    except InvalidRequest:
        return None
    if operation.check(parameters, facts):
        return None
    rates = {
        (operation.name, method.name): Rate(rng.choice([0.0, 0.3, 1.0]) * rate.start, rng.uniform(0.3, 3) * rate.step)
        for method in operation.methods.values()
        for rate in [method.rates["opencl"]]
    }
    asked = [None, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6][rng.integers(6)]
    node = Node(operation.name, operation, parameters, {name: f"input.{name}" for name in facts})
    sources = {f"input.{name}": each for name, each in facts.items()}
    request = Request("opencl", asked, target=operation.name, rates=rates)
    return Graph.of(sources, (node,), operation.name), request


@pytest.mark.parametrize("name", [name for name, each in OPERATIONS.items() if len(each.methods) > 1])
def test_the_choice_is_the_first_of_all_candidates_in_their_order(name: str) -> None:
    rng, compared = np.random.default_rng(7), 0
    for _ in range(60 if name in ("gaussian", "convolve", "sharpen", "mix") else 12):
        found = drawn(OPERATIONS[name], rng)
        if found is None:
            continue
        graph, request = found
        try:
            chosen = choose(graph, request)
        except Unattainable:
            continue
        (node,), facts = chosen.nodes, graph.facts()
        expected, choice = sorted_out(chosen, request), node.choice
        assert choice is not None
        if expected is not None:
            assert (choice.method, choice.passes) == (expected.method, expected.passes)
            if choice.knob != expected.knob:  # settings that are neither quicker nor more accurate
                assert (choice.seconds, choice.error) == (expected.seconds, expected.error)
        elif choice.method == TRUTH:
            stated = [offer.error.value for offer in node.offers(facts).values() if offer.unfit is None]
            assert request.max_error is not None
            assert min(stated, default=np.inf) > request.max_error
        else:
            assert request.max_error is None
            customary = node.operation.customary
            able = [(offer.method, offer.knob) for offer in node.alternatives if offer.unfit is None]
            assert customary not in able or (choice.method, choice.knob) == customary
        compared += 1
    assert compared
