"""OpenColorIO archives: a configuration and the files of tables that it names, in one zip (.ocioz), as base64.

The files are unpacked into a folder of their own, which lives as long as the configuration, since OpenColorIO keeps the
tables that it has read by their path. An archive is read safely: entries, their sizes and names are checked before
anything is written, nothing lies outside of the folder, and files that refer to further files are refused.

Source: OpenColorIO 2.2, Config::archive.
"""

from __future__ import annotations

import base64
import binascii
import io
import shutil
import tempfile
import weakref
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

SIGNATURE = "UEsDB"
"""What the base64 of a zip begins with."""
CONFIG = "config.ocio"
MOST_FILES = 500
LARGEST = 64 << 20
"""Bytes of all files, unpacked."""


@dataclass(frozen=True, eq=False)
class Archive:
    """The configuration's text, and the folder with its files, which goes with this object."""

    text: str
    path: Path

    def __post_init__(self) -> None:
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)

    def holds(self, path: str) -> bool:
        """Whether a file that OpenColorIO found is one of the archive's."""
        return Path(path).resolve().is_relative_to(self.path)


def _checked(entries: list[zipfile.ZipInfo]) -> list[zipfile.ZipInfo]:
    if len(entries) > MOST_FILES:
        raise ValueError(f"the archive holds {len(entries)} files, more than {MOST_FILES}")
    if sum(entry.file_size for entry in entries) > LARGEST:
        raise ValueError(f"the archive's files have more than {LARGEST >> 20} MiB")
    for entry in entries:
        name = PurePosixPath(entry.filename)
        if name.is_absolute() or ".." in name.parts or "\\" in entry.filename or "\0" in entry.filename:
            raise ValueError(f"the archive names {entry.filename[:60]!r}, which lies outside of it")
    return entries


def _files(text: str) -> dict[str, bytes]:
    """By name. Raises `ValueError`."""
    try:
        held = zipfile.ZipFile(io.BytesIO(base64.b64decode(text, validate=True)))
        made = {}
        for entry in _checked([entry for entry in held.infolist() if not entry.is_dir()]):
            with held.open(entry) as source:
                data = source.read(entry.file_size + 1)
            if len(data) != entry.file_size:
                raise ValueError(f"the archive says a wrong size of {entry.filename[:60]!r}")
            if b"<Reference" in data:
                raise ValueError(f"{entry.filename[:60]!r} refers to a further file, which is not read")
            made[entry.filename] = data
    except (binascii.Error, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError) as wrong:
        raise ValueError(f"is no archive of OpenColorIO: {str(wrong)[:120]}") from None
    return made


def unpacked(text: str) -> Archive:
    """The archive in a base64 text. Raises `ValueError`."""
    files = _files(text)
    if CONFIG not in files:
        raise ValueError(f"the archive holds no {CONFIG}")
    try:
        archive = Archive(files[CONFIG].decode("utf-8"), Path(tempfile.mkdtemp(prefix="ocioz-")).resolve())
        for name, data in files.items():
            target = archive.path / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
    except (UnicodeDecodeError, OSError) as wrong:
        raise ValueError(f"is no archive of OpenColorIO: {str(wrong)[:120]}") from None
    return archive
