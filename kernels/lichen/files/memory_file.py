"""OpenImageIO on bytes in memory, with its limits set.

Its Python module opens paths only, so the bytes lie in an anonymous memory file that is reached by its descriptor's
path: nothing touches a disk. OpenImageIO assumes associated alpha and would multiply or divide; the hint
`oiio:UnassociatedAlpha` keeps samples as stored. It reports failure by return values.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

from lichen.errors import UnreadableImage
from lichen.memory import Array
from lichen.processors import threads

_IMAGE_MB = 8192
_CHANNELS = 1024


@cache
def _library() -> Any:
    import OpenImageIO  # heavy, and only some formats need it

    OpenImageIO.attribute("limits:imagesize_MB", _IMAGE_MB)
    OpenImageIO.attribute("limits:channels", _CHANNELS)
    OpenImageIO.attribute("threads", threads())
    OpenImageIO.attribute("exr_threads", threads())
    return OpenImageIO


def read(name: str, parts: Iterable[bytes | memoryview], sample: str) -> tuple[Array, Sequence[str]]:
    """Samples of the first picture, shape (rows, columns, channels), of type `sample`, and the names of the channels.

    `name` is OpenImageIO's name of the reader, `sample` one of uint8, uint16, half, float, double.
    Raises `UnreadableImage` where any part of the picture is missing.
    """
    library = _library()
    descriptor = os.memfd_create(f"lichen.{name}")
    try:
        for part in parts:
            view = memoryview(part)
            while view:
                view = view[os.write(descriptor, view) :]
        hints = library.ImageSpec()
        hints.attribute("oiio:UnassociatedAlpha", 1)
        reader = library.ImageInput.open(f"/proc/self/fd/{descriptor}", hints)
        if reader is None:
            raise UnreadableImage(f"The {name} file cannot be opened: {_reason(library)}.")
        try:
            if reader.format_name() != name:
                raise UnreadableImage(f"The bytes begin like {name} but are read as {reader.format_name()}.")
            samples = reader.read_image(sample)
            names = reader.spec().channelnames
            if samples is None:
                raise UnreadableImage(f"The {name} file is damaged or incomplete: {_reason(reader)}.")
        finally:
            reader.close()
    finally:
        os.close(descriptor)
    return samples, names


def _reason(source: Any) -> str:
    """The library's own sentence, on one line, without the path that means nothing to anybody."""
    try:
        text = str(source.geterror())
    except UnicodeDecodeError:  # it quotes the file, whose bytes need not be text
        return "no readable reason given"
    sentence = " ".join(text.split()).replace("/proc/self/fd/", "descriptor ")
    return sentence.rstrip(".")[:200] or "no reason given"
