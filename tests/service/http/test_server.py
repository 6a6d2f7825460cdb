"""The supervisor and its workers as real processes."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from wire_harness import PATIENCE, Client, get, post

from lichen_service.http.address import bind

MAIN = """
import sys
from lichen_service.http import server
from wire_harness import WireConfig
server.SPARE_AFTER = server.LASTING = 0.0
status = server.serve(sys.argv[1], WireConfig(**eval(sys.argv[2])))
heavy = {"lichen", "numpy", "pyopencl"} & set(sys.modules)
print("imported", sorted(heavy), flush=True)
sys.exit(status)
"""


class Service:
    def __init__(self, errors: Path, maker: str, settings: dict[str, object]) -> None:
        here = str(Path(__file__).parent)
        path = os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH")]))
        self.errors = errors
        with errors.open("wb") as stderr:
            self.process = subprocess.Popen(
                [sys.executable, "-c", MAIN, maker, repr(settings)],
                stdout=subprocess.PIPE,
                stderr=stderr,
                env={**os.environ, "PYTHONPATH": path},
                text=True,
            )
        self.port = self.apart = 0

    def line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def listen(self) -> None:
        said = self.line()
        assert said.startswith("Lichen listens on http://127.0.0.1:"), self.errors.read_text()
        self.port, *apart = map(int, re.findall(r":(\d+)\b", said))
        self.apart = apart[0] if apart else 0

    def pid(self) -> int:
        """Of the worker that answers; waits for one where there is none."""
        end = time.monotonic() + PATIENCE
        while True:
            try:
                with Client(self.port) as client:
                    client.send(get())
                    return int(str(client.reply().document()["pid"]))
            except ConnectionError:
                assert time.monotonic() < end
                time.sleep(0.02)

    def workers(self, count: int) -> set[int]:
        """Processes of all workers, once there are so many."""
        end = time.monotonic() + PATIENCE
        while True:
            found = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
            if len(found) == count:
                return set(map(int, found))
            assert time.monotonic() < end
            time.sleep(0.01)

    def wait(self) -> int:
        return self.process.wait(PATIENCE)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Service]]:
    services: list[Service] = []

    def begin(maker: str = "wire_harness:create", **settings: object) -> Service:
        service = Service(tmp_path / f"errors-{len(services)}", maker, settings)
        services.append(service)
        return service

    yield begin
    for service in services:
        if service.process.poll() is None:
            service.process.kill()
        service.process.wait(PATIENCE)
        if service.process.stdout is not None:
            service.process.stdout.close()


def until_said(service: Service, text: str) -> str:
    end = time.monotonic() + PATIENCE
    while text not in (said := service.errors.read_text()):
        assert time.monotonic() < end, said
        time.sleep(0.01)
    return said


def until_gone(pid: int) -> None:
    """Dead with all its threads, before which nobody can be told of it."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            dead = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
            if dead and len(os.listdir(f"/proc/{pid}/task")) == 1:
                return
        except FileNotFoundError:
            return
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_socket_in_the_file_system(tmp_path: Path) -> None:
    path = tmp_path / "socket"
    with bind(f"unix:{path}", 0) as listener:
        assert stat.S_IMODE(path.stat().st_mode) == 0o660
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(path))
        with pytest.raises(OSError, match="in use"):
            bind(f"unix:{path}", 0)
        assert listener.family == socket.AF_UNIX
    with bind(f"unix:{path}", 0), socket.socket(socket.AF_UNIX) as client:  # nobody listened there any more
        client.connect(str(path))


def test_connections_wait_while_nobody_accepts() -> None:
    with bind("127.0.0.1", 0) as listener, contextlib.ExitStack() as stack:
        for _ in range(300):
            stack.enter_context(socket.create_connection(listener.getsockname(), timeout=PATIENCE))


def test_sigterm_drains_what_is_in_flight(start: Callable[..., Service]) -> None:
    service = start()
    service.listen()
    with Client(service.port) as client:
        client.send(get("/sleep?seconds=0.5"))
        with Client(service.port) as other:  # the loop has gone round: the request before has been begun
            other.send(get())
            other.reply()
        service.process.send_signal(signal.SIGTERM)
        reply = client.reply()
    assert (reply.status, reply.headers["connection"]) == (200, "close")
    assert service.line() == "imported []", "the supervisor must stay light"
    assert service.wait() == 0
    lines = [json.loads(line) for line in service.errors.read_text().splitlines()]
    assert [line["path"] for line in lines] == ["/", "/sleep"]


def test_a_second_signal_forces_the_end(start: Callable[..., Service]) -> None:
    service = start()
    service.listen()
    with Client(service.port) as client:
        client.send(get("/sleep?seconds=60"))
        worker = service.pid()
        service.process.send_signal(signal.SIGINT)
        assert client.socket.fileno() >= 0
        time.sleep(0.1)
        service.process.send_signal(signal.SIGINT)
        assert service.wait() == 1
    until_gone(worker)


def test_connections_are_shared_out_among_workers(start: Callable[..., Service]) -> None:
    service = start("wire_harness:create_courteous", workers=2)
    service.listen()
    end = time.monotonic() + PATIENCE
    with contextlib.ExitStack() as open:

        def connected() -> Client:
            return open.enter_context(Client(service.port))

        def asked(client: Client) -> int:
            client.send(get())
            return int(str(client.reply().document()["pid"]))

        first = asked(connected())
        while (second := asked(connected())) == first:  # the other one may still start
            assert time.monotonic() < end
            time.sleep(0.05)
        for _ in range(4):  # they may be even by chance
            open.close()
            time.sleep(0.5)  # until they have seen that
            pids = [asked(each) for each in [connected() for _ in range(12)]]
            assert min(pids.count(first), pids.count(second)) >= 5


def test_a_worker_that_dies_is_replaced(start: Callable[..., Service]) -> None:
    service = start(workers=2)
    service.listen()
    first = service.pid()
    os.kill(first, signal.SIGKILL)
    until_said(service, f"lost worker {first}")
    with Client(service.port) as client:
        client.send(get("/die"))  # takes the other, if that one accepted it, or the replacement
        with pytest.raises(ConnectionError):
            client.reply()
    assert service.pid() != first
    service.process.send_signal(signal.SIGTERM)
    assert service.wait() == 0


def test_a_worker_that_died_before_the_end_is_no_failure_of_it(start: Callable[..., Service]) -> None:
    service = start()
    service.listen()
    worker = service.pid()
    service.process.send_signal(signal.SIGSTOP)  # it sees both at once
    os.kill(worker, signal.SIGKILL)
    until_gone(worker)
    service.process.send_signal(signal.SIGTERM)
    service.process.send_signal(signal.SIGCONT)
    assert service.wait() == 0
    assert f"lost worker {worker}" in service.errors.read_text()


def test_a_spare_worker_stands_in_and_gets_a_successor(start: Callable[..., Service]) -> None:
    service = start(spare="on")
    service.listen()
    first = service.pid()
    (spare,) = service.workers(2) - {first}
    os.kill(first, signal.SIGKILL)
    until_said(service, f"lost worker {first}")
    assert service.pid() == spare
    (successor,) = service.workers(2) - {spare}
    os.kill(successor, signal.SIGKILL)
    until_gone(successor)
    (another,) = service.workers(2) - {spare}
    assert service.pid() == spare
    assert f"lost worker {successor}" not in service.errors.read_text(), "it served nobody"
    service.process.kill()
    until_gone(spare)
    until_gone(another)


def test_a_spare_worker_is_no_hindrance_to_the_end(start: Callable[..., Service]) -> None:
    service = start(spare="on")
    service.listen()
    service.workers(2)
    service.process.send_signal(signal.SIGTERM)
    assert service.wait() == 0


def test_a_worker_that_shows_no_life_is_killed_and_replaced(start: Callable[..., Service]) -> None:
    service = start(silence=1.0)
    service.listen()
    first = service.pid()
    with Client(service.port) as client:
        client.send(get("/stuck"))
        until_said(service, f"kills worker {first}")
        with pytest.raises(ConnectionError):
            client.reply()
    second = service.pid()
    assert second != first
    time.sleep(1.5)  # longer than it may be silent
    assert service.pid() == second
    assert service.errors.read_text().count("kills worker") == 1


def test_a_worker_that_holds_too_much_is_renewed_and_nothing_it_was_asked_is_lost(
    start: Callable[..., Service],
) -> None:
    service = start(silence=0.5, worker_memory=120_000_000)
    service.listen()
    first = service.pid()
    with Client(service.port) as client, Client(service.port) as other:
        client.send(get("/sleep?seconds=3"))
        other.send(get("/grow?bytes=200000000"))
        assert other.reply().status == 200
        until_said(service, f"renews worker {first}")
        reply = client.reply()
    assert (reply.status, reply.headers["connection"]) == (200, "close")
    until_gone(first)
    assert service.pid() != first
    assert "lost worker" not in service.errors.read_text()


def test_a_worker_that_has_answered_enough_is_renewed_and_nothing_it_was_asked_is_lost(
    start: Callable[..., Service],
) -> None:
    service = start(silence=0.5, worker_requests=20)
    service.listen()
    first = service.pid()
    with Client(service.port) as client, Client(service.port) as other:
        for _ in range(15):
            other.send(get())
            assert other.reply().status == 200
        time.sleep(0.5)
        assert "renews" not in service.errors.read_text()
        client.send(get("/sleep?seconds=3"))
        for _ in range(10):
            other.send(get())
            assert other.reply().status == 200
        until_said(service, f"renews worker {first}: it has answered")
        reply = client.reply()
    assert (reply.status, reply.headers["connection"]) == (200, "close")
    until_gone(first)
    assert service.pid() != first
    assert "lost worker" not in service.errors.read_text()


def test_figures_have_an_address_that_answers_when_every_place_is_taken(start: Callable[..., Service]) -> None:
    service = start(metrics="127.0.0.1:0", threads=1, queue=0)
    service.listen()
    with Client(service.port) as client, Client(service.port) as other, Client(service.apart) as figures:
        client.send(get("/sleep?seconds=1.5"))
        other.send(get())
        assert other.reply().status == 503
        for _ in range(3):
            figures.send(get())
            reply = figures.reply()
            assert (reply.status, reply.document()["apart"]) == (200, True)
        service.process.send_signal(signal.SIGTERM)
        assert client.reply().document()["apart"] is False
    assert service.wait() == 0


def test_workers_end_with_their_supervisor(start: Callable[..., Service]) -> None:
    service = start()
    service.listen()
    worker = service.pid()
    service.process.kill()
    until_gone(worker)


def test_an_application_that_cannot_be_made_ends_the_service(start: Callable[..., Service]) -> None:
    service = start("wire_harness:create_nothing")
    assert service.wait() == 1
    said = service.errors.read_text()
    assert "no application" in said
    assert "Lichen cannot start" in said


def test_an_address_in_use_is_said_plainly(start: Callable[..., Service]) -> None:
    first = start()
    first.listen()
    second = start(port=first.port)
    assert second.wait() == 1
    assert f"cannot listen on 127.0.0.1:{first.port}" in second.errors.read_text()


def test_sigusr1_shows_where_the_threads_are(start: Callable[..., Service]) -> None:
    service = start()
    service.listen()
    service.pid()  # the loop goes round
    service.process.send_signal(signal.SIGUSR1)
    said = until_said(service, "reactor.py")
    assert "Thread 0x" in said
    with Client(service.port) as client:
        client.send(post("/echo", b"alive"))
        assert client.reply().body == b"alive"
