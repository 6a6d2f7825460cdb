"""A decoder: takes encoded images off its socket, one after the other, and gives pixels back.

    python -m lichen_service.decoding.child SOCKET MEMORY

The service has read and checked the header before; the decoder reads it again, and the service compares.

It may use MEMORY bytes beyond what it has when it begins, and processor time as each message says; it opens no file
and starts no process. Files of data may name others that hold their numbers: while one is read, none can be opened.
It ends when its socket does, when a limit ends it, or when a codec does.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import math
import os
import resource
import signal
import socket
import sys
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lichen.errors import LichenError, TooLarge, UnreadableImage
from lichen.files import FORMATS, decode, encode, recognise
from lichen.image import Image
from lichen.memory import Array
from lichen_service.decoding import messages

FILES = 64
"""Descriptors; codecs open none, a message brings one."""


def main(descriptor: int, memory: int) -> int:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _warm_up()
    _limit(memory)
    place = _Place()
    with socket.socket(fileno=descriptor) as service:
        service.sendmsg([b"{}"])
        while True:
            packet, descriptors, _, _ = socket.recv_fds(service, messages.LARGEST, 1)
            if not packet:
                return 0
            place.room.clear()
            _answer(service, json.loads(packet), descriptors[0], place)


def _answer(service: socket.socket, asked: dict[str, object], descriptor: int, place: _Place) -> None:
    try:
        said = _decode(asked, descriptor, place)
    finally:
        os.close(descriptor)
    socket.send_fds(service, [messages.dumps(said)], [] if "error" in said else [place.room.descriptor])


def _decode(asked: dict[str, object], descriptor: int, place: _Place) -> dict[str, object]:
    """What is to be said; the samples are in their place then."""
    _allow(float(asked["seconds"]))  # type: ignore[arg-type]
    try:
        with messages.mapped(descriptor, int(asked["count"])) as data, memoryview(data) as view:  # type: ignore[call-overload]
            try:
                format = recognise(view)
                if not format.places:
                    place.window.close()  # its pages count as memory that a decoder uses
                with _closed(format.modules):
                    header = format.header(view, str(asked.get("select", "")))
                    samples = np.ascontiguousarray(format.samples(view, header, place.allocate))
                place.take(samples)
                return messages.said_of(samples)
            except LichenError as error:
                error.__traceback__ = None  # its frames hold views of what is to be unmapped
                return messages.said_of_error(error)
    except MemoryError:
        return messages.said_of_error(TooLarge("Decoding the image takes more memory than it may."))
    except Exception:
        return messages.said_of_error(UnreadableImage("The image cannot be decoded."))
    finally:
        place.leave()


class _Place:
    """Where samples go; some formats write them there themselves, which spares a copy."""

    def __init__(self) -> None:
        self.room = messages.Room("samples")
        self._array: Array | None = None
        self.window = messages.Window()

    def allocate(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
        kind = np.dtype(dtype)
        count = math.prod(shape) * kind.itemsize
        self.room.make(count)
        try:
            self._array = np.frombuffer(self.window.mapped(self.room.descriptor, count), kind).reshape(shape)
        except OSError:
            raise MemoryError from None
        return self._array

    def take(self, samples: Array) -> None:
        if samples is not self._array:
            self.room.write(memoryview(samples.view(np.uint8).reshape(-1).data))

    def leave(self) -> None:
        self._array = None


@contextlib.contextmanager
def _closed(modules: tuple[str, ...]) -> Iterator[None]:
    """Where a library with these modules reads the bytes: nothing can be opened meanwhile but what is open."""
    if not modules:
        yield
        return
    for each in modules:
        with contextlib.suppress(ImportError):
            importlib.import_module(each)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def _warm_up() -> None:
    """Loads every codec, so that no library has to be found once memory is short."""
    tiny = np.full((2, 2, 3), 0.5, np.float32)
    for each in FORMATS.values():
        storage = each.storage_for(each.storages[0])
        image = Image(tiny, each.natural_space(storage), storage=storage)
        decode(encode(image, each.name).data)


def _limit(memory: int) -> None:
    with open("/proc/self/statm") as file:
        has = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (has + memory, has + memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_NOFILE, (FILES, FILES))


def _allow(seconds: float) -> None:
    """Processor time from now on; beyond it the kernel ends the process."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    used = usage.ru_utime + usage.ru_stime
    resource.setrlimit(resource.RLIMIT_CPU, (int(used + seconds) + 1, resource.RLIM_INFINITY))


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
