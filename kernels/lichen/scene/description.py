"""What a scene is, as its author writes it.

    {"camera": {"eye": [0, 1.5, 4], "target": [0, 0.5, 0], "width": 640, "height": 480},
     "objects": [{"shape": "plane"}, {"shape": "sphere", "centre": [0, 1, 0], "albedo": [0.8, 0.2, 0.1]}],
     "lights": [{"kind": "point", "position": [3, 5, 2], "intensity": 30, "shadow": {"filter": 3}}],
     "fog": {"density": 0.05, "colour": [0.6, 0.7, 0.8]}}

Axes are right-handed with y up; lengths are of any one unit, angles in degrees, colours linear light.

What the camera sees is either `objects`, which are cast rays at, or `buffers`: pictures sent along, by the names they
are sent under. Objects are in the world's axes, and so are lights and heights. Buffers are in the camera's, which
stands at 0 0 0 and looks along -z, unless `position` is among them: then everything is in the axes of those positions,
the camera's eye too. Depth comes as `depth_kind` says (planar, euclidean, window or reversed), normals of any length,
`height` in the scene's unit of length, or in what `relief` multiplies to it. Of normals and positions that are stored
otherwise `conventions` says how.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from lichen.errors import Flaw, InvalidRequest, parameter_flaws
from lichen.operation import OperationParameters
from lichen.operations.environment.surfaces import Encoding
from lichen.operations.lighting.lamps import Kind, Lamp
from lichen.operations.scene.camera import Camera
from lichen.operations.scene.objects import Colour, Object
from lichen.operations.scene.view import DepthKind
from lichen.operations.shadow.parameters import Kind as Filtering
from lichen.planning.remember import Kept, written

Turnable = Literal["normal", "position"]
"""Buffers that have axes."""


class Output(StrEnum):
    """What a scene is rendered to."""

    PICTURE = "picture"
    LIGHT = "light"
    DEPTH = "depth"
    POSITION = "position"
    NORMAL = "normal"
    ALBEDO = "albedo"
    TILES = "tiles"


class View(Camera):
    """The camera, and the size of its picture where there are no buffers to say it."""

    width: int = Field(640, ge=1, le=16384)
    """px"""
    height: int = Field(480, ge=1, le=16384)
    """px"""
    far: float = Field(1e4, gt=0, le=1e6)
    """depth beyond which nothing is seen"""
    near: float = Field(0.1, gt=0, le=1e6)
    """of a window's depth"""
    depth_kind: DepthKind = DepthKind.PLANAR
    """what the buffer `depth` holds"""
    endless: bool = False
    """whether a window's depth has no far end"""


class Buffers(OperationParameters):
    """Names of pictures sent along."""

    layers: str | None = None
    """one picture of many layers, found by their names, in place of those below that are not named"""
    depth: str | None = None
    """how far away each pixel is"""
    position: str | None = None
    """where each pixel's point is, in place of depth"""
    normal: str | None = None
    """which way surfaces face; lights need it"""
    albedo: str | None = None
    """what they reflect diffusely"""
    specular: str | None = None
    """the colour of their highlights"""
    roughness: str | None = None
    """of their facets"""
    emissive: str | None = None
    """how much of them fog does not hide"""
    material: str | None = None
    """the place of each pixel's material in `materials`, in place of albedo, specular and roughness"""
    mask: str | None = None
    """where it is 0 there is nothing, whatever depth or position say"""
    motion: str | None = None
    """how far each pixel's point has moved in the picture, px; the shutter needs it"""
    height: str | None = None
    """a relief on the surfaces, along their normals and in the scene's unit of length: it bends the normals that lights
    and environment see, and moves nothing"""

    @property
    def given(self) -> dict[str, str]:
        names = [name for name in type(self).model_fields if name != "layers"]
        return {name: value for name in names if (value := getattr(self, name)) is not None}


class Conventions(OperationParameters):
    """How buffers are stored that are not as scenes have them: signed, and with y up and z towards the viewer."""

    encoding: Encoding = Encoding.SIGNED
    """of normals; unit: (n + 1) / 2, as pictures hold them"""
    y_down: tuple[Turnable, ...] = ()
    """buffers whose y runs down: normal, position"""
    left_handed: tuple[Turnable, ...] = ()
    """buffers whose z runs the other way, in the camera's axes away from the viewer: normal, position"""


class Material(OperationParameters):
    """How a surface reflects, where buffers hold numbers of materials."""

    albedo: Colour = (0.5, 0.5, 0.5)
    """what it reflects diffusely"""
    specular: Colour = (1.0, 1.0, 1.0)
    """the colour of its highlights"""
    roughness: float = Field(0.5, ge=0, le=1)
    """of its facets"""


class Shadow(OperationParameters):
    """How a light's shadows are made."""

    size: int = Field(1024, ge=16, le=8192)
    """texels of the map's side"""
    kind: Filtering = Filtering.PCF
    """pcf, pcss or variance"""
    filter: float = Field(3.0, ge=0, le=32)
    """texels of the side that is averaged"""
    source: float = Field(0.0, ge=0, le=1e6)
    """of pcss: the light's width; without perspective the tangent of the angle that it fills"""
    points: int = Field(1, ge=1, le=16)
    """of an area or a slab: points of it, at least, each of which casts a shadow of its own; their mean is soft"""
    map: str | None = None
    """the name of a picture sent along: planar depths that the light sees; made from the objects if left out"""
    target: tuple[float, float, float] | None = None
    """of a map sent along: what its middle shows"""
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """of a map sent along: what is up in it"""
    fov: float = Field(90.0, ge=0.01, le=175)
    """of a map sent along: its vertical angle"""
    extent: float | None = Field(None, ge=1e-6, le=1e6)
    """of the map of a directional light sent along: the height of what it shows"""


class Light(Lamp):
    """A lamp, and whether things stand before it."""

    shadow: Shadow | None = None
    """none: what it lights hides nothing"""
    slide: str | None = None
    """of a projector what it shows, of a slab its sheet: the name of a picture sent along"""


class Scene(OperationParameters):
    camera: View = Field(default_factory=View.model_construct)
    """where it stands, how it looks, and its picture's size"""
    objects: Annotated[tuple[Object, ...], Field(max_length=64)] = ()
    """what stands in the scene"""
    buffers: Buffers = Buffers()
    """pictures sent along, in place of objects"""
    conventions: Conventions = Conventions()
    """how buffers are stored, which are converted to signed numbers and right-handed axes"""
    materials: Annotated[tuple[Material, ...], Field(max_length=4096)] = ()
    """what the numbers of the buffer `material` mean, from 0 on"""
    lights: Annotated[tuple[Light, ...], Field(max_length=256)] = ()
    """what lights it"""
    relief: dict[str, Any] | None = None
    """how the buffer `height` bends normals: parameters of the operation bump"""
    ambient: Colour = (0.0, 0.0, 0.0)
    """light from everywhere; times albedo"""
    surface: dict[str, Any] = Field(default_factory=lambda: {"model": "lambert"})
    """how surfaces reflect: parameters of the operation lighting"""
    fog: dict[str, Any] | None = None
    """parameters of the operation fog"""
    environment: dict[str, Any] | None = None
    """what surfaces show of their surroundings: parameters of the operation reflection, and `image`, the name of a
    picture of all directions that is sent along"""
    lens: dict[str, Any] | None = None
    """parameters of the operation depth_of_field"""
    shutter: dict[str, Any] | None = None
    """parameters of the operation motion_blur"""
    background: Colour = (0.0, 0.0, 0.0)
    """the light where there is nothing"""
    output: Output = Output.PICTURE
    """picture; light: without fog and background; or a buffer: depth, position, normal, albedo; tiles: by the
    operation of that name, which lights are left out where"""

    @property
    def names(self) -> tuple[str, ...]:
        """Pictures that it may read, by the names that they are sent under."""
        maps = [each.shadow.map for each in self.lights if each.shadow is not None and each.shadow.map is not None]
        layers = [self.buffers.layers] if self.buffers.layers is not None else []
        if self.environment is not None:
            layers.append(str(self.environment.get("image")))
        slides = [each.slide for each in self.lights if each.slide is not None]
        return tuple(dict.fromkeys([*layers, *self.buffers.given.values(), *maps, *slides]))

    @property
    def everything_given(self) -> bool:
        """Whether buffers stand in place of objects."""
        return bool(self.buffers.given) or self.buffers.layers is not None


_read: Kept[Scene] = Kept()


def read(said: Scene | Mapping[str, Any] | str | bytes) -> Scene:
    """The scene that a mapping or its JSON says; one that was read before, where it said the same. Raises
    `InvalidRequest` with every flaw."""
    if isinstance(said, Scene):
        return said
    key = written(said)
    kept = None if key is None else _read.get(key)
    if kept is not None:
        return kept
    scene = _understood(said)
    if key is not None:
        _read.put(key, scene)
    return scene


def _understood(said: Mapping[str, Any] | str | bytes) -> Scene:
    if isinstance(said, str | bytes):
        try:
            said = json.loads(said)
        except (ValueError, RecursionError) as broken:
            raise InvalidRequest("The scene is not JSON.", [Flaw("/scene", f"is not JSON: {broken}")]) from None
    if not isinstance(said, Mapping):
        raise InvalidRequest("The scene is no object.", [Flaw("/scene", "must be an object")])
    try:
        scene = Scene.model_validate(said)
    except ValidationError as invalid:
        flaws = parameter_flaws(invalid, "scene", Scene.model_fields)
        flaws = [Flaw(each.pointer.removeprefix("/parameters"), each.detail) for each in flaws]
        raise InvalidRequest(f"The scene has {len(flaws)} flaw(s).", flaws) from None
    refuse(scene)
    return scene


def refuse(scene: Scene) -> None:
    """Raises `InvalidRequest` with what only several parts together show; layers are judged when they are known."""
    flaws = [Flaw("/buffers", "objects, or buffers: not both")] if scene.objects and scene.everything_given else []
    flaws += scene.camera.camera_flaws("/camera")
    if scene.environment is not None and not isinstance(scene.environment.get("image"), str):
        flaws.append(Flaw("/environment/image", "is required: the name of a picture that is sent along"))
    flaws += _flaws(scene) if scene.buffers.layers is None else []
    if flaws:
        raise InvalidRequest(f"The scene has {len(flaws)} flaw(s).", flaws)


def _flaws(scene: Scene) -> list[Flaw]:
    """What only several of a scene's parts together show."""
    flaws: list[Flaw] = []
    given = scene.buffers.given
    if given and "depth" in given and "position" in given:
        flaws.append(Flaw("/buffers/position", "depth, or position: not both"))
    if given and scene.lights and "normal" not in given:
        flaws.append(Flaw("/buffers/normal", "is required by lights"))
    placed = scene.fog is not None or scene.lights or scene.environment is not None or "height" in given
    if given and "depth" not in given and "position" not in given and placed:
        flaws.append(Flaw("/buffers/depth", "depth or position is required by fog, lights, environment and relief"))
    if "height" in given and "normal" not in given:
        flaws.append(Flaw("/buffers/normal", "is required by the relief, which bends it"))
    if scene.relief is not None and "height" not in given:
        flaws.append(Flaw("/buffers/height", "is required: the relief has no other"))
    if given and "motion" not in given and scene.shutter is not None:
        flaws.append(Flaw("/buffers/motion", "is required by the shutter"))
    if given and scene.lens is not None and ("depth" not in given or scene.camera.depth_kind is not DepthKind.PLANAR):
        flaws.append(Flaw("/buffers/depth", "planar depth is required by the lens"))
    if given and scene.environment is not None and "normal" not in given:
        flaws.append(Flaw("/buffers/normal", "is required by the environment"))
    if ("material" in given) != bool(scene.materials):
        where, what = ("/materials", "are") if "material" in given else ("/buffers/material", "is")
        flaws.append(Flaw(where, f"{what} required: numbers mean materials, and materials are named by numbers"))
    if "mask" in given and "depth" not in given and "position" not in given:
        flaws.append(Flaw("/buffers/mask", "needs depth or position, of which it leaves a part"))
    if given and not {"albedo", "material"} & given.keys() and scene.output in (Output.ALBEDO,):
        flaws.append(Flaw("/buffers/albedo", "is what was asked for"))
    for name in ("y_down", "left_handed"):
        absent = [each for each in getattr(scene.conventions, name) if each not in given]
        flaws += [Flaw(f"/conventions/{name}", f"{each} is no buffer that is given") for each in absent]
    if scene.conventions.encoding is not Encoding.SIGNED and "normal" not in given:
        flaws.append(Flaw("/conventions/encoding", "is of normals, which are not given"))
    for number, light in enumerate(scene.lights):
        if light.slide is not None and light.kind not in (Kind.PROJECTOR, Kind.SLAB):
            flaws.append(Flaw(f"/lights/{number}/slide", f"is for projectors and slabs; this is a {light.kind} light"))
        shadow = light.shadow
        if shadow is None:
            continue
        where = f"/lights/{number}/shadow"
        if given and shadow.map is None:
            flaws.append(Flaw(f"{where}/map", "is required where buffers are given: nothing else says what hides what"))
        if shadow.map is not None and shadow.points > 1:
            flaws.append(Flaw(f"{where}/points", "must be 1 of a map sent along, which one point sees"))
        if shadow.map is not None and shadow.target is None:
            flaws.append(Flaw(f"{where}/target", "is required of a map sent along"))
        if shadow.kind is not Filtering.PCF and shadow.filter < 1:
            flaws.append(Flaw(f"{where}/filter", f"{shadow.kind} needs a side of at least 1 texel"))
    return flaws
