"""The command line, in process where that is possible and as a command where it matters."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import netCDF4
import numpy as np
import pytest

import lichen
import lichen.files
from lichen.catalogue import operation, operations
from lichen_cli import doctor, options
from lichen_cli.main import main

Lichen = Callable[..., tuple[int, str, str]]


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Lichen:
    """command(*arguments) -> status, standard output, standard error; on a wide terminal."""
    monkeypatch.setenv("COLUMNS", "240")

    def run(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = int(end.code or 0)
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """A small array on disk."""
    path = tmp_path / "photo.npy"
    np.save(path, np.random.default_rng(3).random((12, 17, 3), np.float32))
    return path


# ------------------------------------------------------------------------------------------------------- the command


def test_help_and_mistakes_import_no_image_library() -> None:
    code = "import sys; from lichen_cli.main import main\ntry: main(sys.argv[1:])\nexcept SystemExit: pass\n"
    code += "print([name for name in ('numpy', 'pyopencl', 'pydantic', 'httpx2', 'rich') if name in sys.modules])"
    for arguments in (["--help"], ["serv"], ["--version"], ["run", "--help"], []):
        ran = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, check=True, text=True)
        assert ran.stdout.splitlines()[-1] == "[]", arguments


def test_help_names_every_command(command: Lichen) -> None:
    status, out, _ = command("--help")
    assert status == 0
    assert all(name in out for name in ("serve", "run", "operations", "calibrate", "doctor"))


def test_the_version_is_the_librarys(command: Lichen) -> None:
    assert command("--version") == (0, f"{lichen.__version__}\n", "")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["serv"], "there is no command 'serv'; did you mean serve?"),
        (["xyzzy"], "there is no command 'xyzzy'; known: serve, config, keys, run, "),
        (["--nonsense"], "unrecognized arguments: --nonsense"),
        (["run", "--sigma", "5"], "the name of an operation comes first"),
        (["run", "gausian", "a", "b"], "There is no operation 'gausian'; did you mean gaussian?"),
        (["operations", "gausian"], "did you mean gaussian?"),
        (["run", "gaussian", "--sigma", "5", "a.npy"], "a file to write is missing; the order is IMAGE OUT"),
        (["run", "gaussian", "a.npy", "b.npy", "c.npy"], "c.npy: more files than gaussian takes"),
        (["run", "gaussian", "a.npy", "b.npy", "--sigma"], "--sigma: expected one argument"),
        (["run", "gaussian", "a.npy", "b.xyz", "--sigma", "1"], "b.xyz: the suffix names no format"),
        (["run", "gaussian", "-", "-", "--sigma", "1", "--json"], "not both"),
        (["doctor", "--nonsense"], "unrecognized arguments: --nonsense"),
    ],
)
def test_a_command_line_that_makes_no_sense_ends_with_a_sentence_and_status_2(
    arguments: list[str], sentence: str, command: Lichen
) -> None:
    status, out, err = command(*arguments)
    assert (status, out) == (2, "")
    assert sentence in err
    assert err.startswith("lichen: ")
    assert "Traceback" not in err


def test_no_command_shows_help_and_fails(command: Lichen) -> None:
    status, out, err = command()
    assert (status, out) == (2, "")
    assert "commands:" in err


def test_bad_settings_of_the_server_are_all_named(command: Lichen) -> None:
    status, _, err = command("serve", "--port", "70000", "--workers", "none")
    assert status == 2
    assert "--port must be at most 65535" in err
    assert "--workers must be a whole number" in err


def test_an_interrupt_ends_quietly(command: Lichen, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(arguments: list[str]) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(doctor, "main", interrupted)
    assert command("doctor") == (130, "", "")


def test_a_reader_that_leaves_early_is_no_traceback() -> None:
    read, write = os.pipe()
    os.close(read)
    ran = subprocess.run(
        [sys.executable, "-m", "lichen_cli", "operations", "--json"], stdout=write, stderr=subprocess.PIPE
    )
    os.close(write)
    assert (ran.returncode, ran.stderr) == (1, b"")


# --------------------------------------------------------------------------------------------------------------- run


def test_run_computes_what_the_library_computes(command: Lichen, photo: Path, tmp_path: Path) -> None:
    status, out, err = command("run", "gaussian", photo, tmp_path / "soft.npy", "--sigma", "1.5", "--device", "numpy")
    assert (status, out) == (0, "")
    expected = lichen.run("gaussian", np.load(photo), sigma=1.5, device="numpy")
    np.testing.assert_array_equal(np.load(tmp_path / "soft.npy"), expected.image.pixels)
    assert err.startswith(f"{expected.method} on numpy, error at most {expected.error} (decode ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["photo.npy", "soft.npy"]


def test_options_may_stand_anywhere_and_take_either_spelling(command: Lichen, photo: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "a.npy", tmp_path / "b.npy"
    assert command("run", "gaussian", "--sigma=2", photo, "--max-error", "1e-3", first)[0] == 0
    assert command("run", "gaussian", photo, "--no-prune", "--sigma", "2", "--max_error=0.001", second)[0] == 0
    np.testing.assert_array_equal(np.load(first), np.load(second))
    expected = lichen.run("gaussian", np.load(photo), sigma=2, max_error=1e-3)
    np.testing.assert_array_equal(np.load(first), expected.image.pixels)


def test_the_report_as_json(command: Lichen, photo: Path, tmp_path: Path) -> None:
    arguments = (photo, tmp_path / "soft.npy", "--sigma", "2", "--method", "fir", "--device", "numpy", "--json")
    status, out, err = command("run", "gaussian", *arguments)
    assert (status, err) == (0, "")
    report = json.loads(out)
    assert report["method"].startswith("fir")
    assert (report["device"], report["nonfinite"], report["error"]["kind"]) == ("numpy", 0, "bound")
    assert {"decode", "plan", "kernel", "encode"} <= report["seconds"].keys()
    assert (report["output"]["width"], report["output"]["height"], report["output"]["channels"]) == (17, 12, 3)


def test_a_run_can_be_verified(command: Lichen, photo: Path, tmp_path: Path) -> None:
    arguments = ("run", "gaussian", photo, tmp_path / "soft.npy", "--sigma", "2", "--verify", "--precision", "fixed8")
    status, _, err = command(*arguments)
    assert status == 0
    assert re.search(r"error at most 0\.00\d+ \((bound|estimate)\), measured 0\.00\d+ \(", err)
    measured = json.loads(command(*arguments, "--json")[1])["measured"]
    assert 0 < measured["rms"] <= measured["p999"] <= measured["largest"]
    assert (measured["sampled"], measured["mismatched"]) == (1, 0)


def test_a_plan_is_printed_and_nothing_is_written(command: Lichen, photo: Path, tmp_path: Path) -> None:
    status, out, _ = command("run", "gaussian", photo, "--sigma", "2", "--explain")
    assert status == 0
    plan = json.loads(out)
    assert [node["operation"] for node in plan["nodes"]] == ["gaussian"]
    assert [path.name for path in tmp_path.iterdir()] == ["photo.npy"]


def test_the_suffix_or_the_option_names_the_format(command: Lichen, photo: Path, tmp_path: Path) -> None:
    assert command("run", "gaussian", photo, tmp_path / "soft.png", "--sigma", "1")[0] == 0
    assert command("run", "gaussian", photo, tmp_path / "soft.bin", "--sigma", "1", "--format", "png")[0] == 0
    assert (tmp_path / "soft.png").read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "soft.png").read_bytes() == (tmp_path / "soft.bin").read_bytes()


def test_standard_input_and_output_carry_pictures(photo: Path) -> None:
    arguments = [sys.executable, "-m", "lichen_cli", "run", "gaussian", "-", "-", "--sigma", "0", "--device", "numpy"]
    ran = subprocess.run(arguments, input=photo.read_bytes(), capture_output=True, check=True)
    np.testing.assert_array_equal(np.load(io.BytesIO(ran.stdout)), np.load(photo))
    assert b"identity" in ran.stderr


def test_further_inputs_are_named_options(command: Lichen, tmp_path: Path) -> None:
    field, texture = tmp_path / "field.npy", tmp_path / "texture.npy"
    np.save(field, np.dstack([np.ones((9, 9)), np.zeros((9, 9))]).astype(np.float32))
    np.save(texture, np.random.default_rng(5).random((9, 9, 1), np.float32))
    out = tmp_path / "lic.npy"
    status, _, err = command(
        "run", "lic", field, out, "--texture", texture, "--length", "3", "--method", "rk4", "--device", "numpy"
    )
    assert status == 0, err
    expected = lichen.run("lic", np.load(field), texture=np.load(texture), length=3, method="rk4", device="numpy")
    np.testing.assert_array_equal(np.load(out), expected.image.pixels)


def test_a_field_in_netcdf_becomes_lines_in_npy(command: Lichen, tmp_path: Path) -> None:
    wind, lines = tmp_path / "wind.nc", tmp_path / "lines.npy"
    with netCDF4.Dataset(wind, "w") as file:
        for name, size in (("time", 2), ("lat", 24), ("lon", 32)):
            file.createDimension(name, size)
        for name, value in (("u", 1), ("v", 0)):
            file.createVariable(name, "f4", ("time", "lat", "lon"))[:] = [[[0]], [[value]]]
    run = ["run", "streamlines", wind, lines, "--spacing=8", "--length=8", "--device=numpy", "--findings=npy"]
    assert command(*run, "--select", "time=1")[0] == 0
    table = np.load(lines)
    assert table.shape[1] == 3
    assert (np.diff(table[:, 1])[np.diff(table[:, 0]) == 0] > 0).all()
    assert command(*run)[0] == 0
    assert np.load(lines).shape == (0, 3)  # nothing blows at first
    status, _, said = command(*run, "--select", "time=2,noon=1")
    assert status != 0
    assert "--select: noon is no dimension" in said


def test_every_flaw_is_named_at_once(command: Lichen, photo: Path, tmp_path: Path) -> None:
    status, out, err = command(
        *("run", "gaussian", photo, tmp_path / "x.npy"),
        *("--sigma", "-1e-3", "--bordr", "clamp", "--max-error", "-1", "--device=gpu", "--method", "firr"),
    )
    assert (status, out) == (2, "")
    for option, words in {
        "--sigma": "greater than or equal to 0",
        "--bordr": "did you mean border",
        "--max-error": "greater than 0",
        "--device": "'opencl' or 'numpy'",
        "--method": "did you mean fir",
    }.items():
        assert re.search(rf"^  {option}: .*{re.escape(words)}", err, re.MULTILINE), (option, err)
    assert not (tmp_path / "x.npy").exists()


def test_an_unknown_flag_that_swallows_a_file_is_still_named(command: Lichen, photo: Path, tmp_path: Path) -> None:
    status, _, err = command("run", "gaussian", "--sgima", photo, tmp_path / "x.npy")
    assert status == 2
    assert "--sgima: is not a name gaussian knows; did you mean sigma" in err


@pytest.mark.parametrize(
    ("content", "sentence"), [(b"", "no bytes"), (b"\x93NUMPY\x01\x00v\x00", "ends after 10 bytes|header")]
)
def test_an_unreadable_picture_is_a_sentence(content: bytes, sentence: str, command: Lichen, tmp_path: Path) -> None:
    (tmp_path / "broken.npy").write_bytes(content)
    status, _, err = command("run", "gaussian", tmp_path / "broken.npy", tmp_path / "x.npy", "--sigma", "1")
    assert status == 2
    assert re.search(sentence, err), err
    assert "Traceback" not in err


def test_a_missing_file_is_a_failure_that_names_it(command: Lichen, tmp_path: Path, photo: Path) -> None:
    missing = tmp_path / "missing.npy"
    assert command("run", "gaussian", missing, tmp_path / "x.npy", "--sigma", "1") == (
        1,
        "",
        f"lichen: {missing}: No such file or directory\n",
    )
    status, _, err = command("run", "gaussian", photo, tmp_path / "nowhere" / "x.npy", "--sigma", "1")
    assert status == 1
    assert "No such file or directory" in err


# ------------------------------------------------------------------------------------------- read off the declaration


@pytest.mark.parametrize("name", list(operations()))
def test_help_and_description_name_everything_an_operation_declares(name: str, command: Lichen) -> None:
    declaration = operation(name)
    status, help, _ = command("run", name, "--help")
    assert status == 0
    status, described, _ = command("operations", name)
    assert status == 0
    declared = [*declaration.parameters.model_fields, *declaration.knobs]
    for each in declared + [given.name for given in declaration.inputs[1:]]:
        assert f"--{each.replace('_', '-')}" in help
    for each in [*declared, *declaration.methods, *(given.name for given in declaration.inputs)]:
        assert each in described


def test_the_list_has_every_operation(command: Lichen) -> None:
    status, out, _ = command("operations")
    assert status == 0
    assert all(name in out for name in operations())
    listed = json.loads(command("operations", "--json")[1])["operations"]
    assert [each["name"] for each in listed] == list(operations())


@pytest.mark.parametrize("name", list(operations()))
def test_an_operation_as_json_holds_its_schema(name: str, command: Lichen) -> None:
    document = json.loads(command("operations", name, "--json")[1])
    assert document["name"] == name
    assert document["parameters"]["properties"].keys() == operation(name).parameters.model_fields.keys()


@pytest.mark.parametrize(
    ("field", "kind", "span"),
    [
        ({"type": "number", "minimum": 0, "exclusiveMaximum": 1}, "number", "at least 0, below 1"),
        ({"anyOf": [{"type": "integer", "exclusiveMinimum": 0}, {"type": "null"}]}, "integer", "above 0"),
        ({"enum": ["a", "b"], "type": "string"}, "a|b", ""),
        ({"anyOf": [{"enum": ["a"]}, {"type": "number"}]}, "a or number", ""),
        ({"type": "array"}, "JSON", ""),
        ({"const": "x"}, "x", ""),
        ({}, "text", ""),
    ],
)
def test_schemas_are_told_in_words(field: dict[str, object], kind: str, span: str) -> None:
    assert (options.kind_of(field), options.range_of(field)) == (kind, span)


# ------------------------------------------------------------------------------------------------------------ doctor


def test_a_texture_is_printed_and_run(command: Lichen, tmp_path: Path) -> None:
    status, listed, _ = command("textures")
    assert status == 0
    assert "marble" in listed
    status, out, _ = command("textures", "marble", "--width", "24", "--height", "16")
    assert status == 0
    (tmp_path / "marble.json").write_text(out)
    picture = tmp_path / "marble.png"
    assert command("run", "--pipeline", f"@{tmp_path / 'marble.json'}", str(picture))[0] == 0
    assert lichen.files.decode(picture.read_bytes()).pixels.shape == (16, 24, 3)
    status, _, err = command("textures", "marble", "--width", "none")
    assert (status, "--width" in err) == (2, True)


def test_doctor_tries_every_format_and_every_method(command: Lichen, monkeypatch: pytest.MonkeyPatch) -> None:
    from lichen.files import FORMATS

    status, out, _ = command("doctor", "--json")
    found = json.loads(out)
    failed = [check for check in found["checks"] if check["works"] is False]
    assert (status, found["sound"]) == (1, False) if failed else (0, True)
    broken = [check for check in failed if check["area"] in ("formats", "operations")]
    assert broken == []
    names = {check["name"] for check in found["checks"]}
    assert {f"{format.name} {storage}" for format in FORMATS.values() for storage in format.storages} <= names
    for each in operations().values():
        assert {f"{each.name} {method}, numpy" for method in each.methods} <= names


def test_doctor_finds_a_format_that_alters_pictures(command: Lichen, monkeypatch: pytest.MonkeyPatch) -> None:
    import lichen.files

    real = lichen.files.decode

    def altered(*arguments: object, **keywords: object) -> object:
        image = real(*arguments, **keywords)
        return image.replace(pixels=image.pixels + np.float32(0.25))

    monkeypatch.setattr(lichen.files, "decode", altered)
    monkeypatch.setattr(doctor, "_operations", list)
    status, out, _ = command("doctor")
    assert status == 1
    assert re.search(r"png uint8\s+FAILS\s+came back changed by 0\.2", out)


def test_doctor_finds_a_method_that_is_wrong(command: Lichen, monkeypatch: pytest.MonkeyPatch) -> None:
    real = lichen.evaluate_truth
    some = {name: operations()[name] for name in ("gaussian", "levels")}
    monkeypatch.setattr("lichen.catalogue.operations", lambda: some)
    monkeypatch.setattr(lichen, "evaluate_truth", lambda *given, **values: real(*given, **values) + 0.5, raising=False)
    monkeypatch.setattr(doctor, "_formats", list)
    status, out, _ = command("doctor")
    assert status == 1
    assert re.search(r"gaussian fir, numpy\s+FAILS\s+error 0\.5", out)
