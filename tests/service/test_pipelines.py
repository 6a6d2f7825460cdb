"""Pipelines through the routes: pictures in, several results out, and every flaw by node and field."""

from __future__ import annotations

import dataclasses
import json
import threading
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from email.message import Message
from email.parser import BytesParser
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

import lichen
from lichen import execution
from lichen.files import decode, encode
from lichen.image import Image
from lichen.sharing import Sharing
from lichen_service.app import Service
from lichen_service.documents import content_digest
from lichen_service.http.message import Response
from lichen_service.settings import Settings

from .conftest import Caller, form, picture, pointers, problem_of, read_json

PATH = "/v1/pipelines"
CHAIN = "gaussian:sigma=2|levels:black=0.1,white=0.9"
GRAPH: Mapping[str, Any] = {
    "nodes": {
        "blur": {"operation": "gaussian", "parameters": {"sigma": 2}},
        "sharp": {
            "operation": "mix",
            "parameters": {"amount": 1.5},
            "inputs": {"image": "input.image", "base": "blur"},
        },
    },
    "outputs": {"soft": {"node": "blur", "format": "npy"}, "sharp": {"node": "sharp", "format": "png"}},
}


def target(pipeline: str, **options: str) -> str:
    return f"{PATH}?pipeline={quote(pipeline)}" + "".join(f"&{name}={quote(text)}" for name, text in options.items())


def parts(response: Response) -> dict[str, Message]:
    """The parts of a multipart/mixed body by the outputs they are, or by type."""
    head = f"Content-Type: {response.headers['Content-Type']}\r\n\r\n".encode()
    whole = BytesParser().parsebytes(head + bytes(response.body))
    found = whole.get_payload()
    assert isinstance(found, list)
    return {each["Lichen-Output"] or each.get_content_type(): each for each in found}


def content(part: Message) -> bytes:
    data = part.get_payload(decode=True)
    assert isinstance(data, bytes)
    return data


@pytest.mark.parametrize("method", ["POST", "QUERY"])
def test_a_chain_is_what_the_library_makes(call: Caller, png: bytes, method: str) -> None:
    response = call(method, target(CHAIN, device="numpy"), png)
    assert response.status == 200, bytes(response.body)
    assert response.headers["Content-Type"] == "image/png"
    expected = lichen.run_pipeline(CHAIN, decode(png), device="numpy", storage="uint8")["result"]
    assert bytes(response.body) == bytes(encode(expected.image, "png").data)
    assert response.headers["Content-Digest"] == content_digest(response.body)
    assert "gaussian=" in response.headers["Lichen-Method"]


def test_a_single_operation_gives_the_same_bytes_on_both_paths(call: Caller, png: bytes) -> None:
    alone = call("POST", "/v1/operations/gaussian?sigma=2", png)
    piped = call("POST", target("gaussian:sigma=2"), png)
    assert bytes(alone.body) == bytes(piped.body)
    assert alone.headers["Lichen-Error"] == piped.headers["Lichen-Error"]


def test_several_outputs_are_parts_with_an_account_of_their_own(call: Caller, png: bytes) -> None:
    body, headers = form({"pipeline": (json.dumps(GRAPH).encode(), "application/json"), "image": (png, "image/png")})
    response = call("POST", PATH, body, headers)
    assert response.status == 200, bytes(response.body)
    assert response.headers["Content-Type"].startswith("multipart/mixed")
    found = parts(response)
    assert list(found) == ["soft", "sharp"]
    assert found["soft"].get_content_type() == "application/x-npy"
    assert found["sharp"].get_filename() == "sharp.png"
    for part in found.values():
        assert float(part["Lichen-Error"].split(";")[0]) > 0
    expected = lichen.run_pipeline(GRAPH, decode(png))
    made = decode(content(found["soft"])).pixels  # stored as the picture that came
    np.testing.assert_allclose(made, expected["soft"].image.pixels, atol=0.51 / 255)
    assert response.headers["Lichen-Device"] in ("opencl", "numpy")
    assert "Lichen-Error" not in response.headers


def test_a_pipeline_without_pictures_of_its_own_is_a_body(call: Caller) -> None:
    document = json.dumps({"nodes": {"a": {"operation": "levels", "inputs": {"image": "input.image"}}}}).encode()
    for content_type in ("application/json", "application/x-www-form-urlencoded"):
        problem = problem_of(call("POST", PATH, document, {"content-type": content_type}), 422, "invalid-request")
        assert pointers(problem) == {"/inputs/image"}


def test_explaining_computes_nothing(call: Caller, png: bytes) -> None:
    plan = read_json(call("POST", target("gaussian:sigma=2|levels:black=0,white=1", explain="true"), png))
    assert [node["operation"] for node in plan["nodes"]] == ["transfer", "gaussian", "transfer"]
    assert plan["outputs"]["result"]["format"] == "png"
    assert plan["peak_bytes"] > 0
    two = {"nodes": {"a": {"operation": "levels"}}, "outputs": {name: {"node": "a"} for name in ("one", "two")}}
    asked = target(json.dumps(two), explain="true")
    assert set(read_json(call("POST", asked, png, {"accept": "application/json"}))["outputs"]) == {"one", "two"}
    dropped = [each for each in plan["decisions"] if each["pass"] == "identity"]
    assert [each["node"] for each in dropped] == ["levels"]
    assert dropped[0]["saved_ms"] > 0


def test_dropped_work_is_named(call: Caller, png: bytes) -> None:
    skipped = call("POST", target("levels|gaussian:sigma=1"), png).headers["Lichen-Skipped"]
    assert skipped.startswith('identity;node="levels";reason="')
    assert "Lichen-Skipped" not in call("POST", target("levels|gaussian:sigma=1", prune="false"), png).headers


def test_every_flaw_of_query_pipeline_and_pictures_is_named(call: Caller, png: bytes) -> None:
    bad = target(
        "a=gausian|b=gaussian:sigma=-1|mix:base=input.other", max_error="-1", method="fir", wish="1", format="gif"
    )
    problem = problem_of(call("POST", bad, png), 422, "invalid-request")
    assert pointers(problem) == {
        "/nodes/a/operation",
        "/nodes/b/parameters/sigma",
        "/query/max_error",
        "/query/method",
        "/query/wish",
        "/query/format",
    }
    problem = problem_of(call("POST", target("mix:base=input.other"), b"no picture"), 422, "invalid-request")
    assert pointers(problem) == {"/inputs/other", "/inputs/image"}
    spoilt = json.dumps({**GRAPH, "outputs": {"x": {"node": "blur", "format": "gif", "space": "red"}}})
    problem = problem_of(call("POST", target(spoilt), png), 422, "invalid-request")
    assert pointers(problem) == {"/outputs/x/format", "/outputs/x/space"}


def test_what_does_not_fit_together_points_at_the_node(call: Caller) -> None:
    grey = bytes(encode(picture(channels=1), "png").data)
    problem = problem_of(call("POST", target("gaussian:sigma=1|saturation"), grey), 422, "invalid-request")
    assert pointers(problem) == {"/nodes/saturation/inputs/image"}


@pytest.mark.parametrize("query", ["", "?pipeline="])
def test_a_pipeline_is_required(call: Caller, png: bytes, query: str) -> None:
    assert pointers(problem_of(call("POST", PATH + query, png), 422, "invalid-request"))


def test_parts_that_nothing_reads_are_refused(call: Caller, png: bytes) -> None:
    body, headers = form({"image": png, "other": png})
    problem = problem_of(call("POST", target("levels:gamma=2"), body, headers), 422, "invalid-request")
    assert pointers(problem) == {"/inputs/other"}
    body, headers = form({"pipeline": b"levels", "image": png})
    problem = problem_of(call("POST", target("levels"), body, headers), 422, "invalid-request")
    assert pointers(problem) == {"/query/pipeline"}


def test_several_outputs_need_a_body_of_parts(call: Caller, png: bytes) -> None:
    response = call("POST", target(json.dumps(GRAPH)), png, {"accept": "image/png"})
    problem_of(response, 406, "not-acceptable")
    assert call("POST", target(json.dumps(GRAPH)), png, {"accept": "multipart/*"}).status == 200


def test_unchanged_results_are_not_computed_again(call: Caller, png: bytes) -> None:
    first = call("POST", target(CHAIN), png)
    again = call("POST", target(CHAIN), png, {"if-none-match": first.headers["ETag"]})
    assert (again.status, bytes(again.body)) == (304, b"")
    other = call("POST", target(CHAIN + "|levels:gamma=1.1"), png, {"if-none-match": first.headers["ETag"]})
    assert other.status == 200


def test_an_answer_is_kept_for_whoever_asks_the_same(settings: Settings) -> None:
    keeping = dataclasses.replace(settings, cache=1 << 20)
    call = Caller(Service(keeping), keeping)
    picture_ = Image(np.random.default_rng(99).random((40, 40, 3), dtype=np.float32))
    body = bytes(encode(picture_, "npy").data)
    for path in (target("gaussian:sigma=3|levels:gamma=1.3"), "/v1/operations/gaussian?sigma=3.25"):
        first, second = (call("POST", path, body) for _ in range(2))
        assert (first.log["kept"], second.log["kept"]) == (False, True)
        assert bytes(first.body) == bytes(second.body)
        differing = {"Server-Timing"}
        assert {k: v for k, v in first.headers.items() if k not in differing} == {
            k: v for k, v in second.headers.items() if k not in differing
        }
        assert "kernel" in first.headers["Server-Timing"]
        assert "kernel" not in second.headers["Server-Timing"]


def test_a_plan_beyond_the_memory_allowed_is_refused(call: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lichen_service.routes.pipelines.wishes_of", lambda options, settings: {"max_bytes": 1000})
    problem = problem_of(call("POST", target(CHAIN), png), 413, "too-large")
    assert problem["limit"] == 1000 < problem["actual"]


def test_options_are_told_of_json(call: Caller) -> None:
    headers = call("OPTIONS", PATH).headers
    assert headers["Allow"] == "OPTIONS, POST, QUERY"
    assert "application/json" in headers["Accept-Query"]
    assert call("POST", "/v1/operations/gaussian?sigma=1", b"{}", {"content-type": "application/json"}).status == 415


def test_requests_in_flight_do_a_common_step_once(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second arrives while the first is in the blur; each answers as it would alone."""
    keeping = dataclasses.replace(settings, cache=1 << 20)
    call = Caller(Service(keeping), keeping)
    body = bytes(encode(Image(np.random.default_rng(98).random((40, 40, 3), dtype=np.float32)), "npy").data)
    blur = "gaussian:sigma=3.5,method=fir,tail=1e-4"
    texts = [f"{blur}|median:size=3", f"{blur}|levels:gamma=1.4"]
    expected = [bytes(call("POST", target(each, device="numpy", verify="true"), body).body) for each in texts]
    by_method, done, two = execution.by_method, [], threading.Event()

    def noted(node: Any, *rest: Any) -> Any:
        done.append(node.operation.name)
        if node.operation.name == "gaussian":
            assert two.wait(60)
        return by_method(node, *rest)

    monkeypatch.setattr(execution, "by_method", noted)
    of = Sharing.of

    def asked(self: Sharing, step: str, compute: Any) -> Any:
        if "gaussian" in done:
            threading.Timer(0.05, two.set).start()
        return of(self, step, compute)

    monkeypatch.setattr(Sharing, "of", asked)
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(call, "POST", target(texts[0], device="numpy"), body)
        while "gaussian" not in done:
            time.sleep(0.001)
        second = pool.submit(call, "POST", target(texts[1], device="numpy"), body)
        answers = [bytes(each.result(60).body) for each in (first, second)]
    assert answers == expected
    assert done.count("gaussian") == 1


@pytest.mark.parametrize("path", ["/v1/pipelines", "/v1/scenes"])
@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ('{"nodes": {}, "nodes": {}}', "twice"),
        ('{"nodes": NaN}', "NaN"),
        ('{"camera": {"width": 1e999}}', "double"),
        ('{"seed": 9007199254740993}', "2^53"),
        ('{"a":' * 65 + "1" + "}" * 65, "64 deep"),
        (" " * 100 + '{"a": 1, "a": 2}', "twice"),
    ],
)
def test_documents_that_could_be_read_differently_are_refused(call: Caller, path: str, said: str, reason: str) -> None:
    name = path.removeprefix("/v1/").rstrip("s")
    in_the_body = call("POST", path, said.encode(), {"content-type": "application/json"})
    in_the_query = call("POST", path, query=[(name, said)])
    for response in (in_the_body, in_the_query):
        flaws = problem_of(response, 422, "invalid-request")["errors"]
        assert any(each["pointer"] == f"/{name}" and reason in each["detail"] for each in flaws), flaws


def test_a_document_without_end_is_refused_unparsed(call: Caller) -> None:
    body = b'{"nodes":' + b" " * (8 << 20) + b"{}}"
    large = dataclasses.replace(call.settings, max_body=16 << 20)
    service = Service(large)
    response = Caller(service, large)("POST", "/v1/pipelines", body, {"content-type": "application/json"})
    assert problem_of(response, 413, "too-large")["limit"] == 8 << 20
