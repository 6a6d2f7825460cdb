"""A few decoders that stand ready, each used by one request at a time.

Whatever happens to a decoder costs the request that it happened to, and nothing else: its socket ends, the request is
answered that its image cannot be decoded, and a new decoder starts beside the others. One that was killed from outside
(`kill -9`, the system's own killer) costs not even that: another tries, once. A decoder that takes too long is killed.
After `USES` images each is replaced, so that what a codec leaks stays bounded.

NPY is decoded here: our own reader parses its header, and the rest is a copy of checked length. Files of data are
turned into NPY by a decoder before anything else: only the libraries that read them know how large their pictures are.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from lichen.coding import assembled, decode
from lichen.errors import UnreadableImage, UnsupportedFormat
from lichen.files import Data, Limits, encode, recognise
from lichen.image import Image, Space
from lichen.memory import Array, aligned_empty
from lichen_service.decoding import messages, processes
from lichen_service.logs import log
from lichen_service.refusals import RETRY_AFTER, Refusal

Made = TypeVar("Made")

USES = 2000
STARTING = 60.0
"""Seconds that a decoder may take until it stands ready."""
HERE = frozenset(("npy",))
"""Formats that are decoded in this process."""

UNABLE = "The image cannot be decoded: what decodes it failed, or took too long."


def _own(samples: Array) -> Array:
    """A copy that no decoder writes to; halves are never kept as they are."""
    if samples.dtype == np.float16:
        return samples
    own = aligned_empty(samples.shape, samples.dtype)
    own[...] = samples
    return own


class Died(Exception):
    """The decoder ended, or was ended, before it answered."""


class Killed(Exception):
    """The decoder was killed by somebody else, which need not be the fault of its image."""


@dataclass(eq=False)
class Decoder:
    process: subprocess.Popen[bytes]
    socket: socket.socket
    uses: int = 0
    given: messages.Room = field(default_factory=lambda: messages.Room("image"))
    taken: messages.Window = field(default_factory=messages.Window)

    def ask(self, data: Data, asked: Mapping[str, Any], seconds: float) -> Array:
        """The samples, whose memory is the decoder's: they are gone when it is asked again. Raises `Died`, or what the
        decoder found wrong."""
        self.uses += 1
        try:
            self.given.write(memoryview(data).cast("B"))
            self.socket.settimeout(max(seconds, 0.001))
            message = messages.dumps({**asked, "count": memoryview(data).nbytes})
            socket.send_fds(self.socket, [message], [self.given.descriptor])
            packet, descriptors, _, _ = socket.recv_fds(self.socket, messages.LARGEST, 1)
            self.given.clear()
        except OSError as failure:
            raise Died(str(failure)) from None
        try:
            if not packet:
                raise Died("its end of the socket closed")
            said = json.loads(packet)
            if "error" in said:
                raise messages.error_of(said)
            return messages.samples_of(said, descriptors[0], self.taken)
        finally:
            for each in descriptors:
                os.close(each)

    def status(self) -> int | None:
        """How its process ended, if it does; None for one that goes on."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.process.wait(0.2)
        return None

    def end(self) -> None:
        self.socket.close()
        self.process.kill()
        self.process.wait()


class Decoders:
    """The pool; with `count` 0 everything is decoded in this process."""

    def __init__(
        self,
        count: int,
        memory: int,
        seconds: float,
        *,
        module: str = processes.MODULE,
        begun: Sequence[processes.Begun] = (),
    ) -> None:
        """`begun` holds processes that are decoders of the pool, as soon as they stand."""
        self._count = count
        self._memory = memory
        self._seconds = seconds
        self._module = module
        self._ready: queue.SimpleQueue[Decoder] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._all: set[Decoder] = set()
        self._starting = 0
        self._begun = list(begun)
        self._awaited = 0
        """of those begun: how many do not stand yet; no others are started meanwhile"""
        self._ended = False
        self.died = 0
        """decoders that ended before they had answered"""
        self.on_death: Callable[[], None] = lambda: None

    def start(self) -> None:
        """Lets the pool fill in the background, behind what was begun already, if anything was."""
        with self._lock:
            missing = 0 if self._ended else self._count - len(self._all) - self._starting
            begun: list[processes.Begun | None] = [self._begun.pop() for _ in range(min(missing, len(self._begun)))]
            if not begun and self._awaited:
                return
            missing = len(begun) or missing
            self._awaited += len(begun)
            self._starting += missing
        for each in begun or [None] * missing:
            threading.Thread(target=self._start, args=[each], name="decoder", daemon=True).start()

    def decode(self, data: Data, *, limits: Limits, media_type: str | None = None) -> Image:
        """As `lichen.files.decode`. A decoder that dies of the image makes it an `UnreadableImage`; the 503 refusal
        says that none stood ready in time."""
        format = recognise(data, media_type=media_type)
        if not self._count or format.name in HERE:
            return decode(data, limits=limits, media_type=media_type)
        header = format.read_header(memoryview(data).cast("B"))
        header.check(limits)
        return self._made(data, "", lambda samples: assembled(header, _own(samples)))

    def plain(self, data: Data, *, media_type: str | None = None, select: str = "") -> Data:
        """The bytes, or what the selection says of a file of data, as NPY. Raises as `decode`, and `InvalidRequest`
        for what the file does not have."""
        format = recognise(data, media_type=media_type)
        if not format.selects:
            return data
        if not self._count:
            raise UnsupportedFormat(
                "Files of data may name other files, so only decoders read them, and none runs here."
            )
        return self._made(data, select, lambda samples: encode(Image(samples, Space.DATA), "npy").data)

    def _made(self, data: Data, select: str, make: Callable[[Array], Made]) -> Made:
        """What is made of the samples of a decoder, or of another where somebody killed it."""
        deadline = time.monotonic() + self._seconds
        try:
            return self._ask(data, select, deadline, make)
        except Killed:  # by somebody else, most likely, so the image has another chance
            try:
                return self._ask(data, select, deadline, make)
            except Killed:
                raise UnreadableImage(UNABLE) from None

    def _ask(self, data: Data, select: str, deadline: float, make: Callable[[Array], Made]) -> Made:
        """From one decoder, which nobody else has meanwhile. Raises `Killed`, or what is wrong with the image."""
        decoder = self._take(deadline)
        whole = False
        try:
            asked = {"seconds": self._seconds, "select": select}
            made = make(decoder.ask(data, asked, deadline - time.monotonic()))
            whole = True
        except Died as died:
            self.died += 1
            self.on_death()
            status = decoder.status()
            log.error("a decoder ended on an image", reason=str(died), status=status)
            if status == -signal.SIGKILL:
                raise Killed from None
            raise UnreadableImage(UNABLE) from None
        except Exception:
            whole = True
            raise
        finally:
            self._give_back(decoder, whole)
        return made

    def end(self) -> None:
        """Ends all decoders."""
        with self._lock:
            self._ended = True
            decoders, self._all = self._all, set()
        for each in decoders:
            each.end()

    @property
    def standing(self) -> int:
        return len(self._all)

    def _take(self, deadline: float) -> Decoder:
        while True:
            self.start()
            try:
                decoder = self._ready.get(timeout=max(0.0, min(deadline - time.monotonic(), STARTING)))
            except queue.Empty:
                raise Refusal(
                    503,
                    "overloaded",
                    "The service is busy",
                    "No decoder became free in time.",
                    headers={"Retry-After": RETRY_AFTER},
                    retryable=True,
                ) from None
            if decoder.process.poll() is None:
                return decoder
            self._drop(decoder)  # it was killed while it stood idle

    def _give_back(self, decoder: Decoder, whole: bool) -> None:
        if whole and decoder.uses < USES and not self._ended:
            self._ready.put(decoder)
            return
        self._drop(decoder)
        self.start()

    def _drop(self, decoder: Decoder) -> None:
        with self._lock:
            self._all.discard(decoder)
        decoder.end()

    def _start(self, begun: processes.Begun | None) -> None:
        decoder = None
        try:
            decoder = Decoder(*(begun or processes.begin(self._memory, self._module)))
            decoder.socket.settimeout(STARTING)
            if not decoder.socket.recv(messages.LARGEST):
                raise Died("it did not begin")
        except (OSError, Died) as failure:
            log.error("a decoder could not be started", reason=str(failure))
            if decoder is not None:
                decoder.end()
            decoder = None
            time.sleep(1.0)
        with self._lock:
            self._starting -= 1
            self._awaited -= begun is not None
            if decoder is not None and not self._ended:
                self._all.add(decoder)
        if decoder is not None:
            if self._ended:
                decoder.end()
            else:
                self._ready.put(decoder)
        if begun is not None:
            self.start()
