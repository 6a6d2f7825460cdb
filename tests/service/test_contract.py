"""The contract in /openapi.json, put to the test by schemathesis: requests made from it, answers held to it.

Cases are sent through the WSGI adapter, so no socket is in between. `LICHEN_CASES` says how many of every path and
method (`make fuzz` asks for 20); without it a few of a fixed share of them are enough to notice a document that lies.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterable
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from lichen.files import FORMATS, encode
from lichen_service.app import Service
from lichen_service.http.access_log import AccessLog
from lichen_service.settings import Settings
from lichen_service.wsgi import Environ, Wsgi

from .conftest import picture

CASES = int(os.environ.get("LICHEN_CASES", "0"))
SHARE = 30
"""Of so many operations one is tried where nobody asks for more."""
RUNS = "/v1/operations/"
CHECKS = [not_a_server_error, status_code_conformance, content_type_conformance, response_schema_conformance]
QUIET = [
    HealthCheck.function_scoped_fixture,
    HealthCheck.too_slow,
    HealthCheck.filter_too_much,
    HealthCheck.data_too_large,
]
TINY = [bytes(encode(picture(5, 7, channels), "png").data) for channels in (1, 3, 4)]


@pytest.fixture(scope="module")
def schema(service: Service, settings: Settings) -> Any:
    for each in FORMATS.values():
        for media_type in each.media_types:
            schemathesis.openapi.media_type(media_type, st.sampled_from(TINY))
    return schemathesis.openapi.from_wsgi("/openapi.json", Shortened(service, settings, AccessLog(io.StringIO())))


class Shortened(Wsgi):
    """The service, whose document leaves most operations out where nobody asked for more: reading it takes seconds."""

    def __call__(self, environ: Environ, start_response: Callable[..., Any]) -> Iterable[bytes]:
        if CASES or environ["PATH_INFO"] != "/openapi.json":
            return super().__call__(environ, start_response)
        said: list[Any] = []
        whole = json.loads(b"".join(super().__call__(environ, lambda *told: said.extend(told))))
        runs = [path for path in whole["paths"] if path.startswith(RUNS)]
        for path in set(runs) - set(runs[::SHARE]):
            del whole["paths"][path]
        body = json.dumps(whole).encode()
        start_response(said[0], [("Content-Type", "application/json"), ("Content-Length", str(len(body)))])
        return [body]


def test_answers_are_what_the_document_says(schema: Any) -> None:
    found = [each.ok() for each in schema.get_all_operations()]
    chosen = [each for each in found if not each.path.endswith("/events")]
    assert sum(each.path.startswith(RUNS) for each in chosen) > (100 if CASES else 2)
    assert len(chosen) > 15
    statuses = set()
    for operation in chosen:

        @settings(max_examples=CASES or 2, deadline=None, suppress_health_check=QUIET, phases=[Phase.generate])
        @given(case=operation.as_strategy())
        def holds(case: Any) -> None:
            response = case.call()
            statuses.add(response.status_code)
            if not (
                response.status_code == 503 and response.headers.get("x-problem-code", [""])[0] == "device-failure"
            ):
                case.validate_response(response, checks=CHECKS)

        holds()
    assert {200, 422} <= statuses or not CASES
    assert 200 in statuses
