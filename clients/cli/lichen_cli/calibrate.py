"""`lichen calibrate`: measure how fast the methods are on this machine, so that plans promise its times.

What is measured is kept at once; a calibration that was interrupted goes on where it stopped. With `--errors` the error
table of a checkout is computed anew instead, which says nothing of time and is the same on every machine. With
`--kinds` nothing is measured: how kinds of requests compare by the times that are known here is written into the
checkout, for quick calibrations anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lichen_cli.main import FAILED, Parser

if TYPE_CHECKING:
    from rich.progress import Progress

    from lichen.operation import Operation


QUICKLY = (
    "one setting of each method at two sizes, and what is known of other kinds of requests: 40 seconds on two "
    "processors, and some minutes more where kernels were never built"
)


def main(arguments: Sequence[str]) -> int:
    says = "Measure how fast the methods are on this machine; plans use what was found."
    parser = Parser(prog="lichen calibrate", description=says, allow_abbrev=False)
    parser.add_argument("--quick", action="store_true", help=QUICKLY)
    parser.add_argument("--operation", metavar="NAME", help="only this one")
    parser.add_argument("--errors", action="store_true", help="compute the error table of this checkout instead")
    parser.add_argument("--kinds", action="store_true", help="write how kinds of requests compare into this checkout")
    given = parser.parse_args(arguments)
    if given.kinds:
        from lichen.calibration import kinds

        print(kinds.save())
        return 0

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from lichen.catalogue import operation, operations

    chosen = [operation(given.operation)] if given.operation else list(operations().values())
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        return _errors(chosen, progress) if given.errors else _times(chosen, given.quick, progress)


def _times(chosen: Sequence[Operation[Any]], quick: bool, progress: Progress) -> int:
    from lichen.accuracy import times
    from lichen.calibration.calibrate import Outcome, calibrate
    from lichen.calibration.sweep import backends
    from lichen.calibration.timing import QUICK, THOROUGH

    outcome, available = Outcome(), backends()
    task = progress.add_task("measuring", total=len(chosen) * len(available))
    begun: dict[tuple[str, str], float] = {}
    for step in calibrate(chosen, available, QUICK if quick else THOROUGH, outcome):
        begun[step.operation, step.backend] = step.done / step.total
        progress.update(
            task,
            completed=outcome.resumed + sum(begun.values()),
            description=f"{step.operation}, {step.backend}",
        )
    progress.update(task, completed=len(chosen) * len(available), description="done")
    progress.stop()
    if not outcome.kept:
        print(f"{times.folder()} cannot be written; nothing was kept")
        return FAILED
    for backend in available:
        print(times.path_of(backend))
    within = outcome.samples - outcome.missed
    resumed = f"; {outcome.resumed} were measured before the interruption" if outcome.resumed else ""
    print(f"{within} of {outcome.samples} runs are predicted within a factor of 1.5{resumed}.")
    return 0


def _errors(chosen: Sequence[Operation[Any]], progress: Progress) -> int:
    from lichen.calibration import studies, sweep, table

    task = progress.add_task("comparing", total=sum(len(each.examples) for each in chosen))
    entries = []
    for each in chosen:
        for number in range(len(each.examples)):
            progress.update(task, description=f"{each.name}, example {number}")
            entries += sweep.errors(each, number)
            progress.advance(task)
    paths = table.save(entries), studies.save(chosen)
    progress.stop()
    print(*paths, sep="\n")
    broken = [entry for entry in entries if not entry.holds]
    for entry in broken:
        knob = "" if entry.knob is None else f" at {entry.knob:g}"
        print(
            f"{entry.operation} example {entry.example}, {entry.method}{knob}: {entry.largest:.3g} on "
            f"{entry.worst_image}, stated {entry.stated:.3g}; {entry.mismatched} samples not finite on one side"
        )
    return FAILED if broken else 0
