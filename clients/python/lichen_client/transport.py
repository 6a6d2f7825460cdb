"""What the blocking and the asynchronous client share around a socket.

httpx2 is imported when a client is made, not with the package, and appears in no public signature.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from lichen_client import calls
from lichen_client.calls import Call
from lichen_client.errors import ConnectionFailed, TimedOut
from lichen_client.retry import Reply, Retries
from lichen_client.version import __version__

if TYPE_CHECKING:
    import httpx2

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
    ) -> None:
        """
        url: address of the service; LICHEN_URL, else http://127.0.0.1:8080, where it is None.
        timeout: seconds one call may take in all: every try, every wait and the transfer of the answer.
        retries: how often to try again, or the whole rule.
        connections: open connections at most; more calls at a time than that wait for one another.
        headers: further header fields of every request.
        """
        if not timeout > 0:
            raise ValueError(f"timeout must be above 0 (got {timeout})")
        self.url = calls.base_url(url)
        self.timeout = timeout
        self.retries = Retries(count=retries) if isinstance(retries, int) else retries
        self._headers = {"User-Agent": f"lichen-client/{__version__}", **(headers or {})}
        self._connections = connections
        self._open()

    def _open(self) -> None:
        raise NotImplementedError

    def _arguments(self) -> dict[str, Any]:
        import httpx2

        limits = httpx2.Limits(max_connections=self._connections, max_keepalive_connections=self._connections)
        return {"headers": self._headers, "limits": limits, "timeout": None, "follow_redirects": False}

    def _request(self, call: Call, deadline: float) -> dict[str, Any]:
        """Arguments of one try, whose every step has the time that is left."""
        import httpx2

        left = max(deadline - time.monotonic(), 1e-3)
        return {
            "method": call.method,
            "url": self.url + call.target,
            "headers": call.headers,
            "content": call.content,
            "files": call.files,
            "timeout": httpx2.Timeout(left, connect=min(left, CONNECT_TIMEOUT)),
        }


@contextmanager
def failures(call: Call, url: str) -> Iterator[None]:
    """Turns the transport's errors into ours."""
    import httpx2

    try:
        yield
    except (TimeoutError, httpx2.TimeoutException) as late:
        raise TimedOut(f"{url} did not answer in time") from late
    except (httpx2.RequestError, httpx2.InvalidURL) as failure:
        reason = str(failure) or type(failure).__name__
        raise ConnectionFailed(f"{call.method} {url}: {reason}") from failure


def reply_of(response: httpx2.Response, body: bytearray) -> Reply:
    return Reply(response.status_code, {name.lower(): value for name, value in response.headers.items()}, body)
