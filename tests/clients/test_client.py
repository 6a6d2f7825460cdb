"""Both clients against a server that says exactly what a test scripts."""

from __future__ import annotations

import asyncio
import email
import email.policy
import io
import json
import socket
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from enum import Enum
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import numpy as np
import pytest

import lichen_client
from lichen_client import (
    AsyncClient,
    BadRequest,
    Client,
    Conflict,
    ConnectionFailed,
    Forbidden,
    NotFound,
    RateLimited,
    Result,
    Retries,
    ServerError,
    StatusError,
    TimedOut,
    TooLarge,
    Unauthorized,
    Unavailable,
    Unprocessable,
)
from lichen_client.errors import Flaw, status_error

NPY = ("Content-Type", "application/x-npy")
QUICK = Retries(first=0.001)
Call = Callable[..., Any]


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


@pytest.fixture(params=["blocking", "through httpx2", "asynchronous"])
def call(request: pytest.FixtureRequest, server: Any, monkeypatch: pytest.MonkeyPatch) -> Call:
    """call(method, *arguments, options={}, **values): one call of a fresh client of either kind."""
    if request.param == "through httpx2":  # as where the address asks for more than plain sockets
        monkeypatch.setattr("lichen_client.client.direct", lambda url: False)

    def blocking(method: str, *arguments: Any, options: dict[str, Any] | None = None, **values: Any) -> Any:
        with Client(server.url, **{"retries": QUICK, **(options or {})}) as client:
            return getattr(client, method)(*arguments, **values)

    def asynchronous(method: str, *arguments: Any, options: dict[str, Any] | None = None, **values: Any) -> Any:
        async def once() -> Any:
            async with AsyncClient(server.url, **{"retries": QUICK, **(options or {})}) as client:
                return await getattr(client, method)(*arguments, **values)

        return asyncio.run(once())

    return asynchronous if request.param == "asynchronous" else blocking


# -------------------------------------------------------------------------------------------------------- the package


def test_importing_the_package_imports_neither_numpy_nor_an_http_library() -> None:
    heavy = ("numpy", "httpx2", "asyncio", "ssl", "lichen", "lichen_service")
    code = f"import sys, lichen_client; print([name for name in {heavy} if name in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout.strip() == b"[]"


def test_every_public_name_exists() -> None:
    assert all(getattr(lichen_client, name) is not None for name in lichen_client.__all__)
    with pytest.raises(AttributeError, match="Klient"):
        lichen_client.Klient  # noqa: B018


@pytest.mark.parametrize("url", ["127.0.0.1:8080", "ftp://host", "http://", "http://host/?a=1", "http://host/#x"])
def test_an_address_that_is_none_is_refused_at_once(url: str) -> None:
    with pytest.raises(ValueError, match="address"):
        Client(url)


def test_the_address_comes_from_the_environment(server: Any, answer: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    server.script = [answer(body=b"{}")]
    monkeypatch.setenv("LICHEN_URL", server.url + "/lichen/")
    with Client() as client:
        client.version()
    assert server.received[0].target == "/lichen/v1/version"


def test_a_timeout_must_be_positive() -> None:
    with pytest.raises(ValueError, match="timeout"):
        Client(timeout=0)


# ------------------------------------------------------------------------------------------------------- the request


def test_an_array_travels_bit_for_bit_in_both_directions(call: Call, server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], echo=True)]
    array = np.random.default_rng(1).normal(size=(5, 7, 3)).astype(np.float32)
    array[0, 0] = [np.nan, np.inf, -0.0]
    for sent in (array, array.astype(np.float64), array.astype(">f4"), np.asfortranarray(array), array[::2, ::-1]):
        result = call("run", "gaussian", sent, sigma=2.5)
        assert result.array.dtype == sent.dtype
        np.testing.assert_array_equal(result.array.view(np.uint8), np.ascontiguousarray(sent).view(np.uint8))
    request = server.received[0]
    assert request.method == "QUERY"
    assert request.headers["content-type"] == "application/x-npy"
    assert request.headers["user-agent"] == f"lichen-client/{lichen_client.__version__}"
    assert urlsplit(request.target).path == "/v1/operations/gaussian"
    assert parse_qsl(urlsplit(request.target).query) == [("sigma", "2.5"), ("format", "npy")]


def test_a_result_array_is_writable_and_shares_the_memory_that_was_received(server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], body=npy(np.zeros((2, 3, 1), np.float32)))]
    with Client(server.url) as client:
        result = client.run("gaussian", np.zeros((2, 3)))
    result.array[:] = 1.0
    np.testing.assert_array_equal(np.load(io.BytesIO(result.content)), np.ones((2, 3, 1)))


def test_bytes_and_paths_travel_as_they_are(call: Call, server: Any, answer: Any, tmp_path: Path) -> None:
    server.script = [answer(headers=[("Content-Type", "image/png")], echo=True)]
    path = tmp_path / "photo.png"
    path.write_bytes(b"\x89PNG anything")
    for image in (b"\x89PNG anything", bytearray(b"\x89PNG anything"), path, str(path)):
        assert call("run", "gaussian", image, format="png").content == b"\x89PNG anything"
    assert {request.headers["content-type"] for request in server.received} == {"application/octet-stream"}
    assert server.received[0].target == "/v1/operations/gaussian?format=png"


def test_further_images_make_a_form_named_after_the_inputs(call: Call, server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], body=npy(np.zeros((1, 1))))]
    field, texture = np.zeros((2, 2, 2), np.float32), b"\x89PNG texture"
    call("run", "lic", field, texture=texture, length=20)
    request = server.received[0]
    head = f"Content-Type: {request.headers['content-type']}\r\n\r\n".encode()
    form = email.message_from_bytes(head + request.body, policy=email.policy.HTTP)
    parts = {
        str(part.get_param("name", header="content-disposition")): (
            part.get_content_type(),
            part.get_payload(decode=True),
        )
        for part in form.iter_parts()
    }
    assert parts == {
        "image": ("application/x-npy", npy(field)),
        "texture": ("application/octet-stream", texture),
    }
    assert parse_qsl(urlsplit(request.target).query) == [("length", "20"), ("format", "npy")]


def test_a_lone_named_image_still_goes_under_its_name(server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], body=npy(np.zeros((1, 1))))]
    with Client(server.url) as client:
        client.run("lic", texture=np.zeros((2, 2)))
        client.run("lic", image=np.zeros((2, 2)))
        with pytest.raises(TypeError, match="given twice"):
            client.run("lic", np.zeros((2, 2)), image=np.zeros((2, 2)))
    assert b'name="texture"' in server.received[0].body
    assert server.received[1].headers["content-type"] == "application/x-npy"


class Curve(Enum):
    SRGB = "srgb"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (5, "5"),
        (0.1, "0.1"),
        (1e-300, "1e-300"),
        (float("nan"), "nan"),
        (True, "true"),
        (False, "false"),
        ("a&b=c d/é", "a&b=c d/é"),
        (Curve.SRGB, "srgb"),
        (np.float32(0.5), "0.5"),
        (np.int64(-3), "-3"),
        (np.bool_(True), "true"),
        (np.array([1.0, 2.5]), "[1.0,2.5]"),
        ((1, 2.5), "[1,2.5]"),
        ([[1, 0], [0, np.float64(1)]], "[[1,0],[0,1.0]]"),
        ({"a": np.int8(1)}, '{"a":1}'),
    ],
)
def test_parameters_become_query_text(value: object, text: str, server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], body=npy(np.zeros((1, 1))))]
    with Client(server.url) as client:
        client.run("x/y", None, value=value, absent=None)
    split = urlsplit(server.received[0].target)
    assert split.path == "/v1/operations/x%2Fy"
    assert parse_qsl(split.query) == [("value", text), ("format", "npy")]


def test_a_parameter_of_no_use_is_refused_before_anything_is_sent(server: Any) -> None:
    with Client(server.url) as client, pytest.raises(TypeError, match="not object"):
        client.run("gaussian", b"", sigma=object())
    with Client(server.url) as client, pytest.raises(ValueError, match="Python objects"):
        client.run("gaussian", np.array([[object()]]))
    with Client(server.url) as client, pytest.raises(FileNotFoundError):
        client.run("gaussian", "/nonexistent/photo.png")
    assert server.received == []


def test_documents_are_fetched_and_plans_asked_for(call: Call, server: Any, answer: Any) -> None:
    server.script = [answer(body=b'{"a": 1}')]
    for method, *arguments in (("operations",), ("operation", "a b"), ("version",), ("explain", "gaussian", b"x")):
        assert call(method, *arguments) == {"a": 1}
    assert [(request.method, request.target) for request in server.received] == [
        ("GET", "/v1/operations"),
        ("GET", "/v1/operations/a%20b"),
        ("GET", "/v1/version"),
        ("QUERY", "/v1/operations/gaussian?format=npy&explain=true"),
    ]


# -------------------------------------------------------------------------------------------------------- the result


def test_the_report_is_read_from_the_header_fields(call: Call, server: Any, answer: Any) -> None:
    headers = [
        NPY,
        ("Server-Timing", 'queue;dur=0.5, decode;desc="PNG";dur=1.25, cache, total;dur="2000"'),
        ("Lichen-Method", "fir"),
        ("Lichen-Device", "opencl"),
        ("Lichen-Error", "1.2e-5; bound; max"),
        ("Lichen-Measured", "1.1e-6; measured; max; sampled=0.25; p999=9e-7; rms=2e-7; mismatched=1"),
        ("Lichen-Skipped", "identity: 1"),
        ("Lichen-Nonfinite", "3"),
        ("ETag", '"abc"'),
        ("X-Request-ID", "r1"),
    ]
    server.script = [answer(headers=headers, body=npy(np.zeros((1, 1), np.float32)))]
    report = call("run", "gaussian", b"x").report
    assert (report.method, report.device, report.skipped) == ("fir", "opencl", "identity: 1")
    assert (report.error.value, report.error.kind, report.error.metric) == (1.2e-5, "bound", "max")
    assert report.measured == lichen_client.Measured(1.1e-6, 9e-7, 2e-7, 1, 0.25)
    assert report.timing == {"queue": 0.0005, "decode": 0.00125, "total": 2.0}
    assert (report.nonfinite, report.etag, report.request_id) == (3, '"abc"', "r1")


def test_a_report_without_or_with_garbled_fields_is_empty() -> None:
    for garbled in ({}, {"lichen-error": "?", "lichen-nonfinite": "-", "server-timing": "a;dur=x,,;"}):
        report = lichen_client.Report.read(garbled)
        assert (report.error, report.measured, report.nonfinite, report.timing) == (None, None, None, {})
    measured = lichen_client.Report.read(
        {"lichen-measured": "0.1; measured; max; sampled=1; p999=0; rms=0; mismatched=0; codes=3; ciede2000=0.5"}
    ).measured
    assert measured == lichen_client.Measured(0.1, 0, 0, 0, 1, 3, 0.5)
    for unmeasured in ('none; reason="it would take about 9 s"', "1; measured; max; sampled=x", "?"):
        assert lichen_client.Report.read({"lichen-measured": unmeasured}).measured is None


def test_an_encoded_result_has_bytes_and_no_array(server: Any, answer: Any, tmp_path: Path) -> None:
    server.script = [answer(headers=[("Content-Type", "image/png; x=1")], body=b"\x89PNG")]
    with Client(server.url) as client:
        result = client.run("gaussian", b"x", format="png")
    with pytest.raises(ValueError, match="leave out `format`"):
        result.array  # noqa: B018
    result.save(tmp_path / "out.png")
    result.save(tmp_path / "out.bin")
    assert (tmp_path / "out.png").read_bytes() == (tmp_path / "out.bin").read_bytes() == b"\x89PNG"
    with pytest.raises(ValueError, match="format='jpg'"):
        result.save(tmp_path / "out.jpg")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.bin", "out.png"]


def test_a_failed_save_leaves_what_was_there(tmp_path: Path) -> None:
    result = Result("image/png", lichen_client.Report.read({}), bytearray(b"new"))
    (tmp_path / "out.png").mkdir()
    with pytest.raises(OSError, match=r"out\.png"):
        result.save(tmp_path / "out.png")
    assert [path.name for path in tmp_path.iterdir()] == ["out.png"]


@pytest.mark.parametrize("body", [b"", b"\x93NUMPY", b"not npy", npy(np.zeros(4))[:-1], npy(np.zeros(3))[:70]])
def test_a_body_that_is_no_array_is_an_error_of_the_call(body: bytes, server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], body=body)]
    with Client(server.url) as client, pytest.raises(ConnectionFailed, match="no readable array"):
        client.run("gaussian", b"x")


def test_pickled_arrays_are_never_read(server: Any, answer: Any) -> None:
    file = io.BytesIO()
    np.save(file, np.array([{}]), allow_pickle=True)
    server.script = [answer(headers=[NPY], body=file.getvalue())]
    with Client(server.url) as client, pytest.raises(ConnectionFailed, match="no readable array"):
        client.run("gaussian", b"x")


# -------------------------------------------------------------------------------------------------------- the errors


@pytest.mark.parametrize(
    ("status", "kind"),
    [
        (400, BadRequest),
        (401, Unauthorized),
        (403, Forbidden),
        (404, NotFound),
        (409, Conflict),
        (405, StatusError),
        (413, TooLarge),
        (422, Unprocessable),
        (429, RateLimited),
        (500, ServerError),
        (503, Unavailable),
        (504, ServerError),
        (301, StatusError),
    ],
)
def test_a_problem_document_becomes_a_typed_error(
    status: int, kind: type[StatusError], call: Call, server: Any, answer: Any
) -> None:
    problem = {
        "status": status,
        "code": "too-large",
        "title": "A limit on size was crossed",
        "detail": "The image has 9 pixels.",
        "errors": [{"pointer": "/inputs/image", "detail": "is too large"}, {"pointer": "/parameters/sigma"}, 7],
        "request_id": "r9",
        "retryable": True,
        "limit": 4,
        "actual": 9,
    }
    headers = [("Content-Type", "application/problem+json"), ("Retry-After", "3")]
    server.script = [answer(status, headers, json.dumps(problem).encode())]
    with pytest.raises(StatusError) as raised:
        call("run", "gaussian", b"x", options={"retries": 0})
    error = raised.value
    assert type(error) is kind
    assert (error.status, error.code, error.title) == (status, "too-large", "A limit on size was crossed")
    assert error.errors == (Flaw("/inputs/image", "is too large"), Flaw("/parameters/sigma", ""))
    assert (error.request_id, error.retryable, error.limit, error.actual, error.retry_after) == ("r9", True, 4, 9, 3.0)
    assert str(error) == (
        f"{status} too-large: The image has 9 pixels. /inputs/image: is too large; /parameters/sigma:  (request r9)"
    )


def test_an_answer_of_something_else_on_the_way_is_told_by_its_beginning(server: Any, answer: Any) -> None:
    server.script = [answer(502, [("Content-Type", "text/html"), ("X-Request-ID", "p1")], b"<h1>Bad\n gateway</h1>")]
    with Client(server.url, retries=0) as client, pytest.raises(ServerError) as raised:
        client.version()
    assert str(raised.value) == "502: <h1>Bad gateway</h1> (request p1)"


@pytest.mark.parametrize(
    "body", [b"", b"[]", b"{", b"\xff", b"[" * 100_000, b'{"errors": 3, "limit": "x", "code": null}']
)
def test_a_broken_problem_document_does_not_mask_the_status(body: bytes) -> None:
    error = status_error(422, {"content-type": "application/problem+json"}, body)
    assert (type(error), error.code, error.errors, error.limit) == (Unprocessable, "", (), None)


@pytest.mark.parametrize("body", [b"<html>", b"[1]"])
def test_a_document_that_is_no_object_is_an_error(body: bytes, server: Any, answer: Any) -> None:
    server.script = [answer(body=body)]
    with Client(server.url) as client, pytest.raises(ConnectionFailed, match="JSON"):
        client.operations()


# ------------------------------------------------------------------------------------------------- trying again


@pytest.mark.parametrize("status", [408, 429, 502, 503, 504])
def test_passing_refusals_are_tried_again_with_the_same_request(
    status: int, call: Call, server: Any, answer: Any
) -> None:
    server.script = [answer(status), answer(status, [("Retry-After", "0")]), answer(headers=[NPY], echo=True)]
    image = np.arange(12.0).reshape(3, 4, 1)
    np.testing.assert_array_equal(call("run", "gaussian", image, sigma=1).array, image)
    assert len(server.received) == 3
    assert {(request.method, request.target, request.body) for request in server.received} == {
        ("QUERY", "/v1/operations/gaussian?sigma=1&format=npy", npy(image))
    }


def test_forms_are_sent_again_whole(call: Call, server: Any, answer: Any) -> None:
    server.script = [answer(503), answer(headers=[NPY], body=npy(np.zeros((1, 1))))]
    call("run", "lic", np.zeros((2, 2, 2)), texture=np.ones((2, 2)))
    first, second = server.received
    assert len(first.body) == len(second.body)
    assert b"NUMPY" in second.body


def test_a_refusal_that_stays_is_raised_after_three_tries(call: Call, server: Any, answer: Any) -> None:
    server.script = [answer(503)]
    with pytest.raises(Unavailable):
        call("run", "gaussian", b"x")
    assert len(server.received) == 3


def test_a_long_retry_after_is_left_to_the_caller(call: Call, server: Any, answer: Any) -> None:
    server.script = [answer(429, [("Retry-After", "121")]), answer(body=b"{}")]
    with pytest.raises(RateLimited) as raised:
        call("version", options={"timeout": 1000.0})
    assert (raised.value.retry_after, len(server.received)) == (121.0, 1)


def test_a_wrong_request_is_sent_once(call: Call, server: Any, answer: Any) -> None:
    server.script = [answer(422)]
    with pytest.raises(Unprocessable):
        call("run", "gaussian", b"x")
    assert len(server.received) == 1


def test_a_truncated_answer_is_asked_for_again(call: Call, server: Any, answer: Any) -> None:
    whole = npy(np.ones((4, 4, 1), np.float32))
    server.script = [answer(headers=[NPY], body=whole, cut=len(whole) - 1), answer(headers=[NPY], body=whole)]
    np.testing.assert_array_equal(call("run", "gaussian", b"x").array, np.ones((4, 4, 1)))
    assert len(server.received) == 2


def test_an_answer_that_stays_truncated_is_a_failed_connection(call: Call, server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], body=b"12345678", cut=3)]
    with pytest.raises(ConnectionFailed, match="3 tries"):
        call("run", "gaussian", b"x")
    assert len(server.received) == 3


def test_a_server_that_hangs_up_is_called_again(call: Call, server: Any, answer: Any) -> None:
    server.script = [answer(hang_up=True), answer(body=b'{"a": 1}')]
    assert call("version") == {"a": 1}


def test_nobody_listening_is_a_failed_connection_that_names_the_address() -> None:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{bound.getsockname()[1]}"
        with Client(url, retries=QUICK) as client, pytest.raises(ConnectionFailed, match=f"{url}.*3 tries") as raised:
            client.version()
    assert not isinstance(raised.value, TimedOut)


@pytest.mark.parametrize(
    "script", [{"delay": 5.0}, {"body": b"0123456789" * 20, "pause": 0.05}], ids=["silent", "slow"]
)
def test_a_server_that_takes_too_long_is_given_up_once_the_time_is_used(
    script: dict[str, Any], call: Call, server: Any, answer: Any
) -> None:
    server.script = [answer(**script)]
    with pytest.raises(TimedOut, match=r"1 try, 0\.3 s allowed"):
        call("version", options={"timeout": 0.3})
    assert len(server.received) == 1


# ------------------------------------------------------------------------------------------------------ many at once


def test_one_client_serves_many_threads(server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], echo=True)]

    def once(number: int) -> bool:
        image = np.full((9, 9, 3), number, np.float32)
        return bool((client.run("gaussian", image, sigma=number).array == number).all())

    with Client(server.url, connections=4) as client, ThreadPoolExecutor(8) as pool:
        assert all(pool.map(once, range(48)))
    assert len(server.received) == 48
    assert server.connections <= 4


def test_one_asynchronous_client_serves_many_tasks(server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], echo=True)]

    async def many() -> list[bool]:
        async with AsyncClient(server.url, connections=4) as client:

            async def once(number: int) -> bool:
                result = await client.run("gaussian", np.full((3, 3, 1), number, np.float32))
                return bool((result.array == number).all())

            return await asyncio.gather(*(once(number) for number in range(32)))

    assert all(asyncio.run(many()))
    assert server.connections <= 4


def test_a_refused_call_leaves_its_connection_usable(server: Any, answer: Any) -> None:
    server.script = [answer(422, body=b"no"), answer(body=b"{}")]
    with Client(server.url) as client:
        with pytest.raises(Unprocessable):
            client.version()
        client.version()
    assert server.connections == 1
