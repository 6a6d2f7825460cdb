"""An answer that goes on: a connection that only sends, as long as its source has something to say.

The head has left without a length; the end of the connection is the end of the body. No thread waits: the source calls
`send` and `end` from wherever it likes, and they are carried over to the reactor's thread. A client that does not
read is cut when `MOST_UNSENT` bytes wait for it, or when none has moved for the wire's patience; one that hangs up, or
says anything more, is let go.
"""

from __future__ import annotations

import socket
import time
from collections import deque
from functools import partial
from typing import TYPE_CHECKING

from lichen_service.http.exchange import Exchange
from lichen_service.http.message import Stream
from lichen_service.http.reactor import READ, WRITE

if TYPE_CHECKING:
    from lichen_service.http.loop import Loop

MOST_UNSENT = 256 * 1024


class Streaming:
    def __init__(self, loop: Loop, sock: socket.socket, exchange: Exchange, stream: Stream) -> None:
        self._loop = loop
        self._socket = sock
        self._exchange = exchange
        self._stream = stream
        self._unsent: deque[memoryview] = deque()
        self._ending = False
        self._closed = False
        self._deadline = loop.reactor.deadline(self.close)
        self._watch()

    def open(self) -> None:
        post = self._loop.reactor.post
        self._stream.open(lambda data: post(partial(self._queue, data)), lambda: post(self._end))

    def drain(self) -> None:
        """The service ends, and so does what it has to say."""
        self._end()

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        self._loop.reactor.watch(self._socket, 0, self.ready)
        self._deadline.forget()
        self._socket.close()
        self._loop.answered(self._exchange.end())
        self._stream.close()
        self._loop.closed(self)

    def ready(self, mask: int) -> None:
        try:
            if mask & READ and not self._closed:
                self._socket.recv(4096)
                self.close()  # gone, or asking for something that is not to be had here
            elif mask & WRITE and not self._closed:
                self._flush()
        except BlockingIOError:
            pass
        except OSError:
            self.close()

    def _queue(self, data: bytes) -> None:
        if self._closed or self._ending:
            return
        self._unsent.append(memoryview(data))
        if sum(map(len, self._unsent)) > MOST_UNSENT:
            self.close()
            return
        self._try_to_flush()

    def _end(self) -> None:
        if not self._closed:
            self._ending = True
            self._try_to_flush()

    def _try_to_flush(self) -> None:
        try:
            self._flush()
        except OSError:
            self.close()

    def _flush(self) -> None:
        while self._unsent:
            try:
                count = self._socket.send(self._unsent[0])
            except BlockingIOError:
                break
            self._exchange.sent += count
            self._deadline.clear()
            self._unsent[0] = self._unsent[0][count:]
            if not self._unsent[0]:
                self._unsent.popleft()
        if self._unsent:
            self._deadline.set(min(self._deadline.at, time.monotonic() + self._loop.bounds.patience))
        elif self._ending:
            self.close()
            return
        self._watch()

    def _watch(self) -> None:
        self._loop.reactor.watch(self._socket, READ | (WRITE if self._unsent else 0), self.ready)
