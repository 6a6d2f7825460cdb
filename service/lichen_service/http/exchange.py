"""One request and its answer: how the body is received, how the answer leaves, what is logged."""

from __future__ import annotations

import re
import socket
import time
from dataclasses import dataclass, field
from typing import Any

from lichen_service.http.access_log import shown_query
from lichen_service.http.chunked import ChunkedBody
from lichen_service.http.finish import choose_request_id, finish
from lichen_service.http.message import Body, Head, Lend, Response, Stream
from lichen_service.http.policy import RawHead, Refusal
from lichen_service.http.target import BadTarget, split_target

_MILLISECONDS = re.compile(r"[1-9][0-9]{0,8}")
# W3C Trace Context: version, trace, parent, flags; neither of the two in the middle may be all zeros.
_TRACE = re.compile(r"(?!ff)[0-9a-f]{2}-(?!0{32})([0-9a-f]{32})-(?!0{16})([0-9a-f]{16})-([0-9a-f]{2})")
_JOINED = 16 * 1024
"""bytes of a body that is sent in one piece with its head"""


class FixedBody:
    """A body of known length, received in place.

    Its memory is `lent`, and taken only as bytes arrive, so that claiming a large body costs us nothing.
    """

    def __init__(self, length: int, lent: Lend) -> None:
        self.body = lent(length)
        self.received = 0

    @property
    def done(self) -> bool:
        return self.received == len(self.body)

    def feed(self, data: bytes | bytearray | memoryview) -> int | Refusal:
        taken = min(len(data), len(self.body) - self.received)
        with memoryview(data)[:taken] as view:
            self.body[self.received : self.received + taken] = view
        self.received += taken
        return taken

    def receive(self, sock: socket.socket, most: int) -> int:
        """Receive straight into the body; 0 means that the peer has ended."""
        count = sock.recv_into(self.body[self.received : self.received + most])
        self.received += count
        return count


@dataclass(slots=True)
class Exchange:
    """Times are of `time.monotonic()`."""

    request_id: str
    peer: str = ""
    method: str = ""
    target: str = ""
    head: Head | Refusal | None = None
    """None until a whole head has come"""
    keep_alive: bool = False
    waits_for_continue: bool = False
    started: float = field(default_factory=time.monotonic)
    caller: object = None
    """who asks, as the routes said"""
    body: FixedBody | ChunkedBody | None = None
    body_started: float = 0.0
    received: int = 0
    """bytes of the body so far, framing included"""
    held: int = 0
    """of these, bytes that count against the memory for bodies"""
    discard: int = 0
    """bytes of an unread body to drop before the next request"""
    queued: float = 0.0
    work_started: float = 0.0
    work_ended: float = 0.0
    status: int = 0
    out: list[memoryview] = field(default_factory=list)
    stream: Stream | None = None
    write_started: float = 0.0
    sent: int = 0
    ended: float = 0.0
    fields: dict[str, object] = field(default_factory=dict)

    @classmethod
    def opened(cls, opening: RawHead, peer: str, request_timeout: float, apart: bool = False) -> Exchange:
        """The exchange that a sound head begins; its `head` is a refusal where target or time do not decode."""
        fields = opening.headers
        request_id = choose_request_id(fields.get("x-request-id"))
        exchange = cls(request_id, peer, opening.method, opening.target, keep_alive=opening.keep_alive)
        try:
            path, query = split_target(opening.target)
        except BadTarget as bad:
            exchange.head = Refusal(400, "malformed-target", str(bad))
            return exchange
        allowed = request_timeout
        if (asked := fields.get("request-timeout")) is not None:
            if not _MILLISECONDS.fullmatch(asked):
                exchange.head = Refusal(
                    400, "malformed-timeout", "Request-Timeout is not a positive whole number of milliseconds"
                )
                return exchange
            allowed = min(allowed, int(asked) / 1000)
        now = exchange.started
        head = Head(opening.method, path, query, fields, request_id, now, now + allowed, peer, allowed, apart=apart)
        exchange.head = head
        exchange.waits_for_continue = opening.expects_continue and head.length != 0
        return exchange

    def answer(self, response: Response) -> None:
        """Make the answer ready to send; raises `BadResponse` where it must not leave."""
        if response.stream is not None:
            self.keep_alive = False
            self.stream = None if self.method == "HEAD" else response.stream
        wire = finish(response, request_id=self.request_id, method=self.method, keep_alive=self.keep_alive)
        body = _flat(wire.body)
        if len(body) <= _JOINED:  # one piece costs the system less than two
            self.out = [memoryview(b"".join((wire.head, body)))]
        else:
            self.out = [memoryview(wire.head), body]
        self.status = response.status
        self.fields = response.log
        self.write_started = time.monotonic()

    def send(self, sock: socket.socket) -> bool:
        """Send what the socket takes without waiting; true when everything has left."""
        while self.out:
            try:
                count = sock.send(self.out[0]) if len(self.out) == 1 else sock.sendmsg(self.out)
            except BlockingIOError:
                return False
            self.sent += count
            while self.out and count >= len(self.out[0]):
                count -= len(self.out.pop(0))
            if count:
                self.out[0] = self.out[0][count:]
        return True

    @property
    def discardable(self) -> int | None:
        """Bytes of a body that may be read and dropped; None where nobody knows them, or they may never come."""
        return self.head.length if isinstance(self.head, Head) and not self.waits_for_continue else None

    def end(self) -> Exchange:
        """The answer has left, or never will."""
        self.ended = time.monotonic()
        return self

    def record(self) -> dict[str, Any]:
        """The line of the access log."""
        path, _, query = self.target.partition("?")
        line: dict[str, object] = {
            "request_id": self.request_id,
            "peer": self.peer,
            "method": self.method,
            "path": path,
            "status": self.status,
            "bytes_in": self.received,
            "bytes_out": self.sent,
            "total_ms": milliseconds(self.started, self.ended),
        }
        if query:
            line["query"] = shown_query(query)
        if isinstance(self.head, Head) and (trace := _TRACE.fullmatch(self.head.headers.get("traceparent", ""))):
            line |= {"trace_id": trace[1], "parent_id": trace[2], "trace_flags": trace[3]}
        if self.work_started:
            line["receive_ms"] = milliseconds(self.started, self.queued)
            line["queue_ms"] = milliseconds(self.queued, self.work_started)
            line["work_ms"] = milliseconds(self.work_started, self.work_ended)
        return {**self.fields, **line}


def _flat(body: Body) -> memoryview:
    view = memoryview(body)
    # The view of an array without elements cannot be cast.
    return view.cast("B") if view.c_contiguous and view.nbytes else memoryview(view.tobytes())


def milliseconds(start: float, end: float) -> float:
    return round(1000 * (end - start), 3)
