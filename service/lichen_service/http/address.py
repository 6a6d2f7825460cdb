"""Where the service listens: addresses as settings write them, and sockets there."""

from __future__ import annotations

import errno
import os
import socket

BACKLOG = 2048
UNIX = "unix:"
"""How a host begins that is a path in the file system."""


def address_of(where: str) -> tuple[str, int]:
    """Host and port of `HOST:PORT`, as `bind` takes them; the whole of `unix:PATH` is the host.

    >>> address_of("[::1]:8080"), address_of("unix:/a:b")
    (('::1', 8080), ('unix:/a:b', 0))
    """
    if where.startswith(UNIX):
        return where, 0
    host, _, port = where.rpartition(":")
    return host.removeprefix("[").removesuffix("]"), int(port)


def bind(host: str, port: int) -> socket.socket:
    """A listening socket at the first address that `host` resolves to, or at the path of `unix:PATH`."""
    if host.startswith(UNIX):
        return _bind_unix(host.removeprefix(UNIX))
    family, kind, protocol, _, address = socket.getaddrinfo(
        host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listener = socket.socket(family, kind, protocol)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(BACKLOG)
    except OSError:
        listener.close()
        raise
    return listener


def _bind_unix(path: str) -> socket.socket:
    """A socket in the file system, for its owner and group. One that nobody listens on any more is replaced."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            try:
                probe.connect(path)
            except FileNotFoundError:
                pass
            except ConnectionRefusedError:
                os.unlink(path)
            else:
                raise OSError(errno.EADDRINUSE, os.strerror(errno.EADDRINUSE))
        before = os.umask(0o117)
        try:
            listener.bind(path)
        finally:
            os.umask(before)
        listener.listen(BACKLOG)
    except OSError:
        listener.close()
        raise
    return listener


def url_of(listener: socket.socket) -> str:
    """What clients ask, port included where the system has chosen it."""
    if listener.family == socket.AF_UNIX:
        return f"{UNIX}{listener.getsockname()}"
    host, port = listener.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
