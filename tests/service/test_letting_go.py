"""What a request held is free when it has been answered, and does not wait for the collector of cycles.

The collector looks through everything only when much has piled up. A cycle that holds a body or a picture would keep
megabytes until then, and look like a leak."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest

from lichen.image import Image
from lichen.memory import KEPT
from lichen_service.http.message import Request, Response
from lichen_service.memory import keep_pages
from lichen_service.uploads import Upload

from .conftest import Caller, form

HELD = (Image, Request, Response, Upload)
PIPELINE = "/v1/pipelines?pipeline=gaussian:sigma=1|levels:gamma=1.2"


@pytest.fixture
def kept_by_cycles() -> Iterator[list[object]]:
    """Everything that only the collector would have freed, when the test has called it."""
    gc.collect()
    gc.disable()
    gc.set_debug(gc.DEBUG_SAVEALL)
    yield gc.garbage
    gc.set_debug(0)
    gc.garbage.clear()
    gc.enable()


@pytest.mark.parametrize(
    ("target", "part", "status"),
    [
        ("/v1/operations/gaussian?sigma=1", 1.0, 200),
        ("/v1/operations/gaussian?sigma=1&explain=true", 1.0, 200),
        ("/v1/operations/gaussian?sigma=1", 0.5, 422),
        ("/v1/operations/gaussian?sigma=-1&made=up", 1.0, 422),
        ("/v1/operations/gaussian?sigma=1&max_error=0", 1.0, 422),
        (PIPELINE, 1.0, 200),
        (PIPELINE, 0.5, 422),
        ("/v1/operations/nothing", 1.0, 404),
    ],
)
def test_no_cycle_holds_a_body_or_a_picture(
    call: Caller, png: bytes, kept_by_cycles: list[object], target: str, part: float, status: int
) -> None:
    assert call("POST", target, png[: int(part * len(png))]).status == status
    gc.collect()
    assert [each for each in kept_by_cycles if isinstance(each, HELD)] == []


def test_nor_does_one_where_a_form_holds_several_broken_pictures(
    call: Caller, png: bytes, kept_by_cycles: list[object]
) -> None:
    body, headers = form({"first": png[:60], "second": png[:50]})
    assert call("POST", "/v1/operations/mix", body, headers).status == 422
    gc.collect()
    assert [each for each in kept_by_cycles if isinstance(each, HELD)] == []


def test_pages_are_kept_while_requests_come(monkeypatch: pytest.MonkeyPatch) -> None:
    kept: list[int] = []
    monkeypatch.setattr("lichen_service.memory.keep", kept.append)
    with pytest.raises(StopIteration):
        keep_pages(16 << 30, iter((3, 7, 7, 9)).__next__, idle=0.0)
    assert kept == [4 << 30, 4 << 30, KEPT, 4 << 30, 4 << 30]
