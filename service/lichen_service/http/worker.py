"""A worker process: makes the application, then serves it on the listeners it has inherited.

    python -m lichen_service.http.worker      (see processes.py)

Standard input is a socket. It brings the descriptors READY, LIFELINE, CROWD, LISTENER and, where figures are had apart,
FIGURES; pickled, the name of the application's maker, whether this worker is a spare one, which loads its libraries
then, its place in the crowd, and the environment; and the settings, at which serving begins: of a spare worker that may
be much later, or never. READY gets a byte once requests can be answered, and one at each beat as long as the loop goes
round, which also says whether this worker has answered as many requests as it shall. LIFELINE is readable only when the
supervisor has died; the worker then ends too. SIGTERM drains, SIGUSR1 prints the stacks of all threads to standard
error.

Who asks for figures, at FIGURES, is served by a loop and a thread of their own: figures can be had when every place is
taken, and until the very end.

The process ends without tearing the interpreter down: threads that compute (a warm-up, a calibration, a job that will
wait again) may be inside a library, and one that comes back from C++ to an interpreter that is going is aborted, and
the process with it.
"""

from __future__ import annotations

import atexit
import contextlib
import faulthandler
import gc
import importlib
import math
import os
import pickle
import random
import signal
import socket
import sys
import threading
import time
from dataclasses import replace
from typing import Any, NoReturn, cast

from lichen_service.http.crowd import Crowd
from lichen_service.http.limits import Bounds, WireSettings
from lichen_service.http.loop import Loop
from lichen_service.http.message import Application
from lichen_service.http.reactor import READ
from lichen_service.http.server import ALIVE, SPENT, beat

SWITCH_INTERVAL = 0.001
"""seconds; the loop thread asks for the interpreter often and briefly, and the default of 5 ms would be its latency"""
SPREAD = (0.9, 1.1)
"""times as many requests as a worker shall answer"""
COLLECT = (7000, 10, 30)
"""when the collector of cycles looks at young, older and all objects: ten times, and at all thirty times as seldom as
it would, since all threads stand still meanwhile, for 30 to 60 ms at the last. Nothing large hangs in a cycle here."""
QUEUE_OF_FIGURES, CONNECTIONS_OF_FIGURES = 16, 64
"""at the address of figures"""
MOST_DESCRIPTORS = 8


def run() -> NoReturn:
    faulthandler.enable()
    faulthandler.register(signal.SIGUSR1, all_threads=True)
    sys.setswitchinterval(SWITCH_INTERVAL)
    gc.disable()  # what is loaded stays, and it is a twentieth of the time to look through it meanwhile
    try:
        with socket.socket(fileno=os.dup(sys.stdin.fileno())) as channel, channel.makefile("rb") as told:
            _, descriptors, _, _ = socket.recv_fds(channel, 1, MOST_DESCRIPTORS, socket.MSG_CMSG_CLOEXEC)
            maker, spare, place, environment = cast("tuple[str, bool, int, dict[str, str]]", pickle.load(told))
            os.environ.update(environment)
            if spare:
                prepare(maker)
            settings = cast("WireSettings", pickle.load(told))
    except EOFError:  # the supervisor is gone, or needs none
        os._exit(0)
    ready_fd, lifeline_fd, crowd_fd, listener_fd, *figures_fds = descriptors
    application = make(maker)
    with socket.socket(fileno=listener_fd) as listener:
        loop = Loop(listener, application, settings, crowd=Crowd.at(crowd_fd, place))
        loop.reactor.wake_on_signals()
        signal.signal(signal.SIGTERM, lambda *_: loop.stop())
        loop.reactor.watch(lifeline_fd, READ, lambda _mask: _orphaned(loop, lifeline_fd))
        for each in figures_fds:
            _tell_figures(socket.socket(fileno=each), application, settings)
        gc.freeze()  # what is loaded stays; to look through it again and again stops all threads each time, for 0.1 s
        gc.set_threshold(*COLLECT)
        gc.enable()
        _show_life(loop, ready_fd, beat(settings), settings.worker_requests)
        drained = loop.run()
    if drained:
        atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0 if drained else 1)


def _tell_figures(listener: socket.socket, application: Application, settings: WireSettings) -> None:
    """For as long as the process lives."""
    few = cast("WireSettings", replace(cast("Any", settings), threads=1, queue=QUEUE_OF_FIGURES))
    loop = Loop(listener, application, few, bounds=Bounds(connections=CONNECTIONS_OF_FIGURES), apart=True)
    threading.Thread(target=loop.run, name="figures", daemon=True).start()


def prepare(maker: str) -> None:
    """Load what the application is made of, and whatever else its module's `prepare` finds useful. No thread is
    begun."""
    getattr(importlib.import_module(maker.partition(":")[0]), "prepare", lambda: None)()


def make(maker: str) -> Application:
    """The application of `module:function`."""
    module, _, function = maker.partition(":")
    return cast("Application", getattr(importlib.import_module(module), function)())


def _show_life(loop: Loop, ready_fd: int, every: float, requests: int) -> None:
    """Now, and every so many seconds if there are any; and, from about so many requests on, that they were answered.
    Which number it is differs, so that those that have begun together do not end together."""
    most = requests * random.uniform(*SPREAD) if requests else math.inf
    os.set_blocking(ready_fd, False)

    def show() -> None:
        with contextlib.suppress(OSError):  # the supervisor has not read for long, or has gone
            os.write(ready_fd, ALIVE if loop.answers < most else SPENT)
        if every:
            again.set(time.monotonic() + every)

    again = loop.reactor.deadline(show)
    show()
    if not every:
        os.close(ready_fd)


def _orphaned(loop: Loop, lifeline_fd: int) -> None:
    loop.reactor.watch(lifeline_fd, 0, lambda _mask: None)
    loop.stop()


if __name__ == "__main__":
    run()
