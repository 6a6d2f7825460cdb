"""The query of a run: an operation's parameters and knobs, and the names reserved beside them.

The reserved names are the fields of `Options`: their types, ranges and descriptions are published from there and
nowhere else. Reading a query finds every flaw at once: unknown and repeated names, bad values of parameters, knobs and
options. Pointers say where: `/parameters/...` for what the operation declares, `/query/...` for the rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from pydantic import ConfigDict, Field, ValidationError, field_validator

from lichen.accuracy.precision import Precision
from lichen.errors import Flaw, InvalidRequest, nearest
from lichen.files import FORMATS, selection
from lichen.image import Alpha, Space, Storage
from lichen.operation import Knob, Operation
from lichen.order import Nonfinite
from lichen.parameters import Documented
from lichen_service.assets import is_id


class Options(Documented):
    """What a request may ask for whatever the operation is."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    max_error: float | None = Field(None, gt=0)
    """largest absolute error the result may have, in output units"""
    max_ms: float | None = Field(None, gt=0)
    """milliseconds the computation may take by prediction; the most accurate method within them runs"""
    method: str | None = None
    """the method by name, instead of a choice by error or time"""
    precision: Precision = Precision.FLOAT32
    """what inputs and results of every step are kept in; float64 evaluates definitions instead of methods, slowly"""
    device: Literal["opencl", "numpy"] | None = None
    """where to compute; left out: OpenCL if it works here, else NumPy"""
    explain: bool | Literal["map"] = False
    """answer with the plan as JSON and compute nothing; map, of a scene: a picture of how many lights each tile looks
    at, or by `Accept` JSON that says which and why not the others, or both"""
    verify: bool = False
    """compare the result with truth, whole or on tiles, which is slow; `Accept: multipart/mixed` gets a map, too"""
    prune: bool = True
    """leave out work that cannot change the result by more than the asked error"""
    nonfinite: Nonfinite = Nonfinite.PROPAGATE
    """what to do with NaN and infinity in the inputs"""
    select: str = Field("", max_length=1000)
    """of inputs that are files of data: components and places to read, as in u=u10,v=v10,time=3,level=@850; a part
    may begin with the name of an input, later.time=4, and is for that one alone"""
    findings: Literal["json", "npy"] | None = None
    """answer with what the operation found and no picture: as JSON, or as a table of numbers in NPY where it is one"""
    format: str | None = None
    """format of the result by name; overrides `Accept`"""
    storage: Storage | None = None
    """how the samples of the result are stored"""
    space: Space | None = None
    """what the numbers of the result mean; left out: what is natural to its format"""
    alpha: Alpha | None = None
    """what the last channel of the result is, where the input has coverage; left out: what its format holds"""

    @field_validator("select")
    @classmethod
    def _selecting(cls, text: str) -> str:
        try:
            return selection.check(text)
        except InvalidRequest as invalid:
            raise ValueError(invalid.flaws[0].detail) from None


RESERVED = frozenset(Options.model_fields)


@dataclass(frozen=True, slots=True)
class Query:
    """A query that was read. `values` holds parameters and knobs as the text they came in, `assets` the names of stored
    images by input."""

    options: Options
    values: Mapping[str, str]
    assets: Mapping[str, str] = field(default_factory=dict)


def read(operation: Operation[Any], pairs: Sequence[tuple[str, str]]) -> tuple[Query, list[Flaw]]:
    """The query of a run of `operation`, and everything that is wrong with it."""
    flaws: list[Flaw] = []
    given: dict[str, str] = {}
    assets: dict[str, str] = {}
    for name, value in pairs:
        if name in given or name in assets:
            flaws.append(Flaw(_pointer(operation, name), "is given more than once"))
        elif is_id(value) and any(name == each.name for each in operation.inputs):
            assets[name] = value
        elif _known(operation, name):
            given[name] = value
        else:
            flaws.append(_unknown(operation, name))
    options, wrong = _options({name: value for name, value in given.items() if name in RESERVED})
    values = {name: value for name, value in given.items() if name not in RESERVED}
    flaws += wrong
    flaws += _flaws_of_options(operation, options)
    flaws += _flaws_of_values(operation, values)
    return Query(options, values, assets), list(dict.fromkeys(flaws))


def read_options(
    pairs: Sequence[tuple[str, str]], further: Sequence[str]
) -> tuple[Options, dict[str, str], list[Flaw]]:
    """The options of a query that knows these names besides, their values, and everything that is wrong."""
    flaws: list[Flaw] = []
    given: dict[str, str] = {}
    for name, value in pairs:
        if name in given:
            flaws.append(Flaw(f"/query/{_escaped(name)}", "is given more than once"))
        elif name in RESERVED or name in further:
            given[name] = value
        else:
            hint = nearest(name, {*RESERVED, *further})
            flaws.append(Flaw(f"/query/{_escaped(name)}", f"is not a name known here; {hint}"))
    options, wrong = _options({name: value for name, value in given.items() if name in RESERVED})
    if options.format is not None and options.format not in FORMATS:
        wrong.append(Flaw("/query/format", f"is not a format; {nearest(options.format, FORMATS)}"))
    return options, {name: given[name] for name in further if name in given}, [*flaws, *wrong]


def _known(operation: Operation[Any], name: str) -> bool:
    return name in RESERVED or name in operation.parameters.model_fields or name in operation.knobs


def _pointer(operation: Operation[Any], name: str) -> str:
    """Where in a request a query name lives; options and unknown names stay in the query."""
    declared = name not in RESERVED and _known(operation, name)
    return f"/{'parameters' if declared else 'query'}/{_escaped(name)}"


def _escaped(name: str) -> str:
    """A name as one step of a JSON pointer."""
    return name.replace("~", "~0").replace("/", "~1")


def _unknown(operation: Operation[Any], name: str) -> Flaw:
    pointer = _pointer(operation, name)
    if any(name == each.name for each in operation.inputs):
        return Flaw(
            pointer,
            "is an input: name a stored image, sha256:..., or send it as the part of this name in multipart/form-data",
        )
    names = {*operation.parameters.model_fields, *operation.knobs, *RESERVED}
    return Flaw(pointer, f"is not a name {operation.name} knows; {nearest(name, names)}")


def _options(given: Mapping[str, str]) -> tuple[Options, list[Flaw]]:
    """The options that are good, and the flaws of those that are not."""
    try:
        return Options.model_validate(given), []
    except ValidationError as invalid:
        bad = {str(problem["loc"][0]): problem["msg"] for problem in invalid.errors(include_url=False)}
        good = {name: value for name, value in given.items() if name not in bad}
        flaws = [
            Flaw(f"/query/{name}", f"{message[:1].lower()}{message[1:]} (got {_shown(given[name])})")
            for name, message in bad.items()
        ]
        return Options.model_validate(good), flaws


def _flaws_of_options(operation: Operation[Any], options: Options) -> list[Flaw]:
    flaws = []
    if options.method is not None and options.method not in operation.methods:
        flaws.append(Flaw("/query/method", f"is not a method; {nearest(options.method, operation.methods)}"))
    if options.format is not None and options.format not in FORMATS:
        flaws.append(Flaw("/query/format", f"is not a format; {nearest(options.format, FORMATS)}"))
    if options.findings is not None and not operation.finds:
        flaws.append(Flaw("/query/findings", f"{operation.name} finds nothing"))
    elif options.findings == "npy" and operation.table is None:
        flaws.append(Flaw("/query/findings", f"what {operation.name} finds is no table; json is offered"))
    return flaws


def _flaws_of_values(operation: Operation[Any], values: Mapping[str, str]) -> list[Flaw]:
    fields = operation.parameters.model_fields
    flaws = [
        Flaw(f"/parameters/{name}", wrong)
        for name, value in values.items()
        if name not in fields and (wrong := _wrong_knob(operation.knobs[name], value))
    ]
    try:
        operation.validate({name: value for name, value in values.items() if name in fields})
    except InvalidRequest as invalid:
        flaws += invalid.flaws
    return flaws


def _wrong_knob(knob: Knob, text: str) -> str | None:
    try:
        value = float(text)
    except ValueError:
        return f"must be a number (got {_shown(text)})"
    if not knob.low <= value <= knob.high:
        return f"must lie between {knob.low:g} and {knob.high:g} (got {_shown(text)})"
    return None


def _shown(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")
