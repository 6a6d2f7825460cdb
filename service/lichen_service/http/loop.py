"""A worker's front: accepts connections, holds what they share, and stands between them and the application.

All sockets are served by the thread in `run`; `threads` pool threads compute. What is in flight is counted here: beyond
`threads + queue` requests the answer is 503 at once, before a body is read. A request gives its place up before its
answer leaves, so a client that has the answer finds the place free.
"""

from __future__ import annotations

import contextlib
import errno
import math
import socket
import threading
import time
from collections.abc import Callable
from functools import lru_cache, partial
from http import HTTPStatus

from lichen_service.http.access_log import AccessLog
from lichen_service.http.connection import Connection
from lichen_service.http.crowd import Crowd
from lichen_service.http.exchange import Exchange
from lichen_service.http.limits import Bounds, WireSettings
from lichen_service.http.message import Admission, Application, Head, Lend, Request, Response
from lichen_service.http.policy import RawHead, Refusal
from lichen_service.http.pool import Pool
from lichen_service.http.prompt import Known, Prompted, Prompts
from lichen_service.http.reactor import READ, Reactor
from lichen_service.http.streaming import Streaming
from lichen_service.problems import problem

_OUT_OF_MEANS = frozenset((errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM))
LOGGED_WITHIN = 0.02
"""seconds after an answer has left"""
LOGGED_WHILE_FULL = 0.1
"""the same while all places are taken: more lines at once cost less"""
REST = 0.016
"""seconds between looks at connections while nearly all places are taken: refusals made together take the processor,
and the interpreter, from those who compute less often"""
LOOKED_FOR = 1 / 4
"""of the places in the queue, which must be free before connections are looked at sooner: who computes has enough to do
until then"""
_ACCEPTS_AT_ONCE = 8
"""few, so that workers that share a listener share its connections"""
COURTESY = 0.002
"""seconds that a worker which holds more connections than another leaves new ones to that one"""
_ACCEPTS_AFTER_A_REST = 64


@lru_cache(maxsize=8)
def _busy(detail: str, retry_after: int) -> tuple[list[bytes], dict[str, str]]:
    """The body of that refusal around the id of its request, and its headers."""
    place = "REQUEST-ID"
    made = problem(
        503,
        "overloaded",
        "The service is busy",
        detail,
        request_id=place,
        retryable=True,
        headers={"Retry-After": str(retry_after)},
    )
    return bytes(made.body).split(place.encode()), made.headers


def _fresh(length: int) -> memoryview:
    return memoryview(bytearray(length))


class Loop:
    """Serves `application` on a listening socket, which it closes in the end.

    `in_flight` requests are queued or computed now, `answers` have left or never will; `held` and `memory` are bytes of
    request bodies, now and at most.
    """

    def __init__(
        self,
        listener: socket.socket,
        application: Application,
        settings: WireSettings,
        *,
        bounds: Bounds | None = None,
        log: AccessLog | None = None,
        apart: bool = False,
        crowd: Crowd | None = None,
    ) -> None:
        """`apart`: whether it is the address of figures that is listened at; `crowd`: of the workers at the address."""
        self.settings = settings
        self.bounds = bounds or Bounds()
        self.log = log or AccessLog(tell=getattr(application, "answered", None))
        self.reactor = Reactor()
        self.reactor.after_round = self._log_failures
        self.reactor.rest = self._rest
        self._logging = self.reactor.deadline(self.log.flush)
        self._prompts = Prompts()
        self.scratch = memoryview(bytearray(self.bounds.read_size))
        self.draining = False
        self.apart = apart
        self.held = 0
        self.memory = self.bounds.bodies_in_flight * settings.max_body
        self.lend: Lend = getattr(application, "lend", _fresh)
        self._application = application
        self._pool = Pool(settings.threads)
        self.in_flight = 0
        self.answers = 0
        self._counting = threading.Lock()
        self._connections: set[Connection | Streaming] = set()
        self._listener = listener
        self._listener.setblocking(False)
        self._listening = self.reactor.deadline(self._listen)
        self._crowd = crowd
        self._left_over = self.reactor.deadline(self._accept_left_over)
        self._grace = self.reactor.deadline(self.reactor.stop)

    def run(self) -> bool:
        """Serve until `stop`; true when every request in flight was answered within the grace."""
        self._tell_crowd()
        self._listen()
        self.reactor.run()
        drained = not self._connections
        for connection in list(self._connections):
            connection.close()
        self._listener.close()
        self._pool.stop(timeout=1.0 if drained else 0.0)
        self.reactor.close()
        self.log.flush()
        return drained

    def stop(self) -> None:
        """Accept no more, answer what has come, then end; from any thread or signal handler."""
        self.reactor.post(self._drain)

    @property
    def connections(self) -> int:
        return len(self._connections)

    # What connections ask for

    def slowest(self, start: float, count: int) -> float:
        """Until when a peer may stand still that has moved `count` bytes since `start`.

        A head start buys no longer silence: the system's own buffers take megabytes at once for a peer that then stops.
        """
        return self.bounds.patience + min(start + count / self.settings.body_rate, time.monotonic())

    def answered(self, exchange: Exchange | Prompted) -> None:
        """An answer has left, or never will: its line is written soon, with those of others."""
        self.answers += 1
        self.log.answered(exchange)
        if self._logging.at == math.inf:
            self._logging.set(exchange.ended + (LOGGED_WHILE_FULL if self._full else LOGGED_WITHIN))

    def known(self, received: bytearray) -> Known | None:
        """The answer to a head that need not be read again."""
        return self._prompts.get(received, self._full)

    def learn(self, raw: bytes, exchange: Exchange, response: Response) -> None:
        """What was answered to a head, for when it comes again."""
        if self._full and response.status == 503:
            self._prompts.learn_refusal(raw, exchange, self.busy)
        else:
            self._prompts.learn(raw, exchange, response)

    def encode(self, exchange: Exchange, response: Response) -> None:
        """Lay out an answer, or that of a failure where it cannot leave as it is. From any thread."""
        exchange.keep_alive &= not self.draining
        try:
            exchange.answer(response)
        except Exception:  # not only BadResponse: a route may have put anything into the fields
            self.log.failed("response", request_id=exchange.request_id)
            exchange.answer(self.failure(exchange.request_id))

    def go_on(self, connection: Connection, streaming: Streaming) -> None:
        """An answer that goes on takes the place of the connection whose head it began with."""
        self._connections.discard(connection)
        self._connections.add(streaming)
        streaming.open()
        if self.draining:
            streaming.drain()

    def closed(self, connection: Connection | Streaming) -> None:
        self._connections.discard(connection)
        self._tell_crowd()
        if self.draining and not self._connections:
            self.reactor.stop()
        elif len(self._connections) == self.bounds.connections - 1:
            self._listen()

    def opened(self, opening: RawHead, peer: str) -> Exchange:
        """The exchange that a sound head begins."""
        return Exchange.opened(opening, peer, self.settings.request_timeout, self.apart)

    def admit(self, head: Head) -> Admission | Response:
        """The application's word, and the wire's own: room in the queue, room in memory, declared length."""
        try:
            admission = self._application.admit(head)
        except Exception:
            self.log.failed("admit", request_id=head.request_id)
            return self.failure(head.request_id)
        if isinstance(admission, Response):
            return admission
        if self._full:
            return self.busy(head.request_id)
        length = head.length or 0
        largest = min(admission.largest_body, self.settings.max_body)
        if length > largest:
            return problem(
                413,
                "too-large",
                "The request body is too large",
                f"The body may have {largest} bytes.",
                request_id=head.request_id,
                limit=largest,
                actual=length,
            )
        if self.held + length > self.memory:
            return self.busy(head.request_id, "The memory for request bodies is used up.")
        return admission

    def handle(self, request: Request) -> Response:
        """On a pool thread; lets no exception escape."""
        if time.monotonic() > request.head.deadline:
            return self.busy(request.head.request_id, "The request waited too long for its turn.")
        try:
            return self._application.handle(request)
        except Exception:
            self.log.failed("handle", request_id=request.head.request_id)
            return self.failure(request.head.request_id)

    def submit(self, job: Callable[[], None]) -> bool:
        """Queue a job for the pool, which must call `worked` once; false when there is no room."""
        with self._counting:
            if self._full:
                return False
            self.in_flight += 1
        # After this round: a thread that wakes while the loop has work to do only takes the interpreter from it.
        self.reactor.post(partial(self._pool.submit, job))
        return True

    def worked(self) -> None:
        """A job has computed its answer; from any thread."""
        with self._counting:
            self.in_flight -= 1

    def busy(self, request_id: str, detail: str = "All places in the queue are taken.") -> Response:
        """Made of parts that are kept: who has too much to do must not spend time on saying so."""
        pieces, headers = _busy(detail, self.bounds.retry_after)
        return Response(503, request_id.encode().join(pieces), dict(headers), {"problem": "overloaded"})

    def refusal(self, refusal: Refusal, request_id: str) -> Response:
        return problem(
            refusal.status,
            refusal.code,
            HTTPStatus(refusal.status).phrase,
            refusal.detail,
            request_id=request_id,
            retryable=refusal.status == HTTPStatus.REQUEST_TIMEOUT,
            limit=refusal.limit,
        )

    def failure(self, request_id: str) -> Response:
        """The 500 of a defect; what went wrong is in the log and nowhere else."""
        detail = "The request could not be answered; the fault is ours."
        return problem(500, "internal-error", "The service failed", detail, request_id=request_id)

    def _rest(self) -> float:
        places = self.settings.threads + self.settings.queue
        return REST if self.in_flight >= places - LOOKED_FOR * self.settings.queue else 0.0

    def _log_failures(self) -> None:
        if self.log.failures:
            self.log.flush()

    # Accepting

    @property
    def _full(self) -> bool:
        return self.in_flight >= self.settings.threads + self.settings.queue

    def _listen(self) -> None:
        if not self.draining:
            self.reactor.watch(self._listener, READ, self._accept)

    def _accept(self, _mask: int) -> None:
        for _ in range(_ACCEPTS_AFTER_A_REST if self._rest() else _ACCEPTS_AT_ONCE):
            if self._crowd is not None and self._crowd.ahead():
                self.reactor.watch(self._listener, 0, self._accept)
                self._left_over.set(time.monotonic() + COURTESY)
                return
            if not self._accept_one():
                return

    def _accept_left_over(self) -> None:
        """What others were let to have first and have not taken."""
        if not self.draining:
            self._listen()
            self._accept_one()

    def _tell_crowd(self) -> None:
        if self._crowd is not None:
            self._crowd.leave() if self.draining else self._crowd.tell(len(self._connections))

    def _accept_one(self) -> bool:
        if len(self._connections) >= self.bounds.connections:
            self.reactor.watch(self._listener, 0, self._accept)
            return False
        try:
            sock, address = self._listener.accept()
        except OSError as error:
            if error.errno in _OUT_OF_MEANS:
                # The listener stays ready, so without a pause this would spin until a connection closes.
                self.reactor.watch(self._listener, 0, self._accept)
                self._listening.set(time.monotonic() + 0.2)
            return error.errno == errno.ECONNABORTED
        sock.setblocking(False)
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connections.add(Connection(self, sock, str(address[0]) if address else ""))
        self._tell_crowd()
        return True

    def _drain(self) -> None:
        if self.draining:
            return
        while self._accept_one():  # connections that the system has accepted for us are ours to answer
            pass
        self.draining = True
        self._tell_crowd()
        self.reactor.watch(self._listener, 0, self._accept)
        self._listener.close()
        self._grace.set(time.monotonic() + self.settings.grace)
        drain = getattr(self._application, "drain", None)
        if drain is not None:
            drain()
        for connection in list(self._connections):
            connection.drain()
        if not self._connections:
            self.reactor.stop()
