"""What scenes and their pictures were made to, kept for the next frame.

Frames of an animation, tiles of a picture and requests of a page ask for the same scene with the same pictures again
and again. Reading and lowering one with 64 lights takes 2 to 5 ms, as much as its pixels where most of them are left
out. What a scene says is kept as `lichen.planning.remember` keeps it; here is what depends on its pictures.

Rules:

* A graph is kept by its scene and its pictures themselves, not their equals: what is left out depends on pixels. It
  keeps no picture alive.
* What is made of a picture is kept with it, and dies with it.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping
from typing import Any

from lichen.image import Image


class Pictures:
    """Pictures by their names, told apart as objects, and none of them kept alive."""

    def __init__(self, images: Mapping[str, Image]) -> None:
        self.key = tuple((name, id(image)) for name, image in images.items())
        self._alive = [weakref.ref(image) for image in images.values()]

    @property
    def alive(self) -> bool:
        """Whether all of them still are, so that `key` means no others."""
        return all(each() is not None for each in self._alive)


def made_once(image: Image, key: tuple[Any, ...], make: Callable[..., Image]) -> Image:
    """What `make` makes of a picture and the key, the last few kept with the picture."""
    held: list[tuple[tuple[Any, ...], Image]] = vars(image).setdefault("made", [])
    for known, made in held:
        if len(known) == len(key) and all(map(_same, known, key)):
            return made
    made = make(image, *key)
    held[:] = [*held[-3:], (key, made)]
    return made


def _same(a: Any, b: Any) -> bool:
    """Pictures are told apart as objects, all else by what it says."""
    return a is b or (not isinstance(a, Image) and not isinstance(b, Image) and bool(a == b))
