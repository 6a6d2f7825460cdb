"""Scenes built in Python: what stands in them, what lights them, and which effects they have.

    scene = Scene(width=640, height=480, eye=(0, 1.5, 4), target=(0, 0.5, 0))
    scene.add("plane").add("sphere", centre=(0, 1, 0), albedo=(0.8, 0.2, 0.1))
    scene.light("point", position=(3, 5, 2), intensity=30, shadow={"kind": "pcss", "source": 0.3})
    scene.fog(density=0.05, colour=(0.6, 0.7, 0.8))
    client.render(scene, format="png").save("scene.png")

Pictures that a scene reads (buffers, maps, surroundings) may be given where they are meant: they are sent along. As
with pipelines nothing is checked here; the service says everything that is wrong with a scene at once.
"""

from __future__ import annotations

import html
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

from lichen_client.calls import is_image
from lichen_client.drawing import Box, to_png
from lichen_client.pipeline import short
from lichen_client.values import plain

if TYPE_CHECKING:
    from lichen_client.calls import ImageLike


_SENT = "sent "
"""before the name of a picture that is drawn"""


@dataclass(eq=False)
class Scene:
    """A scene, changed by its methods, which return it."""

    document: dict[str, Any] = field(default_factory=dict)
    images: dict[str, ImageLike] = field(default_factory=dict)
    """pictures that are sent along, by name"""

    def __init__(self, document: Mapping[str, Any] | None = None, /, **view: Any) -> None:
        """`view` is the camera: eye, target, fov, width, height ... `document` is a scene to go on from."""
        self.document, self.images = json.loads(json.dumps(document or {}, default=plain)), {}
        if view:
            self.camera(**view)

    def camera(self, **view: Any) -> Self:
        """Where it stands, how it looks, and the size of its picture."""
        return self._more("camera", view)

    def add(self, shape: str, /, **parameters: Any) -> Self:
        """An object: plane, sphere, box ..."""
        self.document.setdefault("objects", []).append({"shape": shape, **_said(parameters)})
        return self

    def buffers(self, **pictures: ImageLike) -> Self:
        """Pictures of what the camera sees in place of objects: depth, normal, albedo ..., or names of such."""
        return self._more("buffers", {key: self._named(key, each) for key, each in pictures.items()})

    def light(self, kind: str = "point", /, *, shadow: bool | Mapping[str, Any] | None = None, **lamp: Any) -> Self:
        """A lamp; with `shadow`, True or its parameters, things stand before it."""
        lights = self.document.setdefault("lights", [])
        cast: dict[str, Any] = {}
        if shadow is not None and shadow is not False:
            cast = _said({} if shadow is True else dict(shadow))
            if "map" in cast:
                cast["map"] = self._named(f"shadow{len(lights)}", cast["map"])
            cast = {"shadow": cast}
        lights.append({"kind": kind, **_said(lamp), **cast})
        return self

    def ambient(self, red: float, green: float, blue: float) -> Self:
        """Light from everywhere."""
        return self._set("ambient", [red, green, blue])

    def background(self, red: float, green: float, blue: float) -> Self:
        """The light where there is nothing."""
        return self._set("background", [red, green, blue])

    def surface(self, model: str, /, **parameters: Any) -> Self:
        """How surfaces reflect."""
        return self._set("surface", {"model": model, **_said(parameters)})

    def fog(self, **parameters: Any) -> Self:
        return self._more("fog", parameters)

    def environment(self, image: ImageLike, /, **parameters: Any) -> Self:
        """What surfaces show of their surroundings: a picture of all directions, or the name of one."""
        return self._more("environment", {"image": self._named("environment", image), **parameters})

    def lens(self, **parameters: Any) -> Self:
        return self._more("lens", parameters)

    def shutter(self, **parameters: Any) -> Self:
        return self._more("shutter", parameters)

    def output(self, kind: str, /) -> Self:
        """picture, light, depth, position, normal or albedo"""
        return self._set("output", kind)

    def to_json(self) -> dict[str, Any]:
        """What the service is sent."""
        return self.document

    def __str__(self) -> str:
        """One line for each thing in it."""
        return "\n".join(f"{what}: {json.dumps(said, separators=(', ', '='))}" for what, said in self._parts())

    def _repr_html_(self) -> str:
        """What a notebook shows: a table of the parts, and beside them the pictures' names."""
        rows = "".join(
            f"<tr><th>{html.escape(what)}</th><td><code>{html.escape(json.dumps(said))}</code></td></tr>"
            for what, said in self._parts()
        )
        sent = html.escape(", ".join(self.images)) or "none"
        return f"<table>{rows}<tr><th>pictures sent along</th><td>{sent}</td></tr></table>"

    def _repr_png_(self) -> bytes | None:
        """The parts drawn, with the pictures they read, for what shows no HTML; with Pillow. What the scene looks like
        `Client.render` tells: it may take long, so nothing is rendered here."""
        return to_png(self._boxes())

    def _boxes(self) -> dict[str, Box]:
        """What is drawn."""
        sent = {_SENT + name: Box(0, "input", name, "picture") for name in self.images}
        parts = {}
        for what, said in self._parts():
            if what == "output":  # which is where the lines end
                continue
            read = tuple(_SENT + name for name in self.images if name in _texts(said))
            parts[what] = Box(1, "node", *_told(what, said), read)
        end = Box(2, "output", str(self.document.get("output", "picture")), "output", tuple(parts))
        return {**sent, **parts, "output": end}

    def _parts(self) -> list[tuple[str, Any]]:
        parts: list[tuple[str, Any]] = []
        for name, value in self.document.items():
            if name in ("objects", "lights"):
                parts += [(f"{name.removesuffix('s')} {at}", each) for at, each in enumerate(value)]
            else:
                parts.append((name, value))
        return parts

    def _named(self, name: str, image: Any) -> str:
        """The name a picture is sent under; text is a name itself."""
        if isinstance(image, str):
            return image
        if not is_image(image):
            raise TypeError(f"{name} is a picture or the name of one, not {type(image).__name__}")
        self.images[name] = image
        return name

    def _more(self, name: str, values: Mapping[str, Any]) -> Self:
        self.document[name] = {**self.document.get(name, {}), **_said(values)}
        return self

    def _set(self, name: str, value: Any) -> Self:
        self.document[name] = plain(value)
        return self


def _said(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value if is_image(value) else plain(value) for name, value in values.items() if value is not None}


def _told(what: str, said: Any) -> tuple[str, str]:
    """A part in two lines."""
    if not isinstance(said, Mapping):
        return what, short(said)
    kind = next((key for key in ("shape", "kind", "model") if key in said), None)
    rest = ", ".join(f"{key} {short(value)}" for key, value in said.items() if key != kind)
    return what if kind is None else f"{what}: {said[kind]}", rest


def _texts(said: Any) -> set[str]:
    """All texts among values."""
    if isinstance(said, Mapping | list):
        return set().union(*map(_texts, said.values() if isinstance(said, Mapping) else said))
    return {said} if isinstance(said, str) else set()
