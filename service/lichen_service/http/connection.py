r"""One client connection as a state machine on the reactor's thread.

    IDLE -> HEAD -> BODY -> WORK -> WRITE -> IDLE ...                 a request and its answer, again and again
                 \-> WRITE -> DISCARD -> IDLE                         refused before its body was read, body small
                 \-> WRITE -> LINGER -> closed                        answered for the last time

Theory. A thread is the scarce thing, a connection is not: so all waiting for the peer happens here, without a thread,
and a pool thread is taken only from the moment a whole request lies in memory until the socket has no room for more
of the answer. Every phase that waits for the peer has an absolute deadline. Bodies, either way, may lag `patience`
seconds behind their slowest rate, and stand still no longer; so a trickling peer is cut after little more than that,
whatever length it claimed.

Rules
- The pool thread touches the socket only in WORK; the loop then reads ahead a little but does not close it, since a
  closed descriptor's number may already belong to another client.
- Bytes read beyond a request stay in `buffer` and are the beginning of the next one.
- A client that closes its side while its request is computed has hung up: the work is told, and ends before its next
  step. Only one that has sent more, or said that this request is its last, may close its side and still be answered.
- A connection whose framing is in doubt is never used again. It is closed for writing first and read on for a moment:
  an immediate close would reset it and could destroy the answer on its way.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from lichen_service.http.chunked import ChunkedBody
from lichen_service.http.exchange import Exchange, FixedBody
from lichen_service.http.finish import choose_request_id
from lichen_service.http.message import CLIENT_GONE, Admission, Head, Request, Response
from lichen_service.http.phase import Phase
from lichen_service.http.policy import METHODS, Heads, RawHead, Refusal
from lichen_service.http.prompt import Known, Prompted
from lichen_service.http.reactor import READ, WRITE
from lichen_service.http.streaming import Streaming

if TYPE_CHECKING:
    from lichen_service.http.loop import Loop

_STEPS_AT_ONCE = 32
_CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"


class Connection:
    def __init__(self, loop: Loop, sock: socket.socket, peer: str) -> None:
        self.phase = Phase.IDLE
        self._loop = loop
        self._socket = sock
        self._peer = peer
        self._buffer = bytearray()
        self._heads = Heads()
        self._exchange = Exchange("")
        self._served = 0
        self._watched = 0
        self._ended = False
        """the peer will send no more"""
        self._gone = False
        """the peer cannot be reached any more"""
        self._deadline = loop.reactor.deadline(partial(self._guard, self._expire))
        self._deadline.set(time.monotonic() + loop.settings.idle_timeout)
        self._watch()

    # Events

    def ready(self, mask: int) -> None:
        self._guard(self._ready, mask)

    def drain(self) -> None:
        """The service ends: take a request that has already come, close if there is none."""
        if self.phase is Phase.IDLE:
            self.ready(READ)

    def close(self) -> None:
        if self.phase is Phase.CLOSED:
            return
        self._let_go()
        self._release_body()
        self._buffer = bytearray()
        self._exchange.out.clear()
        self._socket.close()
        self._loop.closed(self)

    def _let_go(self) -> None:
        self.phase = Phase.CLOSED
        self._loop.reactor.watch(self._socket, 0, self.ready)
        self._deadline.forget()

    def _guard(self, call: Callable[..., None], *given: int) -> None:
        """Nothing that happens to one connection may reach another."""
        try:
            call(*given)
        except OSError:
            self._lost()
        except Exception:
            self._loop.log.failed("connection", request_id=self._exchange.request_id)
            self._lost()

    def _ready(self, mask: int) -> None:
        if self.phase is Phase.CLOSED:
            return
        if mask & WRITE and self.phase is Phase.WRITE:
            self._exchange.send(self._socket)
            self._begin_writing()
        elif mask & READ:
            self._read()
            if self.phase is Phase.IDLE and (known := self._loop.known(self._buffer)) and self._knows(known):
                return
        self._advance()

    def _lost(self) -> None:
        self._gone = True
        if self.phase is Phase.WORK:
            self._watch()
            return
        if self.phase in (Phase.BODY, Phase.WRITE):
            self._exchange.status = CLIENT_GONE
            self._loop.answered(self._exchange.end())
        self.close()

    def _expire(self) -> None:
        late = Refusal(408, "request-timeout", "the request did not arrive in time")
        if self.phase is Phase.BODY:
            self._refuse(late)
        elif self.phase is Phase.HEAD and self._buffer.strip(b"\r\n"):
            self._refuse_unread(late)
        else:
            self._lost()
        self._advance()

    def _knows(self, known: Known) -> bool:
        """Answer at once what is known by its bytes; false where the connection would end with it."""
        if self._served + 1 >= self._loop.bounds.requests_per_connection or self._ended or self._loop.draining:
            return False
        self._served += 1
        self._buffer.clear()
        answered = known.prompt.send(self._socket, self._peer, known.offered, known.query)
        if isinstance(answered, Prompted):
            self._loop.answered(answered)
            self._next()
        else:
            self._exchange = answered
            self._begin_writing()
            self._watch()
        return True

    # Receiving

    def _read(self) -> None:
        try:
            body = self._exchange.body
            if self.phase is Phase.BODY and isinstance(body, FixedBody) and not self._buffer:
                count = body.receive(self._socket, self._loop.bounds.body_read_size)
                self._count_body(count)
            else:
                count = self._socket.recv_into(self._loop.scratch)
                self._buffer += self._loop.scratch[:count]
        except BlockingIOError:
            return
        self._ended = count == 0

    def _advance(self) -> None:
        """Go on as far as the bytes at hand allow, but let others have their turn between many small requests."""
        for _ in range(_STEPS_AT_ONCE):
            if (step := _STEPS[self.phase]) is None or not step(self):
                break
        else:
            self._loop.reactor.post(partial(self._guard, self._advance))
        self._watch()

    def _watch(self) -> None:
        if self.phase is Phase.CLOSED:
            return
        ahead = self.phase is Phase.WORK and len(self._buffer) >= self._loop.bounds.read_size
        reading = 0 if self._ended or self._gone or ahead else READ
        events = WRITE if self.phase is Phase.WRITE else reading
        if events != self._watched:
            self._watched = events
            self._loop.reactor.watch(self._socket, events, self.ready)

    def _take_head(self) -> bool:
        if not self._buffer:
            if self._ended or self._loop.draining:
                self.close()
            return False
        taken = self._heads.take(self._buffer)
        if taken is None:
            if self._ended:
                self.close()
            elif self.phase is Phase.IDLE:
                self.phase = Phase.HEAD
                self._deadline.set(time.monotonic() + self._loop.settings.header_timeout)
            return False
        if isinstance(taken, Refusal):
            self._refuse_unread(taken)
        else:
            self._begin(*taken)
        return True

    def _take_body(self) -> bool:
        body = self._exchange.body
        assert body is not None
        if self._buffer and not body.done:
            taken = body.feed(self._buffer)
            if isinstance(taken, Refusal):
                self._refuse(taken)
                return True
            del self._buffer[:taken]
            self._count_body(taken)
        if body.done:
            self._submit()
            return True
        if self._ended:
            self._refuse(Refusal(400, "incomplete-body", "the connection ended before the body was complete"))
            return True
        if self._loop.held > self._loop.memory:
            self._exchange.keep_alive = False
            self._respond(self._loop.busy(self._exchange.request_id, "The memory for request bodies is used up."))
            return True
        return False

    def _count_body(self, count: int) -> None:
        exchange = self._exchange
        exchange.received += count
        exchange.held += count
        self._loop.held += count
        self._deadline.set(self._loop.slowest(exchange.body_started, exchange.received))

    def _take_discarded(self) -> bool:
        dropped = min(self._exchange.discard, len(self._buffer))
        del self._buffer[:dropped]
        self._exchange.discard -= dropped
        if not self._exchange.discard:
            self._next()
            return True
        if self._ended:
            self.close()
        return False

    def _take_lingering(self) -> bool:
        self._buffer.clear()
        if self._ended:
            self.close()
        return False

    # Deciding

    def _begin(self, opening: RawHead, raw: bytes) -> None:
        """The head is sound: decide, before reading the body, whether to."""
        self._served += 1
        exchange = self._exchange = self._loop.opened(opening, self._peer)
        exchange.keep_alive &= self._served < self._loop.bounds.requests_per_connection
        exchange.waits_for_continue &= not self._buffer
        head = exchange.head
        assert head is not None
        if isinstance(head, Refusal):
            self._refuse(head)
        elif opening.target == "*":
            self._decline(Response(204, headers={"Allow": ", ".join(METHODS)}))
        else:
            admission = self._loop.admit(head)
            if isinstance(admission, Response):
                self._decline(admission)
                self._loop.learn(raw, exchange, admission)
            else:
                self._admit(head, admission)

    def _admit(self, head: Head, admission: Admission) -> None:
        exchange, length = self._exchange, head.length
        largest = min(admission.largest_body, self._loop.settings.max_body)
        exchange.caller, exchange.body_started = admission.caller, time.monotonic()
        exchange.body = ChunkedBody(largest) if length is None else FixedBody(length, self._loop.lend)
        self.phase = Phase.BODY
        self._deadline.set(self._loop.slowest(exchange.body_started, 0))
        if exchange.waits_for_continue and self._socket.send(_CONTINUE) != len(_CONTINUE):
            raise ConnectionError("the peer takes no bytes")

    def _submit(self) -> None:
        """The whole request is here: queue it for the pool."""
        exchange = self._exchange
        assert isinstance(exchange.head, Head)
        assert exchange.body is not None
        exchange.queued = time.monotonic()
        alive = partial(self._waits, exchange.keep_alive)
        head = exchange.head._replace(deadline=exchange.queued + exchange.head.allowed, alive=alive)
        request = Request(head, exchange.body.body, exchange.caller)
        if not self._loop.submit(partial(self._work, request)):
            self._respond(self._loop.busy(head.request_id))
            return
        exchange.body = None  # the request alone holds it now
        self.phase = Phase.WORK
        self._deadline.clear()

    def _decline(self, response: Response) -> None:
        """Answer without reading the body; keep the connection where dropping the body is cheap and unambiguous."""
        exchange = self._exchange
        length = exchange.discardable
        if length is None or length - len(self._buffer) > self._loop.bounds.drain:
            exchange.keep_alive = False
        else:
            exchange.discard = length
        self._respond(response)

    def _refuse_unread(self, refusal: Refusal) -> None:
        """Refuse a request of which no more is known than that it is broken."""
        self._exchange = Exchange(choose_request_id(None), self._peer)
        self._refuse(refusal)

    def _refuse(self, refusal: Refusal) -> None:
        """Answer that the request is broken; the connection ends with it."""
        self._exchange.keep_alive = False
        self._respond(self._loop.refusal(refusal, self._exchange.request_id))

    # Answering

    def _work(self, request: Request) -> None:
        """On a pool thread: compute the answer and send what the socket takes at once."""
        exchange = self._exchange
        exchange.work_started = exchange.work_ended = time.monotonic()
        try:
            response = self._loop.handle(request) if request.head.alive() else None
            exchange.work_ended = time.monotonic()
            self._loop.worked()
            if response is not None and request.head.alive():
                self._loop.encode(self._exchange, response)
                exchange.send(self._socket)
        except OSError:
            self._gone = True
        finally:
            self._loop.reactor.post(partial(self._guard, self._answered))

    def _waits(self, keep_alive: bool) -> bool:
        """Whether the client still waits for the request being computed; from any thread."""
        return not self._gone and not (self._ended and keep_alive and not self._buffer)

    def _answered(self) -> None:
        self._release_body()
        if self._gone or not self._exchange.status:
            self.phase = Phase.WRITE
            self._lost()
            return
        self._begin_writing()
        self._advance()

    def _respond(self, response: Response) -> None:
        self._release_body()
        self._loop.encode(self._exchange, response)
        self._exchange.send(self._socket)
        self._begin_writing()

    def _begin_writing(self) -> None:
        self.phase = Phase.WRITE
        if self._exchange.out:
            self._deadline.set(self._loop.slowest(self._exchange.write_started, self._exchange.sent))
        else:
            self._finish()

    def _finish(self) -> None:
        """The answer has left."""
        if (stream := self._exchange.stream) is not None and not self._ended:
            self._let_go()
            self._loop.go_on(self, Streaming(self._loop, self._socket, self._exchange, stream))
            return
        self._loop.answered(self._exchange.end())
        if not self._exchange.keep_alive:
            self._linger()
        elif self._exchange.discard:
            self.phase = Phase.DISCARD
            self._deadline.set(self._loop.slowest(time.monotonic(), self._exchange.discard))
        else:
            self._next()

    def _next(self) -> None:
        self.phase = Phase.IDLE
        self._deadline.set(time.monotonic() + self._loop.settings.idle_timeout)

    def _linger(self) -> None:
        if self._ended:
            self.close()
            return
        self.phase = Phase.LINGER
        self._deadline.set(time.monotonic() + self._loop.bounds.linger)
        self._socket.shutdown(socket.SHUT_WR)

    def _release_body(self) -> None:
        self._exchange.body = None
        self._loop.held -= self._exchange.held
        self._exchange.held = 0


_STEPS: dict[Phase, Callable[[Connection], bool] | None] = dict.fromkeys(Phase) | {
    Phase.IDLE: Connection._take_head,
    Phase.HEAD: Connection._take_head,
    Phase.BODY: Connection._take_body,
    Phase.DISCARD: Connection._take_discarded,
    Phase.LINGER: Connection._take_lingering,
}
