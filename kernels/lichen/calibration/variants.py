"""What stores of less precision cost: the same run with every value kept in it.

One setting of an operation, the most accurate, is enough, and one backend: the store's error adds to whatever the
method's is. Pictures that reach beyond [0, 1] are left out where there are others, since a store with a range so wide
says little of its digits: those count that lie within as they go in and as they come out, else those that do as they
go in (differences come out), else all (vectors and depths go in).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lichen import engine
from lichen.accuracy.precision import Precision
from lichen.calibration.corpus import Case
from lichen.engine import Result
from lichen.errors import LichenError
from lichen.memory import Array
from lichen.operation import Operation

STORES = (Precision.FIXED8, Precision.FIXED12, Precision.FIXED16, Precision.FLOAT16)
Known = tuple[Case, Array]
"""A picture of the corpus, and truth."""


@dataclass(frozen=True, slots=True)
class Stored:
    """The example of an operation by one method, in any store."""

    operation: Operation[Any]
    example: Mapping[str, Any]
    method: str
    knob: float | None

    def runs(self, case: Case, backend: str) -> Iterator[tuple[Precision, Result]]:
        """The result in each store; none for a picture that the operation does not take stored."""
        knob = self.operation.methods[self.method].knob
        values: dict[str, Any] = {**case.inputs, **self.example, "method": self.method}
        if knob is not None:
            values[knob.name] = self.knob
        for precision in STORES:
            try:
                yield (
                    precision,
                    engine.run(self.operation.name, device=backend, prune=False, precision=precision, **values),
                )
            except LichenError:
                continue


def telling(known: Sequence[Known]) -> Sequence[Known]:
    """The pictures that show most of the digits of a store."""
    pictures = [(case, truth) for case, truth in known if not case.name.startswith("hard: ")]
    sent = [each for each in pictures if all(_displayable(image.pixels) for image in each[0].inputs.values())]
    return [each for each in sent if _displayable(each[1])] or sent or pictures


def _displayable(pixels: Array) -> bool:
    return bool(pixels.min() >= 0 and pixels.max() <= 1)
