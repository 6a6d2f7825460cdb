"""Effects of scenes one by one, and what leaving lamps out of tiles is worth.

Frames of 640 x 480 (1280 x 1024 where it says so) by the methods of one operation on a device, kernels and everything
that they need for a frame, without decoding and encoding. The frame rates beside them are those that papers and
courses of 1998 and 1999 state for an SGI workstation, which drew one scene frame after frame, as is done here: back to
back, in rows of sixteen, effect after effect in several rounds. Alone is a frame whose pictures have left the caches
since the last. Beside both stands what a plain copy of as many bytes takes on all processors, half of them read and
half written: no effect can be quicker for long. Whole scenes are rendered from buffers, pruned and with everything run,
in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from measuring import Copies, Turns, available
from sections import Section, bars, table

import lichen
from lichen.image import Image, Space
from lichen.memory import aligned
from lichen.opencl.device import default_device

TITLE = "Scenes"
CAMERA: dict[str, Any] = {"eye": [0, 3, 7], "target": [0, 0, -1], "fov": 45}
OBJECTS = [
    {"shape": "plane"},
    {"shape": "sphere", "centre": [0, 0.8, 0], "radius": 0.8, "albedo": [0.7, 0.2, 0.1]},
    {"shape": "box", "centre": [1.7, 0.4, -1], "size": [0.8, 0.8, 0.8], "turn": 20},
]
THEN = {
    "Euclidean fog": 15,
    "layered fog": 12,
    "shadow, 1 texel": 15,
    "Torrance-Sparrow": 20,
    "mirror, Fresnel, diffuse, 1280x1024, single": 20,
}
"""Frames a second, then."""


def buffers(width: int, height: int, *names: str) -> dict[str, Image]:
    size = {"width": width, "height": height}
    return {
        name: lichen.run("gbuffer", objects=OBJECTS, buffer=name, frame="world", **CAMERA, **size).image
        for name in names
    }


def frame(name: str, inputs: Mapping[str, Image], method: str = "exact", knob: float = 0.0, **values: Any) -> Frame:
    operation, device = lichen.operations()[name], default_device()
    assert device is not None, "there is no OpenCL device"
    parameters, body = operation.validate(values), operation.methods[method].implementation
    made = body.opencl(device, inputs, parameters, knob)
    return lambda: body.opencl(device, inputs, parameters, knob), moved(inputs, made.size)


BACK_TO_BACK = 16
"""Frames that are drawn one behind the other."""


def moved(inputs: Mapping[str, Image], out: int) -> int:
    """Bytes of a frame: what it reads, and a float for each of so many values that it writes."""
    different = {id(each): each.pixels.nbytes for each in inputs.values()}
    return sum(different.values()) + 4 * out


def back_to_back(turns: Turns, works: Mapping[str, Callable[[], Any]]) -> dict[str, float]:
    """Seconds of a frame among others, by name: of rows of them, each in turn with those of other effects."""

    def row(work: Callable[[], Any]) -> None:
        for _ in range(BACK_TO_BACK):
            work()

    taken = turns({name: partial(row, work) for name, work in works.items()})
    return {name: figure.median / BACK_TO_BACK for name, figure in taken.items()}


Frame = tuple[Callable[[], Any], int]
"""How one is drawn, and the bytes that it moves at least."""


def frames() -> dict[str, Frame]:
    seen = buffers(640, 480, "position", "normal", "distance")
    rng = np.random.default_rng(3)
    picture = Image(aligned(rng.random((480, 640, 3), np.float32)), Space.LINEAR)
    light = {"light_eye": [3, 6, 4], "light_target": [0, 0, 0], "light_fov": 60}
    camera = {"eye": light["light_eye"], "target": [0, 0, 0], "fov": 60, "width": 1024, "height": 1024}
    depths = lichen.run("gbuffer", objects=OBJECTS, buffer="depth", **camera).image
    placed = {"map": depths, "depth": seen["position"], "normal": seen["normal"]}
    large = buffers(1280, 1024, "normal", "position")
    sky = Image(aligned(rng.random((512, 1024, 3), np.float32)), Space.LINEAR)
    bent = aligned(seen["normal"].pixels + 0.1 * rng.standard_normal((480, 640, 3)).astype(np.float32))
    lamp = {"kind": "point", "position": [3, 6, 4], "intensity": 30}
    shown = {"normal": large["normal"], "position": large["position"], "environment": sky, "irradiance": sky}
    return {
        "Euclidean fog": frame("fog", {"image": picture, "depth": seen["distance"]}, depth_kind="euclidean"),
        "layered fog": frame(
            "fog", {"image": picture, "depth": seen["position"]}, kind="layered", heights=[0, 0.5, 1, 2, 4],
            densities=[0.4, 0.1, 0.3, 0.1, 0], eye=CAMERA["eye"],
        ),
        "shadow, 1 texel": frame("shadow", placed, **light),
        "shadow, 16 texels": frame("shadow", placed, "sampled", 16.0, **light, filter=4),
        "Torrance-Sparrow": frame(
            "lighting", {"normal": seen["normal"], "position": seen["position"]}, lights=[lamp], eye=CAMERA["eye"]
        ),
        **{
            f"mirror, Fresnel, diffuse, 1280x1024, {method}": frame(
                "reflection", shown, method, chart="paraboloid", fresnel="dielectric", eye=CAMERA["eye"], coated=True
            )
            for method in ("single", "exact")
        },
        "normal-mapped environment": frame(
            "reflection", {"normal": Image(bent), "environment": sky}, "nearest", chart="latlong"
        ),
    }  # fmt: skip


def spots(count: int, outer: float) -> list[dict[str, Any]]:
    """As many cones, evenly over the floor that is seen."""
    side = round(count**0.5)
    return [
        {
            "kind": "spot", "position": [float(x), 2.5, float(z)], "direction": [0, -1, 0], "inner": outer / 2,
            "outer": outer, "intensity": 6,
        }
        for x in np.linspace(-3.5, 3.5, side) for z in np.linspace(-5, 2.5, side)
    ]  # fmt: skip


def scenes() -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    shiny = {"model": "torrance_sparrow", "facet_roughness": 0.4}
    base = {"camera": {"eye": CAMERA["eye"], "fov": 45}, "surface": shiny}
    base |= {"buffers": {name: name for name in ("position", "normal", "albedo")}}
    points = [
        {"kind": "point", "position": [x, 4, z], "intensity": 2}
        for x in (-5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6, 7) for z in (-5, -3, -1, 1)
    ]  # fmt: skip
    clear = {"density": 0.03, "colour": [0.5, 0.6, 0.7]}
    half = {"kind": "linear", "start": 2, "end": 7.3, "colour": [0.5, 0.6, 0.7]}
    return {
        "64 lights of 5 %": ({**base, "lights": spots(64, 20)}, {}),
        "fog, half hidden": ({**base, "lights": points, "fog": half}, {"storage": "uint8"}),
        "everything is seen": ({**base, "lights": points, "fog": clear}, {"storage": "uint8"}),
    }


def sections(tell: Callable[[str], None]) -> list[Section]:
    threads = len(available())
    copies = Copies(threads)
    turns, in_rows = Turns(copies, rounds=15, longest=2.5), Turns(copies, rounds=9, longest=20.0)
    works = {name: (work, Copies(threads, size // 8), size) for name, (work, size) in frames().items()}
    warm = back_to_back(in_rows, {name: work for name, (work, _, _) in works.items()})
    copied = back_to_back(in_rows, {name: copy for name, (_, copy, _) in works.items()})
    rows = []
    for name, (work, copy, size) in works.items():
        taken = {each: figure.median for each, figure in turns({"frame": work, "copy": copy}).items()}
        pairs = [(warm[name], copied[name]), (taken["frame"], taken["copy"])]
        cells: list[str] = []
        for seconds, plain in pairs:
            cells += [f"{1 / seconds:.0f}", f"{seconds * 1e3:.2f}", f"{plain * 1e3:.2f}"]
        rows.append([name, THEN.get(name, ""), f"{size / 1e6:.1f}", *cells])
        tell(f"{name}: {warm[name] * 1e3:.2f} ms back to back, {taken['frame'] * 1e3:.2f} ms alone")
    head = ["effect", "then, frames a second", "MB", "here, frames a second", "ms", "a copy, ms"]
    found = [table("Effects", [*head, "alone, frames a second", "ms", "a copy, ms"], rows)]
    images = buffers(640, 480, "position", "normal", "albedo")
    both: dict[str, dict[str, float]] = {}
    rows = []
    for name, (scene, wishes) in scenes().items():
        runs = {
            said: partial(lichen.render, scene, images=images, prune=prune, **wishes)
            for said, prune in (("pruned", True), ("everything", False))
        }
        taken = {said: each.median * 1e3 for said, each in turns(runs).items()}
        left = [each.reason for each in runs["pruned"]().decisions if each.pass_ == "tiles"]
        gain = f"{taken['everything'] / taken['pruned']:.2f}"
        rows.append([name, f"{taken['pruned']:.1f}", f"{taken['everything']:.1f}", gain, "; ".join(left)])
        both |= {f"{name}, {said}": {"render": ms} for said, ms in taken.items()}
        tell(f"{name}: {gain} times")
    head = ["scene, 640 x 480", "pruned, ms", "everything, ms", "times", "what tiles leave out"]
    found.append(table("Whole scenes", head, rows))
    found.append(bars("scenes", "Whole scenes", "ms", ["render"], both))
    return found
