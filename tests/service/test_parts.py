"""The small parts of the routes, each alone: routing, documents, reports, stages, refusals."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lichen import errors
from lichen.errors import Flaw, LichenError
from lichen.planning.graph import Decision
from lichen_service.documents import canonical, content_digest, document, matches, unchanged
from lichen_service.http.message import Head, Request, Response
from lichen_service.refusals import STATUS, Refusal, refusal_of, relocated
from lichen_service.reports import LONGEST, rounded_up, skipped
from lichen_service.routing import Route, Table
from lichen_service.stages import Stages


def head(method: str = "GET", path: str = "/", headers: Mapping[str, str] | None = None, seconds: float = 60.0) -> Head:
    now = time.monotonic()
    return Head(method, path, (), headers or {}, "id", now, now + seconds)


def nothing(request: Request, name: str) -> Response:
    return Response(200)


ROUTES = (
    Route("/v1/things", {"GET": nothing}),
    Route("/v1/things/{name}", {"GET": nothing, "POST": nothing}, bodies=True),
)


# -------------------------------------------------------------------------------------------------------- routing


def test_a_path_finds_its_route_and_name() -> None:
    assert Table(ROUTES).find(head("GET", "/v1/things")).route is ROUTES[0]
    assert Table(ROUTES).find(head("POST", "/v1/things/a b")).name == "a b"
    assert Table(ROUTES).find(head("HEAD", "/v1/things")).route is ROUTES[0]


def test_an_unknown_path_is_named_with_its_neighbours() -> None:
    with pytest.raises(Refusal) as caught:
        Table(ROUTES).find(head("GET", "/v1/thing"))
    assert caught.value.status == 404
    assert "did you mean /v1/things" in caught.value.detail


@pytest.mark.parametrize("path", ["/v1/things/", "/v1/things/a/b", "/V1/things", "//v1/things", "/v1/things\n"])
def test_only_exact_paths_match(path: str) -> None:
    with pytest.raises(Refusal) as caught:
        Table(ROUTES).find(head("GET", path))
    assert caught.value.status == 404
    assert caught.value.detail.isprintable()


def test_a_wrong_method_is_told_the_right_ones() -> None:
    with pytest.raises(Refusal) as caught:
        Table(ROUTES).find(head("DELETE", "/v1/things/a"))
    assert caught.value.status == 405
    assert caught.value.headers["Allow"] == "GET, HEAD, OPTIONS, POST"


# ------------------------------------------------------------------------------------------------------ documents


def test_json_is_canonical_and_has_no_nan() -> None:
    value = {"b": math.nan, "a": [1, 2.5, -math.inf, True, None, "é"], "c": Flaw("/x", "y")}
    assert canonical(value) == ('{"a":[1,2.5,null,true,null,"é"],"b":null,"c":{"detail":"y","pointer":"/x"}}'.encode())


@given(st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists, max_leaves=10))
def test_any_value_is_strict_json(value: object) -> None:
    def refuse(constant: str) -> object:
        raise AssertionError(constant)

    json.loads(canonical(value).decode("utf-8", "surrogatepass"), parse_constant=refuse)


def test_a_document_is_not_sent_twice() -> None:
    first = document(head(), b"{}")
    tag = first.headers["ETag"]
    assert first.status == 200
    again = document(head(headers={"if-none-match": f'"other", W/{tag}'}), b"{}")
    assert (again.status, again.body, again.headers["ETag"]) == (304, b"", tag)
    assert document(head(headers={"if-none-match": tag}), b"{ }").status == 200


def test_if_none_match_compares_whole_tags() -> None:
    assert matches(head(headers={"if-none-match": "*"}), '"a"')
    assert not matches(head(headers={"if-none-match": '"aa"'}), '"a"')
    assert not matches(head(), '"a"')


def test_if_match_wants_these_bytes_or_none() -> None:
    assert unchanged(head(headers={"if-match": '"b", "a"', "if-none-match": '"a"'}), '"a"')
    assert not unchanged(head(headers={"if-match": "*"}), '"a"')
    for wanted in ('"b"', 'W/"a"', ""):
        with pytest.raises(Refusal) as refused:
            unchanged(head(headers={"if-match": wanted}), '"a"')
        assert (refused.value.status, refused.value.code) == (412, "precondition-failed")


def test_the_digest_is_that_of_rfc_9530() -> None:
    # The example of RFC 9530, appendix B.2.
    assert content_digest(b'{"hello": "world"}\n') == "sha-256=:RK/0qy18MlBSVnWgjwz6lZEWjP/lF5HF9bvEF8FabDg=:"


# -------------------------------------------------------------------------------------------------------- reports


@given(st.floats(min_value=0, max_value=1e300, allow_subnormal=False))
def test_a_stated_error_is_never_below_the_bound(value: float) -> None:
    stated = float(rounded_up(value))
    assert value <= stated <= value * 1.0101


def test_dropped_work_is_listed_with_its_reason() -> None:
    decisions = [
        Decision("identity", "blur", "dropped", 'sigma is "0"\r\nX: y', 0.0),
        Decision("choose", "blur", "method fir", "cheapest", 1e-3),
        Decision("invisible", "fog", "dropped", "below the error", 1.234e-4),
    ]
    assert skipped(decisions) == (
        'identity;node="blur";reason="sigma is \\"0\\"??X: y";bound=0, '
        'invisible;node="fog";reason="below the error";bound=0.000124'
    )


def test_a_long_list_of_dropped_work_ends_with_a_count() -> None:
    decisions = [Decision("unread", f"node{n}", "dropped", "nothing reads its result") for n in range(100)]
    header = skipped(decisions)
    assert len(header) < LONGEST + 40
    listed = header.count("unread;")
    assert header.endswith(f"more;count={100 - listed}")
    assert listed > 10


# --------------------------------------------------------------------------------------------------------- stages


def test_stages_are_listed_in_the_order_of_the_road() -> None:
    stages = Stages(head(), 60.0)
    for name in ("encode", "run", "decode"):
        with stages.stage(name):
            pass
    stages.split("run", {"plan": 0.001, "kernel": 0.25, "kernel.a b": 0.25})
    names = [entry.partition(";")[0] for entry in stages.header().split(", ")]
    assert names == ["queue", "decode", "plan", "kernel", "encode", "kernel.a-b", "total"]
    assert "kernel;dur=250.000" in stages.header()


def test_no_stage_begins_after_the_deadline() -> None:
    stages = Stages(head(seconds=-1.0), 60.0)
    with pytest.raises(Refusal) as caught, stages.stage("decode"):
        raise AssertionError("the stage began")
    assert caught.value.status == 504
    assert "decode" in caught.value.detail


# ------------------------------------------------------------------------------------------------------- refusals


def test_every_error_of_the_library_has_a_status() -> None:
    kinds = {each for each in vars(errors).values() if isinstance(each, type) and issubclass(each, LichenError)}
    assert kinds - set(STATUS) == {LichenError}


@pytest.mark.parametrize(("kind", "status"), STATUS.items())
def test_a_refusal_carries_the_whole_error(kind: type[LichenError], status: int) -> None:
    refusal = refusal_of(kind("why", [Flaw("/inputs/image", "bad")], limit=3, actual=4))
    response = refusal.response(head())
    sent = json.loads(bytes(response.body))
    assert response.status == status
    assert (sent["code"], sent["title"], sent["detail"]) == (kind.code, kind.title, "why")
    assert sent["errors"] == [{"pointer": "/inputs/image", "detail": "bad"}]
    assert (sent["limit"], sent["actual"]) == (3, 4)
    assert sent["retryable"] is (status == 503)
    assert ("Retry-After" in response.headers) is (status == 503)


def test_an_error_without_a_status_says_nothing() -> None:
    @dataclasses.dataclass
    class Strange(LichenError):
        detail: str

    response = refusal_of(Strange("the secret path")).response(head())
    assert response.status == 500
    assert b"secret" not in bytes(response.body)


def test_pointers_of_the_library_become_pointers_into_the_request() -> None:
    flaws = [Flaw(pointer, "") for pointer in ("/method", "/knobs/tail", "/parameters/a", "/inputs/b", "/max_error")]
    with pytest.raises(LichenError) as caught, relocated():
        raise errors.InvalidRequest("no", flaws)
    assert [each.pointer for each in caught.value.flaws] == [
        "/query/method",
        "/parameters/tail",
        "/parameters/a",
        "/inputs/b",
        "/query/max_error",
    ]
