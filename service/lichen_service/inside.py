"""The service without a socket: the same routes, engine and answers for callers in this process.

What a request would get over the wire it gets here, byte for byte: documents, problems and accounts included. Nobody is
asked for a key, nothing is kept for later, images are decoded here, and nothing is measured in the background.
"""

from __future__ import annotations

import logging
import math
import tempfile
import time
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any
from urllib.parse import parse_qsl, unquote

from lichen_service.app import Service
from lichen_service.http.message import Body, Head, Request, Response
from lichen_service.settings import Settings

LARGEST_SIDE = 1 << 20


class Inside:
    """A service of this process. Safe to use from any thread; `close` removes what it stored."""

    def __init__(self, *, memory: int | None = None, settings: Settings | None = None) -> None:
        """`memory` is how many bytes the images of one request may take together; None: half of what there is. With
        `settings`, a service's, requests are held to its limits, and images decoded in a process of their own."""
        logging.getLogger("lichen").setLevel(logging.WARNING)
        self._folder = tempfile.TemporaryDirectory(prefix="lichen-inside-")
        own: dict[str, Any] = {"data": self._folder.name, "cache": 0, "jobs": "off", "workers": 1, "calibrate": "off"}
        if settings is not None:
            alone: dict[str, Any] = {"decoders": min(settings.decoders, 1), "assets": "", "traces": "off"}
            self._service = Service(replace(settings, **own, **alone))
            return
        room: dict[str, Any] = {} if memory is None else {"memory": max(memory, 1 << 20)}
        unlimited = Settings(
            decoders=0,
            max_body=1 << 40,
            max_pixels=1 << 40,
            max_side=LARGEST_SIDE,
            max_decoded=1 << 40,
            max_images=1024,
            **own,
            **room,
        )
        self._service = Service(unlimited)

    def ask(
        self, method: str, target: str, headers: Mapping[str, str], body: Body, seconds: float
    ) -> tuple[int, dict[str, str], Body]:
        """Status, headers (lower-case names) and body of the answer, of which no stage begins after so many seconds."""
        path, _, query = target.partition("?")
        given = {name.lower(): value for name, value in headers.items()}
        now = time.monotonic()
        head = Head(
            method,
            unquote(path),
            tuple(parse_qsl(query, keep_blank_values=True)),
            {**given, "content-length": str(len(body))},
            uuid.uuid4().hex,
            now,
            now + (seconds if math.isfinite(seconds) else 1e9),
        )
        answer = self.respond(Request(head, body))
        lower = {name.lower(): value for name, value in answer.headers.items()}
        return answer.status, lower | {"x-request-id": head.request_id}, answer.body

    def respond(self, request: Request, images: Iterable[Body] = ()) -> Response:
        """The answer to a request, which may name these images as stored ones."""
        for each in images:
            self._service.assets.put(each)
        return self._service.handle(request)

    def close(self) -> None:
        self._folder.cleanup()


def open_inside(**options: Any) -> Inside:
    """For callers that find this module by its name."""
    return Inside(**options)
