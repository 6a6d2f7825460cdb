"""What a plan says of itself in sentences, and that what is left is chosen anew once something was left out."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

import lichen
from lichen.image import Image, Space

PHOTO = Image(np.random.default_rng(1).random((300, 400, 3), dtype=np.float32), Space.SRGB)
SAID: dict[str, Any] = {
    "nodes": {
        "turn": {"operation": "rotate", "parameters": {"angle": 2}, "inputs": {"image": "input.image"}},
        "still": {"operation": "hue_rotate", "parameters": {"angle": 360}, "inputs": {"image": "turn"}},
        "faint": {"operation": "gaussian", "parameters": {"sigma": 0.2}, "inputs": {"image": "still"}},
        "grey": {"operation": "saturation", "parameters": {"amount": 0.2}, "inputs": {"image": "faint"}},
        "bright": {"operation": "levels", "parameters": {"white": 0.8}, "inputs": {"image": "grey"}},
        "unread": {"operation": "median", "parameters": {"size": 5}, "inputs": {"image": "input.image"}},
    },
    "outputs": {"x": {"node": "bright", "crop": [50, 60, 100, 80]}},
}


def test_a_plan_reads_like_notes() -> None:
    plan = lichen.explain_pipeline(SAID, PHOTO, device="opencl", max_error=2e-2)
    assert str(plan).splitlines() == plan.to_json()["notes"] == list(plan.notes)
    first, *rest = plan.notes
    assert re.fullmatch(
        r"\d steps on opencl: \S+ ms predicted, off by \S+ at most \(.*\), holds \S+ MiB of pictures at most; "
        r"asked: an error of 0\.02\.",
        first,
    )
    said = "\n".join(rest)
    assert re.search(r"^- turn: rotate, method \w+, off by .+ ms", said, re.M)
    assert re.search(r"^- .*grey.*: one kernel, \S+ ms; apart they would take \S+ ms more\.$", said, re.M)
    assert re.search(r"^- unread: nothing reads its result; changes nothing, and would have cost \S+ m?s", said, re.M)
    assert re.search(r"^- still: does nothing here \(.+\); changes nothing, and would have cost", said, re.M)
    assert re.search(r"^- faint: differs from its image by \S+ at most; changes the result by \S+ at most", said, re.M)
    assert re.search(r"^- turn.*: computed on \S+ from .+: no more of its 400x300 px reaches an output", said, re.M)
    assert lichen.explain_pipeline("levels", PHOTO).notes[0].startswith("Nothing runs: 0 ms predicted, exact")


def test_what_is_left_is_chosen_anew() -> None:
    """Conversions of light around what is left out amplify the blur's error, and only its definition would do."""
    text = "gaussian:sigma=3|levels:black=0.05|saturation:amount=1.00001"
    plan = lichen.explain_pipeline(text, PHOTO, device="numpy", max_error=1e-3)
    assert [each.node for each in plan.decisions if each.pass_ == "invisible"] == ["saturation"]
    blur = plan.graph.named("gaussian")
    assert blur.choice is not None
    assert blur.choice.method != "truth"
    assert plan.error.value <= 1e-3
    left = {each.name for each in plan.nodes}
    assert {each.node for each in plan.decisions if each.pass_ == "choose"} == left
