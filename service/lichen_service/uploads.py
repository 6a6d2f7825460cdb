"""Request bodies as named images, still encoded.

A body is one image (the operation's first input) or `multipart/form-data` whose parts are named after inputs. A
declared media type is passed on to be checked against the bytes; types that say nothing of the content (none,
`application/octet-stream`, and what curl sends for `--data-binary`) leave it to the bytes alone. Parts are
views or single copies of the body, counted before they are kept: parts, header lines and their sizes have caps.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from multipart import MultipartError, MultipartSegment, ParserLimitReached, PushMultipartParser, parse_options_header

from lichen.errors import Flaw, nearest
from lichen_service.http.message import Body, Head
from lichen_service.negotiation import media_type_of
from lichen_service.refusals import Refusal

FORM = "multipart/form-data"
UNTOLD = frozenset({"", "application/octet-stream", "application/x-www-form-urlencoded"})
"""Media types that leave it to the bytes to say what they are."""
JSON = "application/json"
FIRST = "image"
"""A part of this name stands for the first input, whatever that is called."""


@dataclass(frozen=True, slots=True)
class Upload:
    """The bytes of one image and the media type they claim (None: they claim none)."""

    data: Body
    media_type: str | None


def check_type(head: Head, media_types: Collection[str], *, forms: bool = True) -> str:
    """The body's media type. Raises a 415 that lists in `Accept` what can be read, before the body is read; one of
    another kind for a body that is compressed as a whole, which would hide its size."""
    if head.headers.get("content-encoding", "identity").strip().lower() not in ("", "identity"):
        raise Refusal(
            415,
            "unsupported-encoding",
            "The body is compressed",
            "A body is read as it is, without Content-Encoding.",
            headers={"Accept-Encoding": "identity"},
        )
    media_type = media_type_of(head.headers.get("content-type", ""))
    if media_type in UNTOLD or media_type in media_types or (forms and media_type == FORM):
        return media_type
    raise _unsupported(f"The body is of type {media_type}, which is not read here", media_types, forms=forms)


def _unsupported(
    detail: str, media_types: Collection[str], flaws: Sequence[Flaw] = (), *, forms: bool = True
) -> Refusal:
    known = sorted({*media_types, FORM} if forms else media_types)
    return Refusal(
        415,
        "unsupported-format",
        "The image format is not supported",
        f"{detail}; types that are read: {', '.join(known)}.",
        flaws,
        headers={"Accept": ", ".join(known)},
    )


def read(
    head: Head, body: Body, inputs: Sequence[str], media_types: Collection[str], most: int
) -> tuple[dict[str, Upload], list[Flaw]]:
    """The images in a body by input name, and what is wrong with their names.

    `inputs` are the operation's input names in order, `most` is how many parts a form may have. Raises `Refusal` for
    a body that cannot be taken apart (400), one with too many parts (413) and media types nobody reads (415).
    """
    media_type = check_type(head, media_types)
    if media_type == FORM:
        return _name_parts(_parts(head, body, most), inputs, media_types)
    if not len(body):
        return {}, []
    if not inputs:
        return {}, [Flaw("/inputs", "is not empty, but this operation reads no image")]
    return {inputs[0]: Upload(body, None if media_type in UNTOLD else media_type)}, []


def read_with_document(
    head: Head, body: Body, document: str, media_types: Collection[str], most: int
) -> tuple[bytes | None, dict[str, Upload], list[Flaw]]:
    """A JSON document with images: the parts of a form, the document being the one of this name, or the whole body as
    either of both. Bodies of a type that says nothing are the document where they begin with a brace.

    Raises as `read`.
    """
    media_type = check_type(head, {*media_types, JSON})
    if media_type == JSON or (media_type in UNTOLD and bytes(body[:64]).lstrip()[:1] == b"{"):
        return bytes(body), {}, []
    if media_type != FORM:
        return None, *read(head, body, [FIRST], media_types, most)
    parts = _parts(head, body, most)
    documents = [data for segment, data in parts if segment.name == document]
    others = [(segment, data) for segment, data in parts if segment.name != document]
    names = dict.fromkeys(segment.name or "" for segment, _ in others)
    given, flaws = _name_parts(others, list(names), media_types)
    if len(documents) > 1:
        flaws.append(Flaw(f"/{document}", "is given more than once"))
    return documents[0] if documents else None, given, flaws


def _name_parts(
    parts: list[tuple[MultipartSegment, bytes]], inputs: Sequence[str], media_types: Collection[str]
) -> tuple[dict[str, Upload], list[Flaw]]:
    uploads: dict[str, Upload] = {}
    flaws = []
    for segment, data in parts:
        name = segment.name or ""
        if name == FIRST and inputs and FIRST not in inputs:
            name = inputs[0]
        media_type = (segment.content_type or "").lower()
        if media_type in UNTOLD or media_type == "text/plain":
            claimed = None
        elif media_type in media_types:
            claimed = media_type
        else:
            where = f"/inputs/{_escaped(name)}"
            raise _unsupported(
                f"The part {name!r} is of type {media_type}, which is not read here",
                media_types,
                [Flaw(where, f"has the media type {media_type}")],
            )
        if name not in inputs:
            hint = "; parameters go into the query" if segment.filename is None else ""
            flaws.append(Flaw(f"/inputs/{_escaped(name)}", f"is not an input; {nearest(name, inputs)}{hint}"))
        elif name in uploads:
            flaws.append(Flaw(f"/inputs/{name}", "is given more than once"))
        else:
            uploads[name] = Upload(data, claimed)
    return uploads, flaws


def _escaped(name: str) -> str:
    """A name as one step of a JSON pointer."""
    return name.replace("~", "~0").replace("/", "~1")


def _parts(head: Head, body: Body, most: int) -> list[tuple[MultipartSegment, bytes]]:
    _, options = parse_options_header(head.headers["content-type"])
    boundary = options.get("boundary", "")
    try:
        if not 1 <= len(boundary) <= 70:  # RFC 2046, section 5.1.1
            raise MultipartError("the boundary must have 1 to 70 characters")
        return _collect(body, boundary, most)
    except ParserLimitReached as reached:
        raise Refusal(
            413,
            "too-large",
            "A limit on size was crossed",
            f"The form is too large: {str(reached).lower()}.",
            limit=most if "segment count" in str(reached) else None,
        ) from None
    except (MultipartError, UnicodeError) as broken:
        raise Refusal(
            400, "malformed-form", "The form cannot be read", f"multipart/form-data is malformed: {broken}."
        ) from None


def _collect(body: Body, boundary: str, most: int) -> list[tuple[MultipartSegment, bytes]]:
    parts: list[tuple[MultipartSegment, bytes]] = []
    pieces: list[bytes] = []
    segment: MultipartSegment | None = None
    with PushMultipartParser(
        boundary, max_segment_count=most, max_header_count=8, max_header_size=4096, strict=True
    ) as parser:
        for event in parser.parse(bytes(body) if isinstance(body, memoryview) else body):
            if isinstance(event, MultipartSegment):
                segment, pieces = event, []
            elif event is None:
                assert segment is not None
                parts.append((segment, pieces[0] if len(pieces) == 1 else b"".join(pieces)))
            else:
                pieces.append(bytes(event))
    return parts
