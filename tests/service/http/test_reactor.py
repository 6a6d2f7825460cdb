"""The reactor alone: what ends its rest."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest
from wire_harness import PATIENCE

from lichen_service.http.reactor import READ, Reactor

FOR_EVER = 3600.0


@pytest.fixture
def reactor() -> Iterator[Reactor]:
    made = Reactor()
    yield made
    made.close()


def ended(reactor: Reactor, meanwhile: Callable[[], object] = lambda: None) -> bool:
    thread = threading.Thread(target=reactor.run, daemon=True)
    thread.start()
    meanwhile()
    thread.join(PATIENCE)
    return not thread.is_alive()


def test_a_call_from_another_thread_ends_the_rest(reactor: Reactor) -> None:
    reactor.rest = lambda: FOR_EVER
    assert ended(reactor, lambda: reactor.post(reactor.stop))


def test_a_deadline_ends_the_rest(reactor: Reactor) -> None:
    reactor.rest = lambda: FOR_EVER
    reactor.deadline(reactor.stop).set(time.monotonic() + 0.01)
    assert ended(reactor)


def test_calls_are_made_during_the_rest_and_what_came_is_seen_together_after_it(reactor: Reactor) -> None:
    rounds: list[list[str]] = [[]]
    pairs = {name: socket.socketpair() for name in ("first", "second")}
    asleep, called, over = threading.Event(), threading.Event(), threading.Event()

    def rest() -> float:
        asleep.set()
        return 0.0 if over.is_set() else FOR_EVER

    def came(name: str) -> None:
        pairs[name][0].recv(1)
        rounds[-1].append(name)
        if len(rounds[-1]) == len(pairs):
            reactor.stop()

    def send() -> None:
        assert asleep.wait(PATIENCE)
        for _, sender in pairs.values():
            sender.send(b"a")
        reactor.post(called.set)
        assert called.wait(PATIENCE)
        assert not any(rounds)
        over.set()
        reactor.post(lambda: None)

    for name, (receiver, _) in pairs.items():
        reactor.watch(receiver, READ, lambda _mask, name=name: came(name))  # type: ignore[misc]
    reactor.rest, reactor.after_round = rest, lambda: rounds.append([])
    assert ended(reactor, send)
    assert [sorted(each) for each in rounds if each] == [["first", "second"]]
    for pair in pairs.values():
        for each in pair:
            each.close()
