"""The canonical address of a run: one for all spellings, and good for the same bytes."""

from __future__ import annotations

import re

import pytest

from .conftest import Caller, read_json

BLUR = "/v1/operations/gaussian"


def canonical(call: Caller, target: str) -> str:
    response = call("GET", target)
    assert response.status == 200, bytes(response.body)
    found = re.fullmatch(r'<([^>]+)>; rel="canonical"', response.headers["Link"])
    assert found
    return found[1]


@pytest.mark.parametrize(
    "spelling",
    [
        "sigma=3&device=numpy&image={}",
        "image={}&device=numpy&sigma=3.0",
        "device=numpy&sigma=%2b3e0&image={}&explain=false",
        "prune=true&sigma=3.000&image={}&device=numpy",
    ],
)
def test_every_spelling_has_the_same(call: Caller, png: bytes, spelling: str) -> None:
    name = read_json(call("PUT", "/v1/assets", png))["id"]
    assert canonical(call, f"{BLUR}?{spelling.format(name)}") == f"{BLUR}?device=numpy&image={name}&sigma=3"


@pytest.mark.parametrize(
    "target",
    [
        "/v1/operations/white_noise?width=9&height=7&seed=4&device=numpy&format=npy&storage=float32",
        "/v1/operations/perlin_noise?width=16&height=16&cell=%5B4.50,4%5D&device=numpy",
    ],
)
def test_it_is_its_own_and_gives_the_same_bytes(call: Caller, target: str) -> None:
    address = canonical(call, target)
    assert canonical(call, address) == address
    given, again = call("GET", target), call("GET", address)
    assert (given.headers["ETag"], bytes(given.body)) == (again.headers["ETag"], bytes(again.body))


def test_what_needs_a_body_has_none(call: Caller, png: bytes) -> None:
    assert "Link" not in call("POST", f"{BLUR}?sigma=2&device=numpy", png).headers
