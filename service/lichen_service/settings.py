"""Every number the service can be told, in one frozen value.

A setting is one field of `Settings`: its flag (`--max-body`), its environment variable (`LICHEN_MAX_BODY`), its line in
a TOML file (`max_body = 1000`), its range, its help and the name under which clients are told of it all derive from
that field. Where a value comes from is the business of `lichen_service.configuration`.
"""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import platformdirs

PREFIX = "LICHEN_"


class InvalidSettings(ValueError):
    """One or more settings cannot be read or lie outside their range; the message names each of them."""


def _setting(
    default: Any,
    help: str,
    low: float | None = None,
    high: float | None = None,
    *,
    choices: tuple[str, ...] = (),
    form: str = "",
    limit: str = "",
) -> Any:
    """`form` is a regular expression that a text must match. `limit` is the name under which /v1/limits publishes the
    setting; empty where it does not concern clients."""
    said = {"help": help, "low": low, "high": high, "choices": choices, "form": form, "limit": limit}
    return field(default=default, metadata=said)


def _switch(default: str, help: str) -> Any:
    return _setting(default, f"{help}: on or off", choices=("on", "off"))


def _memory() -> int:
    """Half of what this machine, or the container we are in, has."""
    installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        allowed = Path("/sys/fs/cgroup/memory.max").read_text().strip()
    except OSError:
        allowed = "max"
    return (min(installed, int(allowed)) if allowed.isdigit() else installed) // 2


def _workers() -> int:
    """One process per four processors: the kernels of one request already use several."""
    return max(1, (os.cpu_count() or 1) // 4)


@dataclass(frozen=True, slots=True)
class Settings:
    """How the service runs. Sizes are bytes or pixels, times are seconds."""

    host: str = _setting("127.0.0.1", "address to listen on, or unix:PATH for a socket in the file system")
    port: int = _setting(8080, "port to listen on; 0 takes a free one", 0, 65535)
    metrics: str = _setting(
        "",
        "address (HOST:PORT or unix:PATH) where /metrics is answered instead; empty: where everything is",
        form=r"unix:.+|(\[[0-9A-Fa-f:.]+\]|[^\[\]:]*):[0-9]{1,5}",
    )
    workers: int = _setting(_workers(), "processes that answer requests", 1, 256)
    spare: str = _switch("on", "whether one more process waits, its libraries loaded, to stand in for one that dies")
    silence: float = _setting(
        30.0, "seconds in which a process must show that it lives, else another takes its place; 0: for ever", 0, 86400
    )
    worker_memory: int = _setting(0, "bytes a process may hold before another takes its place; 0: any", 0, None)
    worker_requests: int = _setting(
        0, "requests, give or take a tenth, after which another process takes one's place; 0: any number", 0, None
    )
    threads: int = _setting(4, "requests one process computes at a time", 1, 256)
    queue: int = _setting(
        64, "requests one process keeps waiting; more are refused with 503", 0, 65536, limit="waiting_requests"
    )

    header_timeout: float = _setting(
        5.0, "seconds a client has to send a request head", 0.01, 3600, limit="header_seconds"
    )
    body_rate: float = _setting(
        65536.0, "slowest bytes per second at which a body may arrive", 1, None, limit="body_bytes_per_second"
    )
    idle_timeout: float = _setting(10.0, "seconds an idle connection is kept", 0.01, 3600, limit="idle_seconds")
    request_timeout: float = _setting(60.0, "seconds a request may take in all", 0.01, 86400, limit="request_seconds")
    grace: float = _setting(30.0, "seconds that running requests have to end after SIGTERM", 0, 3600)

    max_body: int = _setting(256 << 20, "largest request body in bytes", 1, None, limit="body_bytes")
    max_pixels: int = _setting(100_000_000, "most pixels of one image", 1, None, limit="image_pixels")
    max_side: int = _setting(65536, "longest side of an image in pixels", 1, None, limit="image_side")
    max_channels: int = _setting(64, "most channels of an image", 1, None, limit="image_channels")
    max_decoded: int = _setting(1 << 31, "most bytes of one image once decoded", 1, None, limit="image_bytes")
    memory: int = _setting(
        _memory(), "bytes that all images may take together, shared evenly by the processes", 1 << 20, None
    )
    max_images: int = _setting(16, "most images in one request", 1, 1024, limit="images")

    decoders: int = _setting(2, "processes, for each that answers, in which images are decoded; 0: none", 0, 64)
    decoder_memory: int = _setting(4 << 30, "bytes one of them may take", 1 << 20, None)
    decoder_seconds: float = _setting(30.0, "seconds one image may take to decode", 0.1, 3600, limit="decode_seconds")

    data: str = _setting("", "folder for keys, assets and jobs; empty: this user's data folder")
    keys: str = _setting("", "file of keys (lichen keys); empty: keys.json in the data folder, if there is one")
    assets: str = _setting("", "where assets are kept: a folder, or a URL that fsspec knows; empty: in the data folder")
    asset_store: int = _setting(4 << 30, "bytes of all assets; those unused longest give way", 1, None)
    jobs: str = _setting(
        "on",
        "whether work may be asked for that is done in the background: on, off, or by a cluster: dask://HOST:PORT",
        choices=("on", "off", "dask://"),
    )
    job_threads: int = _setting(1, "jobs one process computes at a time", 1, 64)
    job_timeout: float = _setting(3600.0, "seconds a job may take", 0.1, 1e6, limit="job_seconds")
    job_ttl: float = _setting(86400.0, "seconds an ended job and its result are kept", 1, 1e8, limit="job_kept_seconds")
    max_jobs: int = _setting(1000, "jobs that may wait or run at a time", 1, 10**6, limit="jobs")
    max_jobs_each: int = _setting(100, "jobs of one key that may wait or run at a time", 1, 10**6, limit="jobs_each")
    job_store: int = _setting(8 << 30, "bytes of all jobs on disk; more are refused", 1, None)
    insecure: str = _switch("off", "whether everybody may ask, also from other machines, without a key")
    trusted_proxies: str = _setting(
        "", "addresses and networks, with commas, whose X-Forwarded-For is believed; 'unix' is the socket"
    )
    cors_origins: str = _setting("", "origins, with commas, whose pages may read answers; * for all")
    rate: float = _setting(
        0.0,
        "requests a minute of one key, or of one address where no keys are needed; 0: any",
        0,
        1e9,
        limit="requests_per_minute",
    )
    burst: int = _setting(60, "requests that may come at once within that rate", 1, 10**9, limit="requests_at_once")

    cache: int = _setting(
        64 << 20, "bytes of answers one process keeps for whoever asks the same; 0 keeps none", 0, None
    )

    traces: str = _switch("off", "whether spans of requests are sent to OpenTelemetry, as its variables OTEL_* say")
    calibrate: str = _switch("on", "whether a machine without measured times is measured, while idle")

    def environment(self) -> dict[str, str]:
        """The settings as environment variables, from which a worker makes the same value again.

        They are all there, and a file of settings is switched off, so nothing else can decide.
        """
        return {each.variable: str(getattr(self, each.name)) for each in DECLARED} | {CONFIG_VARIABLE: NO_FILE}

    @classmethod
    def load(cls, environ: Mapping[str, str] | None = None) -> Settings:
        """The settings of the environment (the process's own by default) alone, then defaults.

        Raises `InvalidSettings` naming every bad one at once.
        """
        environ = os.environ if environ is None else environ
        values: dict[str, Any] = {}
        flaws: list[str] = []
        for each in DECLARED:
            text = environ.get(each.variable)
            if text:
                try:
                    values[each.name] = each.read(text)
                except ValueError as wrong:
                    flaws.append(f"{each.variable} {wrong}")
        if flaws:
            raise InvalidSettings("; ".join(flaws))
        return cls(**values)

    @property
    def data_folder(self) -> Path:
        return Path(self.data) if self.data else platformdirs.user_data_path("lichen")

    @property
    def asset_folder(self) -> Path:
        """Where assets are kept, or what is known of them where a store elsewhere keeps them."""
        return self.data_folder / "assets" if not self.assets or "://" in self.assets else Path(self.assets)

    @property
    def key_file(self) -> Path:
        return Path(self.keys) if self.keys else self.data_folder / "keys.json"

    def limits(self) -> dict[str, Any]:
        """What clients are told, by its published name."""
        return {each.limit: getattr(self, each.name) for each in DECLARED if each.limit}


@dataclass(frozen=True, slots=True)
class Declared:
    """One setting as its field declares it."""

    name: str
    default: Any
    help: str
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    form: str
    limit: str

    @property
    def flag(self) -> str:
        return "--" + self.name.replace("_", "-")

    @property
    def variable(self) -> str:
        return PREFIX + self.name.upper()

    @property
    def kind(self) -> type[Any]:
        return type(self.default)

    def read(self, given: Any) -> Any:
        """The value that a text, or a value of a TOML file, stands for. Raises `ValueError` that says what is wrong."""
        shown = repr(given)
        if self.choices:
            given = {True: "on", False: "off"}.get(given, given) if isinstance(given, bool) else given
            if not self._is_choice(given):
                raise ValueError(f"must be {' or '.join(self.choices)} (got {shown})")
        wanted = {int: "a whole number", float: "a number"}.get(self.kind, "text")
        if isinstance(given, list) and self.kind is str and all(isinstance(each, str) for each in given):
            given = ",".join(given)
        fits = isinstance(given, str) or (
            not isinstance(given, bool) and isinstance(given, {int: int, float: int | float}.get(self.kind, str))
        )
        try:
            value = self.kind(given) if fits else None
        except ValueError:
            value = None
        if value is None:
            raise ValueError(f"must be {wanted} (got {shown})")
        if self.form and value and not re.fullmatch(self.form, value):
            raise ValueError(f"must be as it is described (got {shown})")
        self._check_range(value, shown)
        return value

    def _is_choice(self, given: Any) -> bool:
        """Whether it is one of the choices, or goes on after one that is a scheme."""
        schemes = tuple(each for each in self.choices if each.endswith("://"))
        return given not in schemes and (given in self.choices or str(given).startswith(schemes))

    def _check_range(self, value: Any, shown: str) -> None:
        if self.low is not None and not value >= self.low:  # written so that NaN fails
            raise ValueError(f"must be at least {self.low:g} (got {shown})")
        if self.kind is float and value == float("inf"):
            raise ValueError(f"must be finite (got {shown})")
        if self.high is not None and value > self.high:
            raise ValueError(f"must be at most {self.high:g} (got {shown})")


SHARED = PREFIX + "SHARED"
"""The variable by which a worker learns of the folder that all workers of one service share while they run."""
FIGURES = "PROMETHEUS_MULTIPROC_DIR"
"""The variable by which the client library of Prometheus learns where all workers count."""
CONFIG_VARIABLE = PREFIX + "CONFIG"
NO_FILE = "none"
"""The name of a file of settings that stands for none."""


def _declared() -> Iterator[Declared]:
    for each in dataclasses.fields(Settings):
        yield Declared(each.name, each.default, **each.metadata)


DECLARED: tuple[Declared, ...] = tuple(_declared())
"""Every setting, in the order in which they are shown."""
