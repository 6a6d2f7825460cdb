"""What the codes of problem documents mean, and what to do about each.

The `type` of a problem is the address of its meaning here: `/problems/CODE`. Codes are for programs and never change
their meaning; new ones may be added.
"""

from __future__ import annotations

from collections.abc import Mapping

from lichen.errors import nearest
from lichen_service.documents import canonical, document
from lichen_service.http.message import Request, Response
from lichen_service.problems import type_of
from lichen_service.refusals import Refusal

MEANINGS: Mapping[str, str] = {
    "bad-signature": "The signature of the address is wrong, has expired, or its key was revoked. Sign it anew.",
    "client-gone": "The client had hung up; stands in logs alone.",
    "coding-not-implemented": "A transfer coding other than chunked. Send the body with its length, or in chunks.",
    "deadline-exceeded": "The time allowed for the request ended before its work did. Ask for more time or less work.",
    "device-failure": "The compute device failed. Once more may help; device=numpy does without it.",
    "digest-mismatch": "Content-Digest names other bytes than came. Send them again.",
    "dismissed": "The job was dismissed and has no result.",
    "expectation-failed": "Expect asked for something other than 100-continue.",
    "forbidden": "The key is good, but not for this. Use one with the scope.",
    "head-too-large": "The head of the request has too many fields, or too long ones.",
    "in-use": "A running request or job reads the asset. Delete it later.",
    "incomplete-body": "The connection ended before the body was complete.",
    "internal-error": "A fault of the service, which its log explains under the id of the request.",
    "invalid-job": "The document that describes a job is not one; the detail says where.",
    "invalid-request": "Parameters, inputs or options are wrong; `errors` points at each.",
    "job-crashed": "Processes died of the job more than once. It is not tried again.",
    "key-used": "The idempotency key stands for another request. Use a new one.",
    "length-required": "The body must come with its length here.",
    "malformed-form": "The form cannot be taken apart.",
    "malformed-json": "The JSON is broken, or could be read in two ways.",
    "malformed-key": "An idempotency key is 1 to 255 visible characters.",
    "malformed-request": "The bytes are not a sound HTTP request.",
    "malformed-target": "The address has an escape that does not decode.",
    "malformed-timeout": "Request-Timeout is a positive whole number of milliseconds.",
    "method-not-allowed": "The path does not take the method; Allow names those it takes.",
    "method-not-implemented": "No path takes the method.",
    "no-room": "The disk or the share of it is full. Delete something, or come back.",
    "nonfinite-input": "An input holds NaN or infinity, and nonfinite=reject was asked for.",
    "not-acceptable": "The result cannot be sent in a format that Accept allows; the detail lists what exists.",
    "not-finished": "The job has not ended. Its events tell when it has.",
    "not-found": "Nothing is at the path; the detail names what is near.",
    "not-ready": "The service cannot answer runs right now.",
    "overloaded": "The service has as much to do as it takes on. Come back after Retry-After.",
    "precondition-failed": "If-Match names other bytes than there are.",
    "range-not-satisfiable": "One range within the size is answered, and no other.",
    "rate-exceeded": "The rate of the key or the address is used up. Come back after Retry-After.",
    "request-timeout": "The request did not arrive in time.",
    "store-silent": "The store of assets does not answer. Come back later.",
    "too-costly": "By prediction the work takes longer than is allowed; `limit` and `actual` are seconds.",
    "too-large": "A size is beyond its limit; `limit` and `actual` say which and by how much.",
    "too-many-chunks": "The body comes in too many chunks. Use larger ones.",
    "too-many-jobs": "As many jobs as may wait at a time do. Come back after Retry-After.",
    "unattainable": "No method meets the asked error or time; the detail names the best that can be had.",
    "unauthorized": "A key is needed, and none or an unknown one was sent.",
    "unknown-asset": "Nothing is stored under the name, or not any more.",
    "unknown-job": "No job of this key has the name, or not any more.",
    "unknown-operation": "There is no such operation; the detail names those that are near.",
    "unknown-texture": "There is no such texture; the detail names those that are near.",
    "unreadable-image": "The bytes are not a whole image of the format that they begin like.",
    "unsupported-encoding": "The body is compressed. Send it as it is.",
    "unsupported-format": "The format is not read here; Accept lists those that are.",
    "uri-too-long": "The request line is too long. Put what it says into the body.",
    "version-not-supported": "HTTP/1.0 and HTTP/1.1 are spoken here.",
}


def listed(request: Request, name: str) -> Response:
    """All codes."""
    return document(request.head, canonical({"problems": [_one(code) for code in MEANINGS]}))


def one(request: Request, name: str) -> Response:
    """One code. Raises the 404 refusal for one that does not exist."""
    if name not in MEANINGS:
        detail = f"There is no problem of this code; {nearest(name, MEANINGS)}"
        raise Refusal(404, "not-found", "There is nothing at this path", detail)
    return document(request.head, canonical(_one(name)))


def _one(code: str) -> dict[str, str]:
    return {"type": type_of(code), "code": code, "meaning": MEANINGS[code]}
