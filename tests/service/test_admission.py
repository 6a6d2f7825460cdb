"""What is refused before it is computed: what does not fit into memory, what takes too long, what nobody awaits."""

from __future__ import annotations

import importlib.util
import math
import struct
import threading
import zlib
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from lichen import execution
from lichen.files import encode
from lichen.image import Storage
from lichen.memory import Array
from lichen.opencl import watching
from lichen.opencl.device import Device, default_device
from lichen.operation import Inputs
from lichen.planning.graph import Node
from lichen_service.app import Service
from lichen_service.http.message import CLIENT_GONE, Head, Request, Response
from lichen_service.memory import Memory, reserve
from lichen_service.refusals import Refusal
from lichen_service.settings import Settings

from .conftest import Caller, picture, problem_of, read_json

BLUR = "/v1/operations/gaussian?sigma=2&device=numpy"


def test_memory_is_given_back_and_never_overdrawn() -> None:
    memory = Memory(100)
    with memory.request():
        reserve(60)
        reserve(40)
        with pytest.raises(Refusal) as never:
            reserve(1)
        assert (never.value.status, never.value.limit, never.value.actual) == (413, 100, 101)
        assert memory.held == 100
    assert memory.held == 0


def test_who_does_not_fit_beside_others_may_come_back() -> None:
    memory, refused = Memory(100), []

    def other() -> None:
        with memory.request():
            try:
                reserve(50)
            except Refusal as refusal:
                refused.append(refusal)

    with memory.request():
        reserve(60)
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    (refusal,) = refused
    assert (refusal.status, refusal.retryable, refusal.headers["Retry-After"]) == (503, True, "1")
    assert memory.held == 0


def test_a_request_that_needs_more_memory_than_there_is_is_refused(settings: Settings, tmp_path: Path) -> None:
    chosen = replace(settings, data=str(tmp_path), memory=1 << 20, workers=1)
    call = Caller(Service(chosen), chosen)
    small, large = (bytes(encode(picture(side, side), "png").data) for side in (16, 300))
    assert call("POST", BLUR, small).status == 200
    problem = problem_of(call("POST", BLUR, large), 413, "too-large")
    assert problem["limit"] == 1 << 20
    assert problem["actual"] >= 300 * 300 * 3 * 4
    assert call.service.memory.held == 0


def test_the_memory_of_a_request_is_free_after_its_answer(call: Caller, png: bytes) -> None:
    assert call("POST", BLUR, png).status == 200
    problem_of(call("POST", BLUR, png[:60]), 422, "unreadable-image")
    assert call.service.memory.held == 0


def test_what_would_take_far_too_long_is_not_begun(call: Caller, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lichen.planning.plan.Plan.seconds", property(lambda plan: 1e6))
    body = bytes(encode(picture(200, 200, storage=Storage.UINT8), "npy").data)
    problem = problem_of(call("POST", BLUR, body), 422, "too-costly")
    assert problem["actual"] == 1e6
    assert 0 < problem["limit"] <= call.settings.request_timeout


def test_a_pipeline_that_takes_too_long_to_plan_is_not_planned(
    call: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = {"pipeline": "|".join(f"levels:gamma=1.{step}" for step in range(1, 10)), "explain": "true"}
    assert call("POST", "/v1/pipelines", png, query=[*said.items()]).status == 200
    monkeypatch.setattr("lichen.planning.plan.PLANNING", 1e3)
    monkeypatch.setattr("lichen.engine.prepare_pipeline", None)
    problem = problem_of(call("POST", "/v1/pipelines", png, query=[*said.items()]), 422, "too-costly")
    assert problem["actual"] == 9e3


def test_work_ends_before_the_next_stage_when_nobody_waits(service: Service, png: bytes) -> None:
    began: list[str] = []

    def answer(stop_at: str) -> Response:
        began.clear()
        head = Head("POST", "/v1/operations/gaussian", (("sigma", "2"),), {}, "test-request", 0.0, float("inf"))
        return service.handle(
            Request(head._replace(alive=lambda: stop_at not in began, began=began.append, allowed=60.0), png)
        )

    for stop_at in ("decode", "run", "encode"):
        assert answer(stop_at).status == CLIENT_GONE
        assert began[-1] == stop_at
    assert answer("nothing").status == 200
    assert began[-1] == "digest"


def test_work_ends_before_the_next_step_of_a_run_when_nobody_waits(
    service: Service, png: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, by_method = [], execution.by_method

    def told(node: Node, inputs: Inputs, device: Device | None) -> Array:
        begun.append(node.name)
        return by_method(node, inputs, device)

    monkeypatch.setattr(execution, "by_method", told)
    said = (("pipeline", "gaussian:sigma=2|median:size=3|gaussian:sigma=3"), ("prune", "false"), ("format", "png"))
    for most, status in ((1, CLIENT_GONE), (2, CLIENT_GONE), (99, 200)):
        begun.clear()
        head = Head("POST", "/v1/pipelines", said, {}, "test-request", 0.0, float("inf"), allowed=60.0)
        assert service.handle(Request(head._replace(alive=lambda most=most: len(begun) < most), png)).status == status
        assert len(begun) == most or (most == 99 and len(begun) >= 3)


def test_work_ends_within_a_step_of_a_kernel_when_nobody_waits(
    call: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    if default_device() is None:
        pytest.skip("no OpenCL device")
    monkeypatch.setattr(execution, "LONG", 0.0)  # as if it took long
    monkeypatch.setattr(watching, "EVERY", 0.0)
    query = (("width", "400"), ("height", "300"), ("seed", "5"), ("format", "npy"))
    asked: list[int] = []

    def answer(most: int) -> Response:
        asked.clear()

        def alive() -> bool:
            asked.append(1)
            return len(asked) <= most

        head = Head("GET", "/v1/operations/white_noise", query, {}, "test-request", 0.0, math.inf, allowed=60.0)
        return call.service.handle(Request(head._replace(alive=alive), b""))

    whole = answer(10_000)
    parts = len(asked)
    assert parts > 10, "it was asked between parts"
    assert answer(parts // 2).status == CLIENT_GONE
    assert len(asked) == parts // 2 + 1
    monkeypatch.setattr(execution, "LONG", math.inf)
    assert bytes(answer(10_000).body) == bytes(whole.body)
    assert len(asked) < parts


@pytest.mark.parametrize(
    "target",
    [
        pytest.param("/v1/operations/convolve?kernel=[[" + "1," * 3000 + "1]]", id="a kernel of one row"),
        "/v1/operations/lic?length=10000000",
        "/v1/operations/perlin_noise?width=64&height=64&octaves=10000",
        "/v1/operations/resize?width=1000000&height=1000000",
        "/v1/operations/white_noise?width=1000000&height=1000000",
        "/v1/operations/affine?matrix=[[1,0,0],[0,1,0]]&width=100000&height=100000",
        "/v1/operations/box?width=1000000001&height=3",
        "/v1/operations/median?size=100000001",
        pytest.param("/v1/pipelines?pipeline=" + "|".join(["gaussian:sigma=1"] * 50_000), id="50,000 steps"),
    ],
)
def test_parameters_made_to_harm_are_refused_before_anything_is_computed(
    call: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch, target: str
) -> None:
    def never(*_args: object, **_kwargs: object) -> object:
        raise AssertionError("something was computed")

    monkeypatch.setattr("lichen.engine.computed", never)
    response = call("POST", target, png)
    assert response.status in (413, 422), (response.status, bytes(response.body)[:300])
    assert b"is not a name" not in response.body, "what harms is a name that the operation knows"
    assert call.service.memory.held == 0


@cache
def bombs() -> Mapping[str, bytes]:
    """Files made to harm, by name; most have a few thousand bytes."""
    path = Path(__file__).parents[1] / "kernels" / "test_files_hostile.py"
    spec = importlib.util.spec_from_file_location("hostile", path)
    assert spec is not None
    assert spec.loader is not None
    hostile: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hostile)
    png, tiff = hostile.valid("png uint8"), hostile.valid("tiff uint8")
    packed = b"x\0\0" + zlib.compress(bytes(100_000_000), 9)
    profile = struct.pack(">I", len(packed)) + b"iCCP" + packed + struct.pack(">I", zlib.crc32(b"iCCP" + packed))
    text = struct.pack(">I4sI", 0, b"tEXt", zlib.crc32(b"tEXt"))
    objects = b"{'descr': '|O', 'fortran_order': False, 'shape': (9, 9), }  \n"
    gif = b"GIF89a" + struct.pack("<HHBBB", 65535, 65535, 0, 0, 0) + b"\x2c" * 100
    return {
        **hostile.claims(),
        "a profile that unpacks to 100 MB": png[:33] + profile + png[33:],
        "6000 chunks": png[:33] + text * 6000 + png[33:],
        "100,000 directories": hostile.long_chain(tiff, 100_000),
        "directories without end": hostile.ring(tiff),
        "hollow directories": hostile.hollow(tiff),
        "objects": b"\x93NUMPY\1\0" + struct.pack("<H", len(objects)) + objects,
        "frames of a format nobody reads": gif,
    }


def test_files_made_to_harm_are_refused_by_their_headers(call: Caller, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_args: object, **_kwargs: object) -> object:
        raise AssertionError("a decoder was asked")

    monkeypatch.setattr(call.service.decoders, "decode", never)
    for name, data in bombs().items():
        response = call("POST", BLUR, data)
        assert response.status in (413, 415, 422), (name, response.status, bytes(response.body)[:300])
        (flaw,) = read_json(response)["errors"][:1]
        assert flaw["pointer"].startswith("/inputs/image"), name
        assert call.service.memory.held == 0
