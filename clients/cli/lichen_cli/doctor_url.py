"""`lichen doctor --url`: whether a running service can be reached, lets us in, is ready, and computes what this machine
computes from the same image."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx2
import numpy as np

import lichen
from lichen.files import decode, encode
from lichen.image import Image
from lichen_cli.doctor import Check

AREA = "service"
SECONDS = 30.0
OPERATION = "gaussian"
PARAMETERS = {"sigma": "1.5", "device": "numpy", "method": "fir"}


def examine(url: str, key: str | None) -> Iterator[Check]:
    headers = {"Authorization": f"Bearer {key}"} if key else {}
    with httpx2.Client(base_url=url.rstrip("/"), headers=headers, timeout=SECONDS) as client:
        alive = _tried("answers", lambda: _expect(client.get("/livez")))
        yield alive
        if not alive.works:
            return
        yield _tried("is ready", lambda: _expect(client.get("/readyz")))
        yield _tried("lets us in", lambda: _expect(client.get("/v1/limits")))
        yield _tried("its version", lambda: _version(client))
        yield _tried("computes what we compute", lambda: _computed(client))
        yield _tried("says what is wrong", lambda: _problem(client))
        yield _tried("counts", lambda: _figures(client))


def _tried(name: str, what: Callable[[], str]) -> Check:
    began = time.perf_counter()
    try:
        said = what()
    except (AssertionError, httpx2.HTTPError, ValueError, KeyError) as wrong:
        return Check(AREA, name, False, str(wrong) or type(wrong).__name__)
    return Check(AREA, name, True, f"{said}{', ' if said else ''}{1e3 * (time.perf_counter() - began):.0f} ms")


def _expect(response: httpx2.Response, status: int = 200) -> str:
    if response.status_code != status:
        problem = response.headers.get("x-problem-code", "")
        raise ValueError(f"{response.request.url.path} was answered with {response.status_code} {problem}".strip())
    return ""


def _version(client: httpx2.Client) -> str:
    response = client.get("/v1/version")
    _expect(response)
    found = response.json()
    device = found["opencl"].get("device") or "NumPy alone"
    ours = "" if found["lichen"] == lichen.__version__ else f" (here {lichen.__version__})"
    return f"{found['lichen']}{ours} on {device}"


def _computed(client: httpx2.Client) -> str:
    """A tiny image goes there and is computed here too; both must be the same to the last bit."""
    ramp = Image(np.linspace(0, 1, 32 * 24 * 3, dtype=np.float32).reshape(24, 32, 3))
    body = bytes(encode(ramp, "npy").data)
    query = {**PARAMETERS, "format": "npy", "storage": "float32"}
    headers = {"Content-Type": "application/x-npy"}
    response = client.post(f"/v1/operations/{OPERATION}", params=query, content=body, headers=headers)
    _expect(response)
    there = decode(response.content).pixels
    here = lichen.run(OPERATION, ramp, sigma=1.5, method="fir", device="numpy", storage="float32").image.pixels
    if not np.array_equal(there, here):
        raise ValueError(f"differs from this machine by up to {np.abs(there - here).max():.3g}")
    return f"{OPERATION}, the same to the last bit"


def _problem(client: httpx2.Client) -> str:
    response = client.post(f"/v1/operations/{OPERATION}", params={"nonsense": "1"}, content=b"")
    _expect(response, 422)
    document: dict[str, Any] = json.loads(response.content)
    return f"{len(document['errors'])} flaws at once"


def _figures(client: httpx2.Client) -> str:
    response = client.get("/metrics")
    _expect(response)
    if "lichen_requests_total" not in response.text:
        raise ValueError("/metrics holds no figures of ours")
    return f"{sum(not line.startswith('#') for line in response.text.splitlines())} figures"
