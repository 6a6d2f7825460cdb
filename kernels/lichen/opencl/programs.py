"""Kernel sources, and the programs and kernels built from them.

Rules:

* A source is found by its path relative to `operations/`, then to this folder. `#include "x.clh"` is resolved here,
  so the text that is built is the text that is hashed: a changed header is a changed program. A header that says
  `#pragma once` comes once; one that does not is a template, and comes each time with other definitions around it.
* Every program is OpenCL C 1.2 and starts with `FP_CONTRACT OFF`. PoCL contracts `a * b + c` on its own otherwise, and
  what it contracts may depend on how a kernel was vectorised; kernels that want a fused step write `fma`.
  No relaxed mathematics: NaN and infinity mean what they say.
* A program is built once per (source text, definitions) and shared. A kernel object carries its arguments, so every
  thread has its own. Definitions may be a caller's arithmetic, so programs and kernels that have not been used for the
  longest are dropped when there are more than `KEPT`.
"""

from __future__ import annotations

import hashlib
import logging
import re
import threading
import warnings
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lichen.errors import DeviceFailure
from lichen.opencl.cache import restore

if TYPE_CHECKING:
    import pyopencl as cl

_HERE = Path(__file__).resolve().parent
ROOTS = (_HERE.parent / "operations", _HERE)
"""Where sources are looked for, in this order."""
INCLUDE = _HERE / "include"
OPTIONS = ("-cl-std=CL1.2",)
QUICK = (*OPTIONS, "-D_OPENCL_H_", "-w")
"""Without PoCL's header of the whole language, which takes a third of a second to read, and without the count of its
warnings on the standard error; other runtimes have neither."""
ROUNDED = ("-cl-fp32-correctly-rounded-divide-sqrt",)
"""What graphics processors must be asked for; PoCL's processors divide and take roots no other way."""
LANGUAGE = INCLUDE / "language.clh"
"""Declares the functions that kernels call, where that header is left out."""

Definitions = Mapping[str, int | float | str]
"""Preprocessor names and values; a float becomes an exact float32 literal, text is taken as it is."""

_INCLUDE_LINE = re.compile(r'^[ \t]*#[ \t]*include[ \t]+"([^"]+)"[ \t]*$')
_ONCE = re.compile(r"^[ \t]*#[ \t]*pragma[ \t]+once[ \t]*$")
KEPT = 1024
"""Programs of a device, and kernels of a thread."""
_DEPTH = 8
"""Includes within includes; more is a header that includes itself."""
_log = logging.getLogger("lichen")


@dataclass(frozen=True, slots=True)
class Source:
    """A source with its headers in place."""

    name: str
    text: str
    digest: str


_composed: dict[str, Source] = {}
MOST_COMPOSED = 256
"""Programs of generated text that a process builds at most."""


def compose(text: str) -> str | None:
    """The name of a source of generated text, which includes headers by their paths below `ROOTS`; None where there are
    enough of them already. The same text has the same name."""
    name = f"composed/{hashlib.sha256(text.encode()).hexdigest()[:16]}.cl"
    if name not in _composed:
        if len(_composed) >= MOST_COMPOSED:
            return None
        lines = ["#pragma OPENCL FP_CONTRACT OFF", *_included(text.splitlines(), (INCLUDE, *ROOTS), name, set(), 0)]
        whole = "\n".join(lines) + "\n"
        _composed[name] = Source(name, whole, hashlib.sha256(whole.encode()).hexdigest())
    return name


@cache
def load(name: str) -> Source:
    """The source called `name`, headers resolved. Read once per process. Raises `DeviceFailure`."""
    if name in _composed:
        return _composed[name]
    path = next((root / name for root in ROOTS if (root / name).is_file()), None)
    if path is None:
        raise DeviceFailure(f"There is no kernel source {name}.")
    lines = ["#pragma OPENCL FP_CONTRACT OFF", *_resolved(path, name, set())]
    text = "\n".join(lines) + "\n"
    return Source(name, text, hashlib.sha256(text.encode()).hexdigest())


@cache
def _language() -> str:
    return "\n".join([*_resolved(LANGUAGE, LANGUAGE.name, set()), ""])


def _resolved(path: Path, name: str, once: set[Path], depth: int = 0) -> list[str]:
    """The lines of a file with its includes in their place, marked so that build logs name file and line."""
    text = path.read_text(encoding="utf-8").splitlines()
    if any(map(_ONCE.match, text)):
        once.add(path.resolve())
        text = ["" if _ONCE.match(line) else line for line in text]
    return _included(text, (INCLUDE, path.parent), name, once, depth)


def _included(text: Sequence[str], folders: Sequence[Path], name: str, once: set[Path], depth: int) -> list[str]:
    """The lines with what they include from the folders in its place."""
    lines = [f'#line 1 "{name}"']
    for number, line in enumerate(text, start=1):
        include = _INCLUDE_LINE.match(line)
        if include is None:
            lines.append(line)
            continue
        wanted = include.group(1)
        found = next((folder / wanted for folder in folders if (folder / wanted).is_file()), None)
        if found is None:
            raise DeviceFailure(f"{name}, line {number}, includes {wanted}, which does not exist.")
        if depth == _DEPTH:
            raise DeviceFailure(f"{name}, line {number}: includes are nested more than {_DEPTH} deep.")
        if found.resolve() not in once:
            lines += _resolved(found, wanted, once, depth + 1)
        lines.append(f'#line {number + 1} "{name}"')
    return lines


def _definition(name: str, value: int | float | str) -> str:
    """As a line of source rather than a build option: runtimes split options at spaces, quoted or not."""
    if isinstance(value, float):
        return f"#define {name} {value.hex()}f"
    return f"#define {name} {int(value) if isinstance(value, bool) else value}"


def _shorten(held: OrderedDict[Any, Any]) -> None:
    """Drop what has not been used for the longest."""
    while len(held) > KEPT:
        held.popitem(last=False)


class Programs:
    """The programs of one device. Safe to use from any thread."""

    def __init__(self, context: cl.Context, device: cl.Device) -> None:
        import pyopencl as cl

        self._context = context
        self._device = device
        pocl = "Portable Computing Language" in device.platform.name
        exact = bool(device.single_fp_config & cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT) and not pocl
        self._ways = [(_language(), QUICK)] * pocl + [("", (*OPTIONS, *ROUNDED * exact))]
        self._built: OrderedDict[tuple[str, tuple[str, ...]], cl.Program] = OrderedDict()
        self._lock, self._building = threading.Lock(), threading.Lock()
        self._own = threading.local()

    def kernel(self, source: str, name: str, defines: Definitions) -> tuple[cl.Kernel, int]:
        """This thread's kernel object, and how many arguments it takes.

        Raises `DeviceFailure` naming source and kernel, with the build log.
        """
        kernels: OrderedDict[object, tuple[cl.Kernel, int]] = self._own.__dict__.setdefault("kernels", OrderedDict())
        key = (source, name, frozenset(defines.items()))
        kernel = kernels.get(key)
        if kernel is None:
            kernel = kernels[key] = self._create(source, name, defines)
            _shorten(kernels)
        else:
            kernels.move_to_end(key)
        return kernel

    def build(self, source: str, defines: Definitions) -> cl.Program:
        """The program of a source, built at most once."""
        loaded = load(source)
        key = (loaded.digest, tuple(_definition(*item) for item in sorted(defines.items())))
        program = self._held(key)
        if program is None:
            with self._building:
                program = self._held(key)
                if program is None:
                    program = self._compile(loaded, key[1])
                    with self._lock:
                        self._built[key] = program
                        _shorten(self._built)
        return program

    def _held(self, key: tuple[str, tuple[str, ...]]) -> cl.Program | None:
        with self._lock:
            program = self._built.get(key)
            if program is not None:
                self._built.move_to_end(key)
            return program

    @property
    def count(self) -> int:
        """Programs that are held, `kept` at most."""
        return len(self._built)

    @property
    def kept(self) -> int:
        return KEPT

    def _create(self, source: str, name: str, defines: Definitions) -> tuple[cl.Kernel, int]:
        import pyopencl as cl

        program = self.build(source, defines)
        try:
            kernel = cl.Kernel(program, name)
            return kernel, kernel.num_args
        except cl.Error as error:
            known = ", ".join(sorted(kernel.function_name for kernel in program.all_kernels()))
            raise DeviceFailure(f"{source} has no kernel {name} (it has {known}): {error}") from error

    def _compile(self, source: Source, definitions: tuple[str, ...]) -> cl.Program:
        """The quick way where it is enough: a function that is missing from `LANGUAGE` costs time and a warning."""
        import pyopencl as cl

        text = "\n".join([*definitions, source.text])
        missed = ""
        restore()
        for head, options in self._ways:
            program = cl.Program(self._context, head + text)
            try:
                program.build(list(options))
            except cl.Error as error:
                missed = self._build_log(program) or str(error)
                continue
            if missed:
                warnings.warn(f"{source.name} needs more than {LANGUAGE.name} declares:\n{missed}", stacklevel=2)
            log = self._build_log(program)
            if log:
                _log.debug("building %s: %s", source.name, log)
            return program
        given = f" with {', '.join(line.removeprefix('#define ') for line in definitions)}" if definitions else ""
        raise DeviceFailure(f"{source.name} could not be built{given}:\n{missed}")

    def _build_log(self, program: cl.Program) -> str:
        import pyopencl as cl

        try:
            log = program.get_build_info(self._device, cl.program_build_info.LOG)  # type: ignore[no-untyped-call]
        except cl.Error:
            return ""
        return str(log).strip("\0 \n")
