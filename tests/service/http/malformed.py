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
    ("target absolute without host", _line(b"GET http:///a HTTP/1.1"), 400),
    ("target absolute with a port alone", _line(b"GET http://:80/a HTTP/1.1"), 400),
    ("target absolute with user", _line(b"GET http://b@a/ HTTP/1.1"), 400),
    ("target absolute with bad port", _line(b"GET http://a:b/ HTTP/1.1"), 400),
    ("target absolute with fragment", _line(b"GET http://a/b#c HTTP/1.1"), 400),
    ("target absolute with backslash", _line(b"GET http://a\\b/ HTTP/1.1"), 400),
    ("target absolute of another scheme", _line(b"GET file:///etc/passwd HTTP/1.1"), 400),
    ("target absolute without authority", _line(b"GET http:/a HTTP/1.1"), 400),
    ("target absolute, no host field", b"GET http://a/ HTTP/1.1\r\n\r\n", 400),
    ("target absolute, host field malformed", b"GET http://a/ HTTP/1.1\r\nHost: b/c\r\n\r\n", 400),
    ("target absolute, host field twice", b"GET http://a/ HTTP/1.1\r\nHost: a\r\nHost: a\r\n\r\n", 400),
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
    ("request line too long", _line(b"GET /" + b"a" * (8191 - 14) + b" HTTP/1.1"), 414),
    ("field too long", _get(b"X: " + b"a" * 8188), 431),
    ("head too large", _get(*[b"X: " + b"a" * 8000] * 4), 431),
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


def _every_control() -> list[tuple[str, bytes, int]]:
    """Every control character but the tab, in a value and in a target: some parsers end a line or a text there."""
    controls = [*range(0x09), *range(0x0B, 0x20), 0x7F]
    named = {0x00, 0x07, 0x0C, 0x7F}  # told one by one above
    values = [
        (f"control {each:#04x} in value", _get(b"X-Note: a" + bytes([each]) + b"b"), 400)
        for each in controls
        if each not in named and each != 0x0D
    ]
    targets = [
        (f"control {each:#04x} in target", _line(b"GET /a" + bytes([each]) + b"b HTTP/1.1"), 400)
        for each in controls
        if each not in (0x01, 0x0D)
    ]
    return values + targets


def _every_separator() -> list[tuple[str, bytes, int]]:
    """Every delimiter of the grammar in a name, where only token characters are allowed."""
    return [(f"{each!r} in name", _get(b"X-No" + each.encode() + b"te: a"), 400) for each in '"),/;<=>?@[\\]{}']


def _every_single() -> list[tuple[str, bytes, int]]:
    """Every field that has one value, given twice: which one counts is a matter of taste."""
    fields = {
        b"Content-Encoding": b"gzip",
        b"Content-Range": b"bytes 0-1/2",
        b"Date": b"Thu, 01 Jan 1970 00:00:00 GMT",
        b"Expect": b"100-continue",
        b"Idempotency-Key": b"a",
        b"If-Modified-Since": b"Thu, 01 Jan 1970 00:00:00 GMT",
        b"If-Range": b"a",
        b"If-Unmodified-Since": b"Thu, 01 Jan 1970 00:00:00 GMT",
        b"Max-Forwards": b"1",
        b"Range": b"bytes=0-1",
        b"Referer": b"a",
        b"Request-Timeout": b"1000",
        b"User-Agent": b"a",
        b"X-Request-ID": b"a",
    }
    return [
        (f"{name.decode()} twice", _get(name + b": " + value, name.lower() + b": " + value), 400)
        for name, value in fields.items()
    ]


HEADS += [
    ("length with trailing letter", _post(b"Content-Length: 5a", body=b"hello"), 400),
    ("length in quotes", _post(b'Content-Length: "5"', body=b"hello"), 400),
    ("length with exponent", _post(b"Content-Length: 1e1", body=b"hello"), 400),
    ("length in octal", _post(b"Content-Length: 0o5", body=b"hello"), 400),
    ("length with separator", _post(b"Content-Length: 1,000", body=b"hello"), 400),
    ("length with semicolon", _post(b"Content-Length: 5;5", body=b"hello"), 400),
    ("length of minus zero", _post(b"Content-Length: -0"), 400),
    ("length of zeros", _post(b"Content-Length: 00"), 400),
    ("length with no-break space", _post(b"Content-Length: 5\xa0", body=b"hello"), 400),
    ("length of 2^64", _post(b"Content-Length: 18446744073709551616", body=b"hello"), 400),
    ("length of -1 as unsigned", _post(b"Content-Length: 4294967295999999999999", body=b"hello"), 400),
    ("length NaN", _post(b"Content-Length: NaN"), 400),
    ("length on GET, malformed", _get(b"Content-Length: x"), 400),
    ("length and coding on GET", _get(b"Content-Length: 0", b"Transfer-Encoding: chunked"), 400),
    ("coding then identity", _post(b"Transfer-Encoding: chunked, identity", body=b"0\r\n\r\n"), 501),
    ("coding identity then chunked", _post(b"Transfer-Encoding: identity, chunked", body=b"0\r\n\r\n"), 501),
    ("coding with comma first", _post(b"Transfer-Encoding: ,chunked", body=b"0\r\n\r\n"), 501),
    ("coding with comma last", _post(b"Transfer-Encoding: chunked,", body=b"0\r\n\r\n"), 501),
    ("coding with inner space", _post(b"Transfer-Encoding: chun ked", body=b"0\r\n\r\n"), 501),
    ("coding with dotted letter", _post("Transfer-Encoding: chun\u212aed".encode(), body=b"0\r\n\r\n"), 501),
    ("coding after no-break space", _post(b"Transfer-Encoding: \xa0chunked", body=b"0\r\n\r\n"), 501),
    ("coding after form feed", _post(b"Transfer-Encoding: \x0cchunked", body=b"0\r\n\r\n"), 400),
    ("coding folded", _post(b"Transfer-Encoding:", b" chunked", body=b"0\r\n\r\n"), 400),
    ("coding deflate", _post(b"Transfer-Encoding: deflate"), 501),
    ("coding compress", _post(b"Transfer-Encoding: compress"), 501),
    ("coding on 1.0 without chunked", _post(b"Transfer-Encoding: identity", line=b"POST /echo HTTP/1.0"), 400),
    ("length hidden behind bare return", _get(b"X-Note: a\r\rContent-Length: 5"), 400),
    ("second request behind bare return", b"GET / HTTP/1.1\r\nHost: a\rGET /b HTTP/1.1\r\n\r\n", 400),
    ("line feed then return", b"GET / HTTP/1.1\n\rHost: a\n\r\n\r", 400),
    ("only line feeds after the first line", b"GET / HTTP/1.1\r\nHost: a\n\n", 400),
    ("request line ends with bare return", b"GET / HTTP/1.1\rHost: a\r\n\r\n", 400),
    ("space alone as a field", _get(b" "), 400),
    ("tab alone as a field", _get(b"\t"), 400),
    ("colon alone", _get(b":"), 400),
    ("space before name", _get(b" X-Note: a"), 400),
    ("no-break space before colon", _get(b"X-Note\xa0: a"), 400),
    ("name with high byte", _get(b"X-Note\xff: a"), 400),
    ("name in UTF-8 disguise", _get("Content\u2010Length: 5".encode()), 400),
    ("host with brackets unclosed", b"GET / HTTP/1.1\r\nHost: [::1\r\n\r\n", 400),
    ("host with letters in brackets", b"GET / HTTP/1.1\r\nHost: [g::1]\r\n\r\n", 400),
    ("host with port of six digits", b"GET / HTTP/1.1\r\nHost: a:123456\r\n\r\n", 400),
    ("host with query", b"GET / HTTP/1.1\r\nHost: a?b\r\n\r\n", 400),
    ("host with fragment", b"GET / HTTP/1.1\r\nHost: a#b\r\n\r\n", 400),
    ("host with backslash", b"GET / HTTP/1.1\r\nHost: a\\\\b\r\n\r\n", 400),
    ("host with scheme", b"GET / HTTP/1.1\r\nHost: http://a\r\n\r\n", 400),
    ("host not ASCII", "GET / HTTP/1.1\r\nHost: \u00f6\r\n\r\n".encode(), 400),
    ("host with quotes", b'GET / HTTP/1.1\r\nHost: "a"\r\n\r\n', 400),
    ("target of another origin", _line(b"GET //a@b:c HTTP/1.1\x00"), 400),
    ("target with backslash host", _line(b"GET \\\\a HTTP/1.1"), 400),
    ("target of OPTIONS in GET", _line(b"HEAD * HTTP/1.1"), 400),
    ("target with tab", _line(b"GET /a\tb HTTP/1.1"), 400),
    ("target with high byte", _line(b"GET /\xff HTTP/1.1"), 400),
    ("target with DEL", _line(b"GET /a\x7f? HTTP/1.1"), 400),
    ("fragment in query", _line(b"GET /a?b#c HTTP/1.1"), 400),
    ("escape of one digit at the end", _line(b"GET /a%4 HTTP/1.1"), 400),
    ("escape alone", _line(b"GET /% HTTP/1.1"), 400),
    ("escape with sign", _line(b"GET /%-1 HTTP/1.1"), 400),
    ("escape of 16 bits", _line(b"GET /%u0041 HTTP/1.1"), 400),
    ("escaped surrogate", _line(b"GET /%ed%a0%80 HTTP/1.1"), 400),
    ("escaped NUL in query", _line(b"GET /a?b=%00 HTTP/1.1"), 400),
    ("escaped return in path", _line(b"GET /a%0Db HTTP/1.1"), 400),
    ("escaped DEL in path", _line(b"GET /a%7Fb HTTP/1.1"), 400),
    ("version with space inside", _line(b"GET / HTTP/ 1.1"), 400),
    ("version with comma", _line(b"GET / HTTP/1,1"), 400),
    ("version without slash", _line(b"GET / HTTP1.1"), 400),
    ("version with plus", _line(b"GET / HTTP/+1.1"), 400),
    ("version with hexadecimal digit", _line(b"GET / HTTP/1.a"), 400),
    ("version 3", _line(b"GET / HTTP/3.0"), 505),
    ("version 1.9", _line(b"GET / HTTP/1.9"), 505),
    ("version with something behind", _line(b"GET / HTTP/1.1x"), 400),
    ("method empty", _line(b" / HTTP/1.1"), 400),
    ("method with colon", _line(b"GE:T / HTTP/1.1"), 400),
    ("method with control", _line(b"G\x01ET / HTTP/1.1"), 400),
    ("method not ASCII", _line(b"G\xcb\x87ET / HTTP/1.1"), 400),
    ("method of a proxy", _line(b"PROPFIND / HTTP/1.1"), 501),
    ("method M-SEARCH", _line(b"M-SEARCH * HTTP/1.1"), 501),
    ("response instead of request", b"HTTP/1.1 200 OK\r\nHost: a\r\n\r\n", 400),
    ("expectation of more", _get(b"Expect: 100-continue, x"), 417),
    ("expectation empty", _get(b"Expect:"), 417),
    ("SSH instead of HTTP", b"SSH-2.0-OpenSSH_9.2\r\n\r\n", 400),
    ("mail instead of HTTP", b"EHLO a\r\n\r\n", 400),
    *_every_control(),
    *_every_separator(),
    *_every_single(),
]

CHUNKS += [
    ("size empty with extension", b";a=b\r\nhello\r\n0\r\n\r\n", 400),
    ("size with comma", b"5,5\r\nhello\r\n0\r\n\r\n", 400),
    ("size with dot", b"5.0\r\nhello\r\n0\r\n\r\n", 400),
    ("size in quotes", b'"5"\r\nhello\r\n0\r\n\r\n', 400),
    ("size with tab", b"\t5\r\nhello\r\n0\r\n\r\n", 400),
    ("size with suffix", b"5h\r\nhello\r\n0\r\n\r\n", 400),
    ("size in other digits", "\u0665\r\nhello\r\n0\r\n\r\n".encode(), 400),
    ("size beyond 64 bits", b"10000000000000005\r\nhello\r\n0\r\n\r\n", 400),
    ("size of minus zero", b"5\r\nhello\r\n-0\r\n\r\n", 400),
    ("data shorter than size", b"6\r\nhello\r\n0\r\n\r\n", 400),
    ("data ends with bare carriage return", b"5\r\nhello\r0\r\n\r\n\r\n", 400),
    ("data ends with spaces", b"5\r\nhello \r\n0\r\n\r\n", 400),
    ("end with bare line feed", b"5\r\nhello\r\n0\n\n", 400),
    ("extension with DEL", b"5;a=\x7f\r\nhello\r\n0\r\n\r\n", 400),
    ("extension not ASCII", b"5;a=\xff\r\nhello\r\n0\r\n\r\n", 400),
    ("space before extension", b"5 ;a=b\r\nhello\r\n0\r\n\r\n", 400),
    ("trailer with control", b"0\r\nX: \x01\r\n\r\n", 400),
    ("trailer name with space", b"0\r\nX : a\r\n\r\n", 400),
    ("trailer set-cookie", b"0\r\nSet-Cookie: a\r\n\r\n", 400),
    ("trailer content type", b"0\r\nContent-Type: a/b\r\n\r\n", 400),
    ("trailer connection", b"0\r\nConnection: close\r\n\r\n", 400),
    ("trailer expect", b"0\r\nExpect: 100-continue\r\n\r\n", 400),
    ("second request in place of a trailer", b"0\r\nGET / HTTP/1.1\r\n\r\n", 400),
]

REQUESTS = HEADS + [(name, _chunked(body), status) for name, body, status in CHUNKS]
