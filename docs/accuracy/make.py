"""Measures what accuracy costs, for every operation, and writes this folder: a plot and a paragraph for each.

Run: make accuracy, or python docs/accuracy/make.py [--full] [--size N]. Without --full our own errors come from the
table that comes with the library; all times and all peers are measured here and now, on a machine that should have
nothing else to do.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import lichen
from lichen.calibration.drawing import to_png, to_svg
from lichen.calibration.gather import SIZE, measured
from lichen.calibration.plot import plot
from lichen.calibration.report import Report, Setting, milliseconds, scientific
from lichen_service.documents import plain

HERE = Path(__file__).resolve().parent
INTRODUCTION = """# What accuracy costs

Written by `make accuracy`. Each plot shows one operation: error across, falling to the right, so that a step to the
right is one more digit; time up. Filled marks are the worst case over the corpus, hollow ones the typical error, the
median over its images of the RMS error. Errors are in output units for values in [0, 1]; images with larger values
count divided by their largest. Open a plot by itself to point at its marks: each says what it is, and what to
take instead.

A running service draws the same from its error table and from what it measured of its machine:
`/v1/accuracy/gaussian.svg`. For other parameters: `lichen accuracy gaussian --sigma 20`.

What keeping values in 8, 12 or 16 bits costs, whatever is computed: [precision](precision.md).
"""


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure what accuracy costs and write docs/accuracy.")
    parser.add_argument("--full", action="store_true", help="compute our own errors again, and time more often")
    parser.add_argument("--size", type=int, default=SIZE, help="side of the image that is timed, px")
    given = parser.parse_args()
    sections: list[tuple[int, str]] = []
    for name, operation in lichen.operations().items():
        began = time.perf_counter()
        report = measured(operation, size=given.size, quick=not given.full)
        write(report)
        sections.append((len(report.ours), section(report)))
        print(f"{name}: {report.headline} ({time.perf_counter() - began:.0f} s)", file=sys.stderr)
    # Those with the most to choose from come first.
    ordered = [text for _, text in sorted(sections, key=lambda each: -each[0])]
    (HERE / "index.md").write_text("\n".join([INTRODUCTION, *ordered]), encoding="utf-8")


def write(report: Report) -> None:
    """The plot, its preview, and the numbers."""
    drawing = plot(report)
    (HERE / f"{report.operation}.svg").write_bytes(to_svg(drawing))
    (HERE / f"{report.operation}.png").write_bytes(to_png(drawing))
    numbers = json.dumps(plain(report.to_json()), indent=1, ensure_ascii=False)
    (HERE / f"{report.operation}.json").write_text(numbers + "\n", encoding="utf-8")


def section(report: Report) -> str:
    """The sentence that the plot tells, worst and typical errors side by side, peers, and where it was measured."""
    rows = ["| setting | time | worst case | typical |", "|---|---:|---:|---:|"]
    rows += [row(each) for each in report.worthwhile]
    rows += [row(each) for each in report.settings if each.peer and each.failed is None]
    told = report.study.sentences if report.study else ()
    where = f"{report.device}, {report.image}, {', '.join(report.machine.values())}"
    return "\n".join(
        [
            f"## {report.title}",
            "",
            f"![{report.title}: error against time]({report.operation}.svg)",
            "",
            f"{report.headline} {report.remark}".strip(),
            "",
            *rows,
            "",
            *(f"- {sentence}" for sentence in told),
            *([""] if told else []),
            f"{where}. {report.source} Again: `{report.command}`. [Numbers]({report.operation}.json),"
            f" [picture]({report.operation}.png).",
            "",
        ]
    )


def row(setting: Setting) -> str:
    numbers = (milliseconds(setting.seconds), scientific(setting.worst), scientific(setting.typical))
    return f"| {setting.label} | {' | '.join(numbers)} |"


if __name__ == "__main__":
    main()
