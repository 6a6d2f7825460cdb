"""The command line beside runs in process: services, scenes, comparisons, completion."""

from __future__ import annotations

import io
import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lichen
from lichen_cli.main import COMMANDS, main
from lichen_cli.sizes import bytes_of


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "photo.npy"
    np.save(path, np.random.default_rng(3).random((12, 17, 3), np.float32))
    return path


def test_a_service_can_compute_what_the_command_says(
    server: Any, answer: Any, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = [("Content-Type", "image/tiff"), ("Lichen-Method", "fir"), ("Lichen-Error", "1e-5; bound; max")]
    server.script = [answer(headers=made, body=b"II*\0 picture")]
    out = tmp_path / "soft.tif"
    assert main(["run", "gaussian", str(photo), str(out), "--sigma", "2", "--url", server.url]) == 0
    assert out.read_bytes() == b"II*\0 picture"
    assert "fir" in capsys.readouterr().err
    assert main(["run", "gaussian", str(photo), str(out), f"--url={server.url}", "--sigma", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["error"] == {"value": 1e-5, "kind": "bound"}
    request = server.received[0]
    assert request.target == "/v1/operations/gaussian?sigma=2&format=tiff"
    assert request.body == photo.read_bytes()


def test_what_a_service_says_against_it_is_told_as_ever(
    server: Any, answer: Any, photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = {"detail": "No.", "errors": [{"pointer": "/parameters/sigma", "detail": "is negative"}]}
    server.script = [answer(422, [("Content-Type", "application/problem+json")], json.dumps(problem).encode())]
    out = tmp_path / "soft.tif"
    assert main(["run", "gaussian", str(photo), str(out), "--sigma", "-2", "--url", server.url]) == 2
    assert capsys.readouterr().err == "lichen: No.\n  --sigma: is negative\n"
    assert not out.exists()
    assert main(["run", "gaussian", str(photo), str(out), "--sigma", "2", "--url"]) == 2


SCENE = {
    "camera": {"eye": [0, 1.5, 4], "target": [0, 0.5, 0], "width": 24, "height": 16},
    "objects": [{"shape": "plane"}, {"shape": "sphere", "centre": [0, 0.7, 0], "radius": 0.7}],
    "lights": [{"kind": "point", "position": [3, 5, 2], "intensity": 30}],
    "environment": {"image": "sky", "reflectance": 0.2},
}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    np.save(tmp_path / "sky.npy", np.full((4, 8, 3), 0.5, np.float32))
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(SCENE))
    return path


def test_a_scene_is_computed_as_the_library_does_it(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sky, more = f"--input=sky={tmp_path}/sky.npy", ("--device", "numpy")
    first, second = tmp_path / "a.npy", tmp_path / "b.npy"
    assert main(["scene", str(scene), str(first), sky, *more]) == 0
    assert "on numpy, error at most" in capsys.readouterr().err
    expected = lichen.render(SCENE, images={"sky": np.load(tmp_path / "sky.npy")}, device="numpy").image.pixels
    np.testing.assert_array_equal(np.load(first), expected)
    assert main(["run", "--scene", str(scene), str(second), sky, "--json", *more]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["device"], report["path"], report["nonfinite"]) == ("numpy", str(second), 0)
    assert second.read_bytes() == first.read_bytes()
    assert main(["scene", str(scene), "--explain", sky, *more]) == 0
    assert "environment" in capsys.readouterr().out
    assert main(["scene", str(scene), str(tmp_path / "map.png"), "--map", sky, *more]) == 0
    assert "which of light_0, environment each" in capsys.readouterr().err
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    assert main(["scene", str(scene), "--map", sky, *more]) == 0
    assert json.loads(capsys.readouterr().out)["effects"] == ["light_0", "environment"]


def test_a_scene_goes_through_pipes_and_to_a_service(
    scene: Path, server: Any, answer: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfdbinary: Any
) -> None:
    server.script = [answer(headers=[("Content-Type", "image/png"), ("Lichen-Method", "m")], body=b"\x89PNG it is")]
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(scene.read_bytes())))
    sky = f"sky={tmp_path}/sky.npy"
    assert main(["scene", "-", "-", "--input", sky, "--max-error", "0.01", "--url", server.url]) == 0
    assert capfdbinary.readouterr().out == b"\x89PNG it is"
    request = server.received[0]
    assert request.target == "/v1/scenes?max_error=0.01&format=png"
    assert scene.read_bytes() in request.body
    assert (tmp_path / "sky.npy").read_bytes() in request.body


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["SCENE", "out.png", "--max-ms", "-1"], 2, "--max-ms: "),
        (["SCENE", "out.png"], 2, "sky: is read by the scene"),
        (["BAD", "out.png"], 2, "camera fov: "),
        (["SCENE"], 2, "the order is SCENE OUT"),
        (["SCENE", "out.xyz"], 2, "the suffix names no format"),
        (["SCENE", "-", "--json"], 2, "not both"),
        (["SCENE", "out.png", "--input=sky"], 2, "--input takes NAME=FILE"),
        (["nowhere.json", "out.png"], 1, "nowhere.json: No such file"),
        (["SCENE", "out.png", "--url", "http://127.0.0.1:9"], 1, "3 tries"),
    ],
)
def test_what_is_wrong_with_a_scene_is_a_sentence_and_a_status(
    arguments: list[str], status: int, said: str, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = tmp_path / "bad.json"
    bad.write_text(json.dumps({**SCENE, "camera": {"fov": 500}, "mist": 1}))
    places = {"SCENE": str(scene), "BAD": str(bad)}
    assert main(["scene", *(places.get(each, each) for each in arguments)]) == status
    told = capsys.readouterr()
    assert (told.out, said in told.err) == ("", True), told.err


def test_pictures_are_compared_and_pipelines_run_by_commands_of_their_own(
    photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    soft, far = tmp_path / "soft.npy", tmp_path / "far.npy"
    assert main(["pipeline", "gaussian:sigma=1|levels:black=0.1", str(photo), str(soft), "--device", "numpy"]) == 0
    assert main(["compare", str(soft), str(photo), "--device", "numpy"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["largest"] == pytest.approx(np.abs(np.load(soft) - np.load(photo)).max(), rel=1e-6)
    assert main(["compare", str(soft), str(photo), str(far), "--device", "numpy"]) == 0
    np.testing.assert_allclose(np.load(far), np.abs(np.load(soft) - np.load(photo)), atol=1e-7)
    assert main(["compare", str(soft)]) == 2
    assert "come first" in capsys.readouterr().err


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_can_complete_commands_operations_and_options(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(name in script for name in (*COMMANDS, "gaussian", "retry-failed", "max-error"))


def test_bash_takes_the_script_and_completes_with_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    ask = """
    complete_line() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _lichen; echo "${COMPREPLY[*]}"; }
    complete_line lichen ba; complete_line lichen run gaus; complete_line lichen run gaussian in --sig
    complete_line lichen batch run x --retry
    complete_line lichen scene x.json y.png --ma
    """
    said = subprocess.run(["bash", "-c", script + ask], capture_output=True, text=True, check=True).stdout
    commands, operation, options, batch, scene = said.splitlines()
    assert (commands, operation, batch) == ("batch", "gaussian", "--retry-failed")
    assert set(scene.split()) == {"--map", "--max-error", "--max-ms"}
    assert "--sigma" in options.split()
    assert all(each.startswith("--sig") for each in options.split())


@pytest.mark.parametrize(
    ("text", "count"), [("1000", 1000), ("512MB", 512_000_000), ("2GiB", 2 << 30), ("1.5 g", 1_500_000_000)]
)
def test_sizes_are_read_as_people_write_them(text: str, count: int) -> None:
    assert bytes_of(text) == count
