"""Processes that decode, begun: nothing is loaded here, so that one can be while its service still loads libraries."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from typing import NamedTuple

MODULE = "lichen_service.decoding.child"
# Threads of codecs would only compete with those of other requests; and a decoder computes nothing.
_ENVIRONMENT = {
    "OPENCV_FOR_THREADS_NUM": "1",
    "OMP_NUM_THREADS": "1",
    "MALLOC_ARENA_MAX": "1",
    # Said here rather than left to a version of the library; our own limits are checked first.
    "OPENCV_IO_MAX_IMAGE_WIDTH": str(1 << 20),
    "OPENCV_IO_MAX_IMAGE_HEIGHT": str(1 << 20),
    "OPENCV_IO_MAX_IMAGE_PIXELS": str(1 << 30),
}


class Begun(NamedTuple):
    """One that says a first packet when it stands ready."""

    process: subprocess.Popen[bytes]
    socket: socket.socket


def begin(memory: int, module: str = MODULE) -> Begun:
    """A process that may use so many bytes beyond its libraries. Raises `OSError`."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", module, str(theirs.fileno()), str(memory)],
            pass_fds=(theirs.fileno(),),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            env={**os.environ, **_ENVIRONMENT},
        )
    return Begun(process, ours)
