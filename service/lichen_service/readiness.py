"""Whether this process can really answer: warm-up, and a canary on the road every request takes.

A process is ready when an operation has run on a tiny image and a tiny request goes through right now. Behind its back
every other operation runs once, too, which builds its kernels: the first caller of one need not wait for a compiler.
That happens in a thread of its own, so neither liveness nor readiness waits for all of it, and it gives way: no method
is begun while a request is in flight, unless that has lasted. The canary runs in another thread: a stuck device makes
it late, and late means not ready, without taking down the thread that asks.
"""

from __future__ import annotations

import dataclasses
import gc
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np

from lichen import catalogue, engine
from lichen.errors import InvalidRequest, LichenError, Unattainable
from lichen.image import Image, Space, Storage
from lichen.operation import Facts, Input, Operation
from lichen_service.logs import log

PATIENCE = 5.0
"""Seconds after which a canary that has not come back counts as stuck."""
FRESH = 1.0
"""Seconds for which an answer of the canary is believed, so that asking often costs nothing."""
FIRST_REST = 0.25
"""Seconds that clients which have waited for the start have before the warm-up goes on."""
LONGEST_REST = 5.0
"""Seconds for which the warm-up rests at most before it goes on with one method, under whatever load."""
SIDE = 48
"""Pixels; side of the image that warms up a kernel: on smaller ones filters take other kernels, for pictures that are
narrower than they."""


def example(operation: Operation[Any]) -> tuple[dict[str, Image], dict[str, Any]] | None:
    """Tiny inputs and parameters with which an operation really computes; None if its declaration offers none."""
    fallback = None
    for channels in (3, 1):
        inputs = {each.name: _ramp(each, channels) for each in operation.inputs if each.required}
        facts = {name: Facts.of(image) for name, image in inputs.items()}
        for candidate in ({}, *operation.examples, *(case.parameters for case in operation.hard_cases)):
            try:
                parameters = operation.validate(candidate)
            except InvalidRequest:
                continue
            if operation.check(parameters, facts):
                continue
            if operation.identity(parameters, facts) is None:
                return inputs, dict(candidate)
            fallback = fallback or (inputs, dict(candidate))
    return fallback


def _ramp(declared: Input, channels: int) -> Image:
    """A tiny picture with as near to `channels` channels as the input takes."""
    fewest, most = declared.channels
    ramp = np.linspace(0.1, 0.9, SIDE * SIDE, dtype=np.float32).reshape(SIDE, SIDE, 1)
    return Image(np.repeat(ramp, min(max(channels, fewest), most or channels), axis=2))


def warm_up(device: str | None = None) -> Iterator[tuple[str, str, LichenError | None]]:
    """Runs every operation once as it is usually asked for, and once by every method; yields operation, method and what
    went wrong, if anything did.

    Methods that do not take the example are passed over: they are no failure.
    """
    seen = set()
    for operation in catalogue.loaded():
        made = None if operation.name in seen else example(operation)
        seen.add(operation.name)
        if made is None:
            continue
        inputs, parameters = made
        shown = [each.name for each in operation.inputs if each.picture and each.name in inputs]
        usual: dict[str, Any] = {name: dataclasses.replace(inputs[name], space=Space.SRGB) for name in shown}
        wishes = [{"method": method, "prune": False} for method in operation.methods]
        for wish in ({**usual, "storage": Storage.UINT8}, *wishes):
            said = wish.get("method", "as it is chosen")
            arguments: dict[str, Any] = {**inputs, **parameters, **wish, "device": device}
            try:
                engine.prepare(operation.name, **arguments).run(stored=True)
            except (InvalidRequest, Unattainable):
                continue
            except LichenError as failed:
                yield operation.name, said, failed
            else:
                yield operation.name, said, None


class Tried(Protocol):
    """A thread in which an operation runs, and whether it has run well."""

    passed: bool

    def join(self) -> None: ...


class _Canary:
    """One tiny request on its way, in a thread that nobody has to wait for."""

    def __init__(self, request: Callable[[], None]) -> None:
        self._request = request
        self._done = threading.Event()
        self.failed = False
        threading.Thread(target=self._run, name="canary", daemon=True).start()

    def _run(self) -> None:
        try:
            self._request()
        except Exception:
            self.failed = True
            log.exception("the canary failed")
        finally:
            self._done.set()

    def back_within(self, seconds: float) -> bool:
        return self._done.wait(seconds)


class Readiness:
    """Knows when the process is warm, and asks the canary. Safe to use from several threads."""

    def __init__(
        self,
        request: Callable[[], None],
        *,
        patience: float = PATIENCE,
        give_way: Callable[[float], object] = lambda _seconds: None,
    ) -> None:
        """`give_way` waits until nobody is being answered, for so many seconds at most."""
        self._request = request
        self._give_way = give_way
        self._patience = patience
        self._lock = threading.Lock()
        self._canary: _Canary | None = None
        self._good_until = 0.0
        self._able = threading.Event()
        self._warm = threading.Event()
        self._stopping = threading.Event()
        self._leaving = False
        self._tried: Tried | None = None
        self._thread = threading.Thread(target=self._warm_up, name="warm-up", daemon=True)

    def start(self, tried: Tried | None = None) -> None:
        """Begins the warm-up in the background, behind an operation that runs already, if one does."""
        self._tried = tried
        self._thread.start()

    def stop(self, seconds: float) -> None:
        """Ends the warm-up after the method that it runs, for which it waits so long at most."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(seconds)

    def leave(self) -> None:
        """The service is about to end, and shall be sent nothing more."""
        self._leaving = True

    def wait(self, seconds: float) -> bool:
        """Waits for the end of the warm-up; False if it takes longer."""
        return self._warm.wait(seconds)

    def able(self, seconds: float) -> bool:
        """Waits until the first operation has run; False if it takes longer."""
        return self._able.wait(seconds)

    def _warm_up(self) -> None:
        began = time.monotonic()
        if self._tried is not None:
            self._tried.join()
            if self._tried.passed:
                self._able.set()
                self._stopping.wait(FIRST_REST)
                self._give_way(LONGEST_REST)
        try:
            for operation, method, failed in warm_up():
                self._able.set()
                if failed is not None:
                    log.error("warm-up failed", operation=operation, method=method, reason=str(failed))
                if not self._stopping.is_set():
                    self._give_way(LONGEST_REST)
                if self._stopping.is_set():
                    return
            gc.freeze()  # as where serving begins: what was made to last is not looked through again
            log.info("warm", seconds=round(time.monotonic() - began, 3))
        except Exception:
            log.exception("warm-up broke off")
        finally:
            self._able.set()
            self._warm.set()

    @property
    def fresh(self) -> bool:
        """Whether the canary came back a moment ago, so that it need not be asked; takes no lock and never waits."""
        return self._able.is_set() and not self._leaving and time.monotonic() < self._good_until

    def reason(self) -> str | None:
        """Why the process should not be sent requests now, or None if it should."""
        if self._leaving:
            return "the service is about to end"
        if not self._able.is_set():
            return "no operation has run yet"
        with self._lock:
            if time.monotonic() < self._good_until:
                return None
            canary = self._canary = self._canary or _Canary(self._request)
        if not canary.back_within(self._patience):
            return f"a tiny request has not come back within {self._patience:g} s"
        with self._lock:
            if self._canary is canary:
                self._canary = None
                self._good_until = 0.0 if canary.failed else time.monotonic() + FRESH
        return "a tiny request failed" if canary.failed else None
