"""Calls of the system in which a thread keeps the interpreter.

Theory. `socket.send` and `socket.recv_into` let go of the interpreter while they call the system. On a socket that
never blocks such a call takes a few microseconds; but where other threads compute, one of them takes the interpreter at
once and has to give it back afterwards, and the two changes of threads take longer than the call. Who answers hundreds
of small requests a second beside threads that compute had better keep it. Where the C library cannot be reached so, the
usual calls are made.

For sockets that do not block, and small messages. Errors are those of `socket`.
"""

from __future__ import annotations

import ctypes
import os
import socket
from typing import Any

_FLAGS = getattr(socket, "MSG_DONTWAIT", 0) | getattr(socket, "MSG_NOSIGNAL", 0)


def _function(name: str) -> Any:
    """A function of the C library, or None."""
    try:
        found = getattr(ctypes.PyDLL(None, use_errno=True), name)
    except (AttributeError, OSError, TypeError):
        return None
    found.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    found.restype = ctypes.c_ssize_t
    return found


_send, _receive = _function("send"), _function("recv")


def send(sock: socket.socket, data: bytes) -> int:
    """As `sock.send`."""
    if _send is None:
        return sock.send(data)
    return _counted(_send(sock.fileno(), data, len(data), _FLAGS))


class Scratch:
    """Memory for what is received, used again and again."""

    def __init__(self, size: int) -> None:
        memory = bytearray(size)
        self.view = memoryview(memory)
        self._address = ctypes.addressof((ctypes.c_char * size).from_buffer(memory))

    def receive(self, sock: socket.socket) -> int:
        """As `sock.recv_into(self.view)`."""
        if _receive is None:
            return sock.recv_into(self.view)
        return _counted(_receive(sock.fileno(), self._address, len(self.view), _FLAGS))


def _counted(count: int) -> int:
    if count < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return count
