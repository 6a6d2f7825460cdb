"""Settings: where they come from, what is refused, and that workers receive what was asked."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import pytest

from lichen_cli.main import main
from lichen_service import configuration, serving
from lichen_service.configuration import from_command_line, load
from lichen_service.http import processes
from lichen_service.serving import in_memory
from lichen_service.settings import DECLARED, InvalidSettings, Settings


def test_flags_win_over_the_environment_that_over_the_file_and_that_over_defaults(tmp_path: Path) -> None:
    path = tmp_path / "service.toml"
    path.write_text('port = 1\nqueue = 2\nthreads = 3\ncalibrate = false\nhost = "::1"\n')
    environ = {"LICHEN_CONFIG": str(path), "LICHEN_PORT": "11", "LICHEN_QUEUE": "12"}
    found = load({"port": "111", "queue": None}, environ)
    settings, origins = found.settings, found.origins
    assert (settings.port, settings.queue, settings.threads, settings.host) == (111, 12, 3, "::1")
    assert settings.calibrate == "off"
    assert settings.grace == Settings().grace
    assert (origins["port"], origins["queue"], origins["grace"]) == ("--port", "LICHEN_QUEUE", "default")
    assert origins["threads"] == f"{path}: threads"


def test_the_environment_carries_every_setting_and_lets_no_file_decide(tmp_path: Path) -> None:
    settings = Settings(host="::1", port=0, body_rate=12.5, max_body=999, max_images=3)
    assert Settings.load(settings.environment()) == settings
    assert load({}, settings.environment()).settings == settings
    assert len(settings.environment()) == len(dataclasses.fields(Settings)) + 1


def test_every_bad_setting_is_named_at_once(tmp_path: Path) -> None:
    path = tmp_path / "service.toml"
    path.write_text("quue = 3\nmax_side = 1.5\nmax_images = true\nworkers = 0\n")
    environ = {
        "LICHEN_PORT": "99999",
        "LICHEN_METRICS": "9090",
        "LICHEN_THREADS": "many",
        "LICHEN_GRACE": "nan",
        "LICHEN_REQUEST_TIMEOUT": "inf",
    }
    with pytest.raises(InvalidSettings) as caught:
        load({"max_body": "0", "config": str(path)}, environ)
    message = str(caught.value)
    for part in (
        "LICHEN_PORT",
        "LICHEN_METRICS",
        "LICHEN_THREADS",
        "LICHEN_GRACE",
        "LICHEN_REQUEST_TIMEOUT",
        "--max-body",
        "'many'",
    ):
        assert part in message
    for part in ("quue is not a setting; did you mean queue?", "max_side must", "max_images must", "workers must"):
        assert part in message


@pytest.mark.parametrize("text", ["port = [", b"\xff", None])
def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, text: str | bytes | None) -> None:
    path = tmp_path / "service.toml"
    if text is not None:
        path.write_bytes(text.encode() if isinstance(text, str) else text)
    with pytest.raises(InvalidSettings, match=r"service\.toml"):
        load({}, {"LICHEN_CONFIG": str(path)})


def test_an_empty_variable_counts_as_absent() -> None:
    assert load({}, {"LICHEN_PORT": ""}).settings.port == Settings().port


def test_a_command_line_becomes_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LICHEN_QUEUE", "5")
    settings = from_command_line(["--port", "0", "--request-timeout", "2.5"]).settings
    assert (settings.port, settings.request_timeout, settings.queue) == (0, 2.5, 5)


def test_a_bad_command_line_ends_with_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        from_command_line(["--port", "eighty"])
    assert caught.value.code == 2
    assert "--port must be a whole number (got 'eighty')" in capsys.readouterr().err


def test_every_setting_has_a_flag_with_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        from_command_line(["--help"])
    shown = capsys.readouterr().out
    for each in dataclasses.fields(Settings):
        assert "--" + each.name.replace("_", "-") in shown


def test_no_published_limit_is_published_twice() -> None:
    limits = [each.limit for each in DECLARED if each.limit]
    assert len(set(limits)) == len(limits) == len(Settings().limits())


def test_the_command_shows_values_and_origins(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LICHEN_QUEUE", "7")
    assert main(["config", "--json", "--port", "81"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["port"] == {"value": 81, "origin": "--port"}
    assert shown["queue"] == {"value": 7, "origin": "LICHEN_QUEUE"}
    assert set(shown) == {each.name for each in DECLARED}
    assert main(["config", "--port", "81"]) == 0
    lines = {line.split()[0]: line.split()[1:] for line in capsys.readouterr().out.splitlines()}
    assert lines["port"] == ["81", "--port"]
    assert lines["grace"][-1] == configuration.DEFAULT
    assert main(["config", "--port", "x"]) == 2
    assert "--port must be a whole number" in capsys.readouterr().err


def test_what_is_counted_is_kept_in_memory_where_there_is_a_place(tmp_path: Path) -> None:
    assert in_memory(tmp_path) == str(tmp_path)
    assert in_memory(tmp_path / "missing") is None


def test_the_supervisor_loads_nothing_that_computes() -> None:
    heavy = "{'numpy', 'pyopencl', 'cv2', 'OpenImageIO', 'lichen.engine'}"
    said = f"""
import sys
from lichen_service import serving
try:
    serving.main(["--help"])
finally:
    print(sorted({heavy} & set(sys.modules)), "lichen_service.http.server" in sys.modules, file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert done.stderr == "[] True\n"


def test_a_worker_that_was_begun_in_vain_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    begun = processes.begin()
    monkeypatch.setattr(processes, "begin", lambda: begun)
    with pytest.raises(SystemExit):
        serving.main(["--port", "nonsense"])
    assert begun.process.returncode is not None
