"""The error table: what every setting of every method was wrong by, over the corpus.

It belongs to the code: checked in beside it, one line per entry and three digits, so that a change of accuracy shows as
a change of lines. `lichen calibrate --errors` writes it; a test computes a part of it again and fails on a difference.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from decimal import ROUND_CEILING, Decimal
from functools import cache
from importlib.resources import files
from pathlib import Path

NAME = "errors.json"
DIGITS = 3
SEEN = {"delta_e": 0.05, "flip": 1e-3}
"""Last digits of what is seen."""
SHARE = 0.1
"""Of a figure, by which it may differ when it is found again."""
LAST = {
    "fixed8": (1 / 255, 1 / 4080),
    "fixed12": (1 / 4095, 1 / 65520),
    "fixed16": (1 / 65535, 1 / 1048560),
    "float16": (2.0**-11, 2.0**-15),
    "float32": (2.0**-23, 2.0**-24),
}
"""By precision: the last digit at the scale of errors, 1, and what it makes of an RMS error. Another processor or
backend may round a value between two digits otherwise, in float32 all of them, in a store one in hundreds."""


@dataclass(frozen=True, slots=True)
class Entry:
    """Errors over the corpus, OpenCL's or NumPy's, whichever is larger; units as in `lichen.calibration.sweep`."""

    operation: str
    example: int
    """its place among the operation's examples"""
    method: str
    knob: float | None
    precision: str
    size: int
    """side of the corpus's images, px"""
    largest: float
    worst_image: str
    """the image that `largest` and `stated` belong to"""
    p999: float
    """exceeded by one sample in a thousand, on the worst image for it"""
    rms: float
    """on the worst image for it"""
    typical_rms: float
    """median over the images"""
    stated: float
    """what the method states for `worst_image`"""
    kind: str
    """bound or estimate"""
    mismatched: int
    """samples that are non-finite where truth is not, or the other way round; all images together"""
    delta_e: float | None = None
    """largest CIEDE2000 on the photograph, by OpenCL where it works; None where the result is no colour picture, or not
    finite"""
    flip: float | None = None
    """mean FLIP there"""

    @property
    def order(self) -> tuple[str, int, str, str, float]:
        return self.operation, self.example, self.method, self.precision, self.knob if self.knob is not None else 0.0

    @property
    def holds(self) -> bool:
        """Whether it keeps what is stated. A store may make nothing of a small depth, which then has no finite result:
        such samples are counted, and no error is stated for them."""
        return self.largest <= self.stated and not (self.mismatched and self.precision == "float32")

    def drift(self, found: Entry) -> list[str]:
        """In words, which figures `found` does not confirm: off by more than a share and a last digit, either way."""
        said = []
        digits = dict(zip(("largest", "typical_rms"), LAST[self.precision], strict=True)) | SEEN
        for figure, digit in digits.items():
            old, new = getattr(self, figure), getattr(found, figure)
            known = old is not None and new is not None
            if abs(new - old) > SHARE * old + digit if known else old is not new:
                words = ("none" if each is None else f"{each:.3g}" for each in (old, new))
                said.append(f"{found.method} at {found.knob}, {found.precision}: {figure} was {', is '.join(words)}")
        return said


@dataclass(frozen=True)
class Table:
    entries: tuple[Entry, ...]

    def of(self, operation: str, example: int | None = None) -> tuple[Entry, ...]:
        """The entries of an operation, of one of its examples if that is named."""
        return tuple(
            entry for entry in self.entries if entry.operation == operation and example in (None, entry.example)
        )

    def to_text(self) -> str:
        """The file's text: sorted, a line for each entry, a line break at the end."""
        lines = [json.dumps(_rounded(entry), ensure_ascii=False) for entry in sorted(self.entries, key=_order)]
        return "[\n" + ",\n".join(lines) + "\n]\n"


def parse(text: str) -> Table:
    return Table(tuple(Entry(**each) for each in json.loads(text)))


@cache
def load() -> Table:
    """The table that comes with the library."""
    return parse((files("lichen.calibration") / NAME).read_text(encoding="utf-8"))


def save(entries: Iterable[Entry], path: Path | None = None) -> Path:
    """Write the table of a checkout; entries of operations that are not among `entries` stay as they are."""
    path = path or Path(__file__).with_name(NAME)
    new = tuple(entries)
    renewed = {entry.operation for entry in new}
    old = parse(path.read_text(encoding="utf-8")).entries if path.exists() else ()
    kept = tuple(entry for entry in old if entry.operation not in renewed)
    path.write_text(Table(kept + new).to_text(), encoding="utf-8")
    load.cache_clear()
    return path


def _order(entry: Entry) -> tuple[str, int, str, str, float]:
    return entry.order


def _rounded(entry: Entry) -> dict[str, object]:
    """Three digits; `stated` upwards, so that rounding breaks no promise."""
    values = asdict(entry)
    for each in fields(entry):
        value = values[each.name]
        if isinstance(value, float) and each.name != "knob":
            values[each.name] = float(f"{value:.{DIGITS}g}")
    values["stated"] = _upwards(max(entry.stated, values["largest"] if entry.holds else 0.0))
    return values


def _upwards(value: float) -> float:
    """The smallest number of three digits that is not below `value`."""
    exact = Decimal(repr(value))  # as it is written, so that a figure read back stays what it is
    return float(exact.quantize(Decimal(1).scaleb(exact.adjusted() - DIGITS + 1), ROUND_CEILING)) if value else 0.0
