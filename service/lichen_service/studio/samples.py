"""What each operation is first shown with: a picture for every input it needs, and parameters that show what it does.

`content/samples.json` names pictures: a file of the page, or a pipeline that makes one, of others where it says so.
`content/showcase.json` says for some operations what shows them best; all others get what fits their declaration, and
their first example. So an operation that nobody thought of here is shown all the same.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Any

import lichen
from lichen import catalogue
from lichen.files import FORMATS, decode
from lichen.image import Image
from lichen.operation import Input, Operation
from lichen_service.studio.files import files

SUITING = {"depth": "depth", "map": "depth", "normal": "normals", "position": "positions", "motion": "motion"}
"""Samples by the names of inputs that hold one kind of data wherever they occur."""
Table = Mapping[str, Mapping[str, Any]]


def _content(name: str) -> Any:
    return json.loads(files()[f"content/{name}"].data)


@cache
def samples() -> Table:
    """Samples by name: `title`, and `file` or `pipeline` with the `inputs` it reads."""
    return {each["name"]: each for each in _content("samples.json")}


@cache
def curated() -> Table:
    """What is said of single operations."""
    found: Table = _content("showcase.json")
    return found


@lru_cache(maxsize=32)
def sample(name: str) -> Image:
    """The picture of this name."""
    told = samples()[name]
    if "file" in told:
        return decode(files()[f"content/{told['file']}"].data)
    images = {key: sample(each) for key, each in told.get("inputs", {}).items()}
    wishes = {"space": told["space"]} if "space" in told else {}
    (result,) = lichen.run_pipeline(told["pipeline"], images=images, **wishes).values()
    return result.image


def showcase(operation: Operation[Any]) -> dict[str, Any]:
    """`parameters` and `inputs` (samples by the names of inputs) with which an operation is first shown, and
    the `order` of all its parameters in a form: these first, then as they are declared."""
    said = curated().get(operation.name, {})
    inputs = dict(said.get("inputs", {}))
    pictures = iter(("portrait", "painting", "cells"))
    for each in operation.inputs:
        if each.required and each.name not in inputs:
            inputs[each.name] = next(pictures, "painting") if each.picture else _data(each)
    ordered = {each.name: inputs[each.name] for each in operation.inputs if each.name in inputs}
    parameters = said.get("parameters", _example(operation))
    order = list(dict.fromkeys([*parameters, *operation.parameters.model_fields]))
    return {"parameters": parameters, "inputs": ordered, "order": order}


def _example(operation: Operation[Any]) -> Mapping[str, Any]:
    """The first example, at the size of the samples where it makes pictures of any size."""
    example = dict(operation.examples[0]) if operation.examples else {}
    return {**example, "width": 512, "height": 512} if operation.generates else example


def _data(declared: Input) -> str:
    """A sample for an input that is no picture: by its name, or else by its channels."""
    if declared.name in SUITING:
        return SUITING[declared.name]
    least, most = declared.channels
    if least >= 2 and most != 3:
        return "gyre"
    return "portrait" if least == 3 else "clouds"


def showcases() -> dict[str, Any]:
    """What the page needs of all operations."""
    return {
        "samples": list(samples().values()),
        "noise": _content("noise.json"),
        "pipelines": _content("pipelines.json"),
        "scenes": _content("scenes.json"),
        "formats": [{"name": name, "media_type": each.media_type} for name, each in FORMATS.items()],
        "operations": {name: showcase(each) for name, each in catalogue.operations().items()},
    }
