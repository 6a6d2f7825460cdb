"""Named textures over HTTP: what is listed can be got, and what is got can be sent as a pipeline."""

from __future__ import annotations

import numpy as np

import lichen
from lichen.files import decode

from .conftest import Caller, read_json


def test_a_texture_is_a_pipeline_that_can_be_sent(call: Caller) -> None:
    listed = read_json(call("GET", "/v1/textures"))["textures"]
    assert [each["name"] for each in listed] == list(lichen.textures())
    for each in listed[:2]:
        got = call("GET", f"{each['links']['self']}?width=40&height=30&seed=7")
        headers = {"Content-Type": "application/json", "Accept": "application/x-npy"}
        made = call("POST", "/v1/pipelines", bytes(got.body), headers)
        assert made.status == 200, bytes(made.body)
        (own,) = lichen.run_pipeline(lichen.texture(each["name"], width=40, height=30, seed=7), images={}).values()
        assert np.array_equal(decode(bytes(made.body)).pixels, own.image.pixels)


def test_what_is_wrong_with_a_query_is_all_named(call: Caller) -> None:
    refused = call("GET", "/v1/textures/marble?width=0&colour=red")
    assert refused.status == 422
    assert {each["pointer"] for each in read_json(refused)["errors"]} == {"/parameters/width", "/parameters/colour"}
    twice = read_json(call("GET", "/v1/textures/marble?seed=1&seed=2"))
    assert [each["pointer"] for each in twice["errors"]] == ["/query/seed"]
    unknown = call("GET", "/v1/textures/marbel")
    assert (unknown.status, read_json(unknown)["code"]) == (404, "unknown-texture")
    assert "marble" in read_json(unknown)["detail"]
