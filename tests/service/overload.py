"""What the service does under more load than it can bear.

    python tests/service/overload.py [seconds]

An open loop offers 1, 2, 5 and 10 times what four clients that wait for their answers get through, without waiting
itself, and counts what came back, how soon refusals did, and how /livez fared meanwhile. The service has one processor
for itself, and its clients have another: what they do is not taken from it. How busy both were is printed, and what was
done is also told for each second that the service was on its processor, which others may have used as well.
"""

from __future__ import annotations

import http.client
import json
import math
import os
import random
import selectors
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from load import share
from soak import served

REQUEST = b"GET /v1/operations/white_noise?width=640&height=640&format=png&seed=%d HTTP/1.1\r\nHost: a\r\n\r\n"
CONNECTIONS = 256


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
        self.good: list[float] = []
        self.refused: list[float] = []

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

    def listen(self, seconds: float) -> None:
        for key, _ in self._selector.select(seconds):
            awaited: Awaited = key.data
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
            (self.good if awaited.good else self.refused).append(time.monotonic() - awaited.begun)
            if closing:  # after its thousandth request
                self._selector.unregister(awaited.sock)
                awaited.sock.close()
                awaited = self._connected()
            self.free.append(awaited)


def offer(port: int, pid: int, rate: float, seconds: float) -> dict[str, Any]:
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
        crowd.listen(0.0005 if rate else 0.1)
    return {
        "good": crowd.good,
        "refused": crowd.refused,
        "unsent": unsent,
        "service": (processor_seconds(pid) - spent[0]) / seconds,
        "clients": (time.process_time() - spent[1]) / seconds,
    }


def probe(port: int, seconds: float) -> list[float]:
    """How long /livez took, each time."""
    connection = http.client.HTTPConnection("127.0.0.1", port)
    ends, times = time.monotonic() + seconds, []
    while time.monotonic() < ends:
        began = time.monotonic()
        connection.request("GET", "/livez")
        connection.getresponse().read()
        times.append(time.monotonic() - began)
        time.sleep(0.01)
    return times


def processor_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def beside(processor: int, *command: object) -> subprocess.Popen[bytes]:
    """A part of this script in a process of its own, on that processor."""
    process = subprocess.Popen([sys.executable, __file__, *map(str, command)], stdout=subprocess.PIPE)
    os.sched_setaffinity(process.pid, {processor})
    return process


def overload(seconds: float) -> None:
    own, others = sorted(os.sched_getaffinity(0))[:2]
    with served("soak:create", queue=16, cache=0) as (port, pid):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            os.sched_setaffinity(int(thread.name), {own})
        offered, peak = 0.0, 0.0
        for times in (0, 0, 1, 2, 5, 10):
            clients = beside(others, "offer", port, pid, times * offered, seconds)
            alive = beside(others, "probe", port, seconds)
            found, waits = (json.loads(each.communicate()[0]) for each in (clients, alive))
            good, refused = found["good"], found["refused"]
            offered = offered if times else len(good) / seconds
            own_time = max(found["service"], 0.01)
            rate = len(good) / seconds / own_time
            peak = max(peak, rate)
            print(
                f"{f'offered {times}x' if times else 'four that wait'}: good {len(good) / seconds:.1f}/s, "
                f"{rate:.1f} in a second of the service's processor ({rate / peak:.0%} of the most), "
                f"p99 {share(good, 0.99):.0f} ms; refused {len(refused) / seconds:.1f}/s, "
                f"median {share(refused, 0.5):.1f}, p99 {share(refused, 0.99):.1f} ms; unsent {found['unsent']}; "
                f"/livez p99 {share(waits, 0.99):.1f} ms; busy {own_time:.0%}, clients {found['clients']:.0%}",
                flush=True,
            )


def main(arguments: Sequence[str]) -> None:
    match arguments:
        case ["probe", port, seconds]:
            print(json.dumps(probe(int(port), float(seconds))))
        case ["offer", port, pid, rate, seconds]:
            print(json.dumps(offer(int(port), int(pid), float(rate), float(seconds))))
        case [*given]:
            overload(float(given[0]) if given else 6.0)


if __name__ == "__main__":
    main(sys.argv[1:])
