"""Pointwise methods as steps of a kernel that carries out a chain of them: see `lichen.planning.fuse`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lichen.memory import Array
    from lichen.opencl.device import Device
    from lichen.opencl.session import Held, Session
    from lichen.operation import Inputs


@dataclass(frozen=True, slots=True)
class Stage:
    """A pointwise method as a step of a kernel that carries out a chain of them.

    `source` is a header below `operations/` that defines `void OWN(stage)(float16 *v, global const float *k)`, which
    changes sixteen pixels in place: a vector for each of CHANNELS channels, of which COLOURS are no coverage. It does
    the method's own arithmetic, bit for bit. `defines` hold while it is included; `numbers`, float32, arrive in `k`.
    Where the operation takes two pictures, it is `void OWN(stage)(float16 *v, const float16 *w, global const float *k)`
    and changes those of the first picture.
    """

    source: str
    defines: Mapping[str, int | float | str] = field(default_factory=dict)
    numbers: tuple[float, ...] = ()
    single: tuple[float, ...] | None = None
    """the numbers where CHANNELS and COLOURS are 1, of a method that does the same to all colours; None of others"""


@dataclass(frozen=True, slots=True)
class Tail:
    """What a kernel does to each of its results before it writes it: `float16 tail(float16 v, global const float *k)`
    with the `numbers` in `k`, in a source that defines TAIL and goes on with the kernel's own; or nothing, in that."""

    source: str
    numbers: Array | None = None
    moved: Array | None = None
    """where results are written as codes of 8 bits: the two counts, int32, to which those are added that were clipped
    and those that are not finite"""

    @property
    def kind(self) -> str:
        """Of the array of the results."""
        return "float32" if self.moved is None else "uint8"

    @property
    def defines(self) -> dict[str, float]:
        """For the source."""
        return {} if self.moved is None else {"LEVELS": 255.0}

    def counting(self, session: Session) -> Held | None:
        """The counts as a kernel's argument."""
        return None if self.moved is None else session.readwrite(self.moved)


@dataclass(frozen=True, slots=True)
class Head:
    """A method that reads its neighbours as the head of a chain: the kernel's source, and what launches it with a tail
    in the place of that source."""

    source: str
    run: Callable[[Device, Inputs, Tail], Array]


def no_stage(parameters: Any, facts: Any) -> Stage | None:
    """Of methods that are no step of a chain."""
    return None


def no_head(parameters: Any, knob: float, facts: Any) -> Head | None:
    """Of methods that do not go on with a chain."""
    return None
