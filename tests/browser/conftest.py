"""A service in a process of its own, and Debian's Chromium to look at it with."""

from __future__ import annotations

import contextlib
import http.client
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, expect, sync_playwright

START = 120.0
"""Seconds the service may take to be ready; generous, since only a hang should fail here."""
PATIENCE = 30_000
"""Milliseconds an element may take to appear, for the same reason."""
expect.set_options(timeout=PATIENCE)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


class Service:
    """The service as a process, which can be killed and started again where it was."""

    def __init__(self) -> None:
        self._data = tempfile.mkdtemp(prefix="lichen-browser-")
        self.port = 0
        self.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        wanted = {"port": self.port, "workers": 1, "decoders": 1}
        flags = [text for name, value in wanted.items() for text in (f"--{name}", str(value))]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "lichen_service", *flags],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | {"LICHEN_DATA": self._data},
            start_new_session=True,
        )
        assert self._process.stdout is not None
        announced = re.search(r"http://127\.0\.0\.1:(\d+)", self._process.stdout.readline())
        assert announced, "the service did not start"
        self.port = int(announced[1])
        ends = time.monotonic() + START
        while not self._ready():
            assert time.monotonic() < ends, "the service did not become ready"
            time.sleep(0.05)

    def kill(self) -> None:
        """As a power cut would: supervisor, workers and decoders at once."""
        mine = {self._process.pid, *descendants(self._process.pid)}
        for pid in mine:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def end(self) -> None:
        self.kill()
        shutil.rmtree(self._data, ignore_errors=True)

    def _ready(self) -> bool:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10)
        try:
            connection.request("GET", "/readyz")
            return connection.getresponse().status == 200
        except OSError:
            return False
        finally:
            connection.close()


def descendants(pid: int) -> set[int]:
    """Processes that a process has started, and those that they have."""
    found: set[int] = set()
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(status.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if parent == pid:
            child = int(status.parent.name)
            found |= {child} | descendants(child)
    return found


@dataclass
class Visit:
    """A page in a window of its own, with what it said and asked."""

    page: Page
    url: str
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.set_default_timeout(PATIENCE)
        self.page.on("console", self._hear)
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", self._note)

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            self.said.append(message.text)

    def _note(self, request: Request) -> None:
        self.asked.append(request.url)

    def open(self, place: str = "#/try/gaussian") -> Page:
        self.page.goto(f"{self.url}/{place}")
        return self.page

    def settled(self) -> Page:
        """When a result and its plan are there."""
        self.page.wait_for_selector(".account code")
        self.page.wait_for_selector(".plot-point.in-use")
        self.page.wait_for_selector(".stage-box:not(.busy)")
        return self.page


@pytest.fixture(scope="session")
def service() -> Iterator[Service]:
    running = Service()
    yield running
    running.end()


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip("there is no Chromium here; make develop installs it where it may")
    with sync_playwright() as playwright:
        # Its sandbox wants rights of an ordinary user's session, which containers do not give; it opens our page alone.
        launched = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield launched
        launched.close()


@pytest.fixture
def visit(service: Service, browser: Browser) -> Iterator[Callable[..., Visit]]:
    """`visit(width, height, **options)` opens a window; all of them close with the test."""
    contexts = []

    def start(width: int = 1280, height: int = 800, **options: object) -> Visit:
        contexts.append(browser.new_context(viewport={"width": width, "height": height}, **options))  # type: ignore[arg-type]
        return Visit(contexts[-1].new_page(), service.url)

    yield start
    for each in contexts:
        each.close()
