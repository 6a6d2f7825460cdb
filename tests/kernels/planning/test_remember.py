"""A plan that was made before is taken again, and only where it is the same."""

from __future__ import annotations

import numpy as np
import pytest

import lichen
from lichen.accuracy import times
from lichen.errors import InvalidRequest
from lichen.image import Image, Storage
from lichen.memory import aligned_empty
from lichen.operation import Operation
from lichen.planning import remember
from lichen.planning.pipeline import read


def picture(value: float = 0.5) -> Image:
    pixels = aligned_empty((5, 7, 3))
    pixels[...] = value
    return Image(pixels)


def plan(image: Image, **values: object) -> lichen.Plan:
    return lichen.explain("levels", image, device="numpy", **values)


def test_the_same_request_has_the_same_plan_whatever_the_pixels() -> None:
    assert plan(picture(), black=0.1) is plan(picture(), black=0.1)


@pytest.mark.parametrize("changed", [{"black": -0.0}, {"black": 0.1}, {"max_error": 0.1}, {"storage": "uint8"}])
def test_another_request_has_another_plan(changed: dict[str, object]) -> None:
    usual = {"black": 0.0, "white": 0.7}
    found = plan(picture(), **{**usual, **changed})
    assert found is not plan(picture(), **usual)
    assert found is plan(picture(), **{**usual, **changed})


def test_what_is_said_again_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """However large the pictures are; but numbers of NumPy cannot be told apart plainly, and are read anew."""
    read_, validate = [], Operation.validate
    monkeypatch.setattr(Operation, "validate", lambda self, values: read_.append(values) or validate(self, values))
    for value in (0.5, 2.0):
        plan(picture(value), black=0.41)
    assert len(read_) == 1
    for black in (0, 0.0, False):
        plan(picture(), black=black, white=0.9)
    assert len(read_) == 4
    for _ in range(2):
        plan(picture(), black=np.float64(0.41))
    assert len(read_) == 6


def test_every_flaw_is_named_whatever_was_read_before() -> None:
    for _ in range(2):
        with pytest.raises(InvalidRequest) as caught:
            lichen.run("levels", method="none", black="a", nonsense=1, max_error=-1)
        found = {"/".join(each.pointer.split("/")[:3]) for each in caught.value.flaws}
        assert found == {"/inputs/image", "/method", "/max_error", "/parameters/black", "/parameters/nonsense"}


def test_arrays_of_the_same_bytes_are_not_the_same() -> None:
    line, seen = np.array([[1.0, 2.0, 4.0]]), np.eye(5, 7)
    across, down = (lichen.run("convolve", seen, kernel=kernel).image.pixels for kernel in (line, line.T))
    assert not np.array_equal(across, down)
    scene = {"objects": [{"shape": "sphere"}], "camera": {"width": 4, "height": 4}}
    lichen.render({**scene, "background": np.array([0.1, 0.2, 0.3])})
    for other in (np.array([[0.1, 0.2, 0.3]]), np.array([0.1, 0.2, 0.3]).view(np.int64)):
        with pytest.raises(InvalidRequest, match="background"):
            lichen.render({**scene, "background": other})


def test_zeros_of_both_signs_keep_their_signs() -> None:
    for black in (0.0, -0.0, 0.0):
        (node,) = plan(picture(), black=black, white=0.6).nodes
        assert np.signbit(node.parameters.black) == np.signbit(black)


def test_what_is_written_of_a_copy_is_what_it_holds() -> None:
    (node,) = plan(picture(), black=0.25, white=0.6).nodes
    assert '"black":0.25' in node.parameters.written
    copy = node.parameters.model_copy(update={"black": 0.125})
    assert copy.written == copy.model_dump_json() != node.parameters.written


def test_a_pipeline_s_nodes_are_found_once() -> None:
    pipeline = read("levels:black=0.1|gaussian:sigma=2")
    assert pipeline.nodes is pipeline.nodes
    assert [node.operation.name for node in pipeline.nodes] == ["levels", "gaussian"]


def test_other_facts_have_another_plan() -> None:
    assert plan(picture(), gamma=1.5) is not plan(picture(2.0), gamma=1.5)


def test_other_storage_has_another_plan() -> None:
    stored = [picture().replace(storage=storage) for storage in (Storage.FLOAT32, Storage.UINT8)]
    single, coded = (plan(each, gamma=1.6) for each in stored)
    assert single is not coded
    assert [each.graph.outputs["result"].storage for each in (single, coded)] == [Storage.FLOAT32, Storage.UINT8]
    assert plan(stored[0], gamma=1.6) is single


def test_rates_measured_since_make_a_new_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    before = plan(picture(), gamma=1.7)
    monkeypatch.setattr(times, "current", lambda backend: {})
    after = plan(picture(), gamma=1.7)
    assert after is not before
    assert after.request.rates == {}


def test_what_is_refused_is_refused_again() -> None:
    for _ in range(2):
        with pytest.raises(InvalidRequest, match="fog"):
            lichen.run("fog", picture(), depth=np.ones((4, 4)), device="numpy")


def test_no_more_than_some_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(remember, "KEPT", 2)
    first = plan(picture(), black=0.31)
    for black in (0.32, 0.33):
        plan(picture(), black=black)
    assert plan(picture(), black=0.31) is not first
