"""The OpenAPI 3.1 document, derived from the catalogue.

Every operation is a path of its own, so that its parameters, knobs and inputs are checked and completed by tools; the
rest of the paths is fixed. OpenAPI 3.1 has no place for the QUERY method: the text says that it is taken wherever POST
is, with the same meaning.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import lichen
from lichen.files import FORMATS, READABLE
from lichen.operation import Input, Knob, Operation
from lichen.presets import Size, textures
from lichen.scene.description import Scene
from lichen_service.descriptions import accuracy_path_of, inlined, options_schema, path_of
from lichen_service.meanings import MEANINGS
from lichen_service.openapi_storage import asset_paths, job_paths, job_schema
from lichen_service.routes.accuracy import FORMS as ACCURACY_FORMS
from lichen_service.routes.accuracy import View
from lichen_service.uploads import FORM

_PROBLEM = "application/problem+json"

_REPORT_HEADERS = {
    "Server-Timing": "milliseconds by stage",
    "Lichen-Method": "the method that ran, with its knob",
    "Lichen-Device": "where it ran",
    "Lichen-Error": "largest error the result can have; how it is known (bound or estimate); its metric",
    "Lichen-Measured": "with `verify`: the error found on this image; its metric; the share of pixels compared",
    "Lichen-Precision": "what values were kept in between steps, where that is not float32",
    "Lichen-Skipped": "work that was left out, and why",
    "Lichen-Seed": "what decides chance, where there is any: the same seed gives the same bytes",
    "Lichen-Nonfinite": "NaN and infinite samples in the result",
    "ETag": "changes when the same request would give other bytes",
    "Content-Digest": "SHA-256 of the body (RFC 9530)",
}


_OF_A_RUN = {
    status: {"$ref": f"#/components/responses/{name}"}
    for status, name in {"200": "Image", "202": "Accepted", "304": "Unchanged", "default": "Problem"}.items()
}


def openapi(operations: Mapping[str, Operation[Any]]) -> dict[str, Any]:
    """The document for these operations."""
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "Lichen",
            "version": lichen.__version__,
            "description": "Image operations whose accuracy has a stated price. "
            "Wherever POST runs an operation, QUERY (RFC 10008) does the same, safely and idempotently.",
        },
        "paths": {
            **_fixed_paths(),
            **asset_paths(),
            **job_paths(),
            accuracy_path_of("{name}"): _accuracy_path(operations),
            "/v1/pipelines": _pipelines_path(),
            "/v1/scenes": _scenes_path(),
            "/v1/textures/{name}": _texture_path(),
            "/problems/{name}": _problem_path(),
            **{path_of(name): _path(each) for name, each in operations.items()},
        },
        "components": {
            "schemas": {"Problem": _problem_schema()},
            "responses": _responses(),
            "parameters": _shared_parameters(),
        },
    }


def _fixed_paths() -> dict[str, Any]:
    json_paths = {
        "/v1/operations": ("listOperations", "The operations there are"),
        "/v1/textures": ("listTextures", "Named pipelines of noises: marble, wood, clouds and others"),
        "/v1/accuracy": ("listAccuracy", "What one more digit costs, for every operation"),
        "/problems": ("listProblems", "What the codes of problem documents mean"),
        "/v1/limits": ("getLimits", "What one request may ask for"),
        "/v1/version": ("getVersion", "Versions of the engine, its device and its libraries"),
        "/openapi.json": ("getOpenapi", "This document"),
        "/metrics": ("getMetrics", "Figures for Prometheus"),
        "/livez": ("getLiveness", "Whether the process answers"),
        "/readyz": ("getReadiness", "Whether a tiny request goes through right now"),
    }
    paths: dict[str, Any] = {
        path: {
            "get": {
                "operationId": identifier,
                "summary": summary,
                "responses": {"200": _json_response(summary), "default": _reference("Problem")},
            }
        }
        for path, (identifier, summary) in json_paths.items()
    }
    paths["/metrics"]["get"]["responses"]["200"] = {
        "description": "Prometheus's text format",
        "content": {"text/plain": {"schema": {"type": "string"}}},
    }
    paths["/"] = {
        "get": {
            "operationId": "getIndex",
            "summary": "The studio, a page to try operations on",
            "responses": {"200": {"description": "HTML", "content": {"text/html": {"schema": {"type": "string"}}}}},
        }
    }
    return paths


def _accuracy_path(operations: Mapping[str, Operation[Any]]) -> dict[str, Any]:
    fields = inlined(View.model_json_schema())["properties"]
    names = [f"{name}{suffix}" for name in operations for suffix in ("", *(f".{form}" for form in ACCURACY_FORMS))]
    return {
        "get": {
            "operationId": "getAccuracy",
            "summary": "What accuracy costs: errors and times of all settings, and which are worth taking",
            "description": "A suffix names the form: JSON, a plot as SVG or as PNG. Without one `Accept` decides.",
            "parameters": [
                {"name": "name", "in": "path", "required": True, "schema": {"type": "string", "enum": names}},
                *(_parameter(name, each, False) for name, each in fields.items()),
            ],
            "responses": {
                "200": {
                    "description": "The report",
                    "content": {each: {"schema": {}} for each in ACCURACY_FORMS.values()},
                },
                "304": _reference("Unchanged"),
                "default": _reference("Problem"),
            },
        }
    }


def _pipelines_path() -> dict[str, Any]:
    named = {"type": "object", "additionalProperties": {"type": "object"}}
    parts = {"nodes": named, "outputs": named, "concatenate": {"type": "boolean"}}
    document = {"type": "object", "properties": parts, "required": ["nodes"]}
    form = {
        "type": "object",
        "properties": {"pipeline": document},
        "additionalProperties": {"type": "string", "format": "binary"},
    }
    images: dict[str, Any] = {
        media_type: {"schema": {}} for each in READABLE.values() for media_type in each.media_types
    }
    said = {
        "name": "pipeline",
        "in": "query",
        "description": "the pipeline as text, such as gaussian:sigma=5|levels:gamma=1.2, or as JSON",
        "schema": {"type": "string"},
    }
    return {
        "post": {
            "operationId": "runPipeline",
            "summary": "Runs a graph of operations",
            "description": "Nodes by name, each an operation with parameters and inputs: other nodes, or input.NAME "
            "for a picture that is sent along. One output is answered as a picture, several as multipart/mixed.",
            "parameters": [said, *_references()],
            "requestBody": {
                "content": {
                    **images,
                    "application/json": {"schema": document},
                    FORM: {"schema": form, "encoding": {"pipeline": {"contentType": "application/json"}}},
                }
            },
            "responses": _OF_A_RUN,
        }
    }


def _scenes_path() -> dict[str, Any]:
    """As that of pipelines, with a scene for the document."""
    made = _pipelines_path()
    post = made["post"]
    said, *options = post["parameters"]
    document = inlined(Scene.model_json_schema())
    form = {
        "type": "object",
        "properties": {"scene": document},
        "additionalProperties": {"type": "string", "format": "binary"},
    }
    post |= {
        "operationId": "renderScene",
        "summary": "Renders a scene, with only those effects that can be seen",
        "description": "A camera, objects or buffers that are sent along by name, lights with their shadows, fog and a "
        "background. explain=true tells which effects would run, and why the others would not.",
        "parameters": [{**said, "name": "scene", "description": "the scene as JSON"}, *options],
    }
    post["requestBody"]["content"] |= {
        "application/json": {"schema": document},
        FORM: {"schema": form, "encoding": {"scene": {"contentType": "application/json"}}},
    }
    return made


def _texture_path() -> dict[str, Any]:
    named = {"name": "name", "in": "path", "required": True, "schema": {"type": "string", "enum": list(textures())}}
    fields = inlined(Size.model_json_schema())["properties"]
    return {
        "get": {
            "operationId": "getTexture",
            "summary": "The pipeline that makes a texture, as POST on /v1/pipelines takes it",
            "parameters": [named, *(_parameter(name, each, False) for name, each in fields.items())],
            "responses": {"200": _json_response("The pipeline"), "default": _reference("Problem")},
        }
    }


def _problem_path() -> dict[str, Any]:
    named = {"name": "name", "in": "path", "required": True, "schema": {"type": "string", "enum": list(MEANINGS)}}
    return {
        "get": {
            "operationId": "getProblem",
            "summary": "What the code of a problem document means",
            "parameters": [named],
            "responses": {"200": _json_response("The meaning"), "default": _reference("Problem")},
        }
    }


def _path(operation: Operation[Any]) -> dict[str, Any]:
    """GET and POST share their parameters; a name without a default is required where pixels are sent, and of a run."""
    name = operation.name
    described = f"The declaration of {name}; with a query that names all images it needs, a run of it"
    parameters = _parameters(operation)
    required = [each for each in parameters if each.get("required")]
    return {
        "parameters": [each if "$ref" in each else {**each, "required": False} for each in parameters],
        "get": {
            "operationId": f"describe_{name}",
            "summary": described,
            "tags": [operation.family],
            "responses": _OF_A_RUN,
        },
        "post": {
            "operationId": name,
            "summary": operation.summary,
            "description": operation.description,
            "tags": [operation.family],
            **({"parameters": required} if required else {}),
            "requestBody": _request_body(operation),
            "responses": _OF_A_RUN,
        },
    }


def _parameters(operation: Operation[Any]) -> list[dict[str, Any]]:
    schema = inlined(operation.schema())
    required = schema.get("required", [])
    declared = [_parameter(name, each, name in required) for name, each in schema.get("properties", {}).items()]
    knobs = [_knob(each) for each in operation.knobs.values()]
    method = _named("method", operation.methods)
    return [*declared, *knobs, method, *_references(), *(_asset(each) for each in operation.inputs)]


@cache
def _options() -> dict[str, Any]:
    """What every request may ask for, by name."""
    options: dict[str, Any] = options_schema()["properties"]
    return options


def _named(option: str, names: Iterable[str]) -> dict[str, Any]:
    """An option that is one of some names."""
    return {**_parameter(option, _options()[option], False), "schema": {"type": "string", "enum": list(names)}}


def _shared_parameters() -> dict[str, Any]:
    """Options that mean the same to every operation, by name."""
    alike = {name: _parameter(name, each, False) for name, each in _options().items() if name != "method"}
    return {**alike, "format": _named("format", FORMATS)}


def _references() -> list[dict[str, str]]:
    return [{"$ref": f"#/components/parameters/{name}"} for name in _options() if name != "method"]


def _asset(declared: Input) -> dict[str, Any]:
    """An input by the name of a stored image, instead of one in the body."""
    schema = {"type": "string", "pattern": "^sha256:[0-9a-f]{64}$"}
    said = f"{declared.description} (a stored image instead of one that is sent)"
    return {"name": declared.name, "in": "query", "required": False, "description": said, "schema": schema}


def _parameter(name: str, schema: Mapping[str, Any], required: bool) -> dict[str, Any]:
    """One query parameter. Vectors and matrices are JSON text, everything else is plain."""
    parameter: dict[str, Any] = {"name": name, "in": "query", "required": required}
    if "description" in schema:
        parameter["description"] = schema["description"]
    # A name that may be left out has no null in a URL.
    offered = [each for each in schema.get("anyOf", []) if each != {"type": "null"}]
    kept = {key: each for key, each in schema.items() if key not in ("anyOf", "title", "description")}
    if kept.get("default", 0) is None:
        del kept["default"]
    bare = {**kept, **(offered[0] if len(offered) == 1 else {"anyOf": offered} if offered else {})}
    if bare.get("type") in ("array", "object") or "prefixItems" in bare:
        parameter["content"] = {"application/json": {"schema": bare}}
    else:
        parameter["schema"] = bare
    return parameter


def _knob(knob: Knob) -> dict[str, Any]:
    schema = {"type": "number", "minimum": knob.low, "maximum": knob.high, "examples": list(knob.values)}
    return {"name": knob.name, "in": "query", "required": False, "description": knob.description, "schema": schema}


def _request_body(operation: Operation[Any]) -> dict[str, Any]:
    binary = {"type": "string", "format": "binary"}
    required = [each.name for each in operation.inputs if each.required]
    content: dict[str, Any] = {}
    if len(required) <= 1 and operation.inputs:
        content = {media_type: {"schema": {}} for each in READABLE.values() for media_type in each.media_types}
    form = {"type": "object", "properties": {each.name: binary for each in operation.inputs}, "required": required}
    return {"required": bool(required), "content": {**content, FORM: {"schema": form}}}


def _responses() -> dict[str, Any]:
    headers = {name: {"description": text, "schema": {"type": "string"}} for name, text in _REPORT_HEADERS.items()}
    images: dict[str, Any] = {each.media_type: {"schema": {}} for each in FORMATS.values()}
    return {
        "Image": {
            "description": "The result; as JSON the findings of an operation that reports some, "
            "or with `explain=true` the plan",
            "headers": headers,
            "content": {
                **images,
                "application/json": {"schema": {"type": "object"}},
                "multipart/mixed": {
                    "schema": {"description": "the result, then findings, then with `verify` a map of its error"}
                },
            },
        },
        "Accepted": {
            "description": "With `Prefer: respond-async`: the job that will have the result",
            "headers": {name: {"schema": {"type": "string"}} for name in ("Location", "Preference-Applied")},
            "content": {"application/json": {"schema": job_schema()}},
        },
        "Unchanged": {"description": "The result has the entity tag that the request named"},
        "Problem": {
            "description": "What is wrong (RFC 9457)",
            "content": {_PROBLEM: {"schema": {"$ref": "#/components/schemas/Problem"}}},
        },
    }


def _json_response(description: str) -> dict[str, Any]:
    return {"description": description, "content": {"application/json": {"schema": {"type": "object"}}}}


def _reference(name: str) -> dict[str, str]:
    return {"$ref": f"#/components/responses/{name}"}


def _problem_schema() -> dict[str, Any]:
    text, number = {"type": "string"}, {"type": "number"}
    flaw = {"type": "object", "properties": {"pointer": text, "detail": text}, "required": ["pointer", "detail"]}
    return {
        "type": "object",
        "properties": {
            "type": text,
            "title": text,
            "status": {"type": "integer"},
            "detail": text,
            "instance": text,
            "request_id": text,
            "code": text,
            "errors": {"type": "array", "items": flaw},
            "retryable": {"type": "boolean"},
            "limit": number,
            "actual": number,
        },
        "required": ["type", "title", "status", "detail", "code", "request_id"],
    }
