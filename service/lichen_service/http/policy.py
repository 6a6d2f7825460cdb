"""What a request head must be before anything else may look at it.

Theory. Request smuggling, response splitting and their relatives live on disagreement: two parsers read one byte
string and see two messages. The cure is to accept only heads that every careful parser reads alike, and to close the
connection on all others. h11 holds the grammar (tokens, field lines, versions) but is lenient by design about bytes
that its authors met in the wild; this module refuses those first, on the raw bytes.

Rules
- No I/O. `HeadScanner` looks at each line once, as soon as it is complete, so a verdict does not depend on how the
  bytes were cut into segments and a hopeless head is refused before its end has come.
- Whatever frames the message (Content-Length, Transfer-Encoding) or routes it (Host, target) has exactly one reading.
- A target in absolute form is read as its path and query; its authority stands in place of what Host says, which must
  be sound nevertheless (RFC 9112 section 3.2.2).
- A refusal is a value, carries its status, and always ends the connection.
- Nearly all heads are of one plain kind, which one regular expression decides (`usual_head`). It may only pass: what it
  does not pass is judged line by line, and what it passes would have been passed there, with the same reading.

Sources: RFC 9110 (section 4.2: no http address has a user, or no host), RFC 9112 (sections 2.2, 3, 5, 6, 7.1), RFC 3986
section 3.2.2 for Host.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import h11

LONGEST_REQUEST_LINE = 8190
"""bytes, line end excluded; RFC 9112 section 3 asks for 8000, and a pipeline as text in an address needs them"""
LONGEST_FIELD = 8190
"""bytes of one field line, line end excluded"""
MOST_FIELDS = 100
LARGEST_HEAD = 24 * 1024
"""bytes of the whole head, line ends included"""

METHODS = ("GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH", "QUERY")
"""methods some route may know; any other is answered 501"""

# A list of these has no meaning, and which of two counts is a matter of taste: where parsers differ, messages are
# smuggled.
_SINGLE = frozenset(
    b"authorization content-length content-type content-encoding content-range date expect host idempotency-key "
    b"if-modified-since if-range if-unmodified-since max-forwards range referer request-timeout transfer-encoding "
    b"user-agent x-request-id".split()
)
# Fields that frame, route, authorise or describe the message: too late at its end (RFC 9110 section 6.5.1).
_NOT_IN_TRAILERS = _SINGLE | frozenset(
    b"accept cache-control connection cookie keep-alive proxy-authorization proxy-connection set-cookie te trailer "
    b"upgrade www-authenticate".split()
)

_CONTROL = re.compile(rb"[\x00-\x08\x0a-\x1f\x7f]")
_TOKEN = re.compile(rb"[-!#$%&'*+.^_`|~0-9A-Za-z]+")
_FIELD = re.compile(rb"([-!#$%&'*+.^_`|~0-9A-Za-z]+):[ \t]*(.*?)[ \t]*", re.DOTALL)
_VERSION = re.compile(rb"HTTP/[0-9]\.[0-9]")
_LENGTH = re.compile(rb"0|[1-9][0-9]{0,17}")
_HOST = re.compile(rb"(?:[-A-Za-z0-9._~!$&'()*+,;=%]+|\[[0-9A-Fa-f:.]+\])(?::[0-9]{0,5})?")
_TARGET = re.compile(rb"/[\x21-\x22\x24-\x7e]*")
_ABSOLUTE = re.compile(rb"https?://([^/?#]*)([/?][\x21-\x22\x24-\x7e]*)?", re.IGNORECASE)
# Without the rarer things that are allowed: HTTP/1.0, OPTIONS *, absolute targets, bytes beyond ASCII, an empty line
# before.
_USUAL = re.compile(
    rb"(GET|HEAD|POST|PUT|DELETE|OPTIONS|PATCH|QUERY) (/[\x21-\x22\x24-\x7e]*+) HTTP/1\.1\r\n"
    rb"((?>[-!#$%&'*+.^_`|~0-9A-Za-z]++:[\t\x20-\x7e]*+\r\n)++)\r\n"
)
_LARGEST_USUAL = 4096
"""bytes; below every limit on the parts"""

Field = tuple[bytes, bytes]


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a request is not served; the connection closes after the answer."""

    status: int
    code: str
    detail: str
    limit: int | None = None
    """what was crossed, where something was"""


class RawHead(NamedTuple):
    """A head with one reading. `target` is in origin form, or `*`, however it came."""

    method: str
    target: str
    version: str
    fields: tuple[tuple[str, str], ...]
    """lower-case names in the order given"""
    headers: Mapping[str, str]
    """the same by name, those that are repeated joined; the host is that of the target, where it names one"""
    keep_alive: bool
    expects_continue: bool


class _Refused(Exception):
    def __init__(self, status: int, detail: str, code: str = "malformed-request") -> None:
        super().__init__(detail)
        self.refusal = Refusal(status, code, detail)


class HeadScanner:
    """Finds where a head ends in a buffer that grows between calls."""

    __slots__ = ("_fields", "_line", "_lines")

    def __init__(self) -> None:
        self._line = 0
        """where the first line not yet looked at begins"""
        self._lines = 0
        self._fields = 0

    def scan(self, buffer: bytearray) -> int | Refusal | None:
        """Bytes of the head, its empty line included; None while it is not complete.

        One empty line before the request line is skipped, as RFC 9112 section 2.2 asks.
        """
        try:
            while self._begins(buffer) and (end := buffer.find(b"\n", self._line)) >= 0:
                line = bytes(buffer[self._line : end + 1])
                self._line = end + 1
                self._measure(len(line) - 2)
                if self._accept(line):
                    return self._line
            self._measure(len(buffer) - self._line - 1, total=len(buffer))
        except _Refused as refused:
            return refused.refusal
        return None

    def _begins(self, buffer: bytearray) -> bool:
        if self._lines == 0 and self._line < len(buffer):
            first = bytes(buffer[self._line : self._line + 1])
            if first != b"\r" and not _TOKEN.match(first):
                raise _Refused(400, "the request does not begin with a method")
        return True

    def _measure(self, length: int, total: int = 0) -> None:
        if self._lines == 0 and length > LONGEST_REQUEST_LINE:
            raise _Refused(414, f"the request line is longer than {LONGEST_REQUEST_LINE} bytes", "uri-too-long")
        if self._lines and length > LONGEST_FIELD:
            raise _Refused(431, f"a header field is longer than {LONGEST_FIELD} bytes", "head-too-large")
        if max(total, self._line) > LARGEST_HEAD:
            raise _Refused(431, f"the head is larger than {LARGEST_HEAD} bytes", "head-too-large")

    def _accept(self, line: bytes) -> bool:
        """Look at one complete line; true for the empty line that ends the head."""
        content = plain_line(line)
        if not content:
            if self._lines:
                return True
            if self._line > len(line):
                raise _Refused(400, "more than one empty line before the request line")
            return False
        if self._lines:
            self._fields += 1
            if self._fields > MOST_FIELDS:
                raise _Refused(431, f"there are more than {MOST_FIELDS} header fields", "head-too-large")
        self._lines += 1
        return False


def plain_line(line: bytes) -> bytes:
    """The line without its CR LF; refused where it is folded, ends otherwise, or holds control characters."""
    if not line.endswith(b"\r\n"):
        raise _Refused(400, "a line ends with a bare line feed")
    content = line[:-2]
    if _CONTROL.search(content):
        raise _Refused(400, "a line holds a control character")
    if content[:1] in (b" ", b"\t"):
        raise _Refused(400, "a line begins with white space; folded fields are not accepted")
    return content


def read_head(raw: bytes) -> RawHead | Refusal:
    """Judge a head that `HeadScanner` has found whole."""
    try:
        return _read_head(raw)
    except _Refused as refused:
        return refused.refusal


def usual_head(buffer: bytearray) -> tuple[int, RawHead] | None:
    """Bytes and reading of the head that a buffer begins with, if it is whole and of the usual kind."""
    match = _USUAL.match(buffer, 0, _LARGEST_USUAL)
    if match is None or (block := _usual_block(match[3])) is None:
        return None
    return match.end(), RawHead(
        match[1].decode(), match[2].decode(), "1.1", block.fields, block.headers, block.keep_alive, block.expects
    )


class Heads:
    """The heads that a connection begins requests with, one after the other."""

    def __init__(self) -> None:
        self._scanner: HeadScanner | None = None
        """of the head of which a part has come"""

    def take(self, buffer: bytearray) -> tuple[RawHead, bytes] | Refusal | None:
        """The head that a buffer begins with, read and as it came, taken out of it; None where more has to come."""
        if self._scanner is None:
            if (usual := usual_head(buffer)) is not None:
                return usual[1], _taken(buffer, usual[0])
            self._scanner = HeadScanner()
        end = self._scanner.scan(buffer)
        if end is None or isinstance(end, Refusal):
            return end
        self._scanner, raw = None, _taken(buffer, end)
        opening = read_head(raw)
        return opening if isinstance(opening, Refusal) else (opening, raw)


def _taken(buffer: bytearray, count: int) -> bytes:
    raw = bytes(buffer[:count])
    del buffer[:count]
    return raw


def check_trailer(line: bytes) -> Refusal | None:
    """Judge one line, CR LF included, after the last chunk. Trailers are dropped afterwards."""
    try:
        name, _ = _field(plain_line(line))
    except _Refused as refused:
        return refused.refusal
    if name in _NOT_IN_TRAILERS:
        return Refusal(400, "malformed-request", f"the field {name.decode()} is not allowed in a trailer")
    return None


@dataclass(frozen=True, slots=True)
class _Block:
    """What the fields of a head say, whatever its request line."""

    fields: tuple[tuple[str, str], ...]
    headers: Mapping[str, str]
    keep_alive: bool
    expects: bool


@lru_cache(maxsize=256)
def _usual_block(block: bytes) -> _Block | None:
    """The fields of a usual head of HTTP/1.1; None where the long road will refuse them. A client sends the same ones
    again and again, so they are remembered."""
    lines = block.split(b"\r\n")[:-1]
    if len(lines) > MOST_FIELDS:
        return None
    try:
        fields = [(name.lower(), value.strip(b" \t")) for name, _, value in (line.partition(b":") for line in lines)]
        if any(name == b"transfer-encoding" for name, _ in fields):
            return None  # the grammar has the last word on its value
        return _block("1.1", _judged("1.1", fields), fields)
    except _Refused:
        return None


def _read_head(raw: bytes) -> RawHead:
    request_line, *lines = raw.lstrip(b"\r\n").removesuffix(b"\r\n\r\n").split(b"\r\n")
    method, given, version = _request_line(request_line)
    target, host = _origin(method, given)
    expects = _judged(version, [_field(line) for line in lines])
    block = _block(version, expects, _by_grammar(raw.lstrip(b"\r\n")).headers)
    headers = block.headers if host is None else MappingProxyType({**block.headers, "host": host})
    return RawHead(method, target, version, block.fields, headers, block.keep_alive, block.expects)


def _judged(version: str, fields: Sequence[Field]) -> bool:
    """Whether the client waits for a word before the body; raises for fields that are not sound together."""
    single = _singles(fields)
    _check_host(version, single)
    _check_framing(version, single)
    return _expectation(version, single)


def _block(version: str, expects: bool, fields: Iterable[Field]) -> _Block:
    read = tuple((name.decode("ascii"), value.decode("latin-1")) for name, value in fields)
    headers = joined(read)
    options = {each.strip(" \t").lower() for each in headers.get("connection", "").split(",")}
    keep_alive = version == "1.1" and "close" not in options
    return _Block(read, headers, keep_alive, expects)


def joined(fields: Iterable[tuple[str, str]]) -> Mapping[str, str]:
    """Fields by name; those that are repeated become one, as RFC 9110 section 5.3 says."""
    headers: dict[str, str] = {}
    for name, value in fields:
        joint = "; " if name == "cookie" else ", "
        headers[name] = f"{headers[name]}{joint}{value}" if name in headers else value
    return MappingProxyType(headers)


def _request_line(line: bytes) -> tuple[str, bytes, str]:
    parts = line.split(b" ")
    if len(parts) != 3 or not _TOKEN.fullmatch(parts[0]):
        raise _Refused(400, "the request line is not METHOD target HTTP/1.1 with single spaces between")
    if not _VERSION.fullmatch(parts[2]):
        raise _Refused(400, "the protocol version is malformed")
    if parts[2] not in (b"HTTP/1.0", b"HTTP/1.1"):
        raise _Refused(505, "only HTTP/1.0 and HTTP/1.1 are spoken here", "version-not-supported")
    method = parts[0].decode("ascii")
    if method not in METHODS:
        raise _Refused(501, f"no route knows the method; known: {', '.join(METHODS)}", "method-not-implemented")
    return method, parts[1], parts[2][-3:].decode("ascii")


def _origin(method: str, given: bytes) -> tuple[str, str | None]:
    """A target in origin form, or `*`, and the host that it names in absolute form."""
    if _TARGET.fullmatch(given) or (method, given) == ("OPTIONS", b"*"):
        return given.decode("ascii"), None
    absolute = _ABSOLUTE.fullmatch(given)
    if absolute is None:
        raise _Refused(
            400,
            "the target must be a path beginning with a slash, or an address of http or https, of visible ASCII and "
            "without a fragment",
        )
    if not _HOST.fullmatch(absolute[1]):
        raise _Refused(400, "the target's authority is not a host name or address with an optional port")
    rest = (absolute[2] or b"").decode("ascii")
    if not rest and method == "OPTIONS":
        return "*", absolute[1].decode("ascii")  # RFC 9112 section 3.2.4
    return rest if rest.startswith("/") else f"/{rest}", absolute[1].decode("ascii")


def _field(line: bytes) -> Field:
    match = _FIELD.fullmatch(line)
    if match is None:
        raise _Refused(400, "a header field is not NAME: value")
    return match[1].lower(), match[2]


def _singles(fields: Sequence[Field]) -> dict[bytes, bytes]:
    found: dict[bytes, bytes] = {}
    for name, value in fields:
        if name not in _SINGLE:
            continue
        if name in found:
            raise _Refused(400, f"the field {name.decode()} is given more than once")
        found[name] = value
    return found


def _check_host(version: str, single: dict[bytes, bytes]) -> None:
    host = single.get(b"host")
    if host is None:
        if version == "1.1":
            raise _Refused(400, "HTTP/1.1 requires the field Host")
    elif not _HOST.fullmatch(host):
        raise _Refused(400, "the field Host is not a host name or address with an optional port")


def _check_framing(version: str, single: dict[bytes, bytes]) -> None:
    length, coding = single.get(b"content-length"), single.get(b"transfer-encoding")
    if length is not None and not _LENGTH.fullmatch(length):
        raise _Refused(400, "Content-Length is not one plain decimal number")
    if coding is None:
        return
    if version == "1.0":
        raise _Refused(400, "Transfer-Encoding does not exist in HTTP/1.0")
    if length is not None:
        raise _Refused(400, "Content-Length and Transfer-Encoding exclude each other")
    if not coding:
        raise _Refused(400, "Transfer-Encoding is empty")
    if coding.lower() != b"chunked":
        raise _Refused(501, "the only transfer coding known is chunked, alone", "coding-not-implemented")


def _expectation(version: str, single: dict[bytes, bytes]) -> bool:
    expectation = single.get(b"expect")
    if expectation is None or version == "1.0":
        return False  # RFC 9110 section 10.1.1: a 1.0 client never gets, and never waits for, an interim answer
    if expectation.lower() != b"100-continue":
        raise _Refused(417, "the only expectation known is 100-continue", "expectation-failed")
    return True


def _by_grammar(raw: bytes) -> h11.Request:
    connection = h11.Connection(h11.SERVER, max_incomplete_event_size=2 * LARGEST_HEAD)
    connection.receive_data(raw)
    try:
        event = connection.next_event()
    except h11.RemoteProtocolError as error:
        raise _Refused(error.error_status_hint, f"the head is malformed: {error}") from error
    if not isinstance(event, h11.Request):
        raise _Refused(400, "the head is not complete")
    return event
