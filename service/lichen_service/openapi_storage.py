"""What the OpenAPI document says of stored inputs."""

from __future__ import annotations

from typing import Any

from lichen.files import FORMATS

_PROBLEM = {"$ref": "#/components/responses/Problem"}
_ID = {"name": "name", "in": "path", "required": True, "schema": {"type": "string"}}


def asset_paths() -> dict[str, Any]:
    images: dict[str, Any] = {each: {"schema": {}} for format in FORMATS.values() for each in format.media_types}
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
    return {"type": "object", "properties": fields, "required": [*fields]}
