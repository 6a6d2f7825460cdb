"""A session: kernels launched in order on host arrays, and everything they use kept alive until they are done.

Theory. A CPU device reads host memory in place, so an aligned array becomes a buffer without a copy; a GPU keeps its
own copy and brings it back when the buffer is mapped. PoCL works on the host's memory itself, so nothing is mapped
there: of the 0.2 ms that the smallest run takes on two busy processors, mapping and unmapping was half. Launches only
enqueue; the work is waited for once, when the session ends. Kernel arguments do not keep a buffer alive and a buffer
dropped while in use ends the process, so the session holds every buffer and every array, and lets go only after the
queue is empty, whatever was raised meanwhile.

Rules:

* A session belongs to the thread that opened it; sessions of several threads run side by side.
* Between entering and leaving, the host neither writes an array it has handed over nor reads one that is written.
* One array is one buffer. Arrays that overlap without being the same may be read, never written.
* An array that is not aligned or not C-ordered is copied, and copied back if it is written: correct, but slower.
* Work-group sizes are few and fixed, since PoCL compiles a kernel again for each new one. Grids are padded up to them,
  so every kernel checks its bounds. On a GPU, whose work-items step together, a group is at least as many (`widened`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType, TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
import numpy.typing as npt

from lichen.errors import DeviceFailure
from lichen.memory import ALIGNMENT, Array, aligned_empty
from lichen.opencl.programs import Definitions
from lichen.opencl.watching import watch

if TYPE_CHECKING:
    import pyopencl as cl

    from lichen.opencl.device import Device

LOCAL: Mapping[int, tuple[int, ...]] = MappingProxyType({1: (64,), 2: (64, 1), 3: (64, 1, 1)})
"""Work-group size by number of dimensions, where the caller names none."""
RUN = 64
"""Steps of a work-item of `Session.sweep` on a CPU."""
NUMBER = "_set_arg_buf"
"""What sets an argument that is a number. `set_arg` does, too, but tries it as everything else first: 9 us for each, of
which a kernel may take ten, instead of 0.1."""
_abandoned: list[object] = []
"""What a failed device may still be using; dropping it could end the process."""
_NO_DEFINES: Definitions = MappingProxyType({})


def widened(group: tuple[int, ...], lanes: int) -> tuple[int, ...]:
    """The work-group with as many more items along its first axis as `lanes`, which step together, need.

    >>> widened((1, 16), 32), widened((64, 1), 32), widened((1, 1), 1)
    ((2, 16), (64, 1), (1, 1))
    """
    return (group[0] * max(1, lanes // math.prod(group)), *group[1:])


@dataclass(eq=False, slots=True)
class Held:
    """An array inside a session: the memory the device uses, its buffer, and whether the device writes it."""

    array: Array
    memory: Array
    buffer: cl.Buffer
    first: int
    end: int
    written: bool = False
    fetched: bool = True
    """whether the host sees what the device writes"""

    @property
    def copied(self) -> bool:
        return self.memory is not self.array


Argument: TypeAlias = "Held | Array | np.generic | None"
"""What a kernel takes: an array (read), a held array, a NumPy scalar by value, or None for a null pointer."""


def wrapped(device: Device, array: Array, first: int, *, needed: bool, between: bool = False) -> Held:
    """An array whose first byte is `first`, as a buffer; `between` are values that only the device sees."""
    import pyopencl as cl

    if array.size == 0:
        raise ValueError(f"an array of shape {array.shape} holds nothing that a kernel could use")
    memory, flags = array, array.flags
    contiguous = flags.c_contiguous
    if not contiguous or first % ALIGNMENT:
        memory = aligned_empty(array.shape, array.dtype)
        flags = memory.flags
        if needed:
            memory[...] = array
    access = cl.mem_flags.READ_WRITE if flags.writeable else cl.mem_flags.READ_ONLY
    try:
        if between and not device.shares_memory:
            buffer = cl.Buffer(device.context, access, size=memory.nbytes)
        else:
            buffer = cl.Buffer(device.context, access | cl.mem_flags.USE_HOST_PTR, hostbuf=memory)
    except cl.Error as error:
        raise DeviceFailure(f"{device.name} cannot use an array of {array.nbytes} bytes: {error}") from error
    low, high = (first, first + array.nbytes) if contiguous else np.lib.array_utils.byte_bounds(array)
    return Held(array, memory, buffer, low, high, fetched=not between)


class Session:
    """Use as a context manager; get one from `Device.session()`."""

    def __init__(self, device: Device) -> None:
        import pyopencl as cl

        self._device = device
        self._queue = cl.CommandQueue(device.context, device.opencl)
        self._held: dict[tuple[int, int, tuple[int, ...]], Held] = {}
        self._between: list[Array] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None:
                self.finish()
        finally:
            self._release()

    @property
    def in_step(self) -> bool:
        """Whether work-items step together (`Device.in_step`)."""
        return self._device.in_step

    # ------------------------------------------------------------------------------------------------ arrays

    def read(self, array: Array) -> Held:
        """The array as something kernels read."""
        return self._hold(array, needed=True)

    def write(self, array: Array) -> Held:
        """The array as something kernels write; what they leave unwritten is undefined."""
        return self._writable(array, needed=False)

    def readwrite(self, array: Array) -> Held:
        """The array as something kernels both read and write, or write in parts."""
        return self._writable(array, needed=True)

    def scratch(self, shape: tuple[int, ...], dtype: npt.DTypeLike = np.float32) -> Array:
        """An uninitialised aligned array for values between launches; pass it by `write`, then by `read`.

        It belongs to the device: what the host finds in it after the session is undefined.
        """
        between = aligned_empty(shape, dtype)
        self._between.append(between)
        return between

    # ---------------------------------------------------------------------------------------------- launches

    def launch(
        self,
        source: str,
        kernel: str,
        grid: tuple[int, ...],
        /,
        *arguments: Argument,
        local: tuple[int, ...] | None = None,
        defines: Definitions = _NO_DEFINES,
    ) -> None:
        """Enqueue `kernel` of `source` over `grid` work-items, padded up to whole work-groups.

        `local` is the work-group size (None: `LOCAL`); name (1,) or (1, 1) where one item does a lot of work,
        such as a whole segment of a row. Kernels must give the same with any. Where the work is watched
        (`lichen.opencl.watching`) it is carried out in parts before this returns, and ends with what the watch raises.
        Raises `DeviceFailure` naming source and kernel, with the build log where there is one.
        """
        import pyopencl as cl

        group = widened(local or LOCAL[len(grid)], self._device.lanes)
        padded = tuple(-(-size // step) * step for size, step in zip(grid, group, strict=True))
        if 0 in padded:
            return
        built, takes = self._device.programs.kernel(source, kernel, defines)
        if len(arguments) != takes:
            raise TypeError(f"{source}, {kernel}: takes {takes} arguments, got {len(arguments)}")
        number = getattr(built, NUMBER, built.set_arg)
        try:
            for at, argument in enumerate(arguments):
                if isinstance(argument, np.generic):
                    number(at, argument)
                else:
                    built.set_arg(at, self._buffer(argument, source, kernel, at))
        except cl.Error as error:
            given = type(argument).__name__
            raise DeviceFailure(f"Kernel {kernel} of {source} refuses argument {at} ({given}): {error}") from error
        try:
            if (watching := watch()) is None:
                cl.enqueue_nd_range_kernel(self._queue, built, padded, group)
            else:
                watching.run(f"{source}/{kernel}", padded, group, partial(self._carry_out, built, group))
        except cl.Error as error:
            raise DeviceFailure(f"Kernel {kernel} of {source} could not be launched: {error}") from error

    def sweep(
        self, source: str, kernel: str, steps: int, /, *arguments: Argument, defines: Definitions = _NO_DEFINES
    ) -> None:
        """Enqueue a kernel whose work-items take RUN of so many like steps each, one after the other.

        One step for each on most devices. On a CPU the work-items of a group are a loop around the kernel, in which
        every private array that stays in memory has as many copies: there each item is a group, and takes many steps.
        """
        run = RUN if self._device.is_cpu else 1
        self.launch(
            source, kernel, (-(-steps // run),), *arguments,
            local=(1,) if self._device.is_cpu else None, defines={**defines, "RUN": run},
        )  # fmt: skip

    def finish(self) -> None:
        """Wait for everything launched so far; the host may then read what was written. Other threads run meanwhile."""
        import pyopencl as cl

        outputs = [held for held in self._held.values() if held.written and held.fetched]
        try:
            mapped = [self._map(held) for held in outputs if not self._device.in_place]
            self._queue.finish()
            for view in mapped:
                view.release(self._queue)
            if mapped:
                self._queue.finish()
        except cl.Error as error:
            raise DeviceFailure(f"{self._device.name} failed while it ran kernels: {error}") from error
        for held in outputs:
            if held.copied:
                held.array[...] = held.memory

    # --------------------------------------------------------------------------------------------- machinery

    def _carry_out(
        self, built: cl.Kernel, group: tuple[int, ...], size: tuple[int, ...], offset: tuple[int, ...] | None
    ) -> None:
        """Run a part of a grid to its end."""
        import pyopencl as cl

        cl.enqueue_nd_range_kernel(self._queue, built, size, group, offset)
        self._queue.finish()

    def _map(self, held: Held) -> cl.MemoryMap:
        """Begin to bring what the device wrote to the host; where both share memory this moves nothing."""
        import pyopencl as cl

        shape, kind = held.memory.shape, held.memory.dtype
        view: Any
        view, _ = cl.enqueue_map_buffer(self._queue, held.buffer, cl.map_flags.READ, 0, shape, kind, is_blocking=False)
        mapped: cl.MemoryMap = view.base
        return mapped

    def _buffer(self, argument: Held | Array | None, source: str, kernel: str, at: int) -> cl.Buffer | None:
        if argument is None:
            return None
        if isinstance(argument, Held):
            return argument.buffer
        if isinstance(argument, np.ndarray):
            return self._hold(argument, needed=True).buffer
        kind = type(argument).__name__
        raise TypeError(f"{source}, {kernel}, argument {at}: {kind} has no fixed width; use a NumPy scalar or array")

    def _writable(self, array: Array, *, needed: bool) -> Held:
        if not array.flags.writeable:
            raise ValueError("a read-only array cannot be written by a kernel")
        held = self._hold(array, needed=needed)
        self._refuse_overlap(held, written=True)
        held.written = True
        return held

    def _hold(self, array: Array, *, needed: bool) -> Held:
        """The array's one buffer in this session; `needed` says whether its present contents matter."""
        first = array.ctypes.data
        key = (first, array.nbytes, array.strides)
        held = self._held.get(key)
        if held is None:
            held = self._wrap(array, first, needed)
            self._refuse_overlap(held, written=False)
            self._held[key] = held
        return held

    def _wrap(self, array: Array, first: int, needed: bool) -> Held:
        between = bool(self._between) and any(array is each for each in self._between)
        return wrapped(self._device, array, first, needed=needed, between=between)

    def _refuse_overlap(self, held: Held, *, written: bool) -> None:
        for other in self._held.values():
            apart = other is held or other.end <= held.first or held.end <= other.first
            if not apart and (other.written or written):
                raise ValueError("two arrays of one session overlap and one of them is written")

    def _release(self) -> None:
        """Let go of every buffer, once nothing uses them. A device that cannot say so keeps them for good."""
        import pyopencl as cl

        try:
            self._queue.finish()
        except cl.Error:
            _abandoned.extend(self._held.values())
        else:
            for held in self._held.values():
                held.buffer.release()
        self._held.clear()
