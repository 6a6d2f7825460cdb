"""Worker processes, begun: nothing is loaded here, so that one can be while its supervisor still loads libraries."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from typing import NamedTuple

_ENVIRONMENT = {
    "MALLOC_ARENA_MAX": "2",
    "PYTHONFAULTHANDLER": "1",
    "PYDANTIC_DISABLE_PLUGINS": "__all__",  # to look for some takes 40 ms, and there are none
    "OPENBLAS_THREAD_TIMEOUT": "4",  # its threads turn round for 0.1 s otherwise, at the start too, before they sleep
}


class Begun(NamedTuple):
    """A worker that waits to be told what it shall serve, and the channel on which it is (see worker.py)."""

    process: subprocess.Popen[bytes]
    channel: socket.socket

    def end(self) -> None:
        self.channel.close()
        self.process.kill()
        self.process.wait()


def begin() -> Begun:
    """Raises `OSError`."""
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", "lichen_service.http.worker"],
            stdin=theirs.fileno(),
            env={**os.environ, **{name: os.environ.get(name, value) for name, value in _ENVIRONMENT.items()}},
            process_group=0,  # an interrupt from the keyboard is the supervisor's to pass on
        )
    return Begun(process, ours)
