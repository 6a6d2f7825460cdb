"""What a connection is doing; `connection.py` draws how it goes from one to the next."""

from __future__ import annotations

from enum import Enum, auto


class Phase(Enum):
    __hash__ = object.__hash__  # each is there once; hashing its name is a call of Python at every step

    IDLE = auto()
    HEAD = auto()
    BODY = auto()
    WORK = auto()
    WRITE = auto()
    DISCARD = auto()
    LINGER = auto()
    CLOSED = auto()
