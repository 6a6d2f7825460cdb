"""How fast the methods are on this machine: what calibration found, kept in the cache folder.

A method's time is start + step x work, and operations declare both numbers as they were on some machine. Those of this
one take their place once calibration has measured them: a small JSON file for each backend, whose name stands for all
that times depend on (processor, their number, device, runtime, this library's kernels). A file written for anything
else is never looked at, so nothing goes stale; one that cannot be read counts as none. `LICHEN_TIMES` names another
folder.

`current` looks at the file's date now and then, so a process sees what another one has measured. Where several
processes, or one after the other, are to choose the same methods, what one of them `knows` is `held` by all of them.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import os
import platform
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import platformdirs

from lichen.opencl.device import default_device
from lichen.operation import Rate
from lichen.processors import processors

Rates = Mapping[tuple[str, str], Rate]
"""By operation and method."""
Known = Mapping[str, list[Any]]
"""Rates of backends as JSON carries them."""
BACKENDS = ("opencl", "numpy")
AGAIN = 0.1
"""Seconds after which a file is looked at anew; a look by every run would be felt by small ones."""

_log = logging.getLogger("lichen")
_NONE: Rates = MappingProxyType({})
_PACKAGE = Path(__file__).resolve().parents[1]
_kept: dict[Path, tuple[float, tuple[int, int] | None, Rates]] = {}
"""What was read, by file: when it was last looked at, the date and the size that it had, if it was there, and what it
says."""
_held: ContextVar[Mapping[str, Rates] | None] = ContextVar("held", default=None)
"""By backend, in place of what is measured here."""


def current(backend: str) -> Rates:
    """The rates that are held for `backend` (opencl or numpy), or else those measured on this machine; empty where
    nothing was measured."""
    held = _held.get()
    if held is not None:
        return held.get(backend, _NONE)
    path, now = path_of(backend), time.monotonic()
    kept = _kept.get(path)
    if kept is not None and now - kept[0] < AGAIN:
        return kept[2]
    stamp = _stamp(path)
    rates = kept[2] if kept is not None and kept[1] == stamp else _read(path) if stamp else _NONE
    _kept[path] = (now, stamp, rates)
    return rates


def _stamp(path: Path) -> tuple[int, int] | None:
    """Date and size of a file; None where there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def store(backend: str, rates: Rates, pace: Sequence[float] = ()) -> Path | None:
    """Keep `rates` beside those already known, which they replace; None where the folder cannot be written. `pace` is
    what the tasks take by whose speed they were measured (`lichen.calibration.pace`), seconds."""
    path = path_of(backend)
    _kept.pop(path, None)  # somebody else may have stored there
    told = {"machine": machine(backend), "pace": list(pace), "rates": _listed({**current(backend), **rates})}
    stored = write(path, json.dumps(told, indent=1))
    _kept.pop(path, None)
    return path if stored else None


def known() -> dict[str, list[Any]]:
    """What `current` says of all backends, to be written down and `held` by whoever reads it."""
    if _held.get() is None and not any(folder().glob("*.json")):
        return {backend: [] for backend in BACKENDS}  # no device has to be started to say that
    return {backend: _listed(current(backend)) for backend in BACKENDS}


@contextmanager
def held(known: Known) -> Iterator[None]:
    """Lets this thread plan by what was `known` somewhere, whatever is measured here meanwhile. Raises ValueError for
    what is nothing of the kind."""
    try:
        rates = {str(backend): _sounding(listed) for backend, listed in known.items()}
    except (TypeError, KeyError, AttributeError) as wrong:
        raise ValueError(f"these are no times of methods: {wrong}") from None
    token = _held.set(rates)
    try:
        yield
    finally:
        _held.reset(token)


def pace(backend: str) -> tuple[float, ...]:
    """Seconds that the tasks took by whose speed the rates were measured; empty where that is not known."""
    try:
        known = tuple([float(each) for each in json.loads(path_of(backend).read_text())["pace"]])
    except (OSError, ValueError, TypeError, KeyError):
        return ()
    return known if all(math.isfinite(each) and each > 0 for each in known) else ()


def write(path: Path, text: str) -> bool:
    """The whole text or nothing: written beside, then moved into place. False where that is not possible."""
    spare = None
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as file:
            spare = file.name
            file.write(text)
        os.replace(spare, path)
    except OSError as failure:
        if spare is not None:
            Path(spare).unlink(missing_ok=True)
        _log.warning("%s cannot be written (%s); measured times last as long as this process", path, failure.strerror)
        return False
    return True


def folder() -> Path:
    return _folder(*map(os.environ.get, ("LICHEN_TIMES", "XDG_CACHE_HOME", "HOME")))


@cache
def _folder(named: str | None, *_surroundings: str | None) -> Path:
    """Found once for each of the surroundings that it depends on."""
    return Path(named) if named else platformdirs.user_cache_path("lichen") / "times"


def path_of(backend: str) -> Path:
    """Where the rates of `backend` on this machine are kept."""
    return _file(folder(), backend)


@cache
def _file(within: Path, backend: str) -> Path:
    """Found once, as the folder is: every plan asks for it."""
    return within / f"{_name(backend)}.json"


@cache
def _name(backend: str) -> str:
    return f"{backend}-{hashlib.sha256(json.dumps(machine(backend)).encode()).hexdigest()[:16]}"


@cache
def machine(backend: str) -> Mapping[str, Any]:
    """All that times on `backend` depend on."""
    device = default_device() if backend == "opencl" else None
    known: dict[str, Any] = {
        "backend": backend,
        "processor": processor(),
        "processors": processors(),
        "kernels": _digest_of_kernels(),
    }
    if backend == "numpy":
        known["numpy"] = np.__version__
    if device is not None:
        known |= {"device": device.name, "runtime": device.runtime, "units": device.compute_units}
    return known


def processor() -> str:
    """The processor's name as the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def _digest_of_kernels() -> str:
    """Stands for the source of everything that is timed, and for the units in which work is counted."""
    digest = hashlib.sha256()
    for part in ("operations", "opencl"):
        for folder, _, names in sorted(os.walk(_PACKAGE / part)):  # in half the time that `Path.rglob` takes
            for name in sorted(names):
                if name.endswith((".py", ".cl", ".clh")):
                    with open(os.path.join(folder, name), "rb", buffering=0) as file:
                        digest.update(file.read())
    return digest.hexdigest()[:16]


def _read(path: Path) -> Rates:
    """What a file holds; nothing where it is not one of ours."""
    try:
        return _sounding(json.loads(path.read_text())["rates"])
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as failure:
        _log.warning("%s is left aside: %s", path, failure)
        return _NONE


def _listed(rates: Rates) -> list[Any]:
    """Rates as they are written, in the order of their names."""
    return [
        [*name, rate.start, rate.step, {kind: [each.start, each.step] for kind, each in rate.kinds.items()}]
        for name, rate in sorted(rates.items(), key=lambda known: known[0])
    ]


def _sounding(listed: Any) -> Rates:
    """Rates as they were written, without those that make no sense."""
    rates = {(str(o), str(m)): _rate(*numbers) for o, m, *numbers in listed}
    return MappingProxyType({name: rate for name, rate in rates.items() if _sound(rate)})


def _rate(start: Any, step: Any, kinds: Mapping[str, Any]) -> Rate:
    found = {str(kind): Rate(float(first), float(then)) for kind, (first, then) in kinds.items()}
    return Rate(float(start), float(step), {kind: rate for kind, rate in found.items() if _sound(rate)})


def _sound(rate: Rate) -> bool:
    return all(math.isfinite(number) and number >= 0 for number in (rate.start, rate.step)) and rate.step > 0
