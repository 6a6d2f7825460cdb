"""Settings: where they come from, what is refused, and that workers receive what was asked."""

from __future__ import annotations

import dataclasses

import pytest

from lichen_service.settings import InvalidSettings, Settings, from_command_line


def test_flags_win_over_the_environment_and_that_over_defaults() -> None:
    environ = {"LICHEN_PORT": "1234", "LICHEN_QUEUE": "7"}
    settings = Settings.load(environ, {"port": "4321", "queue": None})
    assert (settings.port, settings.queue) == (4321, 7)
    assert settings.host == Settings().host


def test_the_environment_carries_every_setting() -> None:
    settings = Settings(host="::1", port=0, body_rate=12.5, max_body=999, max_images=3)
    assert Settings.load(settings.environment()) == settings
    assert len(settings.environment()) == len(dataclasses.fields(Settings))


def test_every_bad_setting_is_named_at_once() -> None:
    environ = {"LICHEN_PORT": "99999", "LICHEN_THREADS": "many", "LICHEN_GRACE": "nan", "LICHEN_REQUEST_TIMEOUT": "inf"}
    with pytest.raises(InvalidSettings) as caught:
        Settings.load(environ, {"max_body": "0"})
    message = str(caught.value)
    for part in ("LICHEN_PORT", "LICHEN_THREADS", "LICHEN_GRACE", "LICHEN_REQUEST_TIMEOUT", "--max-body", "'many'"):
        assert part in message


def test_an_empty_variable_counts_as_absent() -> None:
    assert Settings.load({"LICHEN_PORT": ""}).port == Settings().port


def test_a_command_line_becomes_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LICHEN_QUEUE", "5")
    settings = from_command_line(["--port", "0", "--request-timeout", "2.5"])
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
