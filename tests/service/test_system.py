"""Paths about the service and its catalogue: documents, methods, readiness, and the OpenAPI description of it all."""

from __future__ import annotations

import inspect
import json
import re
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jsonschema_rs
import pytest
from openapi_spec_validator.schemas import schema_v31

import lichen
import lichen.errors
import lichen_service
from lichen.files import FORMATS, encode
from lichen_service.app import Service
from lichen_service.documents import as_query
from lichen_service.meanings import MEANINGS
from lichen_service.queries import RESERVED
from lichen_service.readiness import Readiness, example
from lichen_service.settings import Settings

from .conftest import Caller, form, pointers, problem_of, read_json

OPENAPI = jsonschema_rs.validator_for(json.loads(json.dumps(schema_v31, default=dict)))
"""The specification's own schema of a document, compiled: it takes 0.05 s, where the reference validator takes 10."""
DOCUMENTS = (
    "/v1/operations",
    "/v1/operations/gaussian",
    "/v1/accuracy",
    "/v1/limits",
    "/v1/version",
    "/problems",
    "/openapi.json",
    "/",
)


# ------------------------------------------------------------------------------------------------------ documents


@pytest.mark.parametrize("path", DOCUMENTS)
def test_documents_are_kept_by_their_tag(call: Caller, path: str) -> None:
    first = call("GET", path)
    assert first.status == 200
    assert first.headers["Cache-Control"] == "no-cache"
    again = call("GET", path, headers={"if-none-match": first.headers["ETag"]})
    assert (again.status, again.body) == (304, b"")


@pytest.mark.parametrize("path", [*DOCUMENTS, "/livez", "/readyz"])
def test_head_has_the_headers_of_get(call: Caller, path: str) -> None:
    assert call("HEAD", path).headers == call("GET", path).headers


def test_the_list_names_every_operation(call: Caller, operations: Mapping[str, Any]) -> None:
    listed = read_json(call("GET", "/v1/operations"))["operations"]
    assert [each["name"] for each in listed] == list(operations)
    for each in listed:
        assert each["summary"]
        assert call("GET", each["links"]["self"]).status == 200


def test_a_description_holds_the_whole_declaration(call: Caller, operations: Mapping[str, Any]) -> None:
    for name, operation in operations.items():
        described = read_json(call("GET", f"/v1/operations/{name}"))
        assert set(described["parameters"].get("properties", {})) == set(operation.parameters.model_fields)
        assert [each["name"] for each in described["inputs"]] == [each.name for each in operation.inputs]
        assert [each["name"] for each in described["methods"]] == list(operation.methods)
        assert {each["knob"]["name"] for each in described["methods"] if each["knob"]} == set(operation.knobs)
        assert all(set(each["rates"]) == {"opencl", "numpy"} for each in described["methods"])
        assert set(described["options"]["properties"]) == RESERVED
        assert [each["name"] for each in described["hard_cases"]] == [each.name for each in operation.hard_cases]
        assert "$ref" not in str(described)


def test_no_operation_uses_a_reserved_name(operations: Mapping[str, Any]) -> None:
    for operation in operations.values():
        names = {*operation.parameters.model_fields, *operation.knobs, *(each.name for each in operation.inputs)}
        assert not names & RESERVED


def test_units_and_ranges_are_published(call: Caller) -> None:
    sigma = read_json(call("GET", "/v1/operations/gaussian"))["parameters"]["properties"]["sigma"]
    assert (sigma["unit"], sigma["minimum"]) == ("px", 0)


def test_limits_are_those_that_hold(call: Caller) -> None:
    limits = read_json(call("GET", "/v1/limits"))
    assert limits["body_bytes"] == call.settings.max_body
    assert limits["image_pixels"] == call.settings.max_pixels


def test_versions_name_what_computes(call: Caller) -> None:
    versions = read_json(call("GET", "/v1/version"))
    assert versions["lichen"] == lichen.__version__
    assert versions["libraries"]["numpy"]
    assert re.fullmatch("[0-9a-f]{16}", versions["build"])
    assert versions["opencl"]["device"] if versions["opencl"]["available"] else versions["opencl"]["reason"]


def test_the_page_is_html_that_runs_nothing_of_others(call: Caller) -> None:
    response = call("GET", "/")
    assert response.headers["Content-Type"].startswith("text/html")
    assert response.headers["Content-Security-Policy"].startswith("default-src 'none'; script-src 'self'")


def test_every_code_of_the_source_is_explained(call: Caller) -> None:
    folder = Path(lichen_service.__file__).parent
    source = "".join(each.read_text() for each in folder.rglob("*.py") if each.stem != "meanings")
    told = set(re.findall(r'\(\s*(?:[45]\d\d|CLIENT_GONE),\s*"([a-z-]+)"', source))
    told |= set(re.findall(r'_Refused\([^"]*f?"[^"]*", "([a-z-]+)"\)', source))
    told |= set(re.findall(r'^    code = "([a-z-]+)"', inspect.getsource(lichen.errors), re.MULTILINE))
    assert set(MEANINGS) - told == set(), "nobody says these"
    assert told - set(MEANINGS) == set(), "nobody explains these"
    listed = read_json(call("GET", "/problems"))["problems"]
    assert [each["code"] for each in listed] == list(MEANINGS)
    for each in listed:
        assert read_json(call("GET", each["type"])) == each
    problem_of(call("GET", "/problems/made-up"), 404, "not-found")


# --------------------------------------------------------------------------------------------- paths and methods


def test_an_unknown_operation_is_named_with_its_neighbours(call: Caller, png: bytes) -> None:
    for method in ("GET", "POST", "QUERY"):
        problem = problem_of(call(method, "/v1/operations/gausian", png), 404, "unknown-operation")
        assert "gaussian" in problem["detail"]
    assert call.admitted == [False] * 3


@pytest.mark.parametrize(("path", "near"), [("/v1/operation", "/v1/operations"), ("/v1/versions", "/v1/version")])
def test_an_unknown_path_is_named_with_its_neighbours(call: Caller, path: str, near: str) -> None:
    assert near in problem_of(call("GET", path), 404, "not-found")["detail"]


@pytest.mark.parametrize(
    ("method", "path", "allow"),
    [
        ("PUT", "/v1/operations/gaussian", "GET, HEAD, OPTIONS, POST, QUERY"),
        ("POST", "/v1/operations", "GET, HEAD, OPTIONS"),
        ("DELETE", "/livez", "GET, HEAD, OPTIONS"),
    ],
)
def test_a_wrong_method_is_told_the_right_ones(call: Caller, method: str, path: str, allow: str) -> None:
    response = call(method, path)
    problem_of(response, 405, "method-not-allowed")
    assert response.headers["Allow"] == allow


def test_options_say_what_may_be_sent(call: Caller) -> None:
    response = call("OPTIONS", "/v1/operations/gaussian")
    assert response.status == 204
    assert response.headers["Allow"] == "GET, HEAD, OPTIONS, POST, QUERY"
    accepted = response.headers["Accept-Query"].split(", ")
    assert {"image/png", "image/x-exr", "application/x-npy", "multipart/form-data"} <= set(accepted)
    assert "Accept-Query" not in call("OPTIONS", "/livez").headers
    assert call("OPTIONS", "/nowhere").status == 404
    assert call("OPTIONS", "/v1/operations/gausian").status == 404


# ------------------------------------------------------------------------------------------- liveness, readiness


@pytest.mark.parametrize("path", ["/v1/operations", "/v1/operations/gaussian", "/v1/limits", "/v1/version"])
def test_what_was_made_once_needs_no_thread_either(settings: Settings, path: str) -> None:
    call = Caller(Service(settings), settings)
    made, found, head = call("GET", path), call("GET", path), call("HEAD", path)
    assert call.admitted == [True, False, False]
    assert (found.status, found.body, found.headers) == (200, made.body, made.headers)
    assert (found.log, found.lasting, head.lasting) == ({"route": found.log["route"]}, True, True)
    kept = call("GET", path, headers={"if-none-match": found.headers["ETag"]})
    assert (kept.status, kept.body, kept.lasting) == (304, b"", True)
    assert call("GET", f"{path}?made=up").lasting is False


def test_a_run_whose_address_names_all_it_needs_is_no_document(call: Caller) -> None:
    plain = call("GET", "/v1/operations/white_noise")
    assert call("GET", "/v1/operations/white_noise").headers["ETag"] == plain.headers["ETag"]
    run = call("GET", "/v1/operations/white_noise?width=8&height=8&format=png")
    assert run.headers["Content-Type"] == "image/png"
    assert run.lasting is False


def test_readiness_is_believed_for_a_moment_without_a_thread(call: Caller) -> None:
    call("GET", "/readyz")
    again = call("GET", "/readyz")
    assert (again.status, again.lasting, call.admitted[-1]) == (200, False, False)


def test_liveness_needs_no_thread_of_the_pool(call: Caller) -> None:
    assert read_json(call("GET", "/livez")) == {"status": "alive"}
    assert call.admitted == [False]


def test_ready_means_that_a_request_went_through(call: Caller) -> None:
    response = call("GET", "/readyz")
    assert (response.status, read_json(response)) == (200, {"status": "ready"})
    assert response.headers["Cache-Control"] == "no-store"


def test_a_service_is_not_ready_before_it_is_warm(settings: Settings) -> None:
    cold = Service(settings)
    response = Caller(cold, settings)("GET", "/readyz")
    problem = problem_of(response, 503, "not-ready")
    assert problem["retryable"] is True
    assert "Retry-After" in response.headers
    assert Caller(cold, settings)("GET", "/livez").status == 200


def _warm(request: Any, monkeypatch: pytest.MonkeyPatch, patience: float = 30.0) -> Readiness:
    monkeypatch.setattr("lichen_service.readiness.warm_up", lambda: iter(()))
    readiness = Readiness(request, patience=patience)
    readiness.start()
    assert readiness.wait(30)
    return readiness


def test_a_failing_operation_is_not_ready_and_may_recover(monkeypatch: pytest.MonkeyPatch) -> None:
    failures = [RuntimeError("the device is gone")]

    def request() -> None:
        if failures:
            raise failures.pop()

    readiness = _warm(request, monkeypatch)
    assert readiness.reason() == "a tiny request failed"
    assert readiness.reason() is None


def test_a_stuck_operation_is_not_ready_and_is_asked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    released, asked = threading.Event(), []

    def request() -> None:
        asked.append(1)
        released.wait(60)

    readiness = _warm(request, monkeypatch, patience=0.05)
    assert "not come back" in (readiness.reason() or "")
    assert "not come back" in (readiness.reason() or "")
    assert len(asked) == 1
    released.set()
    for _ in range(200):
        if readiness.reason() is None:
            break
    assert readiness.reason() is None


def test_a_broken_warm_up_still_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> Any:
        raise RuntimeError("no catalogue")

    monkeypatch.setattr("lichen_service.readiness.warm_up", broken)
    readiness = Readiness(lambda: None)
    readiness.start()
    assert readiness.wait(30)
    assert readiness.reason() is None  # the canary, which works, has the last word


class Tried:
    def __init__(self, passed: bool) -> None:
        self.passed = passed

    def join(self) -> None: ...


def test_an_operation_that_was_tried_makes_able_before_the_warm_up_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lichen_service.readiness.FIRST_REST", 60.0)
    readiness = Readiness(lambda: None)
    readiness.start(Tried(passed=True))
    assert readiness.able(30)
    assert readiness.reason() is None
    assert not readiness.wait(0)
    readiness.stop(30)
    assert readiness.wait(0)


def test_an_operation_that_failed_makes_nobody_able(monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()

    def warm_up() -> Any:
        released.wait(60)
        yield "gaussian", "fir", None

    monkeypatch.setattr("lichen_service.readiness.warm_up", warm_up)
    readiness = Readiness(lambda: None)
    readiness.start(Tried(passed=False))
    assert not readiness.able(0.1)
    released.set()
    assert readiness.able(30)
    readiness.stop(30)


def test_every_operation_offers_an_example(operations: Mapping[str, Any]) -> None:
    for operation in operations.values():
        assert example(operation) is not None, f"{operation.name} cannot be warmed up"


# --------------------------------------------------------------------------------------------------------- openapi


def flaws_of(document: dict[str, Any]) -> list[str]:
    """What the specification has against a document, its schemas and what these refer to."""
    found = [str(each) for each in OPENAPI.iter_errors(document)]
    for value in everything(document):
        if isinstance(schema := value.get("schema"), dict) and not jsonschema_rs.meta.is_valid(schema):
            found.append(f"no schema: {schema}")
        if isinstance(reference := value.get("$ref"), str) and not resolves(document, reference):
            found.append(f"{reference} is nowhere")
    for path, methods in document["paths"].items():
        inside = set(re.findall(r"\{(\w+)\}", path))
        for method in ("get", "post", "put", "delete"):
            said = [*methods.get("parameters", ()), *methods.get(method, {}).get("parameters", ())]
            if method in methods and inside != {each["name"] for each in said if each.get("in") == "path"}:
                found.append(f"{method} {path} does not say what its names are")
    return found


def everything(value: Any) -> Iterator[dict[str, Any]]:
    """All objects within a document."""
    if isinstance(value, dict):
        yield value
    for each in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from everything(each)


def resolves(document: dict[str, Any], reference: str) -> bool:
    at: Any = document
    for step in reference.removeprefix("#/").split("/"):
        at = at.get(step.replace("~1", "/").replace("~0", "~")) if isinstance(at, dict) else None
    return at is not None


def test_the_openapi_document_is_valid_and_whole(call: Caller, operations: Mapping[str, Any]) -> None:
    document = read_json(call("GET", "/openapi.json"))
    assert flaws_of(document) == []
    assert flaws_of({**document, "info": {}})
    broken: dict[str, Any] = {"get": {"parameters": [{"name": "a", "in": "query", "schema": {"type": "what"}}]}}
    broken["get"]["responses"] = {"default": {"description": "anything"}}
    assert [each[:9] for each in flaws_of({**document, "paths": {"/a": broken}})] == ["no schema"]
    assert flaws_of({**document, "paths": {"/a": {"$ref": "#/components/nothing"}}})
    for name, operation in operations.items():
        path = document["paths"][f"/v1/operations/{name}"]
        posted = path["post"]
        names = {each.get("name") or each["$ref"].rpartition("/")[2] for each in path["parameters"]}
        inputs = {each.name for each in operation.inputs}
        assert names == {*operation.parameters.model_fields, *operation.knobs, *RESERVED, *inputs}
        required = {each["name"] for each in posted.get("parameters", ()) if each["required"]}
        assert required == {key for key, field in operation.parameters.model_fields.items() if field.is_required()}
        parts = posted["requestBody"]["content"]["multipart/form-data"]["schema"]["properties"]
        assert set(parts) == {each.name for each in operation.inputs}
    identifiers = [
        each["operationId"] for path in document["paths"].values() for each in path.values() if "operationId" in each
    ]
    assert len(set(identifiers)) == len(identifiers)


def test_every_documented_get_is_answered_as_documented(call: Caller) -> None:
    document = read_json(call("GET", "/openapi.json"))
    shared = {f"#/components/responses/{name}": each for name, each in document["components"]["responses"].items()}
    for path, methods in document["paths"].items():
        if "get" not in methods or ("{name}" in path and "parameters" in methods):
            continue  # what is stored is asked for in tests of its own
        names = next(
            (each["schema"]["enum"] for each in methods["get"].get("parameters", ()) if each["in"] == "path"), []
        )
        answer = methods["get"]["responses"]["200"]
        documented = shared.get(answer.get("$ref", ""), answer)["content"]
        for each in [path.format(name=name) for name in names[:: 1 + len(names) // 40]] or [path]:
            response = call("GET", each)
            assert response.status == 200, each
            assert response.headers["Content-Type"].partition(";")[0] in documented


def test_every_format_is_documented(call: Caller) -> None:
    image = read_json(call("GET", "/openapi.json"))["components"]["responses"]["Image"]
    assert {each.media_type for each in FORMATS.values()} <= set(image["content"])


# ------------------------------------------------------------------------------------------ the whole catalogue


def test_every_operation_answers_its_own_example(call: Caller, operations: Mapping[str, Any]) -> None:
    for operation in operations.values():
        made = example(operation)
        assert made is not None
        inputs, parameters = made
        body, headers = form({name: bytes(encode(image, "npy").data) for name, image in inputs.items()})
        query = "&".join(f"{name}={value}" for name, value in [*as_query(parameters), ("format", "npy")])
        response = call("QUERY", f"/v1/operations/{operation.name}?{query}", body, headers)
        assert response.status == 200, (operation.name, bytes(response.body))
        assert response.headers["Content-Type"] == "application/x-npy"


def test_a_missing_input_is_named(call: Caller, operations: Mapping[str, Any]) -> None:
    for operation in operations.values():
        required = {f"/inputs/{each.name}" for each in operation.inputs if each.required}
        response = call("POST", f"/v1/operations/{operation.name}")
        if required:
            assert required <= pointers(problem_of(response, 422, "invalid-request"))
