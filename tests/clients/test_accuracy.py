"""`lichen accuracy`: the table, the plot, and command lines that make no sense."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import pytest

import lichen
from lichen_cli.main import main

Lichen = Callable[..., tuple[int, str, str]]


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Lichen:
    """command(*arguments) -> status, standard output, standard error."""

    def run(*arguments: object, columns: int = 200) -> tuple[int, str, str]:
        monkeypatch.setenv("COLUMNS", str(columns))
        capsys.readouterr()
        status = main(["accuracy", *(str(argument) for argument in arguments)])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


def test_the_overview_has_a_line_for_every_operation(command: Lichen) -> None:
    status, out, _ = command()
    assert status == 0
    assert all(name in out for name in lichen.operations())
    assert [each["operation"] for each in json.loads(command("--json")[1])] == list(lichen.operations())


@pytest.mark.parametrize("columns", [80, 200])
def test_the_table_names_every_setting_and_its_reason(command: Lichen, columns: int) -> None:
    status, out, _ = command("gaussian", "--predict", "--example", 4, columns=columns)
    assert status == 0
    for knob in ("1e-2", "1e-7"):
        assert f"fir at {knob}" in out
        assert f"x dct at {knob}" in out
    assert "the border is clamp" in out
    assert ("CIEDE2000  " in out) == (columns == 200)
    assert "FLIP" not in command("normals", "--predict", columns=columns)[1]
    assert max(len(line) for line in out.splitlines()) <= columns


def test_parameters_are_measured_and_drawn(command: Lichen, tmp_path: Path) -> None:
    svg, png = tmp_path / "plot.svg", tmp_path / "plot.png"
    given = ("transfer", "--curve=gamma", "--gamma", "2.4", "--size", 64, "--svg", svg, "--png", png, "--json")
    status, out, _ = command(*given)
    assert status == 0
    made = json.loads(out)
    assert made["parameters"] == {"curve": "gamma", "gamma": 2.4}
    assert made["command"] == f"lichen accuracy transfer --curve gamma --gamma 2.4 --size 64 --device {made['device']}"
    assert any(each["on_front"] for each in made["settings"])
    assert ElementTree.parse(svg).getroot().tag.endswith("svg")
    assert png.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["gausian"], "did you mean gaussian?"),
        (["--sigma", "3"], "name an operation first"),
        (["gaussian", "lic"], "lic: one operation at a time"),
        (["gaussian", "--sigma"], "--sigma: expected one argument"),
        (["gaussian", "--example", "99"], "--example must lie between 0 and"),
        (["gaussian", "--size", "7"], "--size must lie between"),
        (["gaussian", "--sigma", "3", "--predict"], "parameters are measured"),
        (["gaussian", "--sgima", "3"], "--sgima: is not a parameter of gaussian"),
    ],
)
def test_a_command_line_that_makes_no_sense_ends_with_a_sentence(
    command: Lichen, arguments: list[str], sentence: str
) -> None:
    status, out, err = command(*arguments)
    assert (status, out) == (2, "")
    assert sentence in err
