"""What accuracy costs: for all operations in brief, for one as JSON, SVG or PNG.

Everything comes from the error table of this version and from the time model of this machine; nothing is computed on
pixels. The form of an answer is named by a suffix (`gaussian.svg`) or agreed on by `Accept`. Documents change when the
machine is calibrated, so they are kept for as long as its rates are the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Literal

from pydantic import ConfigDict, Field, ValidationError

from lichen import catalogue
from lichen.accuracy import times
from lichen.calibration.drawing import to_png, to_svg
from lichen.calibration.examples import SIZE, SIZES
from lichen.calibration.gather import predicted
from lichen.calibration.plot import plot
from lichen.calibration.report import Report
from lichen.calibration.words import PLAIN
from lichen.errors import Flaw, InvalidRequest, nearest
from lichen.opencl.device import default_device
from lichen.operation import Operation
from lichen.parameters import Documented
from lichen_service.addresses import address_of
from lichen_service.descriptions import accuracy_path_of, path_of
from lichen_service.documents import canonical, document
from lichen_service.http.message import Head, Request, Response
from lichen_service.negotiation import acceptable
from lichen_service.refusals import Refusal

FORMS = {"json": "application/json", "svg": "image/svg+xml", "png": "image/png"}
"""Media types by suffix, the preferred one first."""
_POLICY = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'"}


class View(Documented):
    """What a query may ask for."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    example: int | None = Field(None, ge=0)
    """its number among the operation's examples; left out: the one that shows most"""
    size: int = Field(SIZE, ge=SIZES[0], le=SIZES[1])
    """side of the square image that times are for, px"""
    device: Literal["opencl", "numpy"] | None = None
    """left out: OpenCL if it works here, else NumPy"""
    theme: Literal["light", "dark"] = "light"
    """of the PNG; an SVG follows its reader's"""


class Accuracy:
    def list(self, request: Request, name: str) -> Response:
        """All operations: what one more digit costs at the example that shows most."""
        view = _view(request.head, {"size", "device"})
        backend = _backend(view)
        return document(request.head, _list(view.size, backend, _stamp(backend)))

    def one(self, request: Request, name: str) -> Response:
        """One operation. Raises `UnknownOperation` with the nearest names."""
        stem, form = _split(name)
        operation = catalogue.operation(stem)
        form = form or _agreed(request.head)
        view = _view(request.head, set(View.model_fields))
        if view.example is not None and view.example >= len(operation.examples):
            most = len(operation.examples) - 1
            raise InvalidRequest(
                f"{operation.name} has no such example.",
                [Flaw("/query/example", f"must be at most {most} (got {view.example})")],
            )
        backend = _backend(view)
        body = _body(operation.name, view, form, backend, _stamp(backend))
        response = document(request.head, body, FORMS[form])
        response.headers |= {"Vary": "Accept"} | (_POLICY if form == "svg" else {})
        return response


def _split(name: str) -> tuple[str, str | None]:
    """An operation's name and the form that the suffix asks for."""
    stem, dot, suffix = name.rpartition(".")
    if not dot or stem not in catalogue.operations():
        return (stem if dot and suffix in FORMS else name), (suffix if suffix in FORMS and dot else None)
    if suffix not in FORMS:
        hint = nearest(name, [f"{stem}.{form}" for form in FORMS])
        raise Refusal(404, "not-found", "There is nothing at this path", f"There is no form {suffix!r}; {hint}")
    return stem, suffix


def _agreed(head: Head) -> str:
    liked = acceptable(head.headers.get("accept"), {form: (each,) for form, each in FORMS.items()}, list(FORMS))
    if liked:
        return liked[0]
    raise Refusal(
        406,
        "not-acceptable",
        "The result cannot be sent in a format you accept",
        f"The report can be sent as {', '.join(FORMS.values())}.",
        headers={"Vary": "Accept"},
    )


def _view(head: Head, allowed: set[str]) -> View:
    """The query. Raises `InvalidRequest` with every flaw."""
    flaws: list[Flaw] = []
    given: dict[str, str] = {}
    for name, value in head.query:
        if name not in allowed:
            flaws.append(Flaw(f"/query/{name}", f"is not known here; {nearest(name, allowed)}"))
        elif name in given:
            flaws.append(Flaw(f"/query/{name}", "is given more than once"))
        else:
            given[name] = value
    try:
        view = View.model_validate(given)
    except ValidationError as invalid:
        flaws += [
            Flaw(f"/query/{each['loc'][0]}", f"{each['msg'][:1].lower()}{each['msg'][1:]} (got {each['input']!r})")
            for each in invalid.errors(include_url=False)
        ]
        view = View.model_validate({})
    if flaws:
        raise InvalidRequest(f"The query has {len(flaws)} flaw(s).", flaws)
    return view


def _backend(view: View) -> str:
    return view.device or ("numpy" if default_device() is None else "opencl")


def _stamp(backend: str) -> int:
    """Changes when this machine was calibrated anew."""
    return hash(tuple(sorted((*name, rate.start, rate.step) for name, rate in times.current(backend).items())))


@lru_cache(256)
def _report(name: str, view: View, backend: str, stamp: int) -> Report:
    return predicted(catalogue.operation(name), view.example, size=view.size, backend=backend)


@lru_cache(64)
def _body(name: str, view: View, form: str, backend: str, stamp: int) -> bytes:
    report = _report(name, view, backend, stamp)
    if form == "json":
        operation, told = catalogue.operation(name), report.to_json()
        settings = [each | {"replay": _replay(operation, report, each)} for each in told["settings"]]
        return canonical({**told, "settings": settings, "examples": operation.examples, "links": _links(operation)})
    drawing = plot(report)
    return to_svg(drawing) if form == "svg" else to_png(drawing, view.theme)


def _replay(operation: Operation[Any], report: Report, setting: Mapping[str, Any]) -> str | None:
    """Where a picture is sent to be computed so; None for what another library does or what cannot run."""
    if setting["peer"] or setting["failed"] is not None:
        return None
    values = operation.validate(report.parameters).model_dump(exclude_defaults=True)
    if setting["precision"] != PLAIN:
        values["precision"] = setting["precision"]
    if setting["method"] in operation.methods:
        values["method"] = setting["method"]
    if setting["knob"] is not None:
        values[setting["knob_name"]] = setting["knob"]
    return address_of(operation, values)


@lru_cache(16)
def _list(size: int, backend: str, stamp: int) -> bytes:
    reports = {
        operation: _report(name, View.model_validate({"size": size}), backend, stamp)
        for name, operation in catalogue.operations().items()
    }
    return canonical({"operations": [_summary(operation, report) for operation, report in reports.items()]})


def _summary(operation: Operation[Any], report: Report) -> dict[str, Any]:
    kept = ("parameters", "example", "device", "size", "ranked_by", "headline", "remark", "prices")
    whole = report.to_json()
    return {
        "name": operation.name,
        "family": operation.family,
        **{key: whole[key] for key in kept},
        "front": [each for each in whole["settings"] if each["standing"] == "worthwhile"],
        "links": _links(operation),
    }


def _links(operation: Operation[Any]) -> dict[str, str]:
    own = accuracy_path_of(operation.name)
    return {"self": own, **{form: f"{own}.{form}" for form in FORMS}, "operation": path_of(operation.name)}
