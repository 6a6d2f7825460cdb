"""Files and objects by path or URL: read whole, written whole or not at all.

A place is a path, or whatever URL fsspec reads: `s3://bucket/key`, `zip://photo.png::archive.zip`. A local file is
written beside its place, forced to the disk and renamed over it. A store of objects shows an object only when all of it
has arrived, so there one request does the same; on other file systems a finished file is moved to its place.
"""

from __future__ import annotations

import glob
import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import unquote, urlsplit

PART = ".lichen-part-"
"""What the names of files hold that are still being written, or were when the process was killed."""
OBJECTS = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "oci", "r2", "memory"})
"""Protocols in which an object is seen only when it is whole."""


def local(place: str) -> Path | None:
    """The path of a place in the local file system; None for every other."""
    if "::" in place or ("://" in place and not place.startswith(("file://", "local://"))):
        return None
    return Path(unquote(urlsplit(place).path)) if "://" in place else Path(place)


def resolved(place: str, base: str) -> str:
    """A place as seen from `base`, a folder or its URL; absolute ones as they are."""
    if "://" in place or "::" in place or os.path.isabs(place):
        return place
    return f"{base.rstrip('/')}/{place}" if base else place


def absolute(place: str) -> str:
    """A place as other processes see it."""
    return place if "://" in place else os.path.abspath(place)


def suffix_of(place: str) -> str:
    """The ending of its name, lower-case: ".png"."""
    name = place.partition("::")[0].partition("?")[0].rpartition("/")[2]
    return Path(name).suffix.lower()


def read(place: str) -> bytes:
    """All bytes. Raises OSError, or what the file system of the URL raises."""
    path = local(place)
    if path is not None:
        return path.read_bytes()
    import fsspec

    with fsspec.open(place, "rb") as file:
        data: bytes = file.read()
    return data


def missing(place: str) -> str | None:
    """What is wrong with a local place as an input, or None; of others nothing is known before they are read."""
    path = local(place)
    if path is None:
        return None
    if not path.exists():
        return "there is no such file"
    return None if path.is_file() else "is not a file"


def matching(pattern: str) -> list[str]:
    """Places that a pattern of * ? [] and ** names, sorted."""
    if local(pattern) is not None and "://" not in pattern:
        return sorted(each for each in glob.glob(pattern, recursive=True) if os.path.isfile(each))
    import fsspec

    return sorted(str(each.full_name) for each in fsspec.open_files(pattern, "rb"))


def write(place: str, data: bytes) -> None:
    """Replaces what is there. Raises as `read`; leaves nothing half written under the name."""
    path = local(place)
    if path is not None:
        _write_file(path, data)
        return
    import fsspec

    system, inner = fsspec.core.url_to_fs(place)
    names = {system.protocol} if isinstance(system.protocol, str) else set(system.protocol)
    if names & OBJECTS:
        system.pipe_file(inner, data)
        return
    part = f"{inner}{PART}{secrets.token_hex(8)}"
    try:
        system.pipe_file(part, data)
        system.mv(part, inner)
    except BaseException:
        if system.exists(part):
            system.rm(part)
        raise


def _write_file(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}{PART}{secrets.token_hex(8)}")
    descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
    try:
        with open(descriptor, "wb", buffering=0) as file:
            view = memoryview(data)
            while len(view):
                view = view[file.write(view) :]
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def sweep(places: Iterable[str]) -> None:
    """Removes what killed processes left unfinished of these places. Every folder is looked through once."""
    wanted: dict[Path, set[str]] = {}
    for place in places:
        path = local(place)
        if path is not None:
            wanted.setdefault(path.parent, set()).add(path.name)
    for folder, names in wanted.items():
        if not folder.is_dir():
            continue
        for part in folder.iterdir():
            name, found, _ = part.name.rpartition(PART)
            if found and name.removeprefix(".") in names:
                part.unlink(missing_ok=True)
