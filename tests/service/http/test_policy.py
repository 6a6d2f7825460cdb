"""Heads: what is refused and how, what is read, and that neither depends on segments."""

from __future__ import annotations

from urllib.parse import quote_plus

import pytest
from hypothesis import given
from hypothesis import strategies as st
from malformed import HEADS, REQUESTS

from lichen_service.http import policy
from lichen_service.http.policy import HeadScanner, RawHead, Refusal
from lichen_service.http.target import BadTarget, split_target

VALID = [
    b"GET / HTTP/1.1\r\nHost: a\r\n\r\n",
    b"\r\nGET /a%20b?c=d HTTP/1.1\r\nHost: a.example:8080\r\nX-Note:  two words \t\r\nX-Note:\r\n\r\n",
    b"POST /v1/operations/x?a=5 HTTP/1.1\r\nhost: [::1]:80\r\nContent-Length: 0\r\nExpect: 100-Continue\r\n\r\n",
    b"QUERY /x?m=[[1,0],[0,1]] HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: Chunked\r\nConnection: Foo, Close\r\n\r\n",
    b"OPTIONS * HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
    b"GET http://a.example:8080/b?c=d HTTP/1.1\r\nHost: b\r\n\r\n",
    b"HEAD HTTPS://[::1]?c=d HTTP/1.1\r\nHost: b\r\n\r\n",
    b"GET / HTTP/1.0\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: a\r\nX-Latin: gr\xfc\xdfe\r\n\r\n",
]


def in_origin_form(method: str, target: str) -> str:
    """A target as it has to be read, by a road of its own."""
    _, absolute, rest = target.partition("://")
    if target.startswith("/") or not absolute:
        return target
    if not set(rest) & set("/?"):
        return "*" if method == "OPTIONS" else "/"
    begins = min(rest.index(each) for each in "/?" if each in rest)
    return rest[begins:] if rest[begins] == "/" else f"/{rest[begins:]}"


def judge(pieces: list[bytes]) -> tuple[int, RawHead] | Refusal | None:
    """What comes of a head that arrives in these pieces."""
    scanner, buffer = HeadScanner(), bytearray()
    for piece in pieces:
        buffer += piece
        end = scanner.scan(buffer)
        if isinstance(end, Refusal):
            return end
        if end is not None:
            head = policy.read_head(bytes(buffer[:end]))
            if isinstance(head, RawHead):
                try:
                    split_target(head.target)
                except BadTarget as bad:
                    return Refusal(400, "malformed-target", str(bad))
                return end, head
            return head
    return None


@pytest.mark.parametrize(("data", "status"), [case[1:] for case in HEADS], ids=[case[0] for case in HEADS])
def test_malformed_head_is_refused_however_it_arrives(data: bytes, status: int) -> None:
    whole = judge([data])
    assert isinstance(whole, Refusal), "accepted"
    assert whole.status == status
    by_bytes = judge([data[at : at + 1] for at in range(len(data))])
    assert isinstance(by_bytes, Refusal)
    assert by_bytes.status == status


def test_the_corpus_is_large_and_without_repeats() -> None:
    assert len({data for _, data, _ in REQUESTS}) == len(REQUESTS) == len({name for name, _, _ in REQUESTS})
    assert len(REQUESTS) >= 200


@pytest.mark.parametrize("data", VALID)
def test_valid_head_reads_the_same_at_every_split(data: bytes) -> None:
    whole = judge([data])
    assert isinstance(whole, tuple)
    assert whole[0] == len(data)
    for at in range(1, len(data)):
        assert judge([data[:at], data[at:]]) == whole
    assert judge([data[at : at + 1] for at in range(len(data))]) == whole


@pytest.mark.parametrize("data", [*VALID, *(data for _, data, _ in HEADS)])
def test_the_short_road_passes_nothing_that_the_long_one_does_not(data: bytes) -> None:
    usual = policy.usual_head(bytearray(data))
    if usual is not None:
        end = HeadScanner().scan(bytearray(data))
        assert isinstance(end, int)
        assert usual == (end, policy.read_head(data[:end]))


def test_the_short_road_is_the_one_that_is_taken() -> None:
    """Heads as browsers and libraries send them, and none that is unusual."""
    head = b"GET /a?b=c HTTP/1.1\r\nHost: a:80\r\nAccept: */*\r\nCookie: a=b\r\nCookie: c=d\r\nX-Empty:\r\n\r\n"
    usual = policy.usual_head(bytearray(head + b"GET"))
    assert usual is not None
    assert usual[0] == len(head)
    assert usual[1].headers == {"host": "a:80", "accept": "*/*", "cookie": "a=b; c=d", "x-empty": ""}
    assert policy.usual_head(bytearray(head[:-1])) is None
    assert policy.usual_head(bytearray(b"GET / HTTP/1.0\r\nHost: a\r\n\r\n")) is None
    assert policy.usual_head(bytearray(head[:-2] + b"X-Long: " + b"a" * 4096 + b"\r\n\r\n")) is None
    assert policy.usual_head(bytearray(head[:-2] + b"Transfer-Encoding: chunked\r\n\r\n")) is None
    assert policy.usual_head(bytearray(head[:-2] + b"X-Many: a\r\n" * policy.MOST_FIELDS + b"\r\n")) is None


def test_what_is_read() -> None:
    verdict = judge([VALID[1] + b"GET"])
    assert isinstance(verdict, tuple)
    end, head = verdict
    assert end == len(VALID[1])
    assert (head.method, head.target, head.version) == ("GET", "/a%20b?c=d", "1.1")
    assert head.fields == (("host", "a.example:8080"), ("x-note", "two words"), ("x-note", ""))
    assert head.keep_alive
    assert not head.expects_continue


@pytest.mark.parametrize(
    ("given", "target", "host"),
    [
        ("GET /a", "/a", "b"),
        ("GET http://a.example/b%20c?d=http://e/", "/b%20c?d=http://e/", "a.example"),
        ("GET HTTP://a:80", "/", "a:80"),
        ("GET https://[::1]:8080?c=d", "/?c=d", "[::1]:8080"),
        ("GET http://a//b/../c", "//b/../c", "a"),
        ("GET http://a?/b", "/?/b", "a"),
        ("OPTIONS http://a", "*", "a"),
        ("OPTIONS http://a/", "/", "a"),
        ("OPTIONS *", "*", "b"),
    ],
)
def test_an_absolute_target_is_its_path_at_its_own_host(given: str, target: str, host: str) -> None:
    head = policy.read_head(f"{given} HTTP/1.1\r\nHost: b\r\n\r\n".encode())
    assert isinstance(head, RawHead)
    assert (head.target, head.headers["host"]) == (target, host)
    assert head.fields == (("host", "b"),)


@pytest.mark.parametrize(
    ("fields", "version", "keep_alive", "expects"),
    [
        ("", "1.1", True, False),
        ("Connection: close\r\n", "1.1", False, False),
        ("Connection: keep-alive\r\nConnection: x, CLOSE\r\n", "1.1", False, False),
        ("Connection: keep-alive\r\n", "1.0", False, False),
        ("Expect: 100-continue\r\n", "1.1", True, True),
        ("Expect: 100-continue\r\n", "1.0", False, False),
        ("Expect: something\r\n", "1.0", False, False),
    ],
)
def test_persistence_and_expectation(fields: str, version: str, keep_alive: bool, expects: bool) -> None:
    head = policy.read_head(f"GET / HTTP/{version}\r\nHost: a\r\n{fields}\r\n".encode())
    assert isinstance(head, RawHead)
    assert (head.keep_alive, head.expects_continue) == (keep_alive, expects)


def test_the_limits_themselves_are_allowed() -> None:
    line = b"GET /" + b"a" * (policy.LONGEST_REQUEST_LINE - 14) + b" HTTP/1.1\r\nHost: a\r\n"
    field = b"X: " + b"a" * (policy.LONGEST_FIELD - 3) + b"\r\n"
    many = b"X: a\r\n" * (policy.MOST_FIELDS - 2)
    assert isinstance(judge([line + field + b"\r\n"]), tuple)
    assert isinstance(judge([line + field + many + b"\r\n"]), tuple)


def test_a_hopeless_head_is_refused_before_its_end() -> None:
    for data, status in (
        (b"GET /" + b"a" * 9000, 414),
        (b"GET / HTTP/1.1\r\nX: " + b"a" * 9000, 431),
        (b"GET / HTTP/1.1\r\n" + (b"X: " + b"a" * 5000 + b"\r\n") * 5, 431),
        (b"\x16\x03\x01", 400),
        (b"GET / HTTP/1.1\n", 400),
    ):
        verdict = judge([data])
        assert isinstance(verdict, Refusal)
        assert verdict.status == status


@given(st.sampled_from(VALID), st.lists(st.tuples(st.integers(0, 200), st.binary(max_size=3)), max_size=4))
def test_mangled_heads_are_read_or_refused_and_never_split_apart(data: bytes, edits: list[tuple[int, bytes]]) -> None:
    mangled = data
    for at, piece in edits:
        mangled = mangled[:at] + piece + mangled[at + 1 :]
    verdict = judge([mangled])
    assert judge([mangled[at : at + 1] for at in range(len(mangled))]) == verdict
    if isinstance(verdict, tuple):
        end, head = verdict
        lines = mangled[:end].decode("latin-1").strip("\r\n").split("\r\n")
        method, target, version = lines[0].split(" ")
        assert (method, in_origin_form(method, target), version) == (head.method, head.target, f"HTTP/{head.version}")
        named = [line.lower().partition(":") for line in lines[1:]]
        assert [(name, value.strip(" \t")) for name, _, value in named] == [
            (name, value.lower()) for name, value in head.fields
        ]


@pytest.mark.parametrize(
    ("target", "path", "query"),
    [
        ("/", "/", ()),
        ("/a//b/../c", "/a//b/../c", ()),
        ("/%E2%82%AC?x=%26%3D&x=2", "/\u20ac", (("x", "&="), ("x", "2"))),
        ("/?", "/", ()),
        ("/?a&b=&=c&&d=e=f", "/", (("a", ""), ("b", ""), ("", "c"), ("d", "e=f"))),
        ("/?a?b=c", "/", (("a?b", "c"),)),
        ("/a+b?c=d+e%2B", "/a+b", (("c", "d e+"),)),
        ("/?text=a%0Ab", "/", (("text", "a\nb"),)),
    ],
)
def test_targets_decode_once(target: str, path: str, query: tuple[tuple[str, str], ...]) -> None:
    assert split_target(target) == (path, query)


@given(st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0")))
def test_any_text_survives_the_query(text: str) -> None:
    assert split_target(f"/?x={quote_plus(text)}")[1] == (("x", text),)
