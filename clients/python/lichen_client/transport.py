"""What the blocking and the asynchronous client share around a socket.

httpx2 is imported when a client is made that needs it (see `direct`), not with the package, and appears in no public
signature.
"""

from __future__ import annotations

import copy
import importlib
import os
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import urlsplit

from lichen_client import calls
from lichen_client.calls import Call
from lichen_client.errors import ConnectionFailed, TimedOut
from lichen_client.retry import Reply, Retries
from lichen_client.version import __version__

if TYPE_CHECKING:
    import httpx2

    from lichen_client.lanes import Lanes

CONNECT_TIMEOUT = 5.0
"""Seconds. A host that is there answers a connection at once; waiting longer only hides that it is not."""


class Transport:
    """What both clients are made of: options, and the arguments of httpx2."""

    def __init__(
        self,
        url: str | None = None,
        *,
        timeout: float = 65.0,
        retries: Retries | int = Retries(),  # noqa: B008  (frozen)
        connections: int = 16,
        headers: Mapping[str, str] | None = None,
        key: str | None = None,
        local: bool = False,
        memory: int | None = None,
    ) -> None:
        """
        url: address of the service; LICHEN_URL, else http://127.0.0.1:8080, where it is None.
        timeout: seconds one call may take in all: every try, every wait and the transfer of the answer.
        retries: how often to try again, or the whole rule.
        connections: open connections at most; more calls at a time than that wait for one another.
        headers: further header fields of every request.
        key: the key that the service asks for; LICHEN_KEY where it is None.
        local: ask nobody: run the same engine in this process, with the same answers. Needs Lichen itself installed.
        memory: with `local`, bytes that the images of one call may take.
        """
        if not timeout > 0:
            raise ValueError(f"timeout must be above 0 (got {timeout})")
        self.url = "this process" if local else calls.base_url(url)
        self.timeout = timeout
        self.retries = Retries(count=retries) if isinstance(retries, int) else retries
        self._headers = {"User-Agent": f"lichen-client/{__version__}", **calls.authorization(key), **(headers or {})}
        self._connections = connections
        self._shared = False
        self._inside: Any = None
        self._lanes: Lanes | None = None
        if local:
            self._inside = _opened(memory)
        else:
            self._open()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.url!r})"

    def _open(self) -> None:
        raise NotImplementedError

    def with_options(
        self,
        *,
        timeout: float | None = None,
        retries: Retries | int | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> Self:
        """This client with other options. It shares the connections, and closing it leaves them open."""
        other = copy.copy(self)
        other._shared = True
        if timeout is not None:
            if not timeout > 0:
                raise ValueError(f"timeout must be above 0 (got {timeout})")
            other.timeout = timeout
        if retries is not None:
            other.retries = Retries(count=retries) if isinstance(retries, int) else retries
        other._headers = {**self._headers, **(headers or {})}
        return other

    def _arguments(self) -> dict[str, Any]:
        import httpx2

        limits = httpx2.Limits(max_connections=self._connections, max_keepalive_connections=self._connections)
        return {"limits": limits, "timeout": None, "follow_redirects": False}

    def _request(self, call: Call, deadline: float) -> dict[str, Any]:
        """Arguments of one try, whose every step has the time that is left; the service is told how much that is."""
        import httpx2

        left = max(deadline - time.monotonic(), 1e-3)
        return {
            "method": call.method,
            "url": self.url + call.target,
            "headers": {**self._headers, **call.headers, **left_of(deadline)},
            "content": call.content,
            "timeout": httpx2.Timeout(left, connect=min(left, CONNECT_TIMEOUT)),
        }

    def _answer_here(self, call: Call, deadline: float) -> Reply:
        """The answer of the engine in this process."""
        headers = {**self._headers, **call.headers}
        left = max(deadline - time.monotonic(), 1e-3)
        status, told, body = self._inside.ask(call.method, call.target, headers, call.content or b"", left)
        return Reply(status, told, body if isinstance(body, bytearray) else bytearray(body))


def _opened(memory: int | None) -> Any:
    """The service without a socket, found by its name: this package needs it for nothing else."""
    try:
        inside = importlib.import_module("lichen_service.inside")
    except ImportError as missing:
        raise ImportError("local=True runs the engine here, and Lichen itself is not installed") from missing
    return inside.open_inside(memory=memory)


def direct(url: str) -> bool:
    """Whether a service can be reached over sockets of our own (see `lanes`): no TLS, no proxy, nobody's name."""
    split = urlsplit(url)
    proxied = any(os.environ.get(name) for each in ("http_proxy", "all_proxy") for name in (each, each.upper()))
    return split.scheme == "http" and split.netloc.isascii() and "@" not in split.netloc and not proxied


def left_of(deadline: float) -> dict[str, str]:
    """The header field that tells the service how many milliseconds are left."""
    left = max(deadline - time.monotonic(), 1e-3)
    return {"Request-Timeout": str(int(min(left, 1e6) * 1e3))}


@contextmanager
def failures(call: Call, url: str) -> Iterator[None]:
    """Turns the transport's errors into ours."""
    try:
        yield
    except TimeoutError as late:
        raise TimedOut(f"{url} did not answer in time") from late
    except Exception as failure:
        kind = _kind_of(failure)
        if kind is None:
            raise
        if kind is TimedOut:
            raise TimedOut(f"{url} did not answer in time") from failure
        reason = str(failure) or type(failure).__name__
        raise ConnectionFailed(f"{call.method} {url}: {reason}") from failure


def _kind_of(failure: Exception) -> type[ConnectionFailed] | None:
    """What an error of either road is to a caller; None where it is none of the wire's."""
    ours, theirs = sys.modules.get("http.client"), sys.modules.get("httpx2")  # what was not imported raised nothing
    if theirs is not None and isinstance(failure, theirs.TimeoutException):
        return TimedOut
    lost = isinstance(failure, OSError) or (ours is not None and isinstance(failure, ours.HTTPException))
    lost |= theirs is not None and isinstance(failure, theirs.RequestError | theirs.InvalidURL)
    return ConnectionFailed if lost else None


def reply_of(response: httpx2.Response, body: bytearray) -> Reply:
    return Reply(response.status_code, {name.lower(): value for name, value in response.headers.items()}, body)
