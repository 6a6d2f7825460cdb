"""Beside the servers that people use, on the jobs that they share: a JPEG of 12 megapixels blurred, made smaller, and
written anew.

thumbor reads the picture from a file, as it is meant to be used; libvips stands behind a handler of a dozen lines of
the standard library's HTTP server, a thread for each connection; the picture is sent to it as it is to Lichen. All
three run at the same time on the same processors, asked in turn, first by one client and then by four, of whom each
has met as many before: what a first rush takes is mostly memory of the system. They are installed into an environment
of their own, which is no part of Lichen.
"""

from __future__ import annotations

import contextlib
import statistics
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import serving
from measuring import available, quick
from parts.requests import HEIGHT, WIDTH, as_image, photo, split
from rivals import environment
from sections import Section, bars, table

from lichen.files import decode, encode
from lichen.image import Storage

TITLE = "Servers"
SMALL = WIDTH // 4
ROUNDS, SECONDS = (1, 0.2) if quick() else (2, 2.5)
CROWD = 4
HANDLER = """
import sys, urllib.parse
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
import pyvips

class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    def log_message(self, *_): pass
    def do_GET(self): self.answer(b"ready")
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        name, _, value = self.path.strip("/").partition("/")
        if name == "thumbnail":
            image = pyvips.Image.thumbnail_buffer(body, int(value))
        else:
            image = pyvips.Image.new_from_buffer(body, "", access="sequential")
            if name == "blur": image = image.gaussblur(float(value))
            if name == "resize": image = image.resize(int(value) / image.width, kernel="lanczos3")
        self.answer(image.jpegsave_buffer(Q=90, subsample_mode="off"))
    def answer(self, data):
        self.send_response(200)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

class Server(ThreadingHTTPServer):
    daemon_threads = True

Server(("127.0.0.1", int(sys.argv[1])), Handler).serve_forever()
"""
Ask = Callable[[serving.Server], serving.Answer]


def jobs(body: bytes) -> dict[str, dict[str, Ask]]:
    """By job and server. thumbor's blur takes a radius and a sigma: three sigmas, which is as far as OpenCV goes."""

    def post(path: str) -> Ask:
        return lambda server: server.ask(path, body, Content_Type="image/jpeg")

    def get(path: str) -> Ask:
        return lambda server: server.ask(path)

    ours = "/v1/operations"
    return {
        "blur, sigma 5": {
            "Lichen": post(f"{ours}/gaussian?sigma=5&format=jpeg"),
            "libvips": post("/blur/5"),
            "thumbor": get("/unsafe/filters:blur(15,5):quality(90)/photo.jpg"),
        },
        f"resize to {SMALL} px": {
            "Lichen": post(f"{ours}/resize?width={SMALL}&method=lanczos3&format=jpeg"),
            "libvips": post(f"/resize/{SMALL}"),
            "libvips, shrink on load": post(f"/thumbnail/{SMALL}"),
            "thumbor": get(f"/unsafe/{SMALL}x0/filters:quality(90)/photo.jpg"),
        },
        "read and write": {
            "Lichen": post(f"{ours}/levels?format=jpeg"),
            "libvips": post("/copy/1"),
            "thumbor": get("/unsafe/filters:quality(90)/photo.jpg"),
        },
    }


@contextlib.contextmanager
def all_servers(programs: Path, folder: Path, tell: Callable[[str], None]) -> Iterator[dict[str, serving.Server]]:
    """Those that start, by name."""
    commands: Mapping[str, tuple[Callable[[int], list[str]], str]] = {
        "libvips": (lambda port: [str(programs / "python"), "-c", HANDLER, str(port)], "/"),
        "thumbor": (
            lambda port: [
                str(programs / "thumbor"), "--ip", "127.0.0.1", "--port", str(port),
                "--conf", str(folder / "thumbor.conf"),
                "--processes", str(len(available())),
            ],
            "/healthcheck",
        ),
    }  # fmt: skip
    settings = {
        "LOADER": "thumbor.loaders.file_loader", "FILE_LOADER_ROOT_PATH": str(folder),
        "STORAGE": "thumbor.storages.no_storage",
        "RESULT_STORAGE": None, "AUTO_WEBP": False, "HTTP_LOADER_VALIDATE_CERTS": False, "ALLOW_UNSAFE_URL": True,
    }  # fmt: skip
    (folder / "thumbor.conf").write_text("\n".join(f"{name} = {value!r}" for name, value in settings.items()))
    with contextlib.ExitStack() as stack:
        running = {"Lichen": stack.enter_context(serving.lichen())}
        for name, (command, ready) in commands.items():
            try:
                running[name] = stack.enter_context(serving.started(name, command, ready, patience=20))
            except (RuntimeError, OSError) as failure:
                tell(f"{name} is not measured: {failure}")
        yield running


def sections(tell: Callable[[str], None]) -> list[Section]:
    pixels = photo()
    body = bytes(encode(as_image(pixels, "jpeg", Storage.UINT8), "jpeg").data)
    programs = environment(tell)
    rows: list[list[Any]] = []
    shown: dict[str, dict[str, dict[str, float]]] = {}
    words: list[str] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "photo.jpg").write_bytes(body)
        with all_servers(programs, folder, tell) as running:
            for job, asks in jobs(body).items():
                figures = measured({who: ask for who, ask in asks.items() if who.partition(",")[0] in running}, running)
                for who, each in figures.items():
                    rows.append([job, who, *(f"{each[key]:.3g}" for key in KEYS), f"{each['apart']:.2g}"])
                    tell(f"{job}, {who}: {each['one']:.0f} ms, {each['rate']:.2f}/s, {each['cpu']:.2f} s")
                shown[job] = {who: {"request": each["one"]} for who, each in figures.items()}
                words.append(verdict(job, figures, split(asks["Lichen"](running["Lichen"]))))
            missing = [who for who in ("libvips", "thumbor") if who not in running]
    told = (
        "Lichen blurs and shrinks in scene-linear light with float32 samples, the others the 8-bit numbers as they are "
        "stored: the last column is mostly that. thumbor stores colour at half resolution."
    )
    text = " ".join(
        [*words, told, *(f"{who} could not be installed or started here: not measured." for who in missing)]
    )
    head = ["job", "server", *KEYS.values(), "RMS to Lichen's, codes"]
    title = f"A JPEG of {WIDTH} x {HEIGHT} pixels, quality 90 there and back"
    flat = {f"{job}, {who}": each for job, by in shown.items() for who, each in by.items()}
    return [table(title, head, rows, text), bars("servers", f"{title}: one client waits", "ms", ["request"], flat)]


KEYS = {
    "one": "one client waits, ms",
    "rate": f"{CROWD} clients, answers a second",
    "cpu": "processor s a request",
    "memory": "peak memory, MiB",
    "size": "answer, MB",
}


def measured(asks: Mapping[str, Ask], running: Mapping[str, serving.Server]) -> dict[str, dict[str, float]]:
    """Rounds in turn: each server is asked by one client and then by several while the others wait."""
    answers, found = {}, {}
    for who, ask in asks.items():
        server = running[who.partition(",")[0]]
        answers[who] = ask(server)
        serving.together(lambda ask=ask, server=server: ask(server), CROWD, SECONDS / 2)
        server.forget()
    alone: dict[str, list[float]] = {who: [] for who in asks}
    crowd: dict[str, list[tuple[float, float]]] = {who: [] for who in asks}
    for _ in range(ROUNDS):
        for who, ask in asks.items():
            server = running[who.partition(",")[0]]
            alone[who] += [ask(server).seconds for _ in range(3)]
            before = server.seconds
            taken, seconds = serving.together(lambda ask=ask, server=server: ask(server), CROWD, SECONDS)
            crowd[who].append((len(taken) / seconds, (server.seconds - before) / len(taken)))
    ours = decode(answers["Lichen"].body).pixels
    for who in asks:
        theirs = decode(answers[who].body).pixels
        same = theirs.shape == ours.shape
        found[who] = {
            "one": statistics.median(alone[who]) * 1e3,
            "rate": statistics.median(rate for rate, _ in crowd[who]),
            "cpu": statistics.median(cpu for _, cpu in crowd[who]),
            "memory": running[who.partition(",")[0]].peak / 2**20,
            "size": len(answers[who].body) / 1e6,
            "apart": float(np.sqrt(np.mean((theirs - ours) ** 2)) * 255) if same else float("nan"),
        }
    return found


def verdict(job: str, figures: Mapping[str, Mapping[str, float]], stages: Mapping[str, float]) -> str:
    """Who is ahead, by answers a second; and where ours goes if it is not us."""
    best = max(figures, key=lambda who: figures[who]["rate"])
    if best == "Lichen":
        second = max((who for who in figures if who != "Lichen"), key=lambda who: figures[who]["rate"], default=None)
        if second is None:
            return f"{job.capitalize()}: nobody to compare with."
        ratio = figures["Lichen"]["rate"] / figures[second]["rate"]
        return f"{job.capitalize()}: Lichen is ahead, {ratio:.2f} times {second}."
    ratio = figures[best]["rate"] / figures["Lichen"]["rate"]
    longest = sorted(stages.items(), key=lambda each: -each[1])[:3]
    where = ", ".join(f"{name} {value:.0f} ms" for name, value in longest)
    return f"{job.capitalize()}: {best} is ahead, {ratio:.2f} times Lichen, whose request goes mostly to {where}."
