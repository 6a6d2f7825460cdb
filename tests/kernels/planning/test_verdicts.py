"""What a plan says of its alternatives is what the choice was made by."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import lichen
from lichen.engine import prepare_pipeline
from lichen.planning.candidates import IN_SECONDS, Candidate
from lichen.planning.error import total_error
from lichen.planning.plan import Plan
from lichen.planning.predict import Told
from lichen.planning.verdicts import outcomes, verdicts

IMAGE = np.random.default_rng(0).random((96, 96, 3), dtype=np.float32)
FIELD = IMAGE[..., :2] - np.float32(0.5)


def judged(plan: Plan) -> dict[tuple[str, float | None], tuple[Candidate, str]]:
    node = plan.graph.node(plan.request.target)
    assert node is not None
    found = verdicts(plan.graph, plan.request, node)
    return {(each.method, each.knob): (each, said) for each, said in zip(node.alternatives, found, strict=True)}


@pytest.mark.parametrize("max_error", [1e-2, 1e-3, 1e-4, 1e-5])
def test_an_error_asked_for_divides_the_candidates(max_error: float) -> None:
    plan = lichen.explain("gaussian", IMAGE, sigma=9, max_error=max_error)
    for offer, said in judged(plan).values():
        if offer.unfit is not None:
            assert said == f"not possible: {offer.unfit}"
        elif offer.error.value > max_error:
            assert said == f"not accurate enough: an error of {offer.error.value:.3g}, asked {max_error:.3g}"
        else:
            assert said == "taken" or said.startswith("accurate enough, but ")
    assert [said for _, said in judged(plan).values()].count("taken") == 1


def test_a_time_asked_for_divides_the_candidates() -> None:
    slowest = max(offer.seconds for offer, _ in judged(lichen.explain("lic", FIELD, length=9)).values())
    plan = lichen.explain("lic", FIELD, length=9, max_ms=slowest * 1e3 / 2)
    for offer, said in judged(plan).values():
        assert said.startswith("too slow: ") == (offer.seconds > slowest / 2)
        typical = "fast enough, but less accurate as a rule: a typical error of "
        assert said == "taken" or said.startswith(("too slow: ", typical, "fast enough, but no more accurate"))


def test_time_and_error_together_name_what_a_candidate_lacks() -> None:
    plan = lichen.explain("gaussian", IMAGE, sigma=9, max_error=1e-4, max_ms=1e4)
    for offer, said in judged(plan).values():
        lacking = "not accurate enough: " if offer.error.value > 1e-4 else "fast and accurate enough, but "
        lacking = lacking if offer.unfit is None else "not possible: "
        assert said == "taken" or said.startswith(lacking)


def test_what_the_result_would_be_with_each_is_what_it_is_when_asked_for() -> None:
    """Conversions to light and back carry errors further, so the result's error is not the method's."""
    picture = lichen.image.Image(IMAGE, lichen.image.Space.SRGB)
    plan = lichen.explain("gaussian", picture, sigma=9)
    node = plan.graph.node(plan.request.target)
    assert node is not None
    for offer, outcome in zip(node.alternatives, outcomes(plan.graph, plan.request, node), strict=True):
        assert (outcome is None) == (offer.unfit is not None)
        if outcome is not None and offer.method in node.operation.methods:
            knobs = {"tail": offer.knob} if offer.method in ("fir", "dct") else {}
            asked = lichen.explain("gaussian", picture, sigma=9, method=offer.method, **knobs)
            if asked.graph.node(asked.request.target).choice == offer:  # type: ignore[union-attr]
                assert asked.error == outcome
                assert outcome.value > offer.error.value


def test_a_method_that_cannot_run_says_why() -> None:
    judgements = judged(lichen.explain("gaussian", IMAGE, sigma=9, border="wrap")).values()
    said = {offer.method: text for offer, text in judgements if offer.unfit}
    assert said.keys() == {"dct", "fft"}
    assert said["dct"].startswith("not possible: the border is wrap")
    assert said["fft"].startswith("not possible: rows and columns can be filtered one after the other")


def test_where_nothing_can_be_promised_the_customary_setting_is_explained() -> None:
    for _, said in judged(lichen.explain("lic", FIELD, length=9)).values():
        assert said == "taken" or "the customary one is taken, this one has a typical error of " in said


@pytest.mark.parametrize(
    ("seconds", "error", "said"),
    [
        (0.0, 0.0, "accurate enough, but no faster"),
        (0.0, 1e-5, "accurate enough, but no faster, and less accurate"),
        (2e-3, 0.0, "accurate enough, but slower by 2 ms"),
        (-1e-5, 0.0, "accurate enough, but 0.01 ms quicker and not found"),
    ],
)
def test_ties_are_no_slower(seconds: float, error: float, said: str) -> None:
    plan = lichen.explain("gaussian", IMAGE, sigma=9, max_error=1e-3)
    node = plan.graph.node("gaussian")
    assert node is not None
    assert node.choice is not None
    taken = node.choice
    beside = taken._replace(
        knob=0.123,
        stated=Told(dataclasses.replace(taken.error, value=taken.error.value + error), taken.seconds + seconds),
        rate=IN_SECONDS,
    )
    changed: Any = dataclasses.replace(node, alternatives=(taken, beside))
    assert verdicts(plan.graph, plan.request, changed) == ["taken", said]


BRANCHES = {
    "nodes": {
        "soft": {"operation": "gaussian", "parameters": {"sigma": 2}, "inputs": {"image": "input.image"}},
        "dark": {"operation": "levels", "parameters": {"gamma": 0.7}, "inputs": {"image": "soft"}},
        "laid": {"operation": "composite", "parameters": {"opacity": 0.5}, "inputs": {"image": "dark", "base": "soft"}},
        "bent": {"operation": "rotate", "parameters": {"angle": 7}, "inputs": {"image": "laid"}},
    },
    "outputs": {"a": {"node": "bent"}, "b": {"node": "dark"}},
}


def test_a_candidate_beside_branches_counts_wherever_it_is_read() -> None:
    picture = lichen.image.Image(IMAGE, lichen.image.Space.SRGB)
    plan = prepare_pipeline(BRANCHES, images={"image": picture}, max_error=1e-2).plan
    choices = {node.name: node.choice for node in plan.nodes if node.choice is not None}
    tried = 0
    for node in plan.nodes:
        for offer, outcome in zip(node.alternatives, outcomes(plan.graph, plan.request, node), strict=True):
            if outcome is not None:
                assert outcome == total_error(plan.graph, plan.graph.facts(), {**choices, node.name: offer})
                tried += 1
    assert tried > len(plan.nodes)


def test_where_candidates_are_too_many_they_are_named_and_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = lichen.explain("gaussian", IMAGE, sigma=9)
    whole = plan.to_json()["nodes"][0]["alternatives"]
    monkeypatch.setattr("lichen.planning.verdicts.MOST", 1)
    found = plan.to_json()["nodes"][0]["alternatives"]
    assert [each | {"verdict": "", "result_error": None} for each in found] == [
        each | {"verdict": "", "result_error": None} for each in whole
    ]
    for before, now in zip(whole, found, strict=True):
        kept = before["verdict"] == "taken" or before["verdict"].startswith("not possible")
        assert now == before if kept else now["verdict"].startswith("not tried: 1 step")
        assert kept or now["result_error"] is None
