"""Answers that are known by the bytes of a request.

Nearly all small requests are repeated: a probe, a page or a client sends the same head again and again over a
connection that is kept. What identical bytes mean was decided when they first came, by every rule there is; and where
the application has said that its answer holds for everybody as long as the process lives (`Response.lasting`), the
answer is decided, too. Only its date and the id of the request are new. An id that the client has chosen is cut out of
the head before it is looked up: whatever it is, it is only echoed.

Rules
- A head is looked up only if it is all that has come. One that is cut, followed by another request, or has a body,
  takes the long road.
- An id that would not be echoed as it is stays in the head, and so does a second one, which would be refused.
- Heads with a trace of their own do not come again, and are not kept.
"""

from __future__ import annotations

import re
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
_ID = re.compile(rb"\r\nX-Request-ID:[ \t]*([A-Za-z0-9._-]{1,128})[ \t]*(?=\r\n)", re.IGNORECASE)


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

    def send(self, sock: socket.socket, peer: str, offered: str | None) -> Prompted | Exchange:
        """Answers, with the id that the client has offered; where the socket does not take all of it at once, the
        exchange that has the rest to send."""
        started, request_id = time.monotonic(), choose_request_id(offered)
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

    def get(self, received: bytearray) -> tuple[Prompt, str | None] | None:
        """The answer to a head, and the id that its client has chosen."""
        if len(received) > LARGEST_HEAD or not self._known:
            return None
        key, offered = _without_id(bytes(received))
        known = self._known.get(key)
        return None if known is None else (known, offered)

    def learn(self, raw: bytes, exchange: Exchange, response: Response) -> None:
        """Remember the answer to a head, if it is one to remember."""
        head = exchange.head
        if not (response.lasting and exchange.keep_alive and isinstance(head, Head)) or head.length != 0 or head.query:
            return
        if exchange.status != response.status:
            return  # it could not leave
        if len(raw) > LARGEST_HEAD or len(response.body) > LARGEST_BODY or "traceparent" in head.headers:
            return
        raw, offered = _without_id(raw)
        if offered != head.headers.get("x-request-id"):
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


def _without_id(raw: bytes) -> tuple[bytes, str | None]:
    """A head without the id that its client has chosen, and that id."""
    found = _ID.search(raw)
    return (raw, None) if found is None else (raw[: found.start()] + raw[found.end() :], found[1].decode())
