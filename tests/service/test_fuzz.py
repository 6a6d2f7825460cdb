"""Whatever is asked, the answer is a result or a precise refusal: never a 5xx, never JSON that a parser refuses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lichen import catalogue
from lichen.errors import LichenError
from lichen.files import FORMATS, encode
from lichen.image import Alpha, Image, Space, Storage
from lichen_service.documents import as_query
from lichen_service.http.message import Response
from lichen_service.queries import RESERVED
from lichen_service.readiness import example

from .conftest import Caller, form, picture, problem_of, read_json

OPERATIONS = catalogue.operations()
NAMES = sorted(
    {name for each in OPERATIONS.values() for name in (*each.parameters.model_fields, *each.knobs)} | RESERVED
)
VALUES = st.one_of(
    st.sampled_from(
        ["", "0", "1", "-1", "1e-300", "1e308", "nan", "inf", "true", "null", "[]", "{}", "[1,", "[[1,2]]"]
    ),
    st.sampled_from([*FORMATS, "opencl", "numpy", "reflect", "linear", "data", "straight", "uint8", "float64"]),
    st.sampled_from(sorted({name for each in OPERATIONS.values() for name in each.methods})),
    st.floats().map(repr),
    st.integers().map(str),
    st.text(max_size=12),
)
QUERIES = st.lists(st.tuples(st.one_of(st.sampled_from(NAMES), st.text(max_size=8)), VALUES), max_size=5)
GOOD = st.fixed_dictionaries(
    {},
    optional={
        "max_error": st.sampled_from(["1e-9", "1e-3", "1"]),
        "max_ms": st.sampled_from(["1e-6", "10"]),
        "device": st.sampled_from(["numpy", "opencl"]),
        "explain": st.sampled_from(["true", "false"]),
        "prune": st.sampled_from(["true", "false"]),
        "nonfinite": st.sampled_from(["propagate", "reject", "repair"]),
        "format": st.sampled_from(sorted(FORMATS)),
        "storage": st.sampled_from([*Storage]),
        "space": st.sampled_from([*Space]),
        "alpha": st.sampled_from([*Alpha]),
    },
)
HEADERS = st.fixed_dictionaries(
    {},
    optional={
        "accept": st.one_of(st.sampled_from(["*/*", "image/*", "image/jpeg", "text/html"]), st.text(max_size=20)),
        "if-none-match": st.one_of(st.just("*"), st.text(max_size=20)),
    },
)
TINY = [
    bytes(encode(picture(5, 7), "png").data),
    bytes(encode(picture(5, 7, 4), "png").data),
    bytes(encode(Image(picture(6, 4, 2).pixels), "npy").data),
    bytes(encode(picture(1, 1, 1), "npy").data),
]
MANY = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
EACH = settings(MANY, max_examples=20)
"""For every operation: the road is the same for all of them, and is gone thousands of times."""


def _is_sound(response: Response) -> None:
    assert response.status < 500, bytes(response.body)
    if response.status >= 400:
        problem_of(response, response.status, response.headers["X-Problem-Code"])
    elif response.headers.get("Content-Type") == "application/json":
        read_json(response)
    for value in response.headers.values():
        assert value.isascii()
        assert value.isprintable()


@pytest.mark.parametrize("name", list(OPERATIONS))
def test_no_query_breaks_an_operation(call: Caller, name: str) -> None:
    @EACH
    @given(QUERIES, HEADERS, st.sampled_from(TINY))
    def check(query: list[tuple[str, str]], headers: dict[str, str], body: bytes) -> None:
        _is_sound(call("POST", f"/v1/operations/{name}", body, headers, query=query))

    check()


def _encoded(image: Image, format: str) -> bytes:
    """In that format, or as NPY where it cannot hold the image."""
    try:
        return bytes(encode(image, format).data)
    except LichenError:
        return bytes(encode(image, "npy").data)


@pytest.mark.parametrize("name", list(OPERATIONS))
def test_no_mixture_of_good_options_breaks_an_operation(call: Caller, name: str) -> None:
    made = example(OPERATIONS[name])
    assert made is not None
    parameters = as_query(made[1])
    first, *others = [*made[0].items()] or [None]
    answered: set[int] = set()

    @EACH
    @given(GOOD, HEADERS, st.sampled_from(sorted(FORMATS)))
    def check(options: dict[str, str], headers: dict[str, str], format: str) -> None:
        parts = {key: bytes(encode(each, "npy").data) for key, each in others}
        if first is not None:
            single = first[1].channels == 1 and OPERATIONS[name].inputs[0].channels[1] != 1
            pixels = np.repeat(first[1].pixels, 3, axis=2) if single else first[1].pixels
            parts = {first[0]: _encoded(Image(pixels, storage=Storage.FLOAT32), format), **parts}
        body, content = form(parts) if parts else (b"", {})
        query = [*parameters, *((key, value) for key, value in options.items() if key not in dict(parameters))]
        response = call("QUERY", f"/v1/operations/{name}", body, {**headers, **content}, query=query)
        answered.add(response.status)
        if options.get("device") != "opencl" or response.status != 503:  # a machine may have no OpenCL
            _is_sound(response)

    check()
    assert 200 in answered


@MANY
@given(st.binary(max_size=200), st.sampled_from([None, "image/png", "image/x-exr", "application/x-npy", "image/tiff"]))
def test_no_body_breaks_an_upload(call: Caller, body: bytes, media_type: str | None) -> None:
    headers = {"content-type": media_type} if media_type else {}
    _is_sound(call("POST", "/v1/operations/gaussian?sigma=1", body, headers))


@MANY
@given(st.integers(0, 400), st.binary(min_size=1, max_size=6))
def test_no_spoilt_form_breaks_an_upload(call: Caller, place: int, spoilt: bytes) -> None:
    body, headers = form({"image": (TINY[0], "image/png"), "texture": TINY[3]})
    _is_sound(call("POST", "/v1/operations/gaussian?sigma=1", body[:place] + spoilt + body[place:], headers))


@MANY
@given(st.text(max_size=30), st.sampled_from(["GET", "HEAD", "POST", "QUERY", "PUT", "OPTIONS"]))
def test_no_path_breaks_the_routes(call: Caller, path: str, method: str) -> None:
    _is_sound(call(method, "/" + path.replace("?", "").replace("#", "")))
