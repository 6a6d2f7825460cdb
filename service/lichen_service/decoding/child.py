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
"""Descriptors; codecs open none, the messages bring two."""


def main(descriptor: int, memory: int) -> int:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _warm_up()
    _limit(memory)
    with socket.socket(fileno=descriptor) as service:
        service.sendmsg([b"{}"])
        while True:
            packet, descriptors, _, _ = socket.recv_fds(service, messages.LARGEST, 1)
            if not packet:
                return 0
            _answer(service, json.loads(packet), descriptors[0])


def _answer(service: socket.socket, asked: dict[str, object], descriptor: int) -> None:
    try:
        said, memory = _decode(asked, descriptor)
    finally:
        os.close(descriptor)
    try:
        socket.send_fds(service, [messages.dumps(said)], [] if memory is None else [memory])
    finally:
        if memory is not None:
            os.close(memory)


def _decode(asked: dict[str, object], descriptor: int) -> tuple[dict[str, object], int | None]:
    """What is to be said, and the memory of the samples."""
    _allow(float(asked["seconds"]))  # type: ignore[arg-type]
    try:
        with messages.mapped(descriptor) as data, memoryview(data) as view:
            try:
                format = recognise(view)
                with contextlib.closing(_Place()) as place:
                    with _closed(format.modules):
                        header = format.header(view, str(asked.get("select", "")))
                        samples = np.ascontiguousarray(format.samples(view, header, place.allocate))
                    return messages.said_of(samples), place.holds(samples)
            except LichenError as error:
                error.__traceback__ = None  # its frames hold views of what is to be unmapped
                return messages.said_of_error(error), None
    except MemoryError:
        return messages.said_of_error(TooLarge("Decoding the image takes more memory than it may.")), None
    except Exception:
        return messages.said_of_error(UnreadableImage("The image cannot be decoded.")), None


class _Place:
    """Shared memory for the samples: some formats write them there themselves, which spares a copy."""

    def __init__(self) -> None:
        self._array: Array | None = None
        self._descriptor = -1

    def allocate(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
        kind = np.dtype(dtype)
        self._descriptor = messages.room(math.prod(shape) * kind.itemsize, "samples")
        try:
            self._array = np.frombuffer(messages.mapped(self._descriptor), kind).reshape(shape)
        except OSError:
            raise MemoryError from None
        return self._array

    def holds(self, samples: Array) -> int:
        """A descriptor of memory with these samples, which is the caller's to close."""
        if samples is not self._array:
            return messages.shared(memoryview(samples.view(np.uint8).reshape(-1).data), "samples")
        kept, self._descriptor = self._descriptor, -1
        return kept

    def close(self) -> None:
        self._array = None
        if self._descriptor >= 0:
            os.close(self._descriptor)


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
