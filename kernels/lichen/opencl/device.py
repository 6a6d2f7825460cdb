"""The OpenCL device: chosen once, tried before it is trusted.

`LICHEN_DEVICE` chooses: unset or `opencl` takes the first CPU device (what the kernels are tuned for), then any other;
`numpy` takes none; anything else is part of a device's name. A device counts only after a kernel was built and run on
it and gave the right numbers, since a runtime that lists a device may still fail every build. Whatever is wrong ends as
a sentence in `Status.reason`, logged once, and NumPy serves.

PoCL's threads do not survive `fork`: a child gets no device, and says why. Start workers by `spawn`.
"""

from __future__ import annotations

import logging
import os
import re
import shutil
import threading
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lichen.errors import DeviceFailure
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl import cache
from lichen.opencl.programs import Definitions, Programs
from lichen.opencl.session import Held, Session, wrapped
from lichen.processors import threads, vector_width

if TYPE_CHECKING:
    import pyopencl as cl

_log = logging.getLogger("lichen")
POCL = "Portable Computing Language"
LANES = 32
"""of a graphics processor: a warp of NVIDIA's, half a wavefront of AMD's at most"""
_FORKED = "this process was forked from one that had started the OpenCL runtime, which does not survive it; use spawn"


@dataclass(frozen=True, slots=True)
class Status:
    """What became of the search for a device."""

    wanted: str
    """what `LICHEN_DEVICE` asks for"""
    name: str | None = None
    """the device in use, or None"""
    runtime: str | None = None
    reason: str | None = None
    """why there is no device, in one sentence"""
    found: tuple[str, ...] = ()
    """every device the runtimes list"""
    cache: Path | None = None
    """where compiled kernels are kept"""
    compute_units: int = 0
    vector_width: int = 0


@dataclass(frozen=True, eq=False)
class Device:
    """A device that works. Safe to use from any thread of the process that opened it."""

    opencl: cl.Device
    context: cl.Context
    name: str
    runtime: str
    compute_units: int
    vector_width: int
    """float32 values the device likes to work on at once"""
    has_fp64: bool
    is_cpu: bool
    shares_memory: bool
    """whether it works in the host's memory, in place"""
    in_place: bool
    """whether it reads and writes the host's memory itself, so that nothing has to be mapped to be seen"""
    lanes: int
    """work-items that step together: one on a processor, whose lanes a kernel's vectors fill"""
    programs: Programs
    process: int = field(default_factory=os.getpid)

    @classmethod
    def open(cls, opencl: cl.Device) -> Device:
        """The device with its context, untried."""
        import pyopencl as cl

        context = cl.Context([opencl])
        is_cpu = bool(opencl.type & cl.device_type.CPU)
        return cls(
            opencl=opencl,
            context=context,
            name=str(opencl.name).strip(),
            runtime=f"{opencl.platform.name} {opencl.platform.version}".strip(),
            compute_units=int(opencl.max_compute_units),
            vector_width=max(int(opencl.native_vector_width_float), vector_width() if is_cpu else 1),
            has_fp64="cl_khr_fp64" in str(opencl.extensions).split(),
            is_cpu=is_cpu,
            shares_memory=is_cpu or bool(opencl.host_unified_memory),
            in_place=is_cpu and POCL in str(opencl.platform.name),
            lanes=1 if is_cpu else LANES,
            programs=Programs(context, opencl),
        )

    @property
    def in_step(self) -> bool:
        """Whether work-items step together, thousands at once: there each does and keeps as little as it can."""
        return self.lanes > 1

    def session(self) -> Session:
        """A session on this device. Raises `DeviceFailure` in a forked child."""
        if os.getpid() != self.process:
            raise DeviceFailure(f"{self.name} cannot be used: {_FORKED}.")
        return Session(self)

    def constant(self, values: Array, dtype: npt.DTypeLike = np.float32) -> Held:
        """Values that kernels of any session read and nobody writes, for what many runs read alike: a session
        makes a buffer of every array anew. Keep it as long as a session uses it."""
        held = aligned(values, dtype)
        return wrapped(self, held, held.ctypes.data, needed=True)

    def build(self, source: str, defines: Definitions | None = None) -> None:
        """Build a program ahead of its first launch. Raises `DeviceFailure` with the build log.

        PoCL compiles the rest when a kernel first runs with a work-group size, and keeps it on disk: to warm a kernel
        up wholly, run it once on something small.
        """
        self.programs.build(source, defines or {})


def ends_processes(runtime: str) -> str | None:
    """Why a runtime for processors would end the process while it compiles, as PoCL does where it is at a loss; None
    where it would not.

    Of LLVM 18, PoCL 6 asks for a check that many kernels fail: "Instruction Combining did not reach a fixpoint".
    """
    if POCL not in runtime:
        return None
    if shutil.which("ld") is None:
        return "there is no linker (ld) on PATH, without which PoCL ends the process"
    if re.search(r"PoCL 6\.\d.*LLVM 18\.", runtime):
        return "PoCL 6 with LLVM 18 ends the process while it compiles; PoCL 3.1 and 5 do not"
    return None


def probe(device: Device) -> str | None:
    """Build and run a kernel; what is wrong with the device, or None."""
    wrong = ends_processes(device.runtime) if device.is_cpu else None
    if wrong is not None:
        return wrong
    vectors = 100  # not a whole number of work-groups
    given = aligned_empty((vectors, 16))
    given[...] = np.arange(vectors * 16, dtype=np.float32).reshape(vectors, 16) / 16
    found = aligned_empty((vectors, 16))
    found[...] = np.nan
    try:
        with device.session() as session:
            session.launch("probe.cl", "probe", (vectors,), given, session.write(found), np.int32(vectors))
    except DeviceFailure as failure:
        return str(failure)
    # Multiples of 1/16 below 100 have squares of at most 22 bits, so every step is exact.
    if not np.array_equal(found, given * given + 1 + np.arange(vectors, dtype=np.float32)[:, np.newaxis]):
        return "a trial kernel gave wrong numbers"
    return None


# ------------------------------------------------------------------------------------------------------- the choice


@dataclass(frozen=True, slots=True)
class _Choice:
    device: Device | None
    status: Status
    process: int


_choice: _Choice | None = None
_lock = threading.Lock()


def default_device() -> Device | None:
    """The device to run kernels on, or None where NumPy must serve; `status().reason` says why. Chosen once."""
    return _chosen().device


def status() -> Status:
    """What became of the search for a device. Searches, if nobody has yet."""
    return _chosen().status


def _chosen() -> _Choice:
    global _choice
    choice = _choice
    if choice is not None:
        if choice.process == os.getpid() or choice.device is None:
            return choice
        # No lock is taken here: a thread of the parent may have held it.
        _choice = choice = _Choice(None, _refused(choice.status.wanted, f"{_FORKED}"), os.getpid())
        return choice
    with _lock:
        if _choice is None:
            device, found = _search(os.environ.get("LICHEN_DEVICE", "").strip() or "opencl")
            _choice = _Choice(device, found, os.getpid())
        return _choice


def _refused(wanted: str, reason: str, found: tuple[str, ...] = (), folder: Path | None = None) -> Status:
    _log.log(logging.INFO if wanted == "numpy" else logging.WARNING, "NumPy serves, without OpenCL: %s", reason)
    return Status(wanted, reason=reason, found=found, cache=folder)


def _search(wanted: str) -> tuple[Device | None, Status]:
    """Try the devices that fit `wanted`, best first."""
    if wanted.lower() == "numpy":
        return None, _refused("numpy", "LICHEN_DEVICE=numpy asks for it")
    try:
        folder = _start_environment()
    except cache.NoCache as error:
        return None, _refused(wanted, f"compiled kernels cannot be kept anywhere: {error}")
    try:
        devices = _listed()
    except Exception as error:  # whatever a broken installation raises, the service must start
        return None, _refused(wanted, f"no OpenCL runtime can be used ({error})", folder=folder)
    found = tuple(str(device.name).strip() for device in devices)
    if not devices:
        return None, _refused(wanted, "the OpenCL runtime lists no device", folder=folder)
    if wanted.lower() != "opencl":
        devices = [device for device in devices if wanted.lower() in str(device.name).lower()]
        if not devices:
            return None, _refused(wanted, f"no device is called {wanted} (found: {', '.join(found)})", found, folder)
    failures = []
    for candidate in devices:
        try:
            device = Device.open(candidate)
            wrong = probe(device)
        except Exception as error:  # as above
            wrong = str(error)
        if wrong is None:
            return device, _working(wanted, device, found, folder)
        failures.append(f"{str(candidate.name).strip()}: {wrong}")
    return None, _refused(wanted, f"no device passed its trial ({'; '.join(failures)})", found, folder)


def _working(wanted: str, device: Device, found: tuple[str, ...], folder: Path) -> Status:
    _log.info("OpenCL runs on %s (%s), %d compute units", device.name, device.runtime, device.compute_units)
    return Status(wanted, device.name, device.runtime, None, found, folder, device.compute_units, device.vector_width)


def _start_environment() -> Path:
    """What must be set before the runtime starts: the cache folder and the number of threads."""
    folder = cache.prepare()
    os.environ["POCL_CACHE_DIR"] = str(folder)
    for name in ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT"):  # PoCL up to 4, and later
        os.environ.setdefault(name, str(threads()))
    os.environ.setdefault("PYOPENCL_NO_CACHE", "1")  # the runtime keeps its own
    return folder


def _listed() -> list[cl.Device]:
    """Every device of every runtime, CPUs first."""
    import pyopencl as cl

    warnings.filterwarnings("ignore", category=cl.CompilerWarning)  # build logs are ours to report
    devices = []
    for platform in cl.get_platforms():
        try:
            devices += platform.get_devices()
        except cl.Error as error:
            _log.debug("%s lists no device: %s", platform.name, error)
    return sorted(devices, key=lambda device: not device.type & cl.device_type.CPU)
