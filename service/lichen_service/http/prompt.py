"""Answers that are known by the bytes of a request.

Nearly all small requests are repeated: a probe, a page or a client sends the same head again and again over a
connection that is kept. What identical bytes mean was decided when they first came, by every rule there is; and where
the application has said that its answer holds for everybody as long as the process lives (`Response.lasting`), the
answer is decided, too. Only its date and the id of the request are new. An id that the client has chosen is cut out of
the head before it is looked up: whatever it is, it is only echoed.

While all places are taken, most of what comes is refused like what came just before: the same head, its query apart,
in want of a thread. Such a request is not read again either, so that refusing takes little from
those who compute. Whatever its query says, nothing can be begun for it now.

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
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

from lichen_service.http.access_log import shown_query
from lichen_service.http.exchange import Exchange, milliseconds
from lichen_service.http.finish import choose_request_id, date, frame
from lichen_service.http.message import Head, Response

MOST = 256
LARGEST_HEAD = 2048
LARGEST_BODY = 64 * 1024
_QUERIED = re.compile(rb"(?:GET|HEAD) /[\x21-\x22\x24-\x3e\x40-\x7e]*\?[\x21-\x22\x24-\x7e]* HTTP/1\.1\r\n")
_QUERY = re.compile(rb"[\x21-\x22\x24-\x7e]*")
_ID = re.compile(rb"\r\nX-Request-ID:[ \t]*([A-Za-z0-9._-]{1,128})[ \t]*(?=\r\n)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Prompt:
    """What leaves, but for the request's id, and what is logged of it."""

    whole: Callable[[bytes], bytes]
    """head and body around an id"""
    status: int
    method: str
    path: str
    fields: dict[str, object]
    line: dict[str, Any]
    """of the log, but for what is an answer's own"""

    def send(self, sock: socket.socket, peer: str, offered: str | None, query: str = "") -> Prompted | Exchange:
        """Answers, with the id that the client has offered; where the socket does not take all of it at once, the
        exchange that has the rest to send. `query` with its question mark."""
        started, request_id = time.monotonic(), choose_request_id(offered)
        answer = self.whole(request_id.encode())
        try:
            sent = sock.send(answer)
        except BlockingIOError:
            sent = 0
        if sent == len(answer):
            return Prompted(self, request_id, peer, query, sent, started, time.monotonic())
        exchange = Exchange(request_id, peer, self.method, self.path + query, keep_alive=True)
        exchange.out, exchange.write_started = [memoryview(answer)[sent:]], started
        exchange.sent, exchange.status, exchange.fields = sent, self.status, self.fields
        return exchange


class Prompted(NamedTuple):
    """An answer that has left, for the log."""

    prompt: Prompt
    request_id: str
    peer: str
    query: str
    sent: int
    started: float
    ended: float

    def record(self) -> dict[str, Any]:
        line = {
            **self.prompt.line,
            "request_id": self.request_id,
            "peer": self.peer,
            "bytes_out": self.sent,
            "total_ms": milliseconds(self.started, self.ended),
        }
        if self.query:
            line["query"] = shown_query(self.query[1:])
        return line


class Known(NamedTuple):
    """The answer to a head, the id that its client has chosen, and its query."""

    prompt: Prompt
    offered: str | None
    query: str = ""


class Prompts:
    """The answers that are known, at most `MOST`; the oldest gives way."""

    def __init__(self) -> None:
        self._known: dict[bytes, Prompt] = {}
        self._refused: dict[tuple[bytes, bytes], Prompt] = {}
        """by what stands before and behind the query"""

    def get(self, received: bytearray, full: bool = False) -> Known | None:
        """The answer to a head; that there is no place for it, where all are taken and one like it has been refused."""
        if not (self._known or self._refused) or len(received) > LARGEST_HEAD:
            return None
        raw = bytes(received)
        if (known := self._known.get(raw)) is not None:
            return Known(known, None)
        if full and (refused := self._refusal(raw)) is not None:
            return refused
        raw, offered = _without_id(raw)
        known = self._known.get(raw) if offered is not None else None
        return None if known is None else Known(known, offered)

    def _refusal(self, raw: bytes) -> Known | None:
        offered = None
        before, _, rest = raw.partition(b"?")
        query, _, after = rest.partition(b" ")
        if (known := self._refused.get((before, after))) is None:
            after, offered = _without_id(after)
            known = self._refused.get((before, after)) if offered is not None else None
        if known is None or not _QUERY.fullmatch(query):
            return None
        return Known(known, offered, f"?{query.decode()}")

    def learn(self, raw: bytes, exchange: Exchange, response: Response) -> None:
        """Remember the answer to a head, if it is one to remember."""
        if not (response.lasting and exchange.status == response.status):
            return  # it holds for this request alone, or could not leave
        raw, repeats = _repeats(raw, exchange)
        if not repeats or "?" in exchange.target or len(response.body) > LARGEST_BODY:
            return
        start, rest, body = frame(response, exchange.method, keep_alive=True)
        before, after = start.encode("latin-1"), rest.encode("latin-1") + body

        def whole(request_id: bytes) -> bytes:
            return b"%b%b\r\nX-Request-ID: %b\r\n%b" % (before, date(int(time.time())), request_id, after)

        _keep(self._known, raw, _prompt(whole, exchange, response))

    def learn_refusal(self, raw: bytes, exchange: Exchange, refusal: Callable[[str], Response]) -> None:
        """Remember that a head was refused for want of a place, by the refusal of an id."""
        raw, repeats = _repeats(raw, exchange)
        if not repeats or not _QUERIED.match(raw):
            return
        method = exchange.method

        @lru_cache(maxsize=8)
        def around(second: int, length: int) -> list[bytes]:
            """What stands around each place of an id; the length of the answer depends on that of the id."""
            place = "\0" * length
            made = refusal(place)
            start, rest, body = frame(made, method, keep_alive=True)
            head = f"{start}{date(second).decode()}\r\nX-Request-ID: {place}\r\n{rest}".encode("latin-1")
            return (head + bytes(body)).split(place.encode())

        def whole(request_id: bytes) -> bytes:
            return request_id.join(around(int(time.time()), len(request_id)))

        before, _, rest = raw.partition(b"?")
        _keep(self._refused, (before, rest.partition(b" ")[2]), _prompt(whole, exchange, refusal(exchange.request_id)))


def _prompt(whole: Callable[[bytes], bytes], exchange: Exchange, response: Response) -> Prompt:
    status, method, path = response.status, exchange.method, exchange.target.partition("?")[0]
    line = {**response.log, "method": method, "path": path, "status": status, "bytes_in": 0}
    return Prompt(whole, status, method, path, dict(response.log), line)


Key = TypeVar("Key")


def _keep(known: dict[Key, Prompt], key: Key, prompt: Prompt) -> None:
    """The oldest gives way."""
    if len(known) >= MOST:
        del known[next(iter(known))]
    known[key] = prompt


def _repeats(raw: bytes, exchange: Exchange) -> tuple[bytes, bool]:
    """A head without its id, and whether it may come again and be answered alike."""
    head = exchange.head
    if not (exchange.keep_alive and isinstance(head, Head)) or head.length != 0:
        return raw, False
    if len(raw) > LARGEST_HEAD or "traceparent" in head.headers:
        return raw, False
    raw, offered = _without_id(raw)
    return raw, offered == head.headers.get("x-request-id")


def _without_id(raw: bytes) -> tuple[bytes, str | None]:
    """A head without the id that its client has chosen, and that id."""
    found = _ID.search(raw)
    return (raw, None) if found is None else (raw[: found.start()] + raw[found.end() :], found[1].decode())
