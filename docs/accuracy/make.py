"""Measures what accuracy costs, for every operation, and writes this folder: a plot and a paragraph for each.

Run: make accuracy, or python docs/accuracy/make.py [NAME ...] [--full] [--size N]. Without --full our own errors come
from the table that comes with the library; all times and all peers are measured here and now, on a machine that should
have nothing else to do. With names only those operations are measured. The index tells of all whose numbers lie here,
and is written when none of these is left from a version that measured other things.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterable, Mapping, Sequence, Set
from pathlib import Path
from typing import Any

import lichen
from lichen.calibration.drawing import to_png, to_svg
from lichen.calibration.examples import SIZE
from lichen.calibration.gather import measured, predicted
from lichen.calibration.plot import plot
from lichen.calibration.report import Report
from lichen.calibration.words import label_of, milliseconds, scientific
from lichen.operation import Operation
from lichen_service.documents import plain

HERE = Path(__file__).resolve().parent
FORMS = ("svg", "png", "json")
INTRODUCTION = """# What accuracy costs

Written by `make accuracy`. Each plot shows one operation: error across, falling to the right, so that a step to the
right is one more digit; time up. Filled marks are the worst case over the corpus, hollow ones the typical error, the
median over its images of the RMS error. Errors are in output units for values in [0, 1]; images with larger values
count divided by their largest. Open a plot by itself to point at its marks: each says what it is, and what to
take instead.

Where the result is a colour picture, the tables also say what a viewer sees of the error, on the photograph of the
corpus: the largest CIEDE2000, of which 1 can just be noticed, and the mean FLIP, from 0 to 1. A result that is not
finite everywhere has neither.

A running service draws the same from its error table and from what it measured of its machine:
`/v1/accuracy/gaussian.svg`. For other parameters: `lichen accuracy gaussian --sigma 20`.

What keeping values in 8, 12 or 16 bits costs, whatever is computed: [precision](precision.md).
"""


def main() -> None:
    known = lichen.operations()
    parser = argparse.ArgumentParser(description="Measure what accuracy costs and write docs/accuracy.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="operations; all")
    parser.add_argument("--full", action="store_true", help="compute our own errors again, and time more often")
    parser.add_argument("--size", type=int, default=SIZE, help="side of the image that is timed, px")
    given = parser.parse_args()
    if unknown := set(given.names) - set(known):
        parser.error(f"there is no operation {', '.join(sorted(unknown))}")
    began = time.perf_counter()
    for name in given.names or known:
        start = time.perf_counter()
        report = measured(known[name], size=given.size, quick=not given.full)
        write(report)
        print(f"{name}: {report.headline} ({time.perf_counter() - start:.1f} s)", file=sys.stderr)
    print(f"{time.perf_counter() - began:.0f} s", file=sys.stderr)
    if old := outdated(known.values()):
        sys.exit(f"index.md stays as it was: another version wrote {len(old)} of the others ({old[0]}); make them anew")
    (HERE / "index.md").write_text(index(known), encoding="utf-8")


def write(report: Report) -> None:
    """The plot, its preview, and the numbers."""
    drawing = plot(report)
    numbers = json.dumps(plain(report.to_json()), indent=1, ensure_ascii=False) + "\n"
    for form, data in zip(FORMS, (to_svg(drawing), to_png(drawing), numbers.encode()), strict=True):
        (HERE / f"{report.operation}.{form}").write_bytes(data)


def outdated(operations: Iterable[Operation[Any]]) -> list[str]:
    """Those of them whose numbers lie here and are not those that reports of this version have."""
    here = ((each, HERE / f"{each.name}.json") for each in operations)
    return [
        operation.name
        for operation, path in here
        if path.exists() and form(json.loads(path.read_bytes())) != form(predicted(operation).to_json())
    ]


def form(numbers: Mapping[str, Any]) -> tuple[Set[str], ...]:
    """The names of what a report holds, of what it holds of a setting, and of its study."""
    return tuple(each.keys() for each in (numbers, numbers["settings"][0], numbers.get("study") or {}))


def index(known: Sequence[str] | Mapping[str, Any]) -> str:
    """Of all operations whose numbers lie here, those with the most to choose from first."""
    documents = [
        json.loads(path.read_text(encoding="utf-8")) for path in sorted(HERE.glob("*.json")) if path.stem in known
    ]
    documents.sort(key=lambda each: -sum(setting["standing"] == "worthwhile" for setting in each["settings"]))
    overview = ["| operation | what accuracy costs |", "|---|---|"]
    overview += [f"| [{each['operation']}](#{each['operation']}) | {each['headline']} |" for each in documents]
    return "\n".join([INTRODUCTION, *overview, "", *(section(each) for each in documents)])


def section(numbers: Mapping[str, Any]) -> str:
    """The sentence that the plot tells, worst and typical errors side by side, peers, and where it was measured."""
    name, title = numbers["operation"], numbers["title"]
    settings = numbers["settings"]
    ran = [each for each in settings if each["failed"] is None]
    told = [each for each in ran if each["standing"] == "worthwhile"]
    told += [each for each in ran if each["precision"] == "float64"]
    told += [each for each in ran if each["peer"]]
    rows = ["| setting | time | worst case | typical |", "|---|---:|---:|---:|"]
    if any(each["flip"] is not None for each in told):
        rows = ["| setting | time | worst case | typical | CIEDE2000 | FLIP |", "|---|---:|---:|---:|---:|---:|"]
    rows += [row(each, columns=rows[0].count("|") - 1) for each in told]
    found = [numbers["converging"]] if numbers["orders"] else []
    found += numbers["study"]["sentences"] if numbers["study"] else []
    size = f"{numbers['size']} x {numbers['size']} px"
    where = f"{numbers['device']}, {size}, {', '.join(numbers['machine'].values())}"
    return "\n".join(
        [
            f"## {name}",
            "",
            f"![{title}: error against time]({name}.svg)",
            "",
            f"{numbers['headline']} {numbers['remark']}".strip(),
            "",
            *rows,
            "",
            *(f"- {sentence}" for sentence in found),
            *([""] if found else []),
            f"`{title}`: {where}. {numbers['source']} Again: `{numbers['command']}`. [Numbers]({name}.json),"
            f" [picture]({name}.png).",
            "",
        ]
    )


def row(setting: Mapping[str, Any], columns: int) -> str:
    """Of so many columns, the last two of which tell what a viewer sees."""
    name = label_of(setting["method"], setting["knob"], setting["precision"])
    errors = ["exact" if setting[error] == 0 else scientific(setting[error]) for error in ("worst", "typical")]
    seen = ["" if setting[each] is None else scientific(setting[each]) for each in ("ciede2000", "flip")]
    cells = [name, milliseconds(setting["milliseconds"] / 1e3), *errors, *seen]
    return f"| {' | '.join(cells[:columns])} |"


if __name__ == "__main__":
    main()
