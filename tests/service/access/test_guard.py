"""The door: who is let in, who is not and how that is said, before a byte of a body is read."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lichen_service.access import keys, signing
from lichen_service.access.keys import Keys, SigningKey
from lichen_service.access.reach import must_not_listen
from lichen_service.app import Service
from lichen_service.http.message import Head
from lichen_service.settings import Settings

from ..conftest import Caller, problem_of

RUN = "/v1/operations/gaussian?sigma=1"
SIGNER = SigningKey("aaaaaaaa", "a secret")


@pytest.fixture
def guarded(tmp_path: Path, settings: Settings) -> tuple[Caller, str, str]:
    """A service with keys, a token for everything, and one for jobs alone."""
    known, _, token = Keys(signing=(SIGNER,)).add()
    known, _, other = known.add(("jobs",))
    chosen = replace(settings, data=str(tmp_path))
    keys.write(chosen.key_file, known)
    return Caller(Service(chosen), chosen), token, other


def bearer(token: str) -> dict[str, str]:
    return {"authorization": f"Bearer {token}"}


def test_a_key_opens_and_nothing_else_does(guarded: tuple[Caller, str, str], png: bytes) -> None:
    call, token, _ = guarded
    assert call("POST", RUN, png, bearer(token)).status == 200
    assert call("GET", "/v1/operations", headers=bearer(token)).status == 200
    for headers in ({}, bearer(token[:-2]), bearer(""), {"authorization": f"Basic {token}"}, {"authorization": token}):
        for method, target in (("POST", RUN), ("GET", "/v1/limits"), ("GET", "/nowhere"), ("OPTIONS", "/v1/limits")):
            response = call(method, target, png if method == "POST" else b"", headers)
            problem_of(response, 401, "unauthorized")
            assert response.headers["WWW-Authenticate"].startswith('Bearer realm="lichen"')
            assert call.admitted[-1] is False
    assert 'error="invalid_token"' in call("GET", "/v1/limits", headers=bearer("x")).headers["WWW-Authenticate"]
    assert "error=" not in call("GET", "/v1/limits").headers["WWW-Authenticate"]


def test_what_is_looked_up_is_looked_up_for_those_alone_who_may_know(guarded: tuple[Caller, str, str]) -> None:
    call, token, _ = guarded
    for _ in range(3):
        known = call("GET", "/v1/limits", headers=bearer(token))
        assert (known.status, known.lasting) == (200, False)
        assert known.log["key"]
        problem_of(call("GET", "/v1/limits"), 401, "unauthorized")
    assert call.admitted.count(True) == 1
    assert call("GET", "/livez").lasting


@pytest.mark.parametrize("chosen", [{"rate": 60.0}, {"trusted_proxies": "127.0.0.1"}])
def test_where_it_matters_who_asks_no_answer_is_for_everybody(
    tmp_path: Path, settings: Settings, chosen: dict[str, Any]
) -> None:
    strict = replace(settings, data=str(tmp_path), **chosen)
    call = Caller(Service(strict), strict)
    call("GET", "/v1/limits")
    assert (call("GET", "/v1/limits").lasting, call.admitted) == (False, [True, False])


def test_probes_need_no_key(guarded: tuple[Caller, str, str]) -> None:
    call, _, _ = guarded
    assert call("GET", "/livez").status == 200
    assert call("GET", "/readyz").status == 503  # this service was not warmed up, and says so to everybody


def test_the_page_needs_no_key_and_what_it_asks_does(guarded: tuple[Caller, str, str]) -> None:
    call, _, _ = guarded
    for target in ("/", "/studio/main.js", "/studio/lib/api.js", "/studio/showcase.json", "/studio/cases/all.json"):
        assert call("GET", target).status == 200
    problem_of(call("GET", "/v1/operations"), 401, "unauthorized")


def test_a_key_is_good_for_its_scopes_only(guarded: tuple[Caller, str, str], png: bytes) -> None:
    call, _, other = guarded
    assert call("GET", "/v1/limits", headers=bearer(other)).status == 200
    response = call("POST", RUN, png, bearer(other))
    assert "'run'" in problem_of(response, 403, "forbidden")["detail"]
    assert 'error="insufficient_scope", scope="run"' in response.headers["WWW-Authenticate"]


def test_a_signed_address_lets_images_be_read(guarded: tuple[Caller, str, str], png: bytes) -> None:
    call, _, _ = guarded
    until = int(time.time()) + 60
    target = signing.sign("/v1/operations/gaussian", SIGNER, until)
    assert call("GET", target).status == 200
    assert call("HEAD", target).status == 200
    problem_of(call("GET", target[:-1] + ("A" if target[-1] != "A" else "B")), 403, "bad-signature")
    problem_of(call("GET", signing.sign("/v1/operations/gaussian", SIGNER, 1)), 403, "bad-signature")
    problem_of(call("POST", signing.sign(RUN, SIGNER, until), png), 403, "bad-signature")


def test_the_signature_is_no_parameter_of_the_operation(guarded: tuple[Caller, str, str]) -> None:
    call, _, _ = guarded
    target = signing.sign("/v1/accuracy/gaussian?size=256", SIGNER, int(time.time()) + 60)
    assert call("GET", target).status == 200


def test_open_doors_take_a_signed_address_too(call: Caller) -> None:
    assert call("GET", signing.sign("/v1/accuracy/gaussian", SIGNER, 1)).status == 200


def test_a_rate_is_held_and_told(tmp_path: Path, settings: Settings) -> None:
    chosen = replace(settings, data=str(tmp_path), rate=1.0, burst=2)
    call = Caller(Service(chosen), chosen)
    first = call("GET", "/v1/limits")
    assert first.headers["RateLimit-Policy"] == '"requests";q=2;w=120'
    assert first.headers["RateLimit"].startswith('"requests";r=1;t=')
    assert call("GET", "/v1/limits").status == 200
    refused = call("GET", "/v1/limits")
    assert problem_of(refused, 429, "rate-exceeded")["retryable"] is True
    assert 1 <= int(refused.headers["Retry-After"]) <= 60
    assert call("GET", "/v1/limits", peer="198.51.100.1").status == 200
    assert call("GET", "/livez").status == 200


def test_pages_of_other_origins_read_nothing_unless_named(tmp_path: Path, settings: Settings, call: Caller) -> None:
    asking = {"origin": "https://page.example", "access-control-request-method": "POST"}
    assert not [name for name in call("OPTIONS", RUN, headers=asking).headers if name.startswith("Access-Control")]
    known, _, token = Keys().add()
    chosen = replace(settings, data=str(tmp_path), cors_origins="https://page.example, https://other.example")
    keys.write(chosen.key_file, known)
    guarded = Caller(Service(chosen), chosen)
    preflight = guarded("OPTIONS", RUN, headers=asking)
    assert preflight.status == 204
    assert preflight.headers["Access-Control-Allow-Origin"] == "https://page.example"
    assert "POST" in preflight.headers["Access-Control-Allow-Methods"]
    assert "Authorization" in preflight.headers["Access-Control-Allow-Headers"]
    for headers in (bearer(token), {}):
        answer = guarded("GET", "/v1/limits", headers={**headers, "origin": "https://page.example"})
        assert answer.headers["Access-Control-Allow-Origin"] == "https://page.example"
        assert "Origin" in answer.headers["Vary"]
    stranger = guarded("GET", "/v1/limits", headers={**bearer(token), "origin": "https://stranger.example"})
    assert "Access-Control-Allow-Origin" not in stranger.headers
    assert "Origin" in stranger.headers["Vary"]
    assert guarded("OPTIONS", RUN, headers={**asking, "origin": "https://stranger.example"}).status == 401


def test_what_the_log_learns_of_the_caller(tmp_path: Path, settings: Settings) -> None:
    known, key, token = Keys().add()
    chosen = replace(settings, data=str(tmp_path), trusted_proxies="127.0.0.1")
    keys.write(chosen.key_file, known)
    call = Caller(Service(chosen), chosen)
    response = call("GET", "/v1/limits", headers={**bearer(token), "x-forwarded-for": "198.51.100.4"})
    assert response.log == {"client": "198.51.100.4", "key": key.id, "route": "/v1/limits"}


@pytest.mark.parametrize(
    ("host", "insecure", "with_keys", "listens"),
    [
        ("127.0.0.1", "off", False, True),
        ("::1", "off", False, True),
        ("localhost", "off", False, True),
        ("unix:socket", "off", False, True),
        ("0.0.0.0", "off", False, False),
        ("", "off", False, False),
        ("::", "off", False, False),
        ("0.0.0.0", "on", False, True),
        ("0.0.0.0", "off", True, True),
    ],
)
def test_nobody_listens_to_other_machines_without_keys(
    tmp_path: Path, host: str, insecure: str, with_keys: bool, listens: bool
) -> None:
    settings = Settings(host=host, insecure=insecure, data=str(tmp_path))
    if with_keys:
        keys.write(settings.key_file, Keys().add()[0])
    assert (must_not_listen(settings) is None) is listens


def test_figures_are_not_told_to_other_machines_without_keys(tmp_path: Path) -> None:
    said = {metrics: must_not_listen(Settings(metrics=metrics, data=str(tmp_path))) for metrics in (":9", "[::1]:9")}
    assert "every interface" in str(said[":9"])
    assert said["[::1]:9"] is None


def test_the_process_says_why_it_does_not_listen(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "lichen_service", "--host", "0.0.0.0", "--port", "0", "--data", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert ended.returncode == 2
    assert "lichen keys add" in ended.stderr
    assert "--insecure" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_keys_stay_needed_when_their_file_has_gone(guarded: tuple[Caller, str, str]) -> None:
    call, token, _ = guarded
    call.settings.key_file.unlink()
    problem_of(call("GET", "/v1/limits", headers=bearer(token)), 401, "unauthorized")


def test_the_door_comes_before_the_body(guarded: tuple[Caller, str, str]) -> None:
    call, _, _ = guarded
    now = time.monotonic()
    head = Head(
        "POST", "/v1/operations/gaussian", (), {"content-length": "999999999999"}, "test-request", now, now + 60
    )
    problem_of(call.service.admit(head), 401, "unauthorized")  # type: ignore[arg-type]
