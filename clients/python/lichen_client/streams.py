"""Answers that are read piece by piece: what `with_streaming_response` of both clients gives.

A result may be larger than its caller wants to hold. What is tried again is tried again until the head of an answer has
come; then its body is the caller's, within the time of the call, and a body that ends early is a `ConnectionFailed`.
"""

from __future__ import annotations

import os
from collections.abc import AsyncIterator, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

PIECE = 1 << 16
"""Bytes of a piece, about."""


@dataclass(frozen=True, slots=True)
class Stream:
    """An answer whose body is read once, by iterating. `headers` has lower-case names."""

    status: int
    headers: Mapping[str, str]
    pieces: Iterator[bytes]

    def __iter__(self) -> Iterator[bytes]:
        return self.pieces

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the body to a file, which is there whole or not at all."""
        part = _part(path)
        try:
            with part.open("xb") as file:
                for piece in self.pieces:
                    file.write(piece)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


@dataclass(frozen=True, slots=True)
class AsyncStream:
    """`Stream` for asyncio."""

    status: int
    headers: Mapping[str, str]
    pieces: AsyncIterator[bytes]

    def __aiter__(self) -> AsyncIterator[bytes]:
        return self.pieces

    async def save(self, path: str | os.PathLike[str]) -> None:
        """As `Stream.save`."""
        part = _part(path)
        try:
            with part.open("xb") as file:
                async for piece in self.pieces:
                    file.write(piece)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def _part(path: str | os.PathLike[str]) -> Path:
    whole = Path(path)
    return whole.with_name(f".{whole.name}.{os.urandom(8).hex()}")


def cut(body: bytes | bytearray) -> Iterator[bytes]:
    """A body that is there already, in pieces."""
    for at in range(0, len(body), PIECE):
        yield bytes(body[at : at + PIECE])
