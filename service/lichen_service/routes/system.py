"""Paths about the service itself: alive, ready, versions, limits and the OpenAPI document."""

from __future__ import annotations

import hashlib
import platform
import re
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import lichen
import lichen_service
from lichen import catalogue
from lichen.opencl.device import default_device, status
from lichen_service.descriptions import limits_of
from lichen_service.documents import Shelf, canonical, momentary
from lichen_service.http.message import Head, Request, Response
from lichen_service.readiness import Readiness
from lichen_service.refusals import RETRY_AFTER, Refusal
from lichen_service.settings import Settings

ALIVE, READY = "/livez", "/readyz"
CODE = frozenset((".py", ".cl", ".clh", ".json"))
LIBRARIES = ("numpy", "pyopencl", "opencv-python-headless", "OpenImageIO", "pydantic", "h11")


class System:
    def __init__(self, settings: Settings, readiness: Readiness, shelf: Shelf) -> None:
        self._settings = settings
        self._readiness = readiness
        self._shelf = shelf

    def alive(self, request: Request, name: str) -> Response:
        """The process answers; nothing else is said."""
        return momentary(200, {"status": "alive"})

    def at_once(self, head: Head) -> Response | None:
        """What the loop itself can say of `/livez` and `/readyz`; None where the canary has to be asked first."""
        if head.method not in ("GET", "HEAD"):
            return None
        if head.path == ALIVE:
            answer = momentary(200, {"status": "alive"})
            answer.lasting = True
            return answer
        return momentary(200, {"status": "ready"}) if head.path == READY and self._readiness.fresh else None

    def ready(self, request: Request, name: str) -> Response:
        """A tiny image has just gone through a real operation; else a 503 that says why not."""
        reason = self._readiness.reason()
        if reason is None:
            return momentary(200, {"status": "ready"})
        raise Refusal(
            503,
            "not-ready",
            "The service is not ready",
            f"Requests should go elsewhere: {reason}.",
            headers={"Retry-After": RETRY_AFTER},
            retryable=True,
        )

    def version(self, request: Request, name: str) -> Response:
        return self._shelf.answer(request.head, lambda: canonical({**versions(), "build": _build()}))

    def limits(self, request: Request, name: str) -> Response:
        return self._shelf.answer(request.head, lambda: canonical(limits_of(self._settings)))

    def openapi(self, request: Request, name: str) -> Response:
        return self._shelf.answer(request.head, _openapi)


@cache
def _openapi() -> bytes:
    from lichen_service.openapi import openapi

    return canonical(openapi(catalogue.operations()))


@cache
def versions() -> dict[str, Any]:
    """Versions of what computes: the engine, the device, the libraries and Python."""
    device = default_device()
    return {
        "lichen": lichen.__version__,
        "python": platform.python_version(),
        "libraries": {name: _version_of(name) for name in LIBRARIES},
        "opencl": {"available": False, "reason": status().reason}
        if device is None
        else {"available": True, "device": device.name, "runtime": device.runtime},
    }


def _build() -> str:
    """A digest of all code and tables that are installed, which takes a tenth of a second: where it is equal, so is
    what is computed, by equal libraries on equal devices."""
    found = hashlib.sha256()
    for package in (lichen, lichen_service):
        root = Path(str(package.__file__)).parent
        for path in sorted(each for each in root.rglob("*") if each.suffix in CODE):
            found.update(f"{path.relative_to(root)}\0".encode())
            found.update(path.read_bytes())
    return found.hexdigest()[:16]


def _version_of(name: str) -> str | None:
    """As `importlib.metadata.version`, without reading the description of the package as a message, line by line."""
    try:
        found = re.search(r"^Version: (.+)$", distribution(name).read_text("METADATA") or "", re.MULTILINE)
    except PackageNotFoundError:
        return None
    return found and found[1]
