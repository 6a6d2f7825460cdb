"""The same bytes to us, to llhttp (the parser of Node.js and many proxies) and to gunicorn: what we accept, they must
read alike.

Requests are mangled at random, from fixed seeds; `LICHEN_INPUTS` says how many (`make fuzz` asks for 80 000). We may
refuse what they accept. The other way round, or two readings of what both accept, is how requests are smuggled.
"""

from __future__ import annotations

import os
import random
from dataclasses import dataclass, field

import httptools
from gunicorn.config import Config
from gunicorn.http.errors import ParseException
from gunicorn.http.parser import RequestParser
from malformed import REQUESTS
from test_policy import VALID, in_origin_form

from lichen_service.http import policy
from lichen_service.http.chunked import ChunkedBody
from lichen_service.http.policy import HeadScanner, RawHead, Refusal

GUNICORN = Config()
GUNICORN.set("limit_request_line", policy.LONGEST_REQUEST_LINE)
INPUTS = int(os.environ.get("LICHEN_INPUTS", "4000"))
SEEDS = [
    *VALID,
    *(data for _, data, _ in REQUESTS if len(data) < 500),
    b"POST /echo HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\n\r\nhello",
    b"POST /echo HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n5;x=y\r\nhello\r\n0\r\nX-End: a\r\n\r\n",
]
PIECES = (
    *(b"\r\n", b"\n", b"\r", b"\r\n\r\n", b" ", b"\t", b":", b",", b";", b"\0", b"\x0b", b"\x7f", b"\xff", b"\xa0"),
    *(
        b"chunked",
        b"Transfer-Encoding: chunked\r\n",
        b"Content-Length: 5\r\n",
        b"Content-Length: 0\r\n",
        b"Host: b\r\n",
    ),
    *(b"0", b"5", b"+", b"-", b"0x", b"HTTP/1.1", b"HTTP/1.0", b"GET / HTTP/1.1\r\n", b"Connection: close\r\n", b"%00"),
)


@dataclass
class Read:
    """A request as one parser reads it."""

    method: str = ""
    target: str = ""
    fields: list[tuple[str, str]] = field(default_factory=list)
    body: bytes = b""


def ours(data: bytes, cuts: random.Random) -> tuple[Read, int] | None:
    """What we read, and of how many bytes; None where we refuse, or want more. Cut at random places."""
    scanner, buffer, at = HeadScanner(), bytearray(), 0
    while True:
        end = scanner.scan(buffer)
        if isinstance(end, Refusal) or (end is None and at == len(data)):
            assert policy.usual_head(bytearray(data)) is None, data
            return None
        if end is not None:
            break
        step = cuts.randint(1, 40)
        buffer += data[at : at + step]
        at = min(len(data), at + step)
    head = policy.read_head(data[:end])
    usual = policy.usual_head(bytearray(data))
    assert usual is None or usual == (end, head), data
    if not isinstance(head, RawHead):
        return None
    known = dict(head.fields)
    read = Read(head.method, head.target, list(head.fields))
    if "transfer-encoding" not in known:
        length = int(known.get("content-length", "0"))
        if len(data) < end + length:
            return None
        read.body = data[end : end + length]
        return read, end + length
    body, at = ChunkedBody(1 << 20), end
    while not body.done:
        if at == len(data):
            return None
        taken = body.feed(data[at : at + cuts.randint(1, 40)])
        if isinstance(taken, Refusal):
            return None
        at += taken
    read.body = bytes(body.body)
    return read, at


def plain(name: str, value: str) -> tuple[str, str]:
    """A field as we have it: in lower case where case means nothing."""
    name = name.lower()
    return name, value.lower() if name == "transfer-encoding" else value


class Theirs:
    """What llhttp reads of bytes that we take for one whole request."""

    def __init__(self, data: bytes) -> None:
        self.read = Read()
        self.complete = 0
        self.wrong: Exception | None = None
        parser = httptools.HttpRequestParser(self)
        try:
            parser.feed_data(data)
            self.read.method = parser.get_method().decode()
        except httptools.HttpParserError as wrong:
            self.wrong = wrong

    def on_url(self, part: bytes) -> None:
        self.read.target += part.decode("latin-1")

    def on_header(self, name: bytes, value: bytes) -> None:
        if not self.read.body:  # afterwards they are trailers
            self.read.fields.append(plain(name.decode("latin-1"), value.decode("latin-1").strip(" \t")))

    def on_body(self, part: bytes) -> None:
        self.read.body += part

    def on_message_complete(self) -> None:
        self.complete += 1


def gunicorn_reads(data: bytes) -> Read | None:
    """What gunicorn's parser reads of the same bytes; None where it refuses them."""
    try:
        request = next(RequestParser(GUNICORN, [data], ("127.0.0.1", 1)))
        fields = [plain(name, value) for name, value in request.headers]
        return Read(request.method, request.uri, fields, request.body.read())
    except (ParseException, StopIteration):
        return None


def mangled(chance: random.Random) -> bytes:
    data = bytearray(chance.choice(SEEDS))
    for _ in range(chance.randint(0, 4)):
        at = chance.randint(0, len(data))
        match chance.randint(0, 4):
            case 0:
                data[at:at] = chance.choice(PIECES)
            case 1:
                del data[at : at + chance.randint(1, 4)]
            case 2:
                data[at : at + 1] = bytes([chance.randint(0, 255)])
            case 3:
                other = chance.choice(SEEDS)
                data[at:] = other[chance.randint(0, len(other)) :]
            case 4:
                data[at:at] = data[at : at + chance.randint(1, 30)]
    return bytes(data)


def test_what_we_accept_is_read_alike() -> None:
    chance = random.Random(20)
    accepted = 0
    for _ in range(INPUTS):
        data = mangled(chance)
        found = ours(data, chance)
        if found is None:
            continue
        accepted += 1
        read, end = found
        theirs = Theirs(data[:end])
        assert theirs.wrong is None, (data, theirs.wrong)
        assert theirs.complete == 1, data
        target = in_origin_form(theirs.read.method, theirs.read.target)
        assert (theirs.read.method, target, theirs.read.body) == (read.method, read.target, read.body), data
        count = len(read.fields)
        assert theirs.read.fields[:count] == read.fields, data
    assert accepted > INPUTS / 100, "the draws are hopeless, so this shows nothing"


def test_gunicorn_reads_what_we_accept_alike_or_refuses_it() -> None:
    chance = random.Random(22)
    accepted = refused = 0
    for _ in range(INPUTS // 2):
        data = mangled(chance)
        found = ours(data, chance)
        if found is None:
            continue
        accepted += 1
        read, end = found
        theirs = gunicorn_reads(data[:end])
        if theirs is None:
            refused += 1
            continue
        target = in_origin_form(theirs.method, theirs.target)
        assert (theirs.method, target, theirs.body) == (read.method, read.target, read.body), data
        # It drops fields with an underscore in their names, which its own environment could not tell from a dash.
        assert theirs.fields == [(name, value) for name, value in read.fields if "_" not in name], data
    assert accepted > INPUTS / 200, "the draws are hopeless, so this shows nothing"
    assert refused < accepted / 5, "a parser that refuses what we accept cannot differ, and shows nothing"


def test_what_is_refused_is_refused_with_a_status() -> None:
    chance = random.Random(21)
    statuses = set()
    for _ in range(INPUTS // 4):
        data = mangled(chance)
        verdict = HeadScanner().scan(bytearray(data))
        if isinstance(verdict, int):
            head = policy.read_head(data[:verdict])
            verdict = head if isinstance(head, Refusal) else None
        if isinstance(verdict, Refusal):
            statuses.add(verdict.status)
    assert statuses <= {400, 408, 413, 414, 417, 431, 501, 505}
    assert len(statuses) >= 3
