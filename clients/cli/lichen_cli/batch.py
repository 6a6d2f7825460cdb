"""`lichen batch run MANIFEST --out FOLDER`: many images by one command, each done once, whatever happens in between.

The manifest is checked whole before anything starts. Progress goes to standard error where that is a terminal, the
summary to standard output as JSON, or in words to a terminal. Statuses: 0 all done; 2 some failed; 3 the manifest or
the command is not valid, or the run could not go on; 130 and 143 after SIGINT and SIGTERM. Under a Kubernetes Indexed
Job, 42 says that trying this index again cannot help.

`lichen batch tiles IN OUT` computes one image that is larger than memory.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lichen_cli.main import Parser, Usage

if TYPE_CHECKING:
    from lichen.accuracy.times import Known
    from lichen_batch.engines import Engine
    from lichen_batch.item import Item
    from lichen_batch.manifest import Defaults

SOME_FAILED, FATAL, HOPELESS = 2, 3, 42
INDEX, SHARDS = "JOB_COMPLETION_INDEX", "LICHEN_SHARDS"
"""What a Kubernetes Indexed Job sets, and what its template is to set to its number of completions."""
_EPILOG = """A manifest is JSON lines, CSV, or a pattern of files in quotes:

  lichen batch run items.jsonl --out done
  lichen batch run "photos/*.jpg" --out done --operation gaussian --set sigma=5 --output "{stem}.png"

A line: {"id": "a", "operation": "gaussian", "input": "a.exr", "output": "a.png", "parameters": {"sigma": 5}}
Inputs are seen from the manifest's folder, outputs from --out. Both may be URLs (fsspec: s3://, gs://, zip:// ...)."""


def main(arguments: Sequence[str]) -> int:
    parser = _parser()
    try:
        if not arguments or arguments[0] in ("-h", "--help"):
            parser.print_help()
            return 0 if arguments else FATAL
        if arguments[0] == "tiles":
            from lichen_cli import tiles

            return tiles.main(arguments[1:])
        if arguments[0] != "run":
            raise Usage(f"there are 'lichen batch run' and 'lichen batch tiles' (got {arguments[0]!r})")
        return _run(parser.parse_args(arguments[1:]))
    except Usage as wrong:
        return _fatal(str(wrong))


def _parser() -> Parser:
    parser = Parser(
        prog="lichen batch run",
        description="Runs an operation, a pipeline or a scene on every line of a manifest.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("manifest", help="file of JSON lines or CSV, or a pattern of files")
    add("--out", default=".", metavar="FOLDER", help="where outputs go, and the journal and the summary")
    add("--results", metavar="FILE", help="the journal: what became of each item (default: results.jsonl in --out)")
    for_all = parser.add_argument_group("for lines that do not say it")
    for_all.add_argument("--operation", metavar="NAME")
    for_all.add_argument("--pipeline", metavar="TEXT", help="a pipeline, or @FILE")
    for_all.add_argument("--scene", metavar="FILE", help="a scene in JSON; lines give the pictures that it names")
    for_all.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter; repeatable")
    for_all.add_argument("--output", metavar="TEMPLATE", help="such as {stem}.png; also {id}, {suffix} and {number}")
    who = parser.add_argument_group("who does it")
    at_a_time = "items at a time (one a processor; with --url two)"
    who.add_argument("--workers", "--concurrency", type=_count, metavar="N", help=at_a_time)
    who.add_argument("--threads", type=_count, metavar="N", help="of one item (default: processors / workers)")
    who.add_argument("--url", metavar="URL", help="a service, instead of this machine")
    who.add_argument("--engine", default="local", metavar="E", help="local, dask, or dask://HOST:PORT of a scheduler")
    again = parser.add_argument_group("again")
    again.add_argument("--resume", action="store_true", help="go on where an earlier run of this journal ended")
    again.add_argument("--retry-failed", action="store_true", help="resume, and try what failed once more")
    again.add_argument("--overwrite", action="store_true", help="forget the journal and do everything anew")
    chosen = "by which methods are chosen; written by the first run (default: times.json beside the journal)"
    again.add_argument("--times", metavar="FILE", help=chosen)
    tries = "of one item, where another may help (2)"
    again.add_argument("--attempts", type=_count, default=2, metavar="N", help=tries)
    limit = parser.add_argument_group("limits")
    limit.add_argument("--item-seconds", type=_seconds, default=600.0, metavar="S", help="of one item (600)")
    limit.add_argument("--item-memory", type=_bytes, metavar="SIZE", help="of the process doing it, such as 2GiB")
    limit.add_argument("--max-failure-rate", type=_rate, metavar="R", help="end early when more than this share failed")
    limit.add_argument("--grace", type=_seconds, default=30.0, metavar="S", help="for items at work at the end (30)")
    share = f"do every Nth item from the Ith (from 0) on (default: {INDEX} and {SHARDS})"
    add("--shard", type=_shard, metavar="I/N", help=share)
    add("--check", action="store_true", help="check the manifest and do nothing")
    add("--quiet", action="store_true", help="no progress")
    add(
        "--json", action="store_true", help="print the summary as JSON on a terminal, too; it is in summary.json anyway"
    )
    return parser


@dataclass(frozen=True)
class _Kept:
    journal: Path
    summary: Path
    times: Path


def _run(given: argparse.Namespace) -> int:
    from lichen_batch import manifest, places
    from lichen_batch.journal import Journal, JournalError, remaining
    from lichen_batch.run import Rules, Stop, run
    from lichen_batch.settled import Unusable
    from lichen_batch.summary import Account

    index, count = given.shard or _indexed()
    try:
        items = manifest.load(given.manifest, _defaults(given), given.out)
    except manifest.InvalidManifest as invalid:
        for line in manifest.told(invalid.flaws):
            print(f"  {line}", file=sys.stderr)
        return _fatal(str(invalid), hopeless=True)
    mine = manifest.shard(items, index, count)
    if given.check:
        print(json.dumps({"items": len(items), "share": len(mine)}))
        return 0
    kept = _kept(given, index, count)
    given.resume |= given.retry_failed
    try:
        journal = Journal(kept.journal)
    except (JournalError, OSError) as wrong:
        return _fatal(str(wrong))
    with journal:
        if not (journal.empty or given.overwrite or given.resume or _in_a_job()):
            raise Usage(f"{kept.journal} is there: --resume goes on with it, --overwrite begins anew")
        try:
            known, mine = _settled(given, kept.times, mine, alone=count == 1)
        except (Unusable, OSError) as wrong:
            return _fatal(str(wrong))
        if given.overwrite:
            journal.clear()
        entries = journal.entries()
        anew = sum(item.id in entries and entries[item.id].digest != item.digest for item in mine)
        if anew:
            why = f"its line, the engine or what {kept.times} holds was another"
            print(f"lichen: {anew} of {len(mine)} done anew: {why}", file=sys.stderr)
        todo = [
            (item, entry.attempts if entry else 0)
            for item, entry in remaining(mine, entries, retry_failed=given.retry_failed)
        ]
        left_out = {item.id for item in mine} - {item.id for item, _ in todo}
        failed_before = sum(not entries[id].ok for id in left_out)
        account = Account(len(mine), len(left_out) - failed_before, failed_before)
        stop = Stop()
        name = "nobody"
        left = 0
        if todo:
            with stop.listening():
                engine = _engine(given, known)
                name = engine.name
                try:
                    with _progress(given.quiet, len(mine), len(left_out), account) as tell:
                        rules = Rules(given.attempts, given.max_failure_rate, given.grace)
                        left = run(todo, len(mine), engine, journal, rules, stop, tell, failed_before)
                finally:
                    engine.end()
        if not left:
            places.sweep([str(kept.times), *(place for item in mine for place in item.outputs.values())])
    status = _status(account, stop)
    summary = account.to_json(left, _why(stop), **_of(given, name, index, count), status=status)
    _tell(summary, kept.summary, as_json=given.json)
    return status


def _settled(
    given: argparse.Namespace, path: Path, items: list[Item], *, alone: bool
) -> tuple[Known | None, list[Item]]:
    """By which times methods are chosen, with the items as they are done by these; a service chooses by its own."""
    from lichen_batch.checking import VERSION
    from lichen_batch.settled import settled

    if given.url is not None:
        return None, items
    found = settled(path, VERSION, anew=given.overwrite and alone and given.times is None)
    version = f"{VERSION}+{found.digest}"
    return found.known, [replace(item, digest=item.digested(version)) for item in items]


def _of(given: argparse.Namespace, engine: str, index: int, count: int) -> dict[str, Any]:
    from lichen_batch.checking import VERSION

    return {"manifest": given.manifest, "shard": f"{index}/{count}", "engine": engine, "version": VERSION}


def _defaults(given: argparse.Namespace) -> Defaults:
    from lichen_batch.manifest import Defaults

    parameters = {}
    for each in given.set:
        name, equals, value = each.partition("=")
        if not name or not equals:
            raise Usage(f"--set takes NAME=VALUE (got {each!r})")
        parameters[name.replace("-", "_")] = value
    pipeline, scene = given.pipeline, given.scene
    if pipeline is not None and pipeline.startswith("@"):
        pipeline = _text(pipeline[1:])
    return Defaults(given.operation, pipeline, None if scene is None else _text(scene), parameters, given.output)


def _text(path: str) -> str:
    try:
        return Path(path).read_text()
    except (OSError, UnicodeDecodeError) as wrong:
        raise Usage(f"{path} cannot be read: {wrong}") from None


def _kept(given: argparse.Namespace, index: int, count: int) -> _Kept:
    """Where the journal and the summary lie: on this machine, since nowhere else can a line be appended."""
    from lichen_batch.places import local

    share = f"-{index}-of-{count}" if count > 1 else ""
    folder = local(given.out)
    if given.results is None and folder is None:
        raise Usage(f"{given.out} is not on this machine: name a journal that is, with --results FILE")
    journal = Path(given.results) if given.results else (folder or Path()) / f"results{share}.jsonl"
    name = journal.name.removesuffix(".jsonl")
    times = f"{name}.times.json" if given.results else "times.json"  # shards choose alike
    return _Kept(
        journal,
        journal.with_name(name.replace("results", "summary") + ".json"),
        Path(given.times) if given.times else journal.with_name(times),
    )


def _engine(given: argparse.Namespace, times: Known | None) -> Engine:
    from lichen.processors import processors
    from lichen_batch import engines
    from lichen_batch.hands import Limits

    workers = given.workers or processors() * (1 if given.url is None else engines.AT_ONCE)
    threads = given.threads or max(1, processors() // workers)
    limits = Limits(given.item_seconds, given.item_memory, threads, times)
    try:
        return engines.choose(given.engine, given.url, workers, limits)
    except (ValueError, OSError) as wrong:
        raise Usage(str(wrong) or f"{given.engine}: nobody answers there") from None


def _progress(quiet: bool, total: int, done: int, account: Any) -> Any:
    from lichen_cli.progress import progress

    return progress(total, done, account, shown=not quiet and sys.stderr.isatty())


def _status(account: Any, stop: Any) -> int:
    if stop.signal is not None:
        return 128 + int(stop.signal)
    if not account.failed and not account.failed_before:
        return 0
    hopeless = account.permanent == account.failed and _in_a_job()
    return HOPELESS if hopeless else SOME_FAILED


def _why(stop: Any) -> str | None:
    import signal

    if stop.signal is not None:
        return signal.Signals(stop.signal).name
    return "too many failures" if stop.failing else None


def _tell(summary: dict[str, Any], path: Path, *, as_json: bool) -> None:
    """As JSON to whatever reads it, and to people in words."""
    from lichen_batch import places
    from lichen_cli.progress import tell

    text = json.dumps(summary, indent=2, ensure_ascii=False) + "\n"
    places.write(str(path), text.encode())
    if as_json or not sys.stdout.isatty():
        print(text, end="")
    if sys.stderr.isatty() or sys.stdout.isatty():
        tell(summary)


def _fatal(sentence: str, *, hopeless: bool = False) -> int:
    print(f"lichen: {sentence}", file=sys.stderr)
    return HOPELESS if hopeless and _in_a_job() else FATAL


def _in_a_job() -> bool:
    """Whether a Kubernetes Indexed Job runs us: then every start is a resumption."""
    return INDEX in os.environ


def _indexed() -> tuple[int, int]:
    index, count = os.environ.get(INDEX, "0"), os.environ.get(SHARDS, "")
    if INDEX in os.environ and not count:
        raise Usage(f"{INDEX} is set and {SHARDS} is not: set it to the job's number of completions")
    return _shard(f"{index}/{count or 1}")


def _shard(text: str) -> tuple[int, int]:
    index, slash, count = text.partition("/")
    if not slash or not (index.isdigit() and count.isdigit()) or not int(index) < int(count):
        raise Usage(f"a shard is I/N, with I from 0 to N-1 (got {text!r})")
    return int(index), int(count)


def _count(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise Usage(f"a whole number of at least 1 is wanted (got {text!r})")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < float("inf"):
        raise Usage(f"seconds above 0 are wanted (got {text!r})")
    return value


def _rate(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 1:
        raise Usage(f"a share from 0 to 1 is wanted (got {text!r})")
    return value


def _bytes(text: str) -> int:
    from lichen_cli.sizes import bytes_of

    return bytes_of(text)
