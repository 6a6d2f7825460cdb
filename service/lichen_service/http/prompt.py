"""Answers that are known by the bytes of a request.

Nearly all small requests are repeated: a probe, a page or a client sends the same head again and again over a
connection that is kept. What identical bytes mean was decided when they first came, by every rule there is; and where
the application has said that its answer holds for everybody as long as the process lives (`Response.lasting`), the
answer is decided, too. Only its date and the id of the request are new.

Rules
- A head is looked up only if it is all that has come. One that is cut, followed by another request, or has a body,
  takes the long road.
- Heads with an id or a trace of their own do not come again, and are not kept.
"""

from __future__ import annotations

import socket
import time
from dataclasses import dataclass
from typing import Any, NamedTuple

from lichen_service.http.exchange import Exchange, milliseconds
from lichen_service.http.finish import choose_request_id, date, frame
from lichen_service.http.message import Head, Response

MOST = 256
LARGEST_HEAD = 2048
LARGEST_BODY = 64 * 1024
_OWN = frozenset(("x-request-id", "traceparent"))


@dataclass(frozen=True, slots=True)
class Prompt:
    """What leaves, around the date and the request's id, and what is logged of it."""

    start: bytes
    rest: bytes
    status: int
    method: str
    target: str
    fields: dict[str, object]

    def answer(self, request_id: str) -> bytes:
        """Head and body."""
        return b"%b%b\r\nX-Request-ID: %b\r\n%b" % (self.start, date(int(time.time())), request_id.encode(), self.rest)

    def send(self, sock: socket.socket, peer: str) -> Prompted | Exchange:
        """Answers; where the socket does not take all of it at once, the exchange that has the rest to send."""
        started, request_id = time.monotonic(), choose_request_id(None)
        answer = self.answer(request_id)
        try:
            sent = sock.send(answer)
        except BlockingIOError:
            sent = 0
        if sent == len(answer):
            return Prompted(self, request_id, peer, sent, started, time.monotonic())
        exchange = Exchange(request_id, peer, self.method, self.target, keep_alive=True)
        exchange.out, exchange.write_started = [memoryview(answer)[sent:]], started
        exchange.sent, exchange.status, exchange.fields = sent, self.status, self.fields
        return exchange


class Prompted(NamedTuple):
    """An answer that has left, for the log."""

    prompt: Prompt
    request_id: str
    peer: str
    sent: int
    started: float
    ended: float

    def record(self) -> dict[str, Any]:
        prompt = self.prompt
        return {
            **prompt.fields,
            "request_id": self.request_id,
            "peer": self.peer,
            "method": prompt.method,
            "path": prompt.target,
            "status": prompt.status,
            "bytes_in": 0,
            "bytes_out": self.sent,
            "total_ms": milliseconds(self.started, self.ended),
        }


class Prompts:
    """The answers that are known, at most `MOST`; the oldest gives way."""

    def __init__(self) -> None:
        self._known: dict[bytes, Prompt] = {}

    def get(self, received: bytearray) -> Prompt | None:
        return self._known.get(bytes(received)) if len(received) <= LARGEST_HEAD else None

    def learn(self, raw: bytes, exchange: Exchange, response: Response) -> None:
        """Remember the answer to a head, if it is one to remember."""
        head = exchange.head
        if not (response.lasting and exchange.keep_alive and isinstance(head, Head)) or head.length != 0 or head.query:
            return
        if exchange.status != response.status:
            return  # it could not leave
        if len(raw) > LARGEST_HEAD or len(response.body) > LARGEST_BODY or not _OWN.isdisjoint(head.headers):
            return
        start, rest, body = frame(response, exchange.method, keep_alive=True)
        if len(self._known) >= MOST:
            del self._known[next(iter(self._known))]
        self._known[raw] = Prompt(
            start.encode("latin-1"),
            rest.encode("latin-1") + body,
            response.status,
            exchange.method,
            exchange.target,
            dict(response.log),
        )
