"""How far a batch or a large picture is, on standard error: a bar with rate, failures and the time that is left."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lichen_batch.item import Outcome
    from lichen_batch.summary import Account


@contextmanager
def progress(total: int, done: int, account: Account, *, shown: bool) -> Iterator[Callable[[Outcome], None]]:
    """What is to be told of every outcome; `done` items were done before."""
    if not shown:
        yield account.add
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TextColumn("[red]{task.fields[failed]}"),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True, expand=True) as bar:
        task = bar.add_task("", total=total, completed=done, rate="", failed="")

        def tell(outcome: Outcome) -> None:
            account.add(outcome)
            speed = bar.tasks[0].finished_speed or bar.tasks[0].speed
            failed = f"{account.failed} failed" if account.failed else ""
            bar.update(task, advance=1, rate=f"{speed:.3g}/s" if speed else "", failed=failed)
            if outcome.problem is not None:
                where = f" {outcome.problem.errors[0]['pointer']}" if outcome.problem.errors else ""
                bar.console.print(
                    f"{outcome.id}: {outcome.problem.code}{where}: {outcome.problem.detail}", markup=False, style="red"
                )

        yield tell


@contextmanager
def bar(what: str, *, shown: bool) -> Iterator[Callable[[int, int], None]]:
    """What is to be told how many are done of how many."""
    if not shown:
        yield lambda done, count: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(bar_width=None), MofNCompleteColumn(), TextColumn(what + ", left"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True, expand=True) as shown_bar:
        task = shown_bar.add_task("", total=None)
        yield lambda done, count: shown_bar.update(task, completed=done, total=count)


def tell(summary: Mapping[str, Any]) -> None:
    """The summary for people."""
    from rich.console import Console
    from rich.table import Table

    console = Console(stderr=True)
    counts = ", ".join(f"{summary[name]} {name.replace('_', ' ')}" for name in _COUNTS if summary[name])
    console.print(f"{counts or 'nothing to do'}; {summary['seconds']:.1f} s, {summary['items_per_second']:.3g} items/s")
    table = Table("", "mean", "p50", "p90", "p99", "max", box=None, header_style="dim")
    rows = [(f"{name}, s", each) for name, each in summary["stage_seconds"].items() if "." not in name]
    rows += [("stated error", summary["stated_errors"]), ("measured error", summary["measured_errors"])]
    for name, each in rows:
        if each is not None:
            table.add_row(name, *(f"{each[key]:.3g}" for key in ("mean", "p50", "p90", "p99", "max")))
    if table.row_count:
        console.print(table)
    for code, count in summary["problems"].items():
        console.print(f"{count} x {code}", style="red", markup=False)


_COUNTS = ("ok", "failed", "done_before", "failed_before", "left")
