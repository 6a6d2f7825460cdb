"""The short way to a service: plain HTTP/1.1 over sockets that stay open, for the blocking client.

A megabyte there and back costs a general HTTP library milliseconds of copies and bookkeeping, which is more than many
an operation takes. Here the body goes out from where it lies, the standard library reads the head of the answer, and
what follows is received into memory of the size that was announced. Addresses that need more (TLS, a proxy, a name
and a password in them) are left to httpx2; see `transport.direct`.

An open connection is used by one call at a time. One on which something has arrived unasked, its end for instance, is
not used again. Every read and write has the time that is left until the deadline of the call.
"""

from __future__ import annotations

import http.client
import io
import select
import socket
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from lichen_client.retry import Reply

if TYPE_CHECKING:
    from lichen_client.calls import Bytes

LARGEST = 1 << 28
"""Bytes of an answer for which room is made before they are there."""
PIECE = 1 << 16
"""Bytes to ask for at a time where nobody said how many there will be."""


class Lanes:
    """Connections to one address, `count` at most; more calls than that wait for one another."""

    def __init__(self, url: str, count: int, patience: float) -> None:
        """`patience` is how many seconds a connection may take to be made."""
        split = urlsplit(url)
        assert split.hostname is not None, "an address has a host"
        self._place, self._host, self._before = (split.hostname, split.port or 80), split.netloc, split.path
        self._patience = patience
        self._free = threading.BoundedSemaphore(count)
        self._idle: list[socket.socket] = []
        self._lock = threading.Lock()
        self._closed = False

    def exchange(
        self, method: str, target: str, headers: Mapping[str, str], pieces: Sequence[Bytes] | None, deadline: float
    ) -> Reply:
        """One request and its whole answer. Raises TimeoutError, OSError or HTTPException."""
        fields = {"Host": self._host, **headers}
        if pieces is not None:
            fields["Content-Length"] = str(sum(map(len, pieces)))
        head = _head(f"{method} {self._before}{target} HTTP/1.1", fields)
        if not self._free.acquire(timeout=max(0.0, deadline - time.monotonic())):
            raise TimeoutError
        try:
            lane = self._taken(deadline)
            try:
                reply, open = _exchange(lane, method, (head, *(pieces or ())), deadline)
            except BaseException:
                lane.close()
                raise
            self._put_back(lane, open)
            return reply
        finally:
            self._free.release()

    def close(self) -> None:
        with self._lock:
            self._closed = True
            idle, self._idle = self._idle, []
        for each in idle:
            each.close()

    def _taken(self, deadline: float) -> socket.socket:
        while True:
            with self._lock:
                if self._closed:
                    raise RuntimeError("the client is closed")
                lane = self._idle.pop() if self._idle else None
            if lane is None:
                lane = socket.create_connection(self._place, min(self._patience, _left(deadline)))
                lane.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                return lane
            if not _spoken(lane):
                return lane
            lane.close()

    def _put_back(self, lane: socket.socket, open: bool) -> None:
        with self._lock:
            if open and not self._closed:
                self._idle.append(lane)
                return
        lane.close()


def _head(line: str, fields: Mapping[str, str]) -> bytes:
    """The head of a request. Raises ValueError for what would be more than one line."""
    lines = [line, *(f"{name}: {value}" for name, value in fields.items())]
    if any("\r" in each or "\n" in each or "\0" in each for each in lines):
        raise ValueError("a header field is one line")
    return "\r\n".join([*lines, "\r\n"]).encode("latin-1")


def _exchange(lane: socket.socket, method: str, pieces: Sequence[Bytes], deadline: float) -> tuple[Reply, bool]:
    """The answer, and whether the connection can be used again."""
    try:
        for each in pieces:
            lane.settimeout(_left(deadline))
            lane.sendall(each)
    except (BrokenPipeError, ConnectionResetError):
        with suppress(OSError, http.client.HTTPException):  # a refusal may have come before all was sent
            return _answer(lane, method, deadline)[0], False
        raise
    return _answer(lane, method, deadline)


def _answer(lane: socket.socket, method: str, deadline: float) -> tuple[Reply, bool]:
    source = _Source(lane, deadline)
    with io.BufferedReader(source) as reader:
        response = _begun(reader, method)
        while 100 <= response.status < 200:  # a hint of what will come
            response.fp = None  # type: ignore[assignment]  # else it closes the reader
            response = _begun(reader, method)
        if source.ended:
            raise http.client.RemoteDisconnected("the answer ended in its head")
        if response.length is None:  # in chunks, or up to the end of the connection
            body = bytearray().join(iter(partial(response.read1, PIECE), b""))
        else:
            body = bytearray(min(response.length, LARGEST))
            _receive(reader, body, response.length)
        return Reply(response.status, _fields(response), body), not response.will_close


def _begun(reader: io.BufferedReader[Any], method: str) -> http.client.HTTPResponse:
    """An answer whose head was read."""
    response = http.client.HTTPResponse(_Made(reader), method=method)  # type: ignore[arg-type]
    response.begin()
    return response


def _receive(reader: io.BufferedReader[Any], body: bytearray, length: int) -> None:
    """Fills `body` with the bytes that were announced."""
    at = 0
    while at < length:
        if at == len(body):
            body += bytes(min(length - at, LARGEST))  # all that there was room for has come
        with memoryview(body) as view, view[at:] as rest:
            received = reader.readinto1(rest)
        if not received:
            raise http.client.IncompleteRead(b"", length - at)
        at += received


class _Source(io.RawIOBase):
    """What comes in on a socket until a deadline; each read has what is left of the time."""

    def __init__(self, lane: socket.socket, deadline: float) -> None:
        self._lane, self._deadline = lane, deadline
        self.ended = False

    def readable(self) -> bool:
        return True

    def readinto(self, into: Any) -> int:
        self._lane.settimeout(_left(self._deadline))
        received = self._lane.recv_into(into)
        self.ended = received == 0
        return received


class _Made:
    """What the standard library takes for a socket: it asks for nothing but the file to read."""

    def __init__(self, reader: io.BufferedReader[Any]) -> None:
        self._reader = reader

    def makefile(self, mode: str) -> io.BufferedReader[Any]:
        return self._reader


def _fields(response: http.client.HTTPResponse) -> dict[str, str]:
    """The header fields; those that come several times as one (RFC 9110, section 5.3)."""
    fields: dict[str, str] = {}
    for name, value in response.getheaders():
        name = name.lower()
        fields[name] = f"{fields[name]}, {value}" if name in fields else value
    return fields


def _spoken(lane: socket.socket) -> bool:
    """Whether there is something to read, which on a connection that waits for a request is its end."""
    poll = select.poll()
    poll.register(lane, select.POLLIN)
    return bool(poll.poll(0))


def _left(deadline: float) -> float:
    left = deadline - time.monotonic()
    if left <= 0:
        raise TimeoutError
    return left
