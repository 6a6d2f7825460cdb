"""Operations as JSON: what a client needs to call one, read off its declaration.

Nothing here knows an operation by name. The same values feed the catalogue's pages and the OpenAPI document.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lichen.operation import Input, Method, Operation
from lichen_service.queries import Options
from lichen_service.settings import Settings


def path_of(name: str) -> str:
    return f"/v1/operations/{name}"


def accuracy_path_of(name: str) -> str:
    return f"/v1/accuracy/{name}"


def summary_of(operation: Operation[Any]) -> dict[str, Any]:
    """One entry of the list of operations."""
    return {
        "name": operation.name,
        "family": operation.family,
        "summary": operation.summary,
        "links": {"self": path_of(operation.name)},
    }


def description_of(operation: Operation[Any], settings: Settings) -> dict[str, Any]:
    """All a client can know of an operation: parameters, inputs, methods with knobs and rates, limits, hard cases."""
    return {
        "name": operation.name,
        "family": operation.family,
        "summary": operation.summary,
        "description": operation.description,
        "light": operation.light,
        "findings": operation.finds,
        "table": list(operation.table_columns),
        "inputs": [_input(each) for each in operation.inputs],
        "parameters": inlined(operation.schema()),
        "options": options_schema(),
        "methods": [_method(each) for each in operation.methods.values()],
        "hard_cases": [{"name": each.name, "why": each.why} for each in operation.hard_cases],
        "limits": limits_of(settings),
        "links": {
            "self": path_of(operation.name),
            "accuracy": accuracy_path_of(operation.name),
            "operations": "/v1/operations",
            "openapi": "/openapi.json",
        },
    }


def limits_of(settings: Settings) -> dict[str, Any]:
    """What one request may ask for. Sizes in bytes and pixels, times in seconds."""
    return settings.limits()


def options_schema() -> dict[str, Any]:
    """JSON Schema of the names reserved beside an operation's own parameters."""
    return inlined(Options.model_json_schema())


def _input(declared: Input) -> dict[str, Any]:
    least, most = declared.channels
    return {
        "name": declared.name,
        "description": declared.description,
        "channels": {"minimum": least, "maximum": most},
        "required": declared.required,
        "picture": declared.picture,
    }


def _method(method: Method[Any]) -> dict[str, Any]:
    knob = method.knob
    return {
        "name": method.name,
        "description": method.description,
        "knob": None
        if knob is None
        else {
            "name": knob.name,
            "description": knob.description,
            "values": knob.values,
            "minimum": knob.low,
            "maximum": knob.high,
        },
        "rates": {
            backend: {"start_seconds": rate.start, "seconds_per_step": rate.step}
            for backend, rate in method.rates.items()
        },
    }


def inlined(schema: Mapping[str, Any]) -> dict[str, Any]:
    """A schema without `$defs`: every local reference replaced by what it names, so that it stands anywhere."""
    definitions = schema.get("$defs", {})

    def resolve(value: Any) -> Any:
        if isinstance(value, list):
            return [resolve(each) for each in value]
        if not isinstance(value, dict):
            return value
        reference = value.get("$ref", "")
        if reference.startswith("#/$defs/"):
            beside = {key: each for key, each in value.items() if key != "$ref"}
            return {**resolve(definitions[reference.removeprefix("#/$defs/")]), **resolve(beside)}
        return {key: resolve(each) for key, each in value.items() if key != "$defs"}

    resolved = resolve(dict(schema))
    assert isinstance(resolved, dict)
    return resolved
