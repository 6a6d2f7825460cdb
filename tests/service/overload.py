"""What the service does under more load than it can bear.

    python tests/service/overload.py [seconds] [rounds]

An open loop offers 1, 2, 5 and 10 times what four clients that wait for their answers get through, without waiting
itself, and counts what came back, how soon refusals did, and how /livez fared meanwhile. The service has one processor
for itself, and its clients have another: what they do is not taken from it. What was done is told for each second that
the service was on its processor, which others may have used as well. Where the clients themselves were off their
processor for a while, they cannot tell when an answer came: those that were awaited then are counted as not seen, as
good or refused, but their time is not told. A machine that is shared is not as fast at one
time as at another: all loads are offered in every round, one after the other, and the sums over all rounds compared.
"""

from __future__ import annotations

import math
import os
import random
import selectors
import socket
import statistics
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from load import share
from soak import served

REQUEST = b"GET /v1/operations/white_noise?width=640&height=640&format=png&seed=%d HTTP/1.1\r\nHost: a\r\n\r\n"
ALIVE = b"GET /livez HTTP/1.1\r\nHost: a\r\n\r\n"
ALIVE_EVERY = 0.01
CONNECTIONS = 256
LOADS = (0, 1, 2, 5, 10)
"""times what four clients that wait get; 0 for these"""
PROMPT = 0.05
"""seconds within which who is refused shall know"""
BLIND = 0.005
"""seconds off their processor after which clients may have missed when an answer came"""


@dataclass
class Awaited:
    """A connection, and what it waits for."""

    sock: socket.socket
    begun: float = 0.0
    good: bool = False
    missing: int = 0
    """bytes of the answer; 0 before its head has come"""


class Crowd:
    """Many clients in one thread, as cheap as they can be: requests are made of one template, an answer is told by its
    first bytes and counted, and never kept."""

    def __init__(self, port: int, connections: int) -> None:
        self._selector, self._port = selectors.EpollSelector(), port
        self._first, self.sent = random.getrandbits(31), 0
        self._scratch = memoryview(bytearray(1 << 20))
        self.free = [self._connected() for _ in range(connections)]
        self.counted = {True: 0, False: 0}
        """good answers, and refusals"""
        self.good: list[float] = []
        self.refused: list[float] = []
        self.alive: list[float] = []
        self.unseen = 0
        """answers that came while this thread may not have had its processor"""
        self._blind = 0.0
        """until when it had not, the last time"""
        self._was = time.monotonic(), time.thread_time()
        self._probe, self._next_probe = self._connected(), 0.0

    def _connected(self) -> Awaited:
        awaited = Awaited(socket.create_connection(("127.0.0.1", self._port)))
        awaited.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._selector.register(awaited.sock, selectors.EVENT_READ, awaited)
        return awaited

    def ask(self) -> None:
        awaited = self.free.pop()
        self.sent += 1
        awaited.begun, awaited.missing = time.monotonic(), 0
        awaited.sock.sendall(REQUEST % (self._first + self.sent))

    def probe(self, now: float) -> None:
        """Ask whether the service is alive, unless that has just been asked, or is not answered."""
        if now >= self._next_probe and not self._probe.begun:
            self._probe.begun, self._next_probe = now, now + ALIVE_EVERY
            self._probe.sock.sendall(ALIVE)

    def look_after(self, seconds: float) -> None:
        """Note whether more has passed since the last call than this thread has worked, and waited, at most so long."""
        now = time.monotonic(), time.thread_time()
        if now[0] - self._was[0] - (now[1] - self._was[1]) > seconds + BLIND:
            self._blind = now[0]
        self._was = now

    def _took(self, awaited: Awaited, kept: list[float]) -> None:
        if awaited.begun < self._blind:
            self.unseen += 1
        else:
            kept.append(time.monotonic() - awaited.begun)

    def listen(self, seconds: float) -> None:
        ready = self._selector.select(seconds)
        self.look_after(seconds)
        for key, _ in ready:
            awaited: Awaited = key.data
            if awaited is self._probe:
                assert awaited.sock.recv(4096).startswith(b"HTTP/1.1 200")
                self._took(awaited, self.alive)
                awaited.begun = 0.0
                continue
            count = awaited.sock.recv_into(self._scratch)
            if not count:
                raise ConnectionError("the service closed a connection that it had not said it would")
            closing = False
            if not awaited.missing:
                head = bytes(self._scratch[: min(count, 2048)]).partition(b"\r\n\r\n")[0]
                awaited.good = head.startswith(b"HTTP/1.1 200")
                if not awaited.good and not head.startswith(b"HTTP/1.1 503"):
                    raise RuntimeError(head)
                awaited.missing = len(head) + 4 + int(head.partition(b"Content-Length: ")[2].partition(b"\r")[0])
                closing = head.endswith(b"Connection: close")
            awaited.missing -= count
            if awaited.missing:
                continue
            self.counted[awaited.good] += 1
            self._took(awaited, self.good if awaited.good else self.refused)
            if closing:  # after its thousandth request
                self._selector.unregister(awaited.sock)
                awaited.sock.close()
                awaited = self._connected()
            self.free.append(awaited)

    def leave(self) -> None:
        """When all answers have come."""
        good, refused, counted = list(self.good), list(self.refused), dict(self.counted)
        while len(self.free) + 1 < len(self._selector.get_map()) or self._probe.begun:
            self.listen(1.0)
        self.good, self.refused, self.counted = good, refused, counted
        for key in list(self._selector.get_map().values()):
            key.data.sock.close()
        self._selector.close()


@dataclass
class Window:
    """What became of what was offered for a while."""

    seconds: float
    answered: int
    """good answers"""
    turned_away: int
    good: list[float]
    """how long those took that were seen to come"""
    refused: list[float]
    alive: list[float]
    """how long /livez took, each time"""
    unsent: int
    unseen: int
    service: float
    clients: float
    """parts of a processor that both took"""


def offer(port: int, pid: int, rate: float, seconds: float) -> Window:
    """What becomes of so many requests a second, sent whether or not those before are answered; with rate 0 of four
    clients that each wait for their answers."""
    crowd = Crowd(port, CONNECTIONS if rate else 4)
    began, due, unsent = time.monotonic(), 0.0, 0
    spent = processor_seconds(pid), time.process_time()
    while (now := time.monotonic()) < began + seconds:
        due = (now - began) * rate if rate else math.inf
        while crowd.sent + unsent < due and crowd.free:
            crowd.ask()
        if rate and not crowd.free:
            unsent = max(unsent, int(due) - crowd.sent)
        crowd.probe(now)
        crowd.listen(0.0005 if rate else 0.002)
    service, clients = processor_seconds(pid) - spent[0], time.process_time() - spent[1]
    crowd.leave()
    counted, seen = crowd.counted, (crowd.good, crowd.refused, crowd.alive)
    return Window(
        seconds, counted[True], counted[False], *seen, unsent, crowd.unseen, service / seconds, clients / seconds
    )


def processor_seconds(pid: int) -> float:
    """That a process has had, with all its threads, also those that have ended."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def overload(seconds: float, rounds: int) -> None:
    own, others = sorted(os.sched_getaffinity(0))[:2]
    os.sched_setaffinity(0, {others})
    with served("soak:create", queue=16, cache=0) as (port, pid):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            os.sched_setaffinity(int(thread.name), {own})
        offer(port, pid, 0, seconds)
        windows: dict[float, list[Window]] = {times: [] for times in LOADS}
        for _ in range(rounds):
            most = 0.0
            for times in LOADS:
                window = offer(port, pid, times * most, seconds)
                windows[times].append(window)
                most = most or window.answered / seconds
    tell(windows, seconds)


def tell(windows: dict[float, list[Window]], seconds: float) -> None:
    rates = {
        times: sum(one.answered for one in each) / sum(one.seconds * one.service for one in each)
        for times, each in windows.items()
    }
    for times, each in windows.items():
        good, refused, alive = (
            [took for one in each for took in getattr(one, kind)] for kind in ("good", "refused", "alive")
        )
        late, turned = sum(took > PROMPT for took in refused), sum(one.turned_away for one in each)
        told = f"offered {times}x" if times else "four that wait"
        print(
            f"{told}: {rates[times]:.1f} good answers in a second of its processor, "
            f"{rates[times] / max(rates.values()):.0%} of the best load, p99 {share(good, 0.99):.0f} ms; "
            f"refused {turned / seconds / len(each):.0f}/s, median {share(refused, 0.5):.1f}, "
            f"p99 {share(refused, 0.99):.1f} ms, {late} after more than {PROMPT * 1e3:.0f}; "
            f"unsent {sum(one.unsent for one in each)}, unseen {sum(one.unseen for one in each)}; "
            f"/livez p99 {share(alive, 0.99):.1f} ms; busy "
            f"{statistics.median(one.service for one in each):.0%}, clients "
            f"{statistics.median(one.clients for one in each):.0%}",
            flush=True,
        )


def main(arguments: Sequence[str]) -> None:
    overload(float(arguments[0]) if arguments else 3.0, int(arguments[1]) if arguments[1:] else 5)


if __name__ == "__main__":
    main(sys.argv[1:])
