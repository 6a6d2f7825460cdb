"""What tests of the routes share: the service without a socket, requests in one line, and small images."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any
from urllib.parse import parse_qsl

import numpy as np
import pytest

from lichen import catalogue
from lichen.files import encode
from lichen.image import Alpha, Image, Space, Storage
from lichen_service import logs, readiness
from lichen_service.app import Service
from lichen_service.http.message import Head, Request, Response
from lichen_service.meanings import MEANINGS
from lichen_service.settings import Settings


@dataclass
class Caller:
    """Sends requests straight to a service, as the wire would: admission first, then the body."""

    service: Service
    settings: Settings
    admitted: list[bool] = field(default_factory=list)

    def __call__(
        self,
        method: str,
        target: str,
        body: bytes = b"",
        headers: Mapping[str, str] | None = None,
        *,
        seconds: float | None = None,
        query: Sequence[tuple[str, str]] | None = None,
        peer: str = "127.0.0.1",
    ) -> Response:
        path, _, text = target.partition("?")
        now = time.monotonic()
        head = Head(
            method,
            path,
            tuple(parse_qsl(text, keep_blank_values=True) if query is None else query),
            {"content-length": str(len(body)), **(headers or {})},
            "test-request",
            now,
            now + (self.settings.request_timeout if seconds is None else seconds),
            peer,
        )
        admission = self.service.admit(head)
        self.admitted.append(not isinstance(admission, Response))
        return (
            admission if isinstance(admission, Response) else self.service.handle(Request(head, body, admission.caller))
        )


def read_json(response: Response) -> Any:
    """The body as JSON. Anything a strict parser refuses fails, NaN included."""

    def refuse(constant: str) -> Any:
        raise AssertionError(f"JSON holds {constant}")

    return json.loads(bytes(response.body), parse_constant=refuse)


def problem_of(response: Response, status: int, code: str) -> dict[str, Any]:
    """The problem document of a refusal, after checking that it is whole."""
    assert response.status == status, bytes(response.body)
    assert response.headers["Content-Type"] == "application/problem+json"
    assert response.headers["X-Problem-Code"] == code
    document = read_json(response)
    assert document["status"] == status
    assert document["code"] == code
    assert document["type"] == f"/problems/{code}"
    assert code in MEANINGS
    assert document["request_id"] == "test-request"
    assert document["title"]
    assert document["detail"]
    assert isinstance(document, dict)
    return document


def pointers(document: Mapping[str, Any]) -> set[str]:
    return {each["pointer"] for each in document.get("errors", ())}


def picture(height: int = 12, width: int = 16, channels: int = 3, storage: Storage = Storage.UINT8) -> Image:
    """A picture without symmetry, in [0, 1]; with coverage where the channel count allows it."""
    generator = np.random.default_rng(7)
    pixels = generator.integers(0, 256, (height, width, channels)) / np.float32(255)
    return Image(pixels.astype(np.float32), Space.SRGB, Alpha.STRAIGHT if channels in (2, 4) else Alpha.NONE, storage)


def form(parts: Mapping[str, bytes | tuple[bytes, str]], boundary: str = "edge") -> tuple[bytes, dict[str, str]]:
    """A multipart/form-data body of files and the headers that go with it."""
    body = b""
    for name, part in parts.items():
        data, media_type = part if isinstance(part, tuple) else (part, "application/octet-stream")
        body += (
            f'--{boundary}\r\nContent-Disposition: form-data; name="{name}"; filename="{name}.bin"\r\n'
            f"Content-Type: {media_type}\r\n\r\n"
        ).encode()
        body += data + b"\r\n"
    return body + f"--{boundary}--\r\n".encode(), {"content-type": f"multipart/form-data; boundary={boundary}"}


@pytest.fixture(scope="session")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    data = str(tmp_path_factory.mktemp("data"))
    limits = {"max_body": 4 << 20, "max_pixels": 1 << 20, "max_side": 4096, "max_channels": 8, "max_images": 4}
    return Settings(data=data, decoders=0, cache=0, **limits)  # decoders and the cache have tests of their own


@pytest.fixture(scope="session")
def service(settings: Settings) -> Service:
    """Warm as far as it takes to be ready; the tests themselves run every operation."""
    logs.configure()
    service = Service(settings)
    with pytest.MonkeyPatch.context() as patch:
        whole = readiness.warm_up
        patch.setattr(readiness, "warm_up", lambda: islice(whole(), 1))
        service.readiness.start()
        assert service.readiness.wait(300)
    return service


@pytest.fixture
def call(service: Service, settings: Settings) -> Caller:
    return Caller(service, settings)


@pytest.fixture(scope="session")
def png() -> bytes:
    return bytes(encode(picture(), "png").data)


@pytest.fixture(scope="session")
def operations() -> Mapping[str, Any]:
    return catalogue.operations()
