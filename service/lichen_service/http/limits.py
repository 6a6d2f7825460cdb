"""The numbers the wire obeys: those that are set, and those that are part of its design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


class WireSettings(Protocol):
    """What the wire needs to be told. Times are seconds, sizes bytes."""

    @property
    def host(self) -> str: ...
    @property
    def port(self) -> int: ...
    @property
    def metrics(self) -> str: ...
    @property
    def workers(self) -> int: ...
    @property
    def spare(self) -> str: ...
    @property
    def silence(self) -> float: ...
    @property
    def worker_memory(self) -> int: ...
    @property
    def worker_requests(self) -> int: ...
    @property
    def threads(self) -> int: ...
    @property
    def queue(self) -> int: ...
    @property
    def header_timeout(self) -> float: ...
    @property
    def body_rate(self) -> float: ...
    @property
    def idle_timeout(self) -> float: ...
    @property
    def request_timeout(self) -> float: ...
    @property
    def grace(self) -> float: ...
    @property
    def max_body(self) -> int: ...


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds of one worker that are no matter of taste; tests tighten them."""

    connections: int = 4096
    """open at a time; the others wait in the listen backlog"""
    requests_per_connection: int = 1000
    read_size: int = 64 * 1024
    body_read_size: int = 1024 * 1024
    patience: float = 10.0
    """seconds that a body, either way, may be late against its slowest rate"""
    bodies_in_flight: int = 4
    """memory of all bodies together, as a multiple of the largest body"""
    drain: int = 256 * 1024
    """an unread body up to this size is read and dropped, and the connection kept"""
    linger: float = 2.0
    """seconds a closing connection is read on, so that a reset does not destroy our last answer on its way"""
    retry_after: int = 1
    """seconds named in Retry-After when the queue is full"""
