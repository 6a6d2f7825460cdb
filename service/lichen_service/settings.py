"""Every number the service can be told, in one frozen value.

A setting comes from its flag, else from its environment variable, else from its default: `--max-body`,
`LICHEN_MAX_BODY`, `Settings.max_body`. Flags, variables, ranges and help all derive from the fields below, so a new
setting is one new field. Workers are fresh processes and receive the values through their environment (`environment`).
"""

from __future__ import annotations

import argparse
import dataclasses
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

PREFIX = "LICHEN_"


class InvalidSettings(ValueError):
    """One or more settings cannot be read or lie outside their range; the message names each of them."""


def _setting(
    default: Any, help: str, low: float | None = None, high: float | None = None, choices: tuple[str, ...] = ()
) -> Any:
    return field(default=default, metadata={"help": help, "low": low, "high": high, "choices": choices})


def _workers() -> int:
    """One process per four processors: the kernels of one request already use several."""
    return max(1, (os.cpu_count() or 1) // 4)


@dataclass(frozen=True, slots=True)
class Settings:
    """How the service runs. Sizes are bytes or pixels, times are seconds."""

    host: str = _setting("127.0.0.1", "address to listen on")
    port: int = _setting(8080, "port to listen on; 0 takes a free one", 0, 65535)
    workers: int = _setting(_workers(), "processes that answer requests", 1, 256)
    threads: int = _setting(4, "requests one process computes at a time", 1, 256)
    queue: int = _setting(64, "requests one process keeps waiting; more are refused with 503", 0, 65536)

    header_timeout: float = _setting(5.0, "seconds a client has to send a request head", 0.01, 3600)
    body_rate: float = _setting(65536.0, "slowest bytes per second at which a body may arrive", 1, None)
    idle_timeout: float = _setting(10.0, "seconds an idle connection is kept", 0.01, 3600)
    request_timeout: float = _setting(60.0, "seconds a request may take in all", 0.01, 86400)
    grace: float = _setting(30.0, "seconds that running requests have to end after SIGTERM", 0, 3600)

    max_body: int = _setting(256 << 20, "largest request body in bytes", 1, None)
    max_pixels: int = _setting(100_000_000, "most pixels of one image", 1, None)
    max_side: int = _setting(65536, "longest side of an image in pixels", 1, None)
    max_channels: int = _setting(64, "most channels of an image", 1, None)
    max_decoded: int = _setting(1 << 31, "most bytes of one image once decoded", 1, None)
    max_images: int = _setting(16, "most images in one request", 1, 1024)

    max_memory: int = _setting(8 << 30, "most bytes of images that one plan may hold at once", 1, None)
    cache: int = _setting(
        64 << 20, "bytes of answers one process keeps for whoever asks the same; 0 keeps none", 0, None
    )

    calibrate: str = _setting(
        "on", "whether a machine without measured times is measured, while idle: on or off", choices=("on", "off")
    )

    def environment(self) -> dict[str, str]:
        """The settings as environment variables, from which `load` makes the same value again."""
        return {PREFIX + each.name.upper(): str(getattr(self, each.name)) for each in dataclasses.fields(self)}

    @classmethod
    def load(cls, environ: Mapping[str, str] | None = None, flags: Mapping[str, str | None] | None = None) -> Settings:
        """Settings from flags, then the environment (the process's own by default), then defaults.

        Raises `InvalidSettings` naming every bad one at once.
        """
        environ = os.environ if environ is None else environ
        values: dict[str, Any] = {}
        flaws: list[str] = []
        for each in dataclasses.fields(cls):
            variable = PREFIX + each.name.upper()
            given = (flags or {}).get(each.name)
            source, text = (_flag(each.name), given) if given is not None else (variable, environ.get(variable))
            if text is None or (text == "" and source == variable):
                continue
            try:
                values[each.name] = _read(text, type(each.default), **_limits(each))
            except ValueError as wrong:
                flaws.append(f"{source} {wrong}")
        if flaws:
            raise InvalidSettings("; ".join(flaws))
        return cls(**values)


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")


def _limits(each: dataclasses.Field[Any]) -> dict[str, Any]:
    return {name: each.metadata[name] for name in ("low", "high", "choices")}


def _read(text: str, kind: type[Any], low: float | None, high: float | None, choices: tuple[str, ...]) -> Any:
    if choices and text not in choices:
        raise ValueError(f"must be {' or '.join(choices)} (got {text!r})")
    try:
        value = kind(text)
    except ValueError:
        wanted = {int: "a whole number", float: "a number"}.get(kind, "text")
        raise ValueError(f"must be {wanted} (got {text!r})") from None
    if low is not None and not value >= low:  # written so that NaN fails
        raise ValueError(f"must be at least {low:g} (got {text!r})")
    if kind is float and value == float("inf"):
        raise ValueError(f"must be finite (got {text!r})")
    if high is not None and value > high:
        raise ValueError(f"must be at most {high:g} (got {text!r})")
    return value


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Gives a command line one flag for each setting."""
    for each in dataclasses.fields(Settings):
        parser.add_argument(
            _flag(each.name),
            metavar=type(each.default).__name__.upper(),
            help=f"{each.metadata['help']} (default {each.default}; {PREFIX}{each.name.upper()})",
        )


def from_command_line(arguments: Sequence[str] | None = None, prog: str = "python -m lichen_service") -> Settings:
    """Settings of a command line; exits with status 2 and one sentence per flaw when they are not valid."""
    parser = argparse.ArgumentParser(prog=prog, description="Serve image operations over HTTP.", allow_abbrev=False)
    add_flags(parser)
    given = vars(parser.parse_args(arguments))
    try:
        return Settings.load(flags=given)
    except InvalidSettings as invalid:
        parser.error(str(invalid))
