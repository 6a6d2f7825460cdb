"""Addresses that carry their own permission: HMAC-SHA256 over path and query, with key and expiry.

    /v1/operations/noise?width=64&height=64&signature_key=ID&signature_expires=1900000000&signature=...

Theory. What is signed is written anew from the decoded path and pairs, in their order, so that two spellings of the
same request have one signature, and no spelling means two requests. Key and expiry are signed too. Only reading is
permitted this way: GET and HEAD. Several keys are good at a time, so they can be changed without breaking addresses
that are out: make a new key, sign with it, revoke the old one when the last of its addresses has expired.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import time
from urllib.parse import parse_qsl, quote, unquote, urlencode, urlsplit

from lichen_service.access.keys import Keys, SigningKey

KEY, EXPIRES, SIGNATURE = NAMES = ("signature_key", "signature_expires", "signature")
_DUMMY = "0" * 43

Query = tuple[tuple[str, str], ...]


class BadSignature(ValueError):
    """The address permits nothing; the text may be shown to whoever holds it."""


def sign(target: str, key: SigningKey, expires: int) -> str:
    """A path with a query, signed until `expires` (seconds since 1970)."""
    split = urlsplit(target)
    pairs = (*parse_qsl(split.query, keep_blank_values=True, strict_parsing=bool(split.query)),)
    if any(name in NAMES for name, _ in pairs):
        raise ValueError("the address is signed already")
    signed: Query = (*pairs, (KEY, key.id), (EXPIRES, str(expires)))
    decoded = unquote(split.path, errors="strict")
    return f"{_canonical(decoded, signed)}&{SIGNATURE}={_signature(key.secret, decoded, signed)}"


def verify(path: str, query: Query, keys: Keys, now: float | None = None) -> SigningKey:
    """The key that signed a decoded path and query. Raises `BadSignature`."""
    given = dict(query)
    if sorted(name for name, _ in query if name in NAMES) != sorted(NAMES) or query[-1][0] != SIGNATURE:
        raise BadSignature(f"a signed address has {KEY}, {EXPIRES} and, at its end, {SIGNATURE}, each once")
    key = keys.signer(given[KEY])
    expected = _signature(key.secret if key else _DUMMY, path, query[:-1])
    if not hmac.compare_digest(expected.encode(), given[SIGNATURE].encode()) or key is None:
        raise BadSignature("the signature is not that of this address, or its key is not known")
    expires = given[EXPIRES]
    if not (expires.isascii() and expires.isdigit()) or int(expires) <= (time.time() if now is None else now):
        raise BadSignature("the address has expired")
    return key


def is_signed(query: Query) -> bool:
    return any(name in NAMES for name, _ in query)


def without_signature(query: Query) -> Query:
    """What of a query is meant for the routes."""
    return tuple(pair for pair in query if pair[0] not in NAMES) if is_signed(query) else query


def _canonical(path: str, query: Query) -> str:
    return f"{quote(path, safe='/')}?{urlencode(query, quote_via=quote)}"


def _signature(secret: str, path: str, query: Query) -> str:
    digest = hmac.new(secret.encode(), _canonical(path, query).encode(), hashlib.sha256).digest()
    return base64.urlsafe_b64encode(digest).rstrip(b"=").decode()
