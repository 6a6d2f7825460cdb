"""The supervisor: binds the address, keeps the workers alive, ends them in order.

Theory. The process that must never fail does next to nothing: it imports no library that computes, opens no request,
and only waits for children and signals. One listening socket is shared by all workers, so that no connection waits
for a worker that is busy or gone. Workers are fresh interpreters, since the OpenCL runtime does not survive a fork.

Rules
- A worker that dies is replaced: at once if it had served, else after a growing pause; if none has ever become ready,
  the supervisor gives up and says so.
- Loading libraries is most of what a start takes. So one spare worker has done that before it is needed, and waits; it
  is started when all others serve and have had a moment for their first requests.
- A worker shows at each beat that its loop goes round. One that is silent for too long can only be killed. One that
  holds too much memory, or says that it has answered enough, is renewed: it ends in order once another serves in its
  place; one at a time.
- First SIGTERM or SIGINT: workers stop accepting and answer what they have, up to `grace` seconds; exit status 0. A
  second one, or the end of the grace, kills them; exit status 1.
- As process 1 it also reaps the orphans that the system hands it.
"""

from __future__ import annotations

import contextlib
import math
import os
import pickle
import selectors
import signal
import socket
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from subprocess import Popen

from lichen_service.http.address import UNIX, address_of, bind, url_of
from lichen_service.http.crowd import Crowd, shared
from lichen_service.http.limits import WireSettings
from lichen_service.http.processes import Begun, begin

FIRST_PAUSE = 0.1
LONGEST_PAUSE = 5.0
"""seconds between a worker's death and its replacement"""
LASTING = 2 * LONGEST_PAUSE
"""seconds after which a worker had nothing wrong with its start"""
MOST_FAILED_STARTS = 3
"""deaths before any worker was ready after which the supervisor gives up"""
SPARE_AFTER = 3.0
"""seconds from when all workers serve to the start of the spare one"""
BEATS = 5
"""signs of life within the time that a worker may be silent"""
LOOK_EVERY = 5.0
"""seconds between looks at workers where none has to show that it lives"""
ALIVE, SPENT = b"\1", b"\2"
"""what a worker says at a beat: that its loop goes round; that it has answered what it shall, too"""
_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGCHLD, signal.SIGUSR1)


def serve(make_application: str, settings: WireSettings, begun: Begun | None = None) -> int:
    """Serve until told to end; returns the exit status of the process.

    `make_application` is `module:function`, called without arguments in each worker. `settings` must be picklable.
    `begun` is the first worker, where its process was begun already; it is not ended where none is served.
    Raises nothing for an address that cannot be taken: that is said on standard error, with status 1.
    """
    main = settings.host if settings.host.startswith(UNIX) else f"{settings.host}:{settings.port}"
    with contextlib.ExitStack() as stack:
        listeners = []
        for where in filter(None, (main, settings.metrics)):
            try:
                listeners.append(stack.enter_context(bind(*address_of(where))))
            except OSError as error:
                print(f"Lichen cannot listen on {where}: {error.strerror or error}", file=sys.stderr)
                return 1
        return Supervisor(listeners, make_application, settings, begun).run()


def beat(settings: WireSettings) -> float:
    """Seconds between signs of life of a worker; 0 where it need give none after the first."""
    return settings.silence / BEATS or (LOOK_EVERY if settings.worker_requests else 0.0)


def resident(pid: int) -> int:
    """Bytes of memory that a process holds; 0 of one that has gone."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError):
        return 0


@dataclass
class _Worker:
    process: Popen[bytes]
    channel: socket.socket
    """on which it is told what it serves"""
    ready_fd: int
    crowd: Crowd
    spare: bool = False
    ready: bool = False
    silent: int = 0
    """beats that have not been heard"""
    spent: bool = False
    """whether it has answered what it shall"""
    renewed: bool = False
    """whether another is to take its place"""
    started: float = field(default_factory=time.monotonic)


class Supervisor:
    def __init__(
        self,
        listeners: Sequence[socket.socket],
        make_application: str,
        settings: WireSettings,
        begun: Begun | None = None,
    ) -> None:
        """A second listener is that of figures."""
        self._begun = begun
        self._listeners = listeners
        self._maker = make_application
        self._told = pickle.dumps(settings)
        self._settings = settings
        self._workers: dict[int, _Worker] = {}
        self._starts: list[float] = [0.0] * settings.workers
        """when the missing workers are to be started"""
        self._spare_at = math.inf
        """when the spare one is"""
        self._beat = beat(settings) or (LOOK_EVERY if settings.worker_memory else math.inf)
        self._look_at = time.monotonic() + self._beat
        """when workers are looked at next"""
        self._pause = FIRST_PAUSE
        self._failed_starts = 0
        self._announced = False
        self._ends: float | None = None
        """when the grace is over, once the end has begun"""
        self._killed = False
        self._lifeline, self._held_end = os.pipe()
        self._crowd = shared(2 * settings.workers + 1)  # each may be renewed, and there is a spare one
        self._selector = selectors.DefaultSelector()

    def run(self) -> int:
        with self._signals() as woken:
            self._selector.register(woken, selectors.EVENT_READ)
            while self._workers or self._ends is None:
                self._start_due()
                told = b""
                for key, _ in self._selector.select(self._patience()):
                    if key.fileobj is woken:
                        told = woken.recv(4096)
                    else:
                        self._hear(key.data)
                self._reap()  # before the end may begin: who is dead already has not failed to end in order
                for number in told:
                    self._signalled(number)
                if time.monotonic() >= self._look_at:
                    self._look()
                if self._ends is not None and time.monotonic() >= self._ends:
                    self._kill()
                if self._failed_starts >= MOST_FAILED_STARTS and self._ends is None:
                    print("Lichen cannot start: no worker became ready; the reason is above.", file=sys.stderr)
                    self._killed = True
                    self._end()
        for descriptor in (self._lifeline, self._held_end, self._crowd):
            os.close(descriptor)
        self._selector.close()
        return 1 if self._killed else 0

    @contextlib.contextmanager
    def _signals(self) -> Iterator[socket.socket]:
        """Signals as bytes on a socket; what was installed before comes back afterwards."""
        woken, waker = socket.socketpair()
        with woken, waker:
            woken.setblocking(False)
            waker.setblocking(False)
            before = {number: signal.signal(number, lambda *_: None) for number in _SIGNALS}
            old = signal.set_wakeup_fd(waker.fileno(), warn_on_full_buffer=False)
            try:
                yield woken
            finally:
                signal.set_wakeup_fd(old)
                for number, handler in before.items():
                    signal.signal(number, handler)

    def _signalled(self, number: int) -> None:
        if number in (signal.SIGTERM, signal.SIGINT):
            if self._ends is None:
                self._end()
            else:
                self._kill()
        elif number == signal.SIGUSR1:
            self._tell(signal.SIGUSR1)

    def _end(self) -> None:
        # One second more than the workers take for themselves, so that they can close in order.
        self._ends = time.monotonic() + self._settings.grace + 1.0
        for listener in self._listeners:
            listener.close()
        self._starts.clear()
        self._spare_at = math.inf
        self._tell(signal.SIGTERM)

    def _kill(self) -> None:
        self._killed = True
        self._ends = math.inf
        self._tell(signal.SIGKILL)

    def _tell(self, number: signal.Signals) -> None:
        for pid in self._workers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)

    # Workers

    def _start_due(self) -> None:
        now = time.monotonic()
        due = [at for at in self._starts if at <= now]
        self._starts = [at for at in self._starts if at > now]
        for _ in due:
            spare = next((each for each in self._workers.values() if each.spare), None) or self._start()
            self._let_serve(spare)
        if self._spare_at <= now:
            self._spare_at = math.inf
            self._start(spare=True)

    def _let_serve(self, worker: _Worker) -> None:
        worker.spare, worker.started = False, time.monotonic()
        with contextlib.suppress(ConnectionError), worker.channel:  # it may have died before it read all
            worker.channel.sendall(self._told)

    def _start(self, *, spare: bool = False) -> _Worker:
        """A worker that is told to serve next, or else loads its libraries and waits."""
        ready_fd, other_end = os.pipe()
        os.set_blocking(ready_fd, False)
        taken = {each.crowd.place for each in self._workers.values()}
        crowd = Crowd.at(self._crowd, min({*range(len(self._workers) + 1)} - taken))
        (process, channel), self._begun = self._begun or begin(), None
        given = [other_end, self._lifeline, self._crowd, *(listener.fileno() for listener in self._listeners)]
        with contextlib.suppress(ConnectionError):
            socket.send_fds(channel, [b"\0"], given)
            channel.sendall(pickle.dumps((self._maker, spare, crowd.place, dict(os.environ))))
        os.close(other_end)
        worker = self._workers[process.pid] = _Worker(process, channel, ready_fd, crowd, spare)
        self._selector.register(ready_fd, selectors.EVENT_READ, worker)
        return worker

    def _hear(self, worker: _Worker) -> None:
        worker.silent = 0
        said = os.read(worker.ready_fd, 4096)
        worker.spent |= SPENT in said
        if not said:  # it has died, or will say no more
            self._hear_no_more(worker)
        elif not worker.ready:
            worker.ready = True
            self._became_ready()

    def _hear_no_more(self, worker: _Worker) -> None:
        self._selector.unregister(worker.ready_fd)
        os.close(worker.ready_fd)
        worker.ready_fd = -1

    def _became_ready(self) -> None:
        if not self._announced:
            self._announced = True
            listens, *apart = map(url_of, self._listeners)
            print(f"Lichen listens on {listens}", *(f"and tells figures on {each}" for each in apart), flush=True)
        for pid, each in self._workers.items():
            if each.renewed:
                os.kill(pid, signal.SIGTERM)
        serving = [each for each in self._workers.values() if each.ready]
        if len(serving) == len(self._workers) == self._settings.workers:
            self._want_spare()

    def _want_spare(self) -> None:
        if self._settings.spare == "on" and self._ends is None:
            self._spare_at = time.monotonic() + SPARE_AFTER

    def _look(self) -> None:
        """Whether those that serve have been heard, and what they hold. Beats are counted here rather than timed, since
        who has been stopped together with them would find all of them late."""
        self._look_at = time.monotonic() + self._beat
        serving = {pid: each for pid, each in self._workers.items() if each.ready}
        if self._ends is not None:
            return
        for pid, worker in serving.items():
            worker.silent += 1
            if self._settings.silence and worker.silent > BEATS:
                print(f"Lichen kills worker {pid}: silent for {self._settings.silence:g} s", file=sys.stderr)
                os.kill(pid, signal.SIGKILL)
        if any(each.renewed for each in serving.values()):
            return
        for pid, worker in serving.items():
            if self._lasted(worker) and (reason := self._outworn(pid, worker)):
                print(f"Lichen renews worker {pid}: {reason}", file=sys.stderr)
                worker.renewed = True
                self._starts.append(time.monotonic())
                return

    def _outworn(self, pid: int, worker: _Worker) -> str:
        """Why another shall take its place; empty where none shall."""
        if worker.spent:
            return "it has answered as many requests as it shall"
        held = resident(pid) if self._settings.worker_memory else 0
        return f"it holds {held} bytes" if held > self._settings.worker_memory else ""

    def _lasted(self, worker: _Worker) -> bool:
        return time.monotonic() - worker.started > LASTING

    def _reap(self) -> None:
        with contextlib.suppress(ChildProcessError):
            while True:
                pid, status = os.waitpid(-1, os.WNOHANG)
                if not pid:
                    return
                worker = self._workers.pop(pid, None)
                if worker is not None:
                    worker.process.returncode = os.waitstatus_to_exitcode(status)
                    self._lost(worker)

    def _lost(self, worker: _Worker) -> None:
        worker.crowd.leave()
        if worker.ready_fd >= 0:
            with contextlib.suppress(BlockingIOError):
                self._hear(worker)  # what it said last
        if worker.ready_fd >= 0:
            self._hear_no_more(worker)
        worker.channel.close()
        if worker.spare and self._ends is None:
            self._spare_at = time.monotonic() + max(SPARE_AFTER, self._pause)
            return
        if self._ends is not None:
            # Before it is ready a worker has nothing to lose, and ends on SIGTERM as any process does.
            self._killed |= worker.ready and worker.process.returncode != 0
            return
        if worker.renewed:
            self._want_spare()
            return
        print(f"Lichen lost worker {worker.process.pid} (status {worker.process.returncode})", file=sys.stderr)
        if not worker.ready and not self._announced:
            self._failed_starts += 1
        lasted = self._lasted(worker)
        self._pause = FIRST_PAUSE if worker.ready and lasted else min(2 * self._pause, LONGEST_PAUSE)
        self._starts.append(time.monotonic() + (0.0 if worker.ready and lasted else self._pause))

    def _patience(self) -> float | None:
        soonest = min([*self._starts, self._spare_at, self._look_at, math.inf if self._ends is None else self._ends])
        return None if soonest == math.inf else max(0.0, soonest - time.monotonic())
