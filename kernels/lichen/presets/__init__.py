"""Named textures: pipelines of noises and arithmetic that can be run as they are, opened and changed.

Each is a JSON file beside this one: a `summary`, and the `nodes` of a pipeline (see `lichen.planning.pipeline`) that
reads no picture. `texture` gives one for a size and a seed. What is said to repeat does so at any size.

Sources: McReynolds and Blythe, Programming with OpenGL: advanced rendering, SIGGRAPH 1997, sections 5.12.3 and 11;
Gardner, Visual simulation of clouds, SIGGRAPH 1985; Ebert et al., Texturing and modeling, 2003.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from pydantic import Field, ValidationError

from lichen.catalogue import operation
from lichen.errors import InvalidRequest, UnknownTexture, nearest, parameter_flaws
from lichen.operation import OperationParameters

SEEDS = 2**32


class Size(OperationParameters):
    """What a texture may be asked for."""

    width: int = Field(512, ge=1, le=16384, description="of the picture", json_schema_extra={"unit": "px"})
    height: int = Field(512, ge=1, le=16384, description="of the picture", json_schema_extra={"unit": "px"})
    seed: int = Field(0, ge=0, lt=SEEDS, description="added to the seeds of all noises")


def textures() -> Mapping[str, str]:
    """What there is: a sentence for each name."""
    return {name: document["summary"] for name, document in _documents().items()}


def texture(name: str, **values: Any) -> dict[str, Any]:
    """The pipeline that makes a texture, as JSON values; `values` are those of `Size`.

    Raises `UnknownTexture` with the nearest names, `InvalidRequest` naming every bad value.
    """
    known = _documents()
    if name not in known:
        raise UnknownTexture(f"There is no texture {name!r}; {nearest(name, known)}")
    try:
        size = Size.model_validate(values)
    except ValidationError as invalid:
        flaws = parameter_flaws(invalid, name, Size.model_fields)
        raise InvalidRequest(f"{len(flaws)} value(s) are not valid.", flaws) from None
    nodes = copy.deepcopy(known[name]["nodes"])
    for node in nodes.values():
        if operation(node["operation"]).generates:
            own = node["parameters"]
            own |= {"width": size.width, "height": size.height, "seed": (own["seed"] + size.seed) % SEEDS}
    return {"nodes": nodes}


@cache
def _documents() -> dict[str, Any]:
    found = {each.name.removesuffix(".json"): each for each in files(__name__).iterdir() if each.name.endswith(".json")}
    return {name: json.loads(found[name].read_text("utf-8")) for name in sorted(found)}
