"""The chunked coding: h11 as oracle for what is accepted, a table for what is not."""

from __future__ import annotations

import h11
import pytest
from hypothesis import given
from hypothesis import strategies as st
from malformed import CHUNKS

from lichen_service.http.chunked import MOST_CHUNKS, ChunkedBody
from lichen_service.http.policy import Refusal

LARGEST = 100_000
VALID = b"5\r\nhello\r\n06;name=value\r\n world\r\n1A\r\n" + b"x" * 26 + b"\r\n0;last\r\nX: y\r\n\r\n"


def decode(*pieces: bytes) -> tuple[bytes, int] | Refusal:
    """Body, and how many bytes of the pieces belong to it."""
    chunked, consumed = ChunkedBody(LARGEST), 0
    for piece in pieces:
        taken = chunked.feed(piece)
        if isinstance(taken, Refusal):
            return taken
        consumed += taken
        if chunked.done:
            return bytes(chunked.body), consumed
        assert taken == len(piece)
    return Refusal(0, "unfinished", "")


def decode_by_h11(data: bytes) -> bytes | None:
    connection = h11.Connection(h11.SERVER)
    connection.receive_data(b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n" + data)
    body = b""
    while True:
        event = connection.next_event()
        if isinstance(event, h11.Data):
            body += event.data
        elif isinstance(event, h11.EndOfMessage):
            return body
        elif event is h11.NEED_DATA:
            return None


def test_every_split_gives_the_same_body() -> None:
    expected = (b"hello world" + b"x" * 26, len(VALID))
    assert decode(VALID + b"GET /next") == expected
    for at in range(1, len(VALID)):
        assert decode(VALID[:at], VALID[at:] + b"GET /next") == expected
    assert decode(*(VALID[at : at + 1] for at in range(len(VALID)))) == expected


@pytest.mark.parametrize(("data", "status"), [case[1:] for case in CHUNKS], ids=[case[0] for case in CHUNKS])
def test_malformed_chunks_are_refused_however_they_arrive(data: bytes, status: int) -> None:
    for pieces in ([data], [data[at : at + 1] for at in range(len(data))]):
        verdict = decode(*pieces)
        assert isinstance(verdict, Refusal)
        assert verdict.status == status


def test_chunks_and_bytes_are_counted() -> None:
    chunk = b"1\r\na\r\n"
    body = decode(chunk * MOST_CHUNKS + b"0\r\n\r\n")
    assert isinstance(body, tuple)
    assert len(body[0]) == MOST_CHUNKS
    for data in (chunk * (MOST_CHUNKS + 1), b"%x\r\n" % (LARGEST + 1), b"5\r\nhello\r\n%x\r\n" % (LARGEST - 4)):
        verdict = decode(data)
        assert isinstance(verdict, Refusal)
        assert verdict.status == 413


@given(st.lists(st.tuples(st.integers(0, len(VALID)), st.binary(max_size=2)), max_size=3))
def test_what_is_accepted_another_parser_reads_alike(edits: list[tuple[int, bytes]]) -> None:
    mangled = VALID
    for at, piece in edits:
        mangled = mangled[:at] + piece + mangled[at + 1 :]
    verdict = decode(mangled)
    assert decode(*(mangled[at : at + 1] for at in range(len(mangled)))) == verdict
    if isinstance(verdict, tuple):
        body, consumed = verdict
        assert decode_by_h11(mangled[:consumed]) == body
