"""Requests that must not reach an application: (name, bytes, status of the refusal).

Each is a way in which parsers have been seen to disagree, or a limit.
"""

from __future__ import annotations


def _post(*fields: bytes, line: bytes = b"POST /echo HTTP/1.1", body: bytes = b"") -> bytes:
    return b"\r\n".join([line, b"Host: a", *fields, b"", b""]) + body


def _chunked(body: bytes) -> bytes:
    return _post(b"Transfer-Encoding: chunked", body=body)


def _get(*fields: bytes) -> bytes:
    return _post(*fields, line=b"GET / HTTP/1.1")


def _line(line: bytes) -> bytes:
    return line + b"\r\nHost: a\r\n\r\n"


HEADS: list[tuple[str, bytes, int]] = [
    # which body framing counts
    ("length and chunked", _post(b"Content-Length: 5", b"Transfer-Encoding: chunked", body=b"0\r\n\r\n"), 400),
    ("chunked and length", _post(b"Transfer-Encoding: chunked", b"Content-Length: 0", body=b"0\r\n\r\n"), 400),
    ("chunked in 1.0", _post(b"Transfer-Encoding: chunked", line=b"POST /echo HTTP/1.0", body=b"0\r\n\r\n"), 400),
    ("length list", _post(b"Content-Length: 5, 5", body=b"hello"), 400),
    ("length twice, equal", _post(b"Content-Length: 5", b"Content-Length: 5", body=b"hello"), 400),
    ("length twice, unequal", _post(b"Content-Length: 5", b"Content-Length: 6", body=b"hello"), 400),
    ("length twice, in different case", _post(b"Content-Length: 5", b"CONTENT-LENGTH: 5", body=b"hello"), 400),
    ("length with plus", _post(b"Content-Length: +5", body=b"hello"), 400),
    ("length with minus", _post(b"Content-Length: -5", body=b"hello"), 400),
    ("length with leading zero", _post(b"Content-Length: 05", body=b"hello"), 400),
    ("length in hexadecimal", _post(b"Content-Length: 0x5", body=b"hello"), 400),
    ("length with underscore", _post(b"Content-Length: 1_0", body=b"hello"), 400),
    ("length with fraction", _post(b"Content-Length: 5.0", body=b"hello"), 400),
    ("length with inner space", _post(b"Content-Length: 5 5", body=b"hello"), 400),
    ("length in other digits", _post("Content-Length: \u0665".encode(), body=b"hello"), 400),
    ("length empty", _post(b"Content-Length:", body=b"hello"), 400),
    ("length beyond 64 bits", _post(b"Content-Length: 99999999999999999999", body=b"hello"), 400),
    ("coding empty", _post(b"Transfer-Encoding:", body=b"0\r\n\r\n"), 400),
    ("coding identity", _post(b"Transfer-Encoding: identity", body=b"0\r\n\r\n"), 501),
    ("coding gzip", _post(b"Transfer-Encoding: gzip", body=b"0\r\n\r\n"), 501),
    ("codings stacked", _post(b"Transfer-Encoding: gzip, chunked", body=b"0\r\n\r\n"), 501),
    ("codings repeated", _post(b"Transfer-Encoding: chunked, chunked", body=b"0\r\n\r\n"), 501),
    ("codings in two fields", _post(b"Transfer-Encoding: gzip", b"Transfer-Encoding: chunked"), 400),
    ("coding misspelt", _post(b"Transfer-Encoding: xchunked", body=b"0\r\n\r\n"), 501),
    ("coding with parameter", _post(b"Transfer-Encoding: chunked;a=b", body=b"0\r\n\r\n"), 501),
    ("coding quoted", _post(b'Transfer-Encoding: "chunked"', body=b"0\r\n\r\n"), 501),
    ("coding after vertical tab", _post(b"Transfer-Encoding: \x0bchunked", body=b"0\r\n\r\n"), 400),
    ("space before colon", _post(b"Transfer-Encoding : chunked", body=b"0\r\n\r\n"), 400),
    ("tab before colon", _post(b"Content-Length\t: 5", body=b"hello"), 400),
    # lines and bytes
    ("folded field", _get(b"X-Long: a", b" b"), 400),
    ("folded with tab", _get(b"X-Long: a", b"\tb"), 400),
    ("first field folded", b"GET / HTTP/1.1\r\n Host: a\r\n\r\n", 400),
    ("bare line feeds", b"GET / HTTP/1.1\nHost: a\n\n", 400),
    ("one bare line feed", b"GET / HTTP/1.1\r\nHost: a\nX: b\r\n\r\n", 400),
    ("head ends with bare line feed", b"GET / HTTP/1.1\r\nHost: a\r\n\n", 400),
    ("bare carriage return in value", _get(b"X-Note: a\rContent-Length: 5"), 400),
    ("carriage return before line end", b"GET / HTTP/1.1\r\nHost: a\r\r\n\r\n", 400),
    ("NUL in value", _get(b"X-Note: a\x00b"), 400),
    ("BEL in value", _get(b"X-Note: a\x07b"), 400),
    ("DEL in value", _get(b"X-Note: a\x7fb"), 400),
    ("form feed in value", _get(b"X-Note: a\x0cb"), 400),
    ("NUL in name", _get(b"X-No\x00te: a"), 400),
    ("space in name", _get(b"X Note: a"), 400),
    ("name not ASCII", _get(b"X-N\xc3\xb6te: a"), 400),
    ("name with parenthesis", _get(b"X-(Note): a"), 400),
    ("name empty", _get(b": a"), 400),
    ("no colon", _get(b"X-Note"), 400),
    ("two empty lines first", b"\r\n\r\n" + _get(), 400),
    ("bare line feed first", b"\n" + _get(), 400),
    # fields given twice
    ("no host", b"GET / HTTP/1.1\r\n\r\n", 400),
    ("host twice", _get(b"Host: b"), 400),
    ("host empty", b"GET / HTTP/1.1\r\nHost:\r\n\r\n", 400),
    ("host with path", b"GET / HTTP/1.1\r\nHost: a/b\r\n\r\n", 400),
    ("host with user", b"GET / HTTP/1.1\r\nHost: b@a\r\n\r\n", 400),
    ("host with space", b"GET / HTTP/1.1\r\nHost: a b\r\n\r\n", 400),
    ("host list", b"GET / HTTP/1.1\r\nHost: a, b\r\n\r\n", 400),
    ("host with bad port", b"GET / HTTP/1.1\r\nHost: a:b\r\n\r\n", 400),
    ("content type twice", _post(b"Content-Type: a/b", b"Content-Type: c/d"), 400),
    ("authorisation twice", _get(b"Authorization: a", b"Authorization: b"), 400),
    # request line
    ("target relative", _line(b"GET a HTTP/1.1"), 400),
    ("target absolute", _line(b"GET http://a/ HTTP/1.1"), 400),
    ("target authority", _line(b"GET a:80 HTTP/1.1"), 400),
    ("target asterisk", _line(b"GET * HTTP/1.1"), 400),
    ("target with fragment", _line(b"GET /a#b HTTP/1.1"), 400),
    ("target not ASCII", _line(b"GET /\xc3\xb6 HTTP/1.1"), 400),
    ("target with control", _line(b"GET /\x01 HTTP/1.1"), 400),
    ("target empty", _line(b"GET  HTTP/1.1"), 400),
    ("target with space", _line(b"GET /a b HTTP/1.1"), 400),
    ("two spaces", _line(b"GET  / HTTP/1.1"), 400),
    ("tab for space", _line(b"GET\t/ HTTP/1.1"), 400),
    ("space at the end", _line(b"GET / HTTP/1.1 "), 400),
    ("space at the beginning", _line(b" GET / HTTP/1.1"), 400),
    ("no version", _line(b"GET /"), 400),
    ("version 2", _line(b"GET / HTTP/2.0"), 505),
    ("version 1.2", _line(b"GET / HTTP/1.2"), 505),
    ("version 0.9", _line(b"GET / HTTP/0.9"), 505),
    ("version without minor", _line(b"GET / HTTP/2"), 400),
    ("version with more digits", _line(b"GET / HTTP/1.10"), 400),
    ("version in lower case", _line(b"GET / http/1.1"), 400),
    ("other protocol", _line(b"GET / ICAP/1.1"), 400),
    ("HTTP/2 preface", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 505),
    ("TLS hello", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", 400),
    ("CONNECT", _line(b"CONNECT a:80 HTTP/1.1"), 501),
    ("TRACE", _line(b"TRACE / HTTP/1.1"), 501),
    ("method in lower case", _line(b"get / HTTP/1.1"), 501),
    ("method unknown", _line(b"FROBNICATE / HTTP/1.1"), 501),
    ("method not a token", _line(b"GE(T / HTTP/1.1"), 400),
    ("expectation unknown", _get(b"Expect: 200-ok"), 417),
    # limits
    ("101 fields", _get(*[b"X: a"] * 100), 431),
    ("request line too long", _line(b"GET /" + b"a" * (4095 - 14) + b" HTTP/1.1"), 414),
    ("field too long", _get(b"X: " + b"a" * 8188), 431),
    ("head too large", _get(*[b"X: " + b"a" * 8000] * 3), 431),
    # escapes that do not decode
    ("escape cut short", _line(b"GET /a%2 HTTP/1.1"), 400),
    ("escape not hexadecimal", _line(b"GET /a?b=%zz HTTP/1.1"), 400),
    ("escaped NUL", _line(b"GET /a%00 HTTP/1.1"), 400),
    ("escaped line feed in path", _line(b"GET /a%0Ab HTTP/1.1"), 400),
    ("escaped bytes not UTF-8", _line(b"GET /a?b=%ff HTTP/1.1"), 400),
    ("escaped overlong slash", _line(b"GET /%c0%af HTTP/1.1"), 400),
]

CHUNKS: list[tuple[str, bytes, int]] = [
    ("no size", b"\r\n\r\n", 400),
    ("size not hexadecimal", b"g\r\nhello\r\n0\r\n\r\n", 400),
    ("size with prefix", b"0x5\r\nhello\r\n0\r\n\r\n", 400),
    ("size with plus", b"+5\r\nhello\r\n0\r\n\r\n", 400),
    ("size with minus", b"-5\r\nhello\r\n0\r\n\r\n", 400),
    ("size with underscore", b"1_0\r\nhello\r\n0\r\n\r\n", 400),
    ("size after space", b" 5\r\nhello\r\n0\r\n\r\n", 400),
    ("size before space", b"5 \r\nhello\r\n0\r\n\r\n", 400),
    ("size of 17 digits", b"00000000000000005\r\nhello\r\n0\r\n\r\n", 400),
    ("size beyond the limit", b"ffffffffffffffff\r\nhello\r\n0\r\n\r\n", 413),
    ("size line ends with bare line feed", b"5\nhello\r\n0\r\n\r\n", 400),
    ("size line ends with bare carriage return", b"5\rhello\r\n0\r\n\r\n", 400),
    ("data longer than size", b"5\r\nhelloworld\r\n0\r\n\r\n", 400),
    ("data ends with bare line feed", b"5\r\nhello\n0\r\n\r\n", 400),
    ("data without end", b"5\r\nhello0\r\n\r\n\r\n", 400),
    ("control in extension", b"5;a=\x00\r\nhello\r\n0\r\n\r\n", 400),
    ("carriage return in extension", b"5;a\rb\r\nhello\r\n0\r\n\r\n", 400),
    ("line feed in extension", b"5;a\nb\r\nhello\r\n0\r\n\r\n", 400),
    ("extension too long", b"5;" + b"a" * 2000 + b"\r\nhello\r\n0\r\n\r\n", 400),
    ("trailer length", b"0\r\nContent-Length: 5\r\n\r\n", 400),
    ("trailer host", b"0\r\nHost: a\r\n\r\n", 400),
    ("trailer coding", b"0\r\nTransfer-Encoding: chunked\r\n\r\n", 400),
    ("trailer authorisation", b"0\r\nauthorization: a\r\n\r\n", 400),
    ("trailer folded", b"0\r\nX: a\r\n b\r\n\r\n", 400),
    ("trailer with bare line feed", b"0\r\nX: a\n\r\n", 400),
    ("trailer without colon", b"0\r\nX\r\n\r\n", 400),
    ("trailers end with bare line feed", b"0\r\n\n", 400),
    ("trailers too large", b"0\r\n" + b"X: aaaaaaaaaa\r\n" * 1000 + b"\r\n", 400),
]

REQUESTS = HEADS + [(name, _chunked(body), status) for name, body, status in CHUNKS]
