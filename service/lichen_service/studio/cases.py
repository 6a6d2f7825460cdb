"""Hard cases to be looked at: the pictures that go in and come out, and whether what must hold does, found by running.

A case is run once by each process, when it is first asked for, by the method that a caller who asks for nothing else
would get among those that the case is meant for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import lichen
from lichen import catalogue
from lichen.errors import LichenError
from lichen.image import Image, as_image
from lichen_service.studio.pictures import png

TEST = "tests/kernels/test_every_operation.py::test_hard_cases_hold"
"""What holds every method on every backend to all of them; each has its own name there, after the backend."""


@dataclass(frozen=True, slots=True)
class Examined:
    """One case after it was run. `wrong` says what does not hold, or why it could not be run."""

    account: dict[str, Any]
    pictures: dict[str, bytes]
    """PNGs by the input's name; `result` is what came out"""


def listed() -> dict[str, Any]:
    """All cases of all operations by name, none of them run."""
    return {
        "operations": [
            {
                "name": name,
                "family": each.family,
                "cases": [{"name": case.name, "why": case.why} for case in each.hard_cases],
            }
            for name, each in catalogue.operations().items()
            if each.hard_cases
        ]
    }


def examined(name: str, index: int) -> Examined:
    """Raises `UnknownOperation`, and `IndexError` for a case that there is not."""
    catalogue.operation(name).hard_cases[index]
    return _examined(name, index)


def _told(image: Image) -> dict[str, Any]:
    """Size and range of a picture."""
    extent = image.extent
    size = [image.width, image.height, image.channels]
    return {"size": size, "low": extent.low, "high": extent.high, "nonfinite": extent.nonfinite}


@lru_cache(maxsize=1024)
def _examined(name: str, index: int) -> Examined:
    operation = catalogue.operation(name)
    case = operation.hard_cases[index]
    given = case.inputs()
    test = f"{TEST}[opencl-{name}: {case.name}]"
    account: dict[str, Any] = {"name": case.name, "why": case.why, "parameters": case.parameters, "test": test}
    try:
        inputs = {key: as_image(each) for key, each in given.items()}
        method = case.methods[0] if case.methods else None
        asked: dict[str, Any] = {**inputs, **case.parameters, "method": method, "prune": False}
        result = lichen.run(name, **asked)
        account |= {
            "method": result.method,
            "does": operation.methods[result.method].description if result.method in operation.methods else "",
            "device": result.device,
            "nonfinite": result.nonfinite,
            "result": _told(result.image),
            "inputs": {key: _told(each) for key, each in inputs.items()},
            "wrong": case.holds(given, result.image.pixels),
        }
        pictures = {key: png(each) for key, each in inputs.items()} | {"result": png(result.image)}
    except LichenError as failed:
        account |= {"wrong": str(failed), "inputs": {}}
        pictures = {}
    return Examined(account, pictures)
