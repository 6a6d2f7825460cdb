"""Answers that are kept: within their bytes, once at a time, and never where they failed."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from lichen_service.cache import Answers
from lichen_service.http.message import Response


def later() -> float:
    return time.monotonic() + 60


def test_the_longest_unused_is_dropped_first() -> None:
    answers = Answers(250)
    for tag in ("a", "b"):
        answers.answer(tag, lambda: Response(200, b"x" * 100), later())
    assert answers.answer("a", lambda: Response(500), later())[1]
    answers.answer("c", lambda: Response(200, b"x" * 100), later())
    assert answers.held == 200
    assert answers.answer("a", lambda: Response(500), later())[1]
    assert not answers.answer("b", lambda: Response(200), later())[1]


@pytest.mark.parametrize(
    ("capacity", "response"), [(0, Response(200, b"x")), (9, Response(200, b"x" * 10)), (99, Response(404))]
)
def test_what_is_too_large_or_no_result_is_not_kept(capacity: int, response: Response) -> None:
    answers = Answers(capacity)
    for _ in range(2):
        assert answers.answer("a", lambda: response, later()) == (response, False)
    assert answers.held == 0


def test_an_answer_taken_out_cannot_spoil_the_one_kept() -> None:
    answers = Answers(1000)
    first, _ = answers.answer("a", lambda: Response(200, b"x", {"A": "1"}), later())
    first.headers["A"] = "2"
    second, kept = answers.answer("a", lambda: Response(500), later())
    assert kept
    assert second.headers == {"A": "1"}


def test_the_same_is_computed_once_at_a_time() -> None:
    answers, started, calls = Answers(1000), threading.Event(), []

    def compute() -> Response:
        calls.append(1)
        started.wait(10)
        return Response(200, b"x")

    with ThreadPoolExecutor(4) as pool:
        futures = [pool.submit(answers.answer, "a", compute, later()) for _ in range(4)]
        while not calls:
            time.sleep(0.001)
        started.set()
        found = [future.result() for future in futures]
    assert len(calls) == 1
    assert sorted(kept for _, kept in found) == [False, True, True, True]


def test_where_the_first_fails_the_others_compute() -> None:
    answers, calls, lock = Answers(1000), [], threading.Lock()

    def compute() -> Response:
        with lock:
            calls.append(1)
            first = len(calls) == 1
        if first:
            time.sleep(0.05)
            raise RuntimeError("broken")
        return Response(200, b"x")

    with ThreadPoolExecutor(3) as pool:
        futures = [pool.submit(answers.answer, "a", compute, later()) for _ in range(3)]
        broken = [future.exception() for future in futures]
    assert sum(each is not None for each in broken) == 1


def test_nobody_waits_beyond_the_deadline() -> None:
    answers, go = Answers(1000), threading.Event()

    def slow() -> Response:
        go.wait(10)
        return Response(200, b"slow")

    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(answers.answer, "a", slow, later())
        while "a" not in answers._computing:
            time.sleep(0.001)
        response, kept = answers.answer("a", lambda: Response(200, b"own"), time.monotonic())
        go.set()
        running.result()
    assert (bytes(response.body), kept) == (b"own", False)
