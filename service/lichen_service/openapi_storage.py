"""What the OpenAPI document says of stored inputs and of jobs."""

from __future__ import annotations

from typing import Any

from lichen.files import READABLE

_PROBLEM = {"$ref": "#/components/responses/Problem"}
_ID = {"name": "name", "in": "path", "required": True, "schema": {"type": "string"}}


def asset_paths() -> dict[str, Any]:
    images: dict[str, Any] = {each: {"schema": {}} for format in READABLE.values() for each in format.media_types}
    stored = {"description": "Its name and what its header says", "content": {"application/json": {"schema": _asset()}}}
    return {
        "/v1/assets": {
            "put": {
                "operationId": "putAsset",
                "summary": "Stores an image under the SHA-256 of its bytes",
                "requestBody": {"required": True, "content": images},
                "responses": {"200": stored, "201": stored, "default": _PROBLEM},
            }
        },
        "/v1/assets/{name}": {
            "parameters": [_ID],
            "get": {
                "operationId": "getAsset",
                "summary": "A stored image as it came; one range of its bytes where that is asked for",
                "responses": {
                    "200": {"description": "The bytes", "content": images},
                    "206": {"description": "Some of them", "content": images},
                    "304": {"$ref": "#/components/responses/Unchanged"},
                    "default": _PROBLEM,
                },
            },
            "delete": {
                "operationId": "deleteAsset",
                "summary": "Forgets a stored image that nobody works with",
                "responses": {"204": {"description": "It has gone"}, "default": _PROBLEM},
            },
        },
    }


def _asset() -> dict[str, Any]:
    number = {"type": "integer"}
    text = {"type": "string"}
    fields = {"id": text, "bytes": number, "media_type": text, "width": number, "height": number, "channels": number}
    return {"type": "object", "properties": fields, "required": ["id", "bytes", "media_type"]}


def job_paths() -> dict[str, Any]:
    job = {"application/json": {"schema": job_schema()}}
    accepted = {"description": "The job", "headers": {"Location": _TEXT}, "content": job}
    own = "/v1/jobs/{name}"
    return {
        "/v1/jobs": {
            "get": {
                "operationId": "listJobs",
                "summary": "The newest jobs of the key that asks",
                "responses": {
                    "200": {"description": "Jobs", "content": {"application/json": {"schema": {"type": "object"}}}},
                    "default": _PROBLEM,
                },
            },
            "post": {
                "operationId": "postJob",
                "summary": "Has an operation, a pipeline or a scene run in the background",
                "description": "Whatever computes does the same with `Prefer: respond-async`.",
                "parameters": [{"name": "Idempotency-Key", "in": "header", "schema": {"type": "string"}}],
                "requestBody": {"required": True, "content": {"application/json": {"schema": _order()}}},
                "responses": {"202": accepted, "default": _PROBLEM},
            },
        },
        own: {
            "parameters": [_ID],
            "get": {
                "operationId": "getJob",
                "summary": "How far a job is",
                "responses": {"200": {"description": "The job", "content": job}, "default": _PROBLEM},
            },
            "delete": {
                "operationId": "deleteJob",
                "summary": "Ends a job that has not ended, or forgets one that has",
                "responses": {
                    "200": {"description": "It was ended", "content": job},
                    "204": {"description": "It is forgotten"},
                    "default": _PROBLEM,
                },
            },
        },
        f"{own}/events": {
            "parameters": [_ID],
            "get": {
                "operationId": "watchJob",
                "summary": "Server-sent events, one for each change, until the job has ended",
                "responses": {
                    "200": {"description": "Events", "content": {"text/event-stream": {"schema": {"type": "string"}}}},
                    "default": _PROBLEM,
                },
            },
        },
        f"{own}/result": {
            "parameters": [_ID],
            "get": {
                "operationId": "getJobResult",
                "summary": "The answer to the request that the job stands for",
                "responses": {
                    "200": {"$ref": "#/components/responses/Image"},
                    "206": {"description": "Some of its bytes"},
                    "304": {"$ref": "#/components/responses/Unchanged"},
                    "default": _PROBLEM,
                },
            },
        },
    }


_TEXT = {"schema": {"type": "string"}}


def job_schema() -> dict[str, Any]:
    moment = {"type": ["string", "null"], "format": "date-time"}
    states = ["accepted", "running", "successful", "failed", "dismissed"]
    fields: dict[str, Any] = {
        "id": {"type": "string"},
        "status": {"type": "string", "enum": states},
        "progress": {"type": "integer", "minimum": 0, "maximum": 100},
        "stage": {"type": "string"},
        "path": {"type": "string"},
        **dict.fromkeys(("created", "started", "finished", "updated", "expires"), moment),
        "links": {"type": "object", "additionalProperties": {"type": "string"}},
    }
    return {"type": "object", "properties": fields, "required": list(fields)}


def _order() -> dict[str, Any]:
    """One of three: an operation, a pipeline, or a scene."""
    stored = {"type": "string", "pattern": "^sha256:[0-9a-f]{64}$"}
    inputs = {"type": "object", "additionalProperties": stored}
    free, text = {"type": "object"}, {"type": "string"}

    def order(kind: str, said: dict[str, Any], settings: str) -> dict[str, Any]:
        fields = {kind: said, settings: free, "inputs": inputs}
        return {"type": "object", "properties": fields, "required": [kind], "additionalProperties": False}

    return {
        "oneOf": [
            order("operation", text, "parameters"),
            order("pipeline", {"anyOf": [free, text]}, "options"),
            order("scene", free, "options"),
        ]
    }
