"""`lichen accuracy [NAME]`: what accuracy costs, in the terminal or as a plot.

Without a name: for every operation in a line, from the table of errors and the time model of this machine. With one:
measured here and now, beside the same function of other installed libraries; `--predict` takes the table and the time
model instead. Parameters of the operation are options, as in `lichen run`; without any, `--example` chooses a set.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lichen_cli.main import Parser, Usage

if TYPE_CHECKING:
    from lichen.calibration.report import Report, Setting, Verdict

MARKS = {"worthwhile": "*", "front": "+", "failed": "x"}
_LEGEND = "* worth its time   + on the front, but hardly worth it   x could not run"
SEEN = "CIEDE2000", "FLIP"
"""The largest and the mean on the photograph."""


def main(arguments: Sequence[str]) -> int:
    parser = _parser()
    # The name comes first, so that it cannot be taken for the value of an option that only the operation knows.
    named = [*arguments[:1]] if arguments and not arguments[0].startswith("-") else []
    given, rest = parser.parse_known_args(list(arguments[len(named) :]))
    given.name = named[0] if named else None
    if given.name is None:
        if rest or given.example is not None or given.svg or given.png:
            raise Usage(f"name an operation first; see {parser.prog} --help")
        _overview(given)
        return 0
    report = _report(given, _values(rest, parser))
    if given.svg or given.png:
        _draw(report, given)
    if given.json:
        from lichen_service.documents import plain

        print(json.dumps(plain(report.to_json()), indent=2, ensure_ascii=False))
    else:
        _print(report)
    return 0


def _parser() -> Parser:
    parser = Parser(
        prog="lichen accuracy",
        usage="lichen accuracy [NAME] [--PARAMETER VALUE ...] [options]",
        description="Show what accuracy costs in time: for all operations, or measured for the one named NAME, whose "
        "parameters are options as in `lichen run`.",
        allow_abbrev=False,
    )
    parser.add_argument("--example", type=int, metavar="N", help="take the operation's example N instead of parameters")
    parser.add_argument("--size", type=int, default=512, metavar="N", help="side of the image that is timed, px")
    parser.add_argument("--device", choices=("opencl", "numpy"), help="default: OpenCL if it works, else NumPy")
    parser.add_argument("--predict", action="store_true", help="measure nothing: show the table and the time model")
    parser.add_argument("--quick", action="store_true", help="take our own errors from the table, and fewer timings")
    parser.add_argument("--json", action="store_true", help="print JSON, as the service does")
    parser.add_argument("--svg", metavar="FILE", help="write the plot")
    parser.add_argument("--png", metavar="FILE", help="write the plot as a picture")
    return parser


def _values(rest: Sequence[str], parser: Parser) -> dict[str, str]:
    """Parameters from what the parser did not know: --name value or --name=value."""
    values: dict[str, str] = {}
    tokens = list(rest)
    while tokens:
        token = tokens.pop(0)
        if not token.startswith("--"):
            raise Usage(f"{token}: one operation at a time; see {parser.prog} --help")
        name, given, value = token[2:].partition("=")
        if not given:
            if not tokens:
                raise Usage(f"{token}: expected one argument; see {parser.prog} --help")
            value = tokens.pop(0)
        values[name.replace("-", "_")] = value
    return values


def _report(given: Any, values: dict[str, str]) -> Report:
    from rich.console import Console

    from lichen.calibration import gather
    from lichen.calibration.examples import SIZES
    from lichen.catalogue import operation

    chosen = operation(given.name)
    if not SIZES[0] <= given.size <= SIZES[1]:
        raise Usage(f"--size must lie between {SIZES[0]} and {SIZES[1]}")
    if given.example is not None and not 0 <= given.example < len(chosen.examples):
        raise Usage(f"--example must lie between 0 and {len(chosen.examples) - 1}")
    if values and (given.example is not None or given.predict):
        raise Usage("parameters are measured: leave out --example and --predict, or the parameters")
    if given.predict:
        return gather.predicted(chosen, given.example, size=given.size, backend=given.device)
    parameters = chosen.validate(values).model_dump(mode="json", exclude_unset=True) if values else None
    with Console(stderr=True).status("measuring") as status:
        return gather.measured(
            chosen,
            parameters or given.example,
            size=given.size,
            backend=given.device,
            quick=given.quick,
            tell=lambda stage: status.update(f"measuring {stage}"),
        )


def _draw(report: Report, given: Any) -> None:
    from lichen.calibration.drawing import to_png, to_svg
    from lichen.calibration.plot import plot

    drawing = plot(report)
    if given.svg:
        Path(given.svg).write_bytes(to_svg(drawing))
    if given.png:
        Path(given.png).write_bytes(to_png(drawing))


def _overview(given: Any) -> None:
    from rich.console import Console
    from rich.table import Table

    from lichen.calibration import gather
    from lichen.catalogue import operations

    reports = [gather.predicted(each, size=given.size, backend=given.device) for each in operations().values()]
    if given.json:
        from lichen_service.documents import plain

        print(json.dumps(plain([report.to_json() for report in reports]), indent=2, ensure_ascii=False))
        return
    table = Table("operation", "what accuracy costs", box=None)
    for report in reports:
        table.add_row(report.title, report.headline)
    Console().print(table, markup=False)


def _print(report: Report) -> None:
    from rich.console import Console

    console = Console()
    console.print(report.title, style="bold", markup=False, highlight=False)
    for line in (report.headline, report.remark):
        if line:
            console.print(line, markup=False, highlight=False)
    console.print()
    for text, style in _lines(report, console.width):
        console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)
    console.print()
    for line in (_LEGEND, f"{report.device}, {report.image}, {', '.join(report.machine.values())}", report.source):
        console.print(line, style="dim", markup=False, highlight=False)


def _lines(report: Report, width: int) -> list[tuple[str, str]]:
    """The table, a line with its style for each setting; the reason stands below where it does not fit beside."""
    rows, widths = _table(report, seen=report.seen)
    if 2 * len(widths) + sum(widths) - 2 > width:  # what a viewer sees is left out where there is no room
        rows, widths = _table(report, seen=False)
    judged = [verdict.standing in ("worthwhile", "front") for verdict in report.verdicts]
    styles = ["bold", *("" if each else "dim" for each in judged)]
    lines = []
    for row, style in zip(rows, styles, strict=True):
        mark, name, *numbers, reason = row
        padded = [text.rjust(room) for text, room in zip(numbers, widths[2:], strict=True)]
        line = "  ".join([f"{mark:1} {name.ljust(widths[1])}", *padded])
        beside = not reason or len(line) + 3 + len(reason) <= width
        lines.append((f"{line}   {reason}".rstrip() if beside else line, style))
        if not beside:
            lines.append((f"    {reason}", "dim"))
    return lines


def _table(report: Report, *, seen: bool) -> tuple[list[tuple[str, ...]], list[int]]:
    """Rows of text below their heads, and how wide the columns before the reasons are."""
    rows = [("", "", "time", "worst", "typical", "stated", *(SEEN if seen else ()), "")]
    rows += [_row(setting, judged, seen=seen) for setting, judged in zip(report.settings, report.verdicts, strict=True)]
    return rows, [max(1, *(len(row[column]) for row in rows)) for column in range(len(rows[0]) - 1)]


def _row(setting: Setting, verdict: Verdict, *, seen: bool) -> tuple[str, ...]:
    from lichen.calibration.words import milliseconds, scientific

    mark = MARKS.get(verdict.standing, "")
    if setting.failed is not None:
        return (mark, setting.label, *[""] * (6 if seen else 4), verdict.reason)
    spread = f" +-{setting.spread * 100:3.0f} %" if setting.spread else ""
    time, stated = milliseconds(setting.seconds) + spread, ""
    if setting.stated is not None:
        stated = f"{scientific(setting.stated)} {setting.kind}"
    looks = ["" if each is None else scientific(each) for each in (setting.delta_e, setting.flip) if seen]
    errors = scientific(setting.worst), scientific(setting.typical), stated
    return (mark, setting.label, time, *errors, *looks, verdict.reason)
