"""Steps that runs at the same time have in common are done once, whatever becomes of whoever does them."""

from __future__ import annotations

import gc
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from lichen import execution
from lichen.engine import Prepared, prepare_pipeline
from lichen.image import Image, Space
from lichen.memory import Array
from lichen.sharing import Shared, Sharing

PICTURE = Image(np.random.default_rng(4).random((30, 40, 3), dtype=np.float32), Space.LINEAR)
TOGETHER = 10.0
"""Seconds after which a test that waits has failed."""


def prepared(text: str) -> Prepared:
    return prepare_pipeline(text, PICTURE, device="numpy")


def test_a_prefix_that_two_runs_share_is_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second run begins while the first is in the prefix, and the first ends only when the second has it."""
    sharing, asked, done = Sharing(), threading.Event(), []
    by_method, of = execution.by_method, sharing.of

    def noted(node: Any, *rest: Any) -> Array:
        done.append(node.name)
        if node.operation.name == "gaussian":
            assert asked.wait(TOGETHER), "the other run did not come"
        return by_method(node, *rest)

    def asking(step: str, compute: Any) -> Array:
        if "soft" in done:  # the other run is at it, and this one will have begun to wait for it by then
            threading.Timer(0.5, asked.set).start()
        return of(step, compute)

    monkeypatch.setattr(execution, "by_method", noted)
    monkeypatch.setattr(sharing, "of", asking)
    shared = Shared(sharing, {"input.image": "the same picture"})
    texts = [
        "soft=gaussian:sigma=3,method=fir,tail=0.0001|median:size=3",
        "blurred=gaussian:sigma=3.0,method=fir,tail=0.0001|levels:black=0.1",
    ]
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(prepared(texts[0]).run, shared=shared)
        while "soft" not in done:
            assert not first.done()
        results = [pool.submit(prepared(texts[1]).run, shared=shared), first]
        pixels = [each.result()["result"].image.pixels for each in results]
    assert sorted(done) == ["levels", "median", "soft"]
    monkeypatch.undo()
    for text, found in zip(texts[::-1], pixels, strict=True):
        np.testing.assert_array_equal(found, prepared(text).run()["result"].image.pixels)


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("x=gaussian:sigma=2", True),
        ("gaussian:sigma=2.5", False),
        ("gaussian:sigma=2,method=fir,tail=0.01", False),
        ("gaussian:sigma=2,border=wrap", False),
        ("levels:black=0.1|gaussian:sigma=2", False),
    ],
)
def test_steps_are_the_same_where_all_is_that_decides_their_pixels(text: str, same: bool) -> None:
    plan, other = prepared("gaussian:sigma=2").plan, prepared(text).plan
    known = {"input.image": "a"}
    (step,) = plan.identities(known).values()
    found = other.identities(known)
    assert (found[other.graph.output] == step) is same
    assert step not in plan.identities({"input.image": "b"}).values()
    assert plan.identities({}) == {}


def test_who_waits_gets_what_is_made_even_if_nobody_else_keeps_it() -> None:
    sharing, begun, go, made = Sharing(), threading.Event(), threading.Event(), []

    def compute() -> Array:
        made.append(threading.get_ident())
        begun.set()
        assert go.wait(TOGETHER)
        return np.zeros(3)

    def used_and_dropped() -> int:
        return sharing.of("step", compute).size

    with ThreadPoolExecutor(3) as pool:
        first = pool.submit(used_and_dropped)
        assert begun.wait(TOGETHER)
        others = [pool.submit(used_and_dropped) for _ in range(2)]
        time.sleep(0.5)  # they have begun to wait by then
        go.set()
        assert [each.result() for each in (first, *others)] == [3, 3, 3]
    assert len(made) == 1


def test_nothing_is_kept_that_nobody_uses() -> None:
    sharing, made = Sharing(), []

    def compute() -> Array:
        made.append(np.zeros(3))
        return made[-1]

    held = sharing.of("step", compute)
    assert sharing.of("step", compute) is held
    del held
    made.clear()
    gc.collect()
    sharing.of("step", compute)
    assert len(made) == 1


def test_who_waited_for_a_failure_computes_itself() -> None:
    sharing, begun, go = Sharing(), threading.Event(), threading.Event()

    def failing() -> Array:
        begun.set()
        assert go.wait(TOGETHER)
        raise ValueError("spoilt")

    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(sharing.of, "step", failing)
        assert begun.wait(TOGETHER)
        second = pool.submit(sharing.of, "step", lambda: np.ones(2))
        go.set()
        with pytest.raises(ValueError, match="spoilt"):
            first.result(TOGETHER)
        np.testing.assert_array_equal(second.result(TOGETHER), np.ones(2))
