"""What a connection is doing; `connection.py` draws how it goes from one to the next."""

from __future__ import annotations

from enum import Enum, auto


class Phase(Enum):
    IDLE = auto()
    HEAD = auto()
    BODY = auto()
    WORK = auto()
    WRITE = auto()
    DISCARD = auto()
    LINGER = auto()
    CLOSED = auto()
