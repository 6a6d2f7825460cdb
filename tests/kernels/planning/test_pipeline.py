"""Pipelines as they are written: read, checked and put in order, as mappings, as JSON and as text."""

from __future__ import annotations

import json
from typing import Any

import pytest

from lichen.errors import InvalidRequest
from lichen.planning import text
from lichen.planning.pipeline import nodes_of, read


def pointers(said: Any) -> set[str]:
    with pytest.raises(InvalidRequest) as refused:
        nodes_of(read(said))
    return {flaw.pointer for flaw in refused.value.flaws}


def details(said: Any) -> str:
    with pytest.raises(InvalidRequest) as refused:
        nodes_of(read(said))
    return str(refused.value)


# -------------------------------------------------------------------------------------------------------------- text


def test_text_is_a_chain() -> None:
    pipeline = read("transfer:direction=decode | gaussian:sigma=5|transfer:direction=encode")
    assert list(pipeline.steps) == ["transfer", "gaussian", "transfer2"]
    assert pipeline.steps["transfer"].inputs == {"image": "input.image"}
    assert pipeline.steps["gaussian"].inputs == {"image": "transfer"}
    assert pipeline.outputs["result"].node == "transfer2"
    assert pipeline.inputs == ("image",)


def test_text_knows_parameters_knobs_methods_and_inputs() -> None:
    pipeline = read("soft=gaussian:sigma=3,method=fir,tail=0.01,max_error=0.1|mix:amount=0.5,base=input.other")
    soft, mixed = pipeline.steps["soft"], pipeline.steps["mix"]
    assert (soft.parameters, soft.method, soft.knobs, soft.max_error) == (
        {"sigma": "3"},
        "fir",
        {"tail": "0.01"},
        "0.1",
    )
    assert mixed.inputs == {"image": "soft", "base": "input.other"}
    assert pipeline.inputs == ("image", "other")
    assert nodes_of(pipeline)[0].asked.knobs == {"tail": 0.01}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a=[[1,0,0],[0,1,0],[0,0,1]]", [[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
        ('a={"x":"1,2|3"}', {"x": "1,2|3"}),
        ('a="1,2|3"', "1,2|3"),
        (r"a=1\,2\|3\\", "1,2|3\\"),
        ("a= b c ", "b c"),
        ("a=", ""),
        ("a=b=c", "b=c"),
        ("a=[broken", "[broken"),
    ],
)
def test_values_hold_what_ends_them_elsewhere(text: str, value: Any) -> None:
    steps = read(f"matrix:{text},z=1|levels").steps
    assert steps["matrix"].parameters == {"a": value, "z": "1"}
    assert list(steps) == ["matrix", "levels"]


@pytest.mark.parametrize(
    "text", ["", "|", "gaussian|", "gaussian:sigma", "a=gaussian|a=levels", "gaussian:sigma=1,sigma=2"]
)
def test_text_of_another_form_is_refused(text: str) -> None:
    assert pointers(text)


def test_json_and_mappings_and_text_are_one() -> None:
    said = {"nodes": {"gaussian": {"operation": "gaussian", "parameters": {"sigma": 2}}}}
    made = [nodes_of(read(each)) for each in (said, json.dumps(said), json.dumps(said).encode(), "gaussian:sigma=2")]
    assert all(each == made[0] for each in made)


# ---------------------------------------------------------------------------------------------------------- mappings


def test_every_flaw_is_named_at_once() -> None:
    said = {
        "nodes": {
            "a": {"operation": "gausian", "inputs": {"image": "b"}},
            "b": {"operation": "gaussian", "parameters": {"sigma": -1, "sigmas": 2}, "method": "fur"},
            "c": {"operation": "levels", "inputs": {"picture": "nowhere"}, "knobs": {"tail": 1}, "max_error": 0},
            "d": {"operation": "mix", "inputs": {"base": "b"}, "wish": 1},
        },
        "outputs": {"o": {"node": "zz", "size": 3}},
        "name": "x",
    }
    assert pointers(said) == {
        "/name",
        "/nodes/a/operation",
        "/nodes/b/parameters/sigma",
        "/nodes/b/parameters/sigmas",
        "/nodes/b/method",
        "/nodes/c/inputs/picture",
        "/nodes/c/inputs/image",
        "/nodes/c/knobs/tail",
        "/nodes/c/max_error",
        "/nodes/d/wish",
        "/nodes/d/inputs/image",
        "/outputs/o/node",
        "/outputs/o/size",
    }
    assert "did you mean gaussian?" in details(said)


def test_a_cycle_is_told() -> None:
    nodes = {name: {"operation": "levels", "inputs": {"image": before}} for name, before in ("ac", "ba", "cb")}
    said = {"nodes": nodes, "outputs": {"o": "a"}}
    assert "a -> c -> b -> a" in details(said)
    nodes["a"]["inputs"] = {"image": "a"}  # type: ignore[assignment]
    assert "a -> a" in details(said)


def test_nodes_may_be_written_in_any_order() -> None:
    nodes = {
        "last": {"operation": "mix", "inputs": {"image": "first", "base": "middle"}},
        "middle": {"operation": "gaussian", "parameters": {"sigma": 1}, "inputs": {"image": "first"}},
        "first": {"operation": "levels", "inputs": {"image": "input.photo"}},
    }
    assert [node.name for node in nodes_of(read({"nodes": nodes}))] == ["first", "middle", "last"]


def test_the_output_may_be_left_out_where_there_is_only_one() -> None:
    two = {name: {"operation": "levels"} for name in ("a", "b")}
    assert pointers({"nodes": two}) == {"/outputs"}
    assert read({"nodes": {"a": two["a"]}}).outputs["result"].node == "a"


@pytest.mark.parametrize(
    "said",
    [
        {},
        {"nodes": {}},
        {"nodes": []},
        {"nodes": {"a": 3}},
        {"nodes": {"a": {"operation": 3}}},
        {"nodes": {"a b": {"operation": "levels"}}},
        {"nodes": {"a": {"operation": "levels", "parameters": []}}},
        {"nodes": {"a": {"operation": "levels", "inputs": {"image": 3}}}},
        {"nodes": {"a": {"operation": "levels", "method": 3}}},
        {"nodes": {"a": {"operation": "levels"}}, "outputs": {}},
        {"nodes": {"a": {"operation": "levels"}}, "outputs": {"x": 3}},
        {"nodes": {"a": {"operation": "levels"}}, "outputs": {"x": {"node": "a", "format": 3}}},
        "{",
        b"\xff",
        '{"nodes": ' + "[" * 100000,
    ],
)
def test_what_has_another_shape_is_refused(said: Any) -> None:
    assert pointers(said)


def test_a_long_chain_is_put_in_order() -> None:
    names = [f"n{number}" for number in range(1000)]
    nodes = {
        name: {"operation": "levels", "inputs": {"image": names[number - 1] if number else "input.image"}}
        for number, name in reversed(list(enumerate(names)))
    }
    assert [node.name for node in nodes_of(read({"nodes": nodes}))] == names


def test_text_ends_with_the_part_that_is_wanted() -> None:
    said = text.read("levels:black=0.1|gaussian:sigma=2|crop:left=3,top=4,width=20,height=10")
    assert said["outputs"] == {"result": {"node": "gaussian", "crop": [3, 4, 20, 10]}}
    assert list(said["nodes"]) == ["levels", "gaussian"]
    assert read("levels|crop:width=5,height=6").outputs["result"].crop == (0, 0, 5, 6)
    for wrong, pointer in (
        ("levels|crop:width=5", "/outputs/result/crop/height"),
        ("levels|crop:width=5,hight=6,height=1", "/outputs/result/crop/hight"),
        ("levels|crop:width=5,height=-6", "/outputs/result/crop"),
        ("crop:width=5,height=6|levels", "/pipeline"),
    ):
        with pytest.raises(InvalidRequest) as refused:
            read(wrong)
        assert [flaw.pointer for flaw in refused.value.flaws] == [pointer], wrong


def test_concatenation_is_asked_for_in_so_many_words() -> None:
    nodes = {"a": {"operation": "rotate"}, "b": {"operation": "affine", "inputs": {"image": "a"}}}
    assert read({"nodes": nodes, "concatenate": True}).concatenate
    assert pointers({"nodes": nodes, "concatenate": "yes"}) == {"/concatenate"}
