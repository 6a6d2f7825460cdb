"""From a caller's arguments to an order: images, parameters and wishes, all checked, every flaw named at once.

The names in `Wish` are reserved beside an operation's own parameters and are the same in the library, in URLs, in JSON,
on the command line and in the clients.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, TypeVar

import numpy.typing as npt

from lichen.accuracy.precision import Precision
from lichen.catalogue import operation
from lichen.errors import Flaw, InvalidRequest, NonfiniteInput, nearest
from lichen.image import Alpha, Image, Space, Storage, as_image, repaired
from lichen.operation import Operation, OperationParameters
from lichen.planning.graph import Request

Picture = Image | npt.ArrayLike
Named = TypeVar("Named", bound=StrEnum)


class Nonfinite(StrEnum):
    """What to do with NaN and infinity in the inputs."""

    PROPAGATE = "propagate"
    """compute with them; they spread no further than the footprint"""
    REJECT = "reject"
    REPAIR = "repair"
    """replace each by the mean of its finite neighbours"""


@dataclass(frozen=True, slots=True)
class Wish:
    """What a caller may ask for beside the operation's own parameters."""

    method: str | None = None
    max_error: float | str | None = None
    max_ms: float | str | None = None
    device: str | None = None
    nonfinite: str = Nonfinite.PROPAGATE
    space: Space | str | None = None
    alpha: Alpha | str | None = None
    storage: Storage | str | None = None
    prune: bool = True
    precision: Precision | str | None = None
    verify: bool = False


RESERVED = tuple(field.name for field in dataclasses.fields(Wish))
BACKENDS = ("opencl", "numpy")


@dataclass(frozen=True, eq=False)
class Order:
    """One operation, ready to be planned. `request.backend` is still to be filled in where the caller named none."""

    operation: Operation[Any]
    parameters: OperationParameters
    images: Mapping[str, Image]
    request: Request
    precision: Precision = Precision.FLOAT32
    verify: bool = False


def read_order(name: str, first: Picture | None, arguments: Mapping[str, Any], backend: str) -> Order:
    """Check a call. `arguments` mixes reserved names, parameters, knobs and further inputs, as callers write them.

    Raises `UnknownOperation`, `InvalidRequest` with every flaw, `NonfiniteInput`.
    """
    wanted = operation(name)
    flaws: list[Flaw] = []
    wish = Wish(**{key: value for key, value in arguments.items() if key in RESERVED})
    values = {key: value for key, value in arguments.items() if key not in RESERVED}
    request = _request(wanted, wish, backend, flaws)
    precision = _enumerated(Precision, wish.precision, "precision", flaws) or Precision.FLOAT32
    if precision is Precision.FLOAT64 and (wish.method is not None or wanted.knobs.keys() & values.keys()):
        flaws.append(Flaw("/precision", "float64 evaluates the definition itself; leave out method and knobs"))
    names = {declared.name for declared in wanted.inputs}
    images = _images(wanted, first, {key: values.pop(key) for key in names & values.keys()}, flaws)
    knobs = {key: _knob(wanted, key, values.pop(key), flaws) for key in wanted.knobs.keys() & values.keys()}
    parameters = None
    try:
        parameters = wanted.validate(values)
    except InvalidRequest as invalid:
        flaws = [*invalid.flaws, *flaws]
    if parameters is None or flaws:
        raise InvalidRequest(f"This request for {name} is not valid.", flaws)
    images = {key: _policed(key, image, Nonfinite(wish.nonfinite)) for key, image in images.items()}
    if request.storage is None and images:
        request = dataclasses.replace(request, storage=next(iter(images.values())).storage)
    return Order(wanted, parameters, images, dataclasses.replace(request, knobs=knobs), precision, wish.verify)


def _request(wanted: Operation[Any], wish: Wish, backend: str, flaws: list[Flaw]) -> Request:
    _enumerated(Nonfinite, wish.nonfinite, "nonfinite", flaws)
    if wish.method is not None and wish.method not in wanted.methods:
        flaws.append(
            Flaw("/method", f"{wanted.name} has no method {wish.method!r}; {nearest(wish.method, wanted.methods)}")
        )
    return Request(
        backend=backend,
        max_error=_positive(wish.max_error, "max_error", flaws),
        max_ms=_positive(wish.max_ms, "max_ms", flaws),
        method=wish.method,
        target=wanted.name,
        prune=wish.prune,
        space=_enumerated(Space, wish.space, "space", flaws),
        alpha=_enumerated(Alpha, wish.alpha, "alpha", flaws),
        storage=_enumerated(Storage, wish.storage, "storage", flaws),
    )


def _enumerated(kind: type[Named], value: str | None, key: str, flaws: list[Flaw]) -> Named | None:
    if value is None:
        return None
    try:
        return kind(value)
    except ValueError:
        flaws.append(Flaw(f"/{key}", f"{value!r} is not known; {nearest(str(value), list(kind))}"))
        return None


def _number(value: float | str) -> float:
    """The finite number in a value or its text; NaN where there is none."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return math.nan
    return number if math.isfinite(number) else math.nan


def _positive(value: float | str | None, key: str, flaws: list[Flaw]) -> float | None:
    if value is None:
        return None
    number = _number(value)
    if not number > 0:
        flaws.append(Flaw(f"/{key}", f"must be a finite number above 0 (got {value!r})"))
        return None
    return number


def _knob(wanted: Operation[Any], key: str, value: Any, flaws: list[Flaw]) -> float:
    knob, number = wanted.knobs[key], _number(value)
    if not knob.low <= number <= knob.high:
        flaws.append(Flaw(f"/knobs/{key}", f"must lie between {knob.low:g} and {knob.high:g} (got {value!r})"))
    return number


def _images(
    wanted: Operation[Any], first: Picture | None, others: Mapping[str, Any], flaws: list[Flaw]
) -> dict[str, Image]:
    """Inputs by name in the declared order; a missing or unfit one is a flaw."""
    given = dict(others)
    if first is not None:
        if not wanted.inputs:
            flaws.append(Flaw("/inputs", f"{wanted.name} takes no image"))
        elif wanted.inputs[0].name in given:
            flaws.append(Flaw(f"/inputs/{wanted.inputs[0].name}", "is given twice"))
        else:
            given[wanted.inputs[0].name] = first
    images = {}
    for declared in wanted.inputs:
        pointer = f"/inputs/{declared.name}"
        value = given.get(declared.name)
        if value is None:
            if declared.required:
                flaws.append(Flaw(pointer, "is required"))
            continue
        try:
            image = as_image(value, pointer=pointer)
        except InvalidRequest as invalid:
            flaws.extend(invalid.flaws)
            continue
        fewest, most = declared.channels
        if image.channels < fewest or (most is not None and image.channels > most):
            wants = f"{fewest}" if fewest == most else f"{fewest} to {most}" if most else f"at least {fewest}"
            flaws.append(Flaw(pointer, f"must have {wants} channels (has {image.channels})"))
        if image.pages > 1:
            flaws.append(Flaw(pointer, f"must be one picture (has {image.pages} pages)"))
        images[declared.name] = image
    return images


def _policed(name: str, image: Image, policy: Nonfinite) -> Image:
    if policy is Nonfinite.PROPAGATE or not image.extent.nonfinite:
        return image
    if policy is Nonfinite.REJECT:
        count = image.extent.nonfinite
        raise NonfiniteInput(
            f"The input {name} holds {count} values that are NaN or infinite.",
            [Flaw(f"/inputs/{name}", f"{count} values are NaN or infinite")],
            limit=0,
            actual=count,
        )
    return repaired(image)
