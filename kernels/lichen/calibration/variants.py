"""What stores of less precision cost: the same run with every value kept in it.

One setting of an operation, the most accurate, is enough: the store's error adds to whatever the method's is. Pictures
that reach beyond [0, 1], in what goes in or comes out, are left out, since fixed point clips them and nothing else
would show.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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


@dataclass(frozen=True, slots=True)
class Stored:
    """The example of an operation by one method, in any store."""

    operation: Operation[Any]
    example: Mapping[str, Any]
    method: str
    knob: float | None

    def runs(self, case: Case, truth: Array, backend: str) -> Iterator[tuple[Precision, Result]]:
        """The result in each store; none for a picture that no store of fixed point holds."""
        if not all(_displayable(pixels) for pixels in (truth, *(image.pixels for image in case.inputs.values()))):
            return
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
            except LichenError:  # an operation that takes no such store
                continue


def _displayable(pixels: Array) -> bool:
    return bool(pixels.min() >= 0 and pixels.max() <= 1)
