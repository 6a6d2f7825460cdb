"""Calls that keep the interpreter: what they do, and that their errors are those of the usual ones."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from lichen_service.http import brisk
from lichen_service.http.brisk import Scratch, send


@pytest.fixture(params=["of the C library", "of sockets"])
def pair(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[socket.socket, socket.socket]]:
    if request.param == "of sockets":
        monkeypatch.setattr(brisk, "_send", None)
        monkeypatch.setattr(brisk, "_receive", None)
    else:
        assert brisk._send is not None
    one, other = socket.socketpair()
    with one, other:
        one.setblocking(False)
        other.setblocking(False)
        yield one, other


def test_what_is_sent_is_received(pair: tuple[socket.socket, socket.socket]) -> None:
    one, other = pair
    scratch = Scratch(8)
    with pytest.raises(BlockingIOError):
        scratch.receive(other)
    assert send(one, b"hello\0 world") == 12
    assert (scratch.receive(other), bytes(scratch.view)) == (8, b"hello\0 w")
    assert (scratch.receive(other), bytes(scratch.view[:4])) == (4, b"orld")
    one.close()
    assert scratch.receive(other) == 0


def fill(sock: socket.socket) -> None:
    while True:
        assert 0 < send(sock, bytes(1 << 16)) <= 1 << 16


def test_a_full_socket_does_not_block_and_a_closed_one_is_told(pair: tuple[socket.socket, socket.socket]) -> None:
    one, other = pair
    with pytest.raises(BlockingIOError):
        fill(one)
    other.close()
    with pytest.raises((BrokenPipeError, ConnectionResetError)):
        fill(one)
