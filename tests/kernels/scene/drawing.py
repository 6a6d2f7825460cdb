"""Random scenes of all kinds of objects, lights, shadows, fog and finish, many of which light or hide nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st

from lichen.image import Image, Space

ON = st.sampled_from([True, True, False])


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda each: round(each, 2))


def vectors(low: float, high: float) -> st.SearchStrategy[list[float]]:
    return st.lists(numbers(low, high), min_size=3, max_size=3)


def colours() -> st.SearchStrategy[list[float]]:
    return vectors(0, 1)


@st.composite
def objects(draw: st.DrawFn) -> list[dict[str, Any]]:
    made: list[dict[str, Any]] = [{"shape": "plane", "point": [0, -1, 0]}] if draw(ON) else []
    for _ in range(draw(st.integers(0 if made else 1, 3))):
        shape = draw(st.sampled_from(["sphere", "box", "blob"]))
        kinds: dict[str, dict[str, Any]] = {
            "sphere": {"centre": draw(vectors(-1, 1)), "radius": 0.4},
            "box": {"centre": draw(vectors(-1, 1)), "size": [0.5, 0.6, 0.4], "turn": draw(st.sampled_from([0, 20]))},
            "blob": {"balls": [[*draw(vectors(-1, 1)), 0.4], [*draw(vectors(-1, 1)), 0.3]], "smooth": 0.3},
        }
        made.append({"shape": shape, **kinds[shape], "albedo": draw(colours())})
    if draw(st.booleans()):
        made[-1]["velocity"] = draw(vectors(-0.3, 0.3))
    return made


@st.composite
def lights(draw: st.DrawFn) -> dict[str, Any]:
    """Some give nothing, some shine past everything, some are far away."""
    kind = draw(st.sampled_from(["point", "spot", "directional"]))
    shadow = {"size": 48, "filter": 2, "kind": draw(st.sampled_from(["pcf", "pcf", "pcss", "variance"]))}
    return {
        "kind": kind,
        "position": draw(vectors(2, 4)),
        "direction": draw(st.sampled_from([[-1, -1, -1], [0, 1, 0], [0.2, -1, 0.1]])),
        "intensity": draw(st.sampled_from([0.0, 1e-7, 0.5, 5.0])),
        "colour": draw(colours()),
        **({"inner": 8, "outer": draw(st.sampled_from([12, 40]))} if kind == "spot" else {}),
        **({"shadow": shadow} if draw(st.booleans()) else {}),
    }


FOGS: list[dict[str, Any]] = [
    {"density": 0},
    {"density": 1e-7},
    {"density": 0.1, "colour": [0.6, 0.7, 0.8]},
    {"kind": "height", "density": 1.5, "falloff": 2, "colour": [0.5, 0.6, 0.7]},
    {"kind": "layered", "heights": [0, 0.5, 2], "densities": [0.4, 0.0, 0.1], "density": 0.5},
]
LENSES: list[dict[str, Any]] = [{"focus": 5, "blur": 0}, {"focus": 5, "blur": 2}, {"focus": 4, "blur": 1, "blades": 6}]
SURFACES = ["lambert", "blinn_phong", "torrance_sparrow"]


@st.composite
def scenes(draw: st.DrawFn) -> tuple[dict[str, Any], dict[str, Image]]:
    """A scene of few pixels, and the pictures that it reads."""
    images: dict[str, Image] = {}
    made: dict[str, Any] = {
        "camera": {"eye": [0, 0.5, 5], "target": [0, 0, 0], "width": draw(st.integers(1, 40)), "height": 30},
        "objects": draw(objects()),
        "lights": draw(st.lists(lights(), min_size=0, max_size=4)),
        "ambient": draw(st.sampled_from([[0, 0, 0], [0.1, 0.1, 0.2]])),
        "background": draw(st.sampled_from([[0, 0, 0], [0.2, 0.3, 0.4]])),
        "surface": {"model": draw(st.sampled_from(SURFACES))},
        "output": draw(st.sampled_from(["picture", "picture", "picture", "light"])),
    }
    optional = {"fog": FOGS, "lens": LENSES, "shutter": [{}, {"shutter": 0.5}]}
    for name, kinds in optional.items():
        if draw(st.booleans()):
            made[name] = draw(st.sampled_from(kinds))
    if draw(st.integers(0, 3)) == 0:
        sky = np.random.default_rng(draw(st.integers(0, 99))).random((8, 16, 3), dtype=np.float32)
        images["sky"] = Image(sky, Space.LINEAR)
        made["environment"] = {"image": "sky", "reflectance": draw(st.sampled_from([0, 0.4]))}
    return made, images
