"""The service as a WSGI application (PEP 3333), for those whose servers speak that.

    LICHEN_INSECURE=on gunicorn --worker-class gthread --threads 4 'lichen_service.wsgi:create()'

Requests take the road they take from our own wire: the routes decide before a byte of the body is read, and answers are
completed and checked alike. What WSGI does not carry is the server's to do, or is not there: deadlines on clients that
send slowly, a bounded queue, and the news that a client has hung up. Settings are those of `lichen serve`; those of
the wire (host, port, metrics, workers, threads, queue and timeouts of connections) mean nothing here.

OpenCL does not survive a fork: the server must make the application in the process that serves (gunicorn does, unless
it is told to preload).
"""

from __future__ import annotations

import atexit
import queue
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any
from urllib.parse import quote

from lichen_service.http.access_log import AccessLog
from lichen_service.http.exchange import Exchange
from lichen_service.http.finish import BadResponse, completed, phrase
from lichen_service.http.message import Admission, Application, Body, Head, Request, Response, Stream
from lichen_service.http.policy import RawHead, Refusal, joined
from lichen_service.problems import problem
from lichen_service.settings import InvalidSettings, Settings

Environ = Mapping[str, Any]
_PIECE = 1 << 20


class TooLarge(Exception):
    """The body is larger than it may be."""


class Wsgi:
    def __init__(self, application: Application, settings: Settings, log: AccessLog | None = None) -> None:
        self._application = application
        self._settings = settings
        self._log = log or AccessLog(tell=getattr(application, "answered", None))

    def __call__(self, environ: Environ, start_response: Callable[..., Any]) -> Iterable[bytes]:
        exchange = Exchange.opened(_opening(environ), environ.get("REMOTE_ADDR", ""), self._settings.request_timeout)
        response = self._respond(exchange, environ)
        try:
            headers = completed(response, exchange.request_id)
        except BadResponse:
            self._log.failed("response", request_id=exchange.request_id)
            response = _failure(exchange.request_id)
            headers = completed(response, exchange.request_id)
        bodiless = exchange.method == "HEAD" or response.status in (204, 304)
        if response.status not in (204, 304) and response.stream is None:
            headers["Content-Length"] = str(memoryview(response.body).nbytes)
        exchange.status, exchange.fields = response.status, response.log
        start_response(f"{response.status} {phrase(response.status)}", [*headers.items()])
        return self._sent(exchange, response, bodiless)

    def _respond(self, exchange: Exchange, environ: Environ) -> Response:
        head = exchange.head
        if isinstance(head, Refusal):
            return problem(head.status, head.code, phrase(head.status), head.detail, request_id=exchange.request_id)
        assert head is not None
        try:
            admission = self._application.admit(head)
            if isinstance(admission, Response):
                return admission
            return self._answer(exchange, head, admission, environ)
        except Exception:
            self._log.failed("handle", request_id=exchange.request_id)
            return _failure(exchange.request_id)

    def _answer(self, exchange: Exchange, head: Head, admission: Admission, environ: Environ) -> Response:
        if head.length is None and not environ.get("wsgi.input_terminated"):
            detail = "This server hands on no body whose length is not declared."
            return problem(411, "length-required", phrase(411), detail, request_id=exchange.request_id)
        largest = min(admission.largest_body, self._settings.max_body)
        try:
            body = _body(environ, head.length, largest)
        except TooLarge:
            detail = f"The body may have {largest} bytes."
            title = "The request body is too large"
            return problem(413, "too-large", title, detail, request_id=exchange.request_id, limit=largest)
        if body is None:
            detail = "The connection ended before the body was complete."
            return problem(400, "incomplete-body", phrase(400), detail, request_id=exchange.request_id)
        exchange.received = memoryview(body).nbytes
        exchange.queued = exchange.work_started = time.monotonic()
        try:
            return self._application.handle(Request(head, body, admission.caller))
        finally:
            exchange.work_ended = time.monotonic()

    def _sent(self, exchange: Exchange, response: Response, bodiless: bool) -> Iterator[bytes]:
        """What leaves, and then the line in the log, also where the server broke off."""
        try:
            if bodiless:
                return
            if response.stream is not None:
                for piece in _streamed(response.stream):
                    exchange.sent += len(piece)
                    yield piece
                return
            body = memoryview(response.body)
            exchange.sent += body.nbytes
            yield bytes(body)
        finally:
            self._log.answered(exchange.end())
            self._log.flush()


def create() -> Wsgi:
    """The application with the settings of the environment. Raises `InvalidSettings` where nobody needs a key and
    nobody said that this is meant: the address is the server's, so it may be one that others reach."""
    from lichen_service.app import create_application

    settings = Settings.load()
    if settings.insecure == "off" and not settings.key_file.exists():
        raise InvalidSettings("no key is needed here: make one with 'lichen keys add', or set LICHEN_INSECURE=on")
    application = create_application(settings=replace(settings, metrics=""))
    atexit.register(application.end)
    return Wsgi(application, settings)


def _opening(environ: Environ) -> RawHead:
    """The head as our own wire would have read it; the server has judged it."""
    target = quote(environ.get("PATH_INFO", "").encode("latin-1"), safe="/:@!$&'()*+,;=~-._") or "/"
    if query := environ.get("QUERY_STRING", ""):
        target += f"?{query}"
    fields = [
        (name.removeprefix("HTTP_").replace("_", "-").lower(), str(value))
        for name, value in environ.items()
        if name.startswith("HTTP_") or (name in ("CONTENT_TYPE", "CONTENT_LENGTH") and value)
    ]
    known = environ["REQUEST_METHOD"]
    return RawHead(known, target, "1.1", tuple(fields), joined(fields), keep_alive=True, expects_continue=False)


def _body(environ: Environ, length: int | None, largest: int) -> Body | None:
    """The body, of which never more than a piece over the largest is read; None where it ended early."""
    if length is not None and length > largest:
        raise TooLarge
    source = environ["wsgi.input"]
    whole = bytearray()
    while length is None or len(whole) < length:
        piece = source.read(_PIECE if length is None else min(_PIECE, length - len(whole)))
        if not piece:
            return whole if length is None else None
        whole += piece
        if len(whole) > largest:
            raise TooLarge
    return whole


def _streamed(stream: Stream) -> Iterator[bytes]:
    """What a stream sends, in a thread of the server's own."""
    pieces: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
    stream.open(pieces.put, lambda: pieces.put(None))
    try:
        while (piece := pieces.get()) is not None:
            yield piece
    finally:
        stream.close()


def _failure(request_id: str) -> Response:
    detail = "The request could not be answered; the fault is ours."
    return problem(500, "internal-error", "The service failed", detail, request_id=request_id)
