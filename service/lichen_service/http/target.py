"""Request targets: percent-decoding of the path and the query.

Decoding happens once, here, and strictly: an escape that is cut short, a NUL, or bytes that are not UTF-8 are refused
rather than repaired, since whoever repairs them next may do it differently. Nothing is normalised: `..` and `//`
reach the routes as they came, and no route maps a path to a file.
"""

from __future__ import annotations

import re
from urllib.parse import unquote_to_bytes

Query = tuple[tuple[str, str], ...]

_BAD_ESCAPE = re.compile(r"%(?![0-9A-Fa-f]{2})")
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")


class BadTarget(ValueError):
    """The target cannot be decoded; the text says where."""


def split_target(target: str) -> tuple[str, Query]:
    """Path and query pairs of a target in origin form.

    `+` stands for a space in the query, as HTML forms and every client library write it.

    >>> split_target("/a%20b?sigma=5&name=x+y&flag")
    ('/a b', (('sigma', '5'), ('name', 'x y'), ('flag', '')))
    """
    path, _, query = target.partition("?")
    decoded = _decode(path, "the path")
    if _CONTROL.search(decoded):
        raise BadTarget("the path holds a control character")
    pairs = (piece.partition("=") for piece in query.split("&") if piece)
    return decoded, tuple((_decode_form(name), _decode_form(value)) for name, _, value in pairs)


def _decode_form(text: str) -> str:
    return _decode(text.replace("+", " "), "the query")


def _decode(text: str, where: str) -> str:
    if "%" not in text and "\0" not in text:
        return text
    if _BAD_ESCAPE.search(text):
        raise BadTarget(f"{where} holds a percent sign that two hexadecimal digits do not follow")
    try:
        decoded = unquote_to_bytes(text).decode("utf-8")
    except UnicodeDecodeError as error:
        raise BadTarget(f"{where} does not decode to UTF-8") from error
    if "\0" in decoded:
        raise BadTarget(f"{where} holds a NUL")
    return decoded
