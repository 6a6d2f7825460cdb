"""Pipelines from the clients and the command line: built, drawn, sent, and taken apart again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit
from xml.etree import ElementTree

import numpy as np
import pytest

import lichen
from lichen.planning.pipeline import nodes_of, read
from lichen_cli.main import main
from lichen_client import Client, ConnectionFailed, Pipeline, Results
from lichen_client.calls import pipeline_call
from lichen_client.retry import Reply
from lichen_service import mixed


def built() -> Pipeline:
    p = Pipeline()
    photo = p.input("image")
    soft = p.add("gaussian", photo, sigma=5.0, method="fir", knobs={"tail": 1e-3})
    sharp = p.add("mix", photo, base=soft, amount=np.float64(1.5))
    p.output("soft", soft, format="png")
    p.output("sharp", p.add("gaussian", sharp, name="last", sigma=1))
    return p


def test_a_built_pipeline_is_one_the_library_reads() -> None:
    p = built()
    nodes = nodes_of(read(p.to_json()))
    assert [(node.name, node.operation.name) for node in nodes] == [
        ("gaussian", "gaussian"),
        ("mix", "mix"),
        ("last", "gaussian"),
    ]
    assert nodes[0].asked.method == "fir"
    assert nodes[1].inputs == {"image": "input.image", "base": "gaussian"}
    assert read(json.dumps(p.to_json())).outputs["soft"].format == "png"
    assert not read(p.to_json()).concatenate
    p.concatenate = True
    assert read(p.to_json()).concatenate


def test_the_first_input_is_found_whatever_it_is_called() -> None:
    p = Pipeline()
    p.add("lic", p.input("field"), texture=p.input("texture"), length=5)
    assert nodes_of(read(p.to_json()))[0].inputs == {"field": "input.field", "texture": "input.texture"}


def test_nodes_of_one_pipeline_do_not_enter_another() -> None:
    p, other = Pipeline(), Pipeline()
    value = other.add("levels")
    with pytest.raises(ValueError, match="another pipeline"):
        p.add("levels", value)
    with pytest.raises(ValueError, match="another pipeline"):
        p.output("x", value)
    with pytest.raises(ValueError, match="already"):
        other.add("levels", name="levels")
    with pytest.raises(ValueError, match="empty"):
        p.to_json()


def test_a_pipeline_is_drawn_as_text() -> None:
    assert str(built()).splitlines() == [
        "gaussian = gaussian(input.image, sigma=5.0)",
        "mix = mix(input.image, base=gaussian, amount=1.5)",
        "last = gaussian(mix, sigma=1)",
        "gaussian -> soft",
        "last -> sharp",
    ]


def test_a_pipeline_is_drawn_as_svg() -> None:
    p = built()
    p.add("curve", p.input("<&>"), points=[[0, 0], [1, 1]])
    drawing = ElementTree.fromstring(p.to_svg())
    space = "{http://www.w3.org/2000/svg}"
    boxes = drawing.findall(f".//{space}rect")
    kinds = [box.get("class") for box in boxes]
    assert {kind: kinds.count(kind) for kind in ("input", "node", "output")} == {"input": 2, "node": 4, "output": 2}
    assert len(drawing.findall(f"{space}path")) == 7
    places = [(box.get("x"), box.get("y")) for box in boxes]
    assert len(set(places)) == len(places)


def test_a_call_is_a_form_with_the_pipeline_and_its_pictures() -> None:
    call = pipeline_call(built(), np.ones((2, 2)), {"other": b"x"}, {"max_error": 0.5}, format=None)
    assert [part.name for part in call.parts] == ["pipeline", "image", "other"]
    assert call.accept.startswith("multipart/mixed")
    assert parse_qs(urlsplit(call.target).query) == {"max_error": ["0.5"], "format": ["npy"]}
    text = pipeline_call("gaussian:sigma=1", None, None, {}, format="png", explain=True)
    assert (text.parts[0].pieces, text.accept) == ((b"gaussian:sigma=1",), "application/json")
    assert parse_qs(urlsplit(text.target).query) == {"format": ["png"], "explain": ["true"]}


def test_an_answer_is_taken_apart() -> None:
    body = b"a\r\n\r\n--b\r\n" * 3
    parts: list[Any] = [
        ({"Content-Type": "image/png", "Lichen-Output": "x", "Lichen-Error": "0.5; bound; max"}, body),
        ({"Content-Type": "image/png", "Lichen-Output": "x", "Lichen-Map": "log10"}, b"map"),
        ({"Content-Type": "application/json"}, b'{"node": {"mean": 1}}'),
    ]
    content_type, whole = mixed.join(parts)
    reply = Reply(200, {"content-type": content_type, "lichen-device": "numpy"}, bytearray(whole))
    results = Results.read(reply)
    assert dict(results).keys() == {"x"}
    assert results["x"].content == body
    assert results["x"].report.error is not None
    assert (results["x"].report.error.value, results["x"].report.device) == (0.5, "numpy")
    assert (results.findings, results.maps["x"].content) == ({"node": {"mean": 1}}, b"map")


def test_an_answer_that_is_cut_off_is_no_answer(server: Any, answer: Any) -> None:
    content_type, whole = mixed.join([({"Content-Type": "image/png", "Lichen-Output": "x"}, b"data")])
    for headers, body in (([("Content-Type", content_type)], whole[:-30]), ([("Content-Type", "image/png")], b"data")):
        server.script = [answer(headers=headers, body=body)]
        with Client(server.url) as client, pytest.raises(ConnectionFailed):
            client.run_pipeline("levels", np.ones((2, 2)))


# -------------------------------------------------------------------------------------------------- the command line


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "photo.npy"
    np.save(path, np.random.default_rng(3).random((12, 17, 3), np.float32))
    return path


def test_a_pipeline_runs_on_files(photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.npy"
    assert (
        main(["run", "--pipeline", "gaussian:sigma=2|levels:black=0.1", str(photo), str(out), "--device", "numpy"]) == 0
    )
    expected = lichen.run_pipeline("gaussian:sigma=2|levels:black=0.1", np.load(photo), device="numpy")["result"]
    np.testing.assert_array_equal(np.load(out), expected.image.pixels)
    assert "levels=exact on numpy" in capsys.readouterr().err


def test_several_files_have_names(photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = tmp_path / "said.json"
    said.write_text(json.dumps(built().to_json()))
    soft, sharp = tmp_path / "soft.png", tmp_path / "sharp.npy"
    arguments = [
        "run",
        "--pipeline",
        f"@{said}",
        str(photo),
        f"--output=soft={soft}",
        f"--output=sharp={sharp}",
        "--json",
    ]
    assert main(arguments) == 0
    report = json.loads(capsys.readouterr().out)
    assert set(report["outputs"]) == {"soft", "sharp"}
    assert report["outputs"]["soft"]["media_type"] == "image/png"
    assert np.load(sharp).shape == (12, 17, 3)
    assert soft.read_bytes().startswith(b"\x89PNG")


def test_a_plan_is_explained(photo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--pipeline=gaussian:sigma=0|levels:gamma=2", str(photo), "--explain"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert [node["operation"] for node in plan["nodes"]] == ["levels"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--pipeline", "gausian", "IN", "out.npy"], "did you mean gaussian?"),
        (["--pipeline", "gaussian:sigma=-1", "IN", "out.npy"], "node gaussian parameters sigma: "),
        (["--pipeline", "levels", "IN"], "nobody says where 'result' goes"),
        (["--pipeline", "levels", "IN", "a.npy", "b.npy"], "b.npy: there is nothing left"),
        (["--pipeline", "levels", "IN", "--output=x=y.npy"], "there is no output 'x'"),
        (["--pipeline", "levels", "IN", "--output=x"], "--output takes NAME=FILE"),
        (["--pipeline", "mix:base=input.other", "--input=image=IN", "--output=result=o.npy"], "is required"),
        (["--pipeline", "levels", "IN", "out.xyz"], "the suffix names no format"),
    ],
)
def test_mistakes_are_explained(
    arguments: list[str], said: str, photo: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", *(each.replace("IN", str(photo)) for each in arguments)]) == 2
    assert said in capsys.readouterr().err
