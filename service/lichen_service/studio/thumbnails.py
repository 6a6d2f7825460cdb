"""Pictures of the catalogue: each operation run as it is first shown, cropped, and shrunk by the service itself.

They are made when first asked for and kept: as many as there are operations, some tens of kilobytes each.
"""

from __future__ import annotations

from functools import lru_cache

import lichen
from lichen import catalogue
from lichen.files import encode
from lichen.image import Image, Storage
from lichen.memory import aligned
from lichen_service.studio.pictures import shown
from lichen_service.studio.samples import sample, showcase

WIDTH, HEIGHT = 160, 120
"""px: twice what the page shows, for dense displays."""


def thumbnail(name: str) -> bytes:
    """A PNG of `WIDTH` x `HEIGHT`. Raises `UnknownOperation`, and what the run raises."""
    catalogue.operation(name)
    return _thumbnail(name)


@lru_cache(maxsize=512)
def _thumbnail(name: str) -> bytes:
    operation = catalogue.operation(name)
    said = showcase(operation)
    asked = {**said["parameters"], **{key: sample(each) for key, each in said["inputs"].items()}}
    result = lichen.run(name, **asked)
    picture = _cropped(shown(result.image))
    small = lichen.run("resize", picture, width=WIDTH, height=HEIGHT).image
    return bytes(encode(small, "png", storage=Storage.UINT8).data)


def _cropped(picture: Image) -> Image:
    """The middle, as wide for its height as a thumbnail."""
    height = min(picture.height, max(1, picture.width * HEIGHT // WIDTH))
    width = min(picture.width, max(1, picture.height * WIDTH // HEIGHT))
    top, left = (picture.height - height) // 2, (picture.width - width) // 2
    return picture.replace(pixels=aligned(picture.pixels[top : top + height, left : left + width]))
