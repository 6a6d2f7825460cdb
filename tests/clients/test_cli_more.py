"""The command line beside runs in process: services, completion."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

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
    """
    said = subprocess.run(["bash", "-c", script + ask], capture_output=True, text=True, check=True).stdout
    commands, operation, options, batch = said.splitlines()
    assert (commands, operation, batch) == ("batch", "gaussian", "--retry-failed")
    assert "--sigma" in options.split()
    assert all(each.startswith("--sig") for each in options.split())


@pytest.mark.parametrize(
    ("text", "count"), [("1000", 1000), ("512MB", 512_000_000), ("2GiB", 2 << 30), ("1.5 g", 1_500_000_000)]
)
def test_sizes_are_read_as_people_write_them(text: str, count: int) -> None:
    assert bytes_of(text) == count
