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

Bytes = bytes | bytearray | memoryview

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
    token = secrets.token_hex(8)
    try:
        lay(place, data, token)
        keep([place], token)
    except BaseException:
        drop([place], token)
        raise


def lay(place: str, data: Bytes, token: str) -> None:
    """Writes a local file beside its place, where `keep` with the same token finds it; elsewhere all that `write`
    does. Raises as `read`."""
    path = local(place)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        _part(path, token).write_bytes(data)
        return
    import fsspec

    system, inner = fsspec.core.url_to_fs(place)
    names = {system.protocol} if isinstance(system.protocol, str) else set(system.protocol)
    if names & OBJECTS:
        system.pipe_file(inner, bytes(data))
        return
    part = f"{inner}{PART}{token}"
    try:
        system.pipe_file(part, bytes(data))
        system.mv(part, inner)
    except BaseException:
        if system.exists(part):
            system.rm(part)
        raise


def keep(places: Iterable[str], token: str) -> None:
    """Forces files that were laid to the disk and puts them in their places. Raises OSError."""
    paths = [path for place in places if (path := local(place)) is not None]
    for path in paths:
        part = _part(path, token)
        _force(part)
        part.replace(path)
    for folder in {path.parent for path in paths}:
        _force(folder)


def drop(places: Iterable[str], token: str) -> None:
    """Removes files that were laid and shall not be kept."""
    for place in places:
        if (path := local(place)) is not None:
            _part(path, token).unlink(missing_ok=True)


def _part(path: Path, token: str) -> Path:
    return path.with_name(f".{path.name}{PART}{token}")


def _force(path: Path) -> None:
    """Waits until a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


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
