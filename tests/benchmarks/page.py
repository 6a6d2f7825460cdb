"""Makes docs/performance from the numbers that lie there: an index, a page for each part, and their plots.

Nothing is measured here. Plots are SVG, with titles and descriptions for those who cannot see them.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import plots
from bench import PARTS
from reasons import REASONS

from lichen.calibration.drawing import Drawing, to_svg
from lichen.calibration.words import scientific

Document = Mapping[str, Any]
Draw = Callable[[str, Drawing], str]
"""Writes a plot by its name and returns the Markdown that shows it."""
INTRODUCTION = """# Speed

Written by `make bench`; `make bench ARGS=warps` measures one part, the others keep their numbers. All contestants of a
comparison take turns in one process, on the same arrays, held to the same processors: one, then all. Ours is
`lichen.run`, planning and checks included. A reference copy is timed before and after every run; runs beside a copy
that was more than 1.5 times slower than usual are dropped, since somebody else had the machine, and counted. Times are
medians of what is left, with the middle half of them; errors are the largest distances from the definition in float64,
on both sides.

The roofline is the least time that this machine needs to move what must be read and written at the bandwidth of a copy,
or to do the multiply-adds that were declared at its measured peak; `of it` is the share that ours reaches.
"""
HEAD = (
    "work",
    "size",
    "by",
    "ms",
    "middle half",
    "error",
    "of it",
    "peer",
    "ms",
    "middle half",
    "error",
    "times as fast",
)
UNSTEADY = "(unsteady)"


def write(folder: Path) -> None:
    """All pages of the parts whose numbers lie in the folder."""
    documents = [
        json.loads((folder / f"{part}.json").read_text(encoding="utf-8"))
        for part in PARTS
        if (folder / f"{part}.json").exists()
    ]
    for document in documents:
        text = "\n".join(_page(document, _drawing(folder, document["part"])))
        (folder / f"{document['part']}.md").write_text(text, encoding="utf-8")
    if documents:
        (folder / "README.md").write_text("\n".join(_index(documents, _drawing(folder, "all"))), encoding="utf-8")


def _drawing(folder: Path, part: str) -> Draw:
    def draw(name: str, drawing: Drawing) -> str:
        (folder / f"{part}-{name}.svg").write_bytes(to_svg(drawing))
        return f"![{drawing.title}]({part}-{name}.svg)"

    return draw


# -------------------------------------------------------------------------------------------------------------- pages


def _page(document: Document, draw: Draw) -> Iterator[str]:
    yield f"# {document['title']}\n"
    yield f"{document['text']}\n"
    headed = ""
    for section in document["sections"]:
        if section["title"] not in ("", headed):
            yield f"## {section['title']}\n"
        headed = section["title"]
        yield from KINDS[section["kind"]](document, section, draw)
    yield f"{caption(document)} [Numbers]({document['part']}.json), [all parts](README.md)."
    yield ""


def caption(document: Document) -> str:
    """Where, when, from which tree and by which command."""
    machine = ", ".join(document["machine"].values())
    when = f"{document['taken']}, in {document['seconds']:.0f} s"
    said = " **Tried with --quick: these figures are worth nothing.**" if document["quick"] else ""
    return f"{machine}. Commit {document['commit']}, {when}: `{document['command']}`.{said}"


def _comparison(document: Document, section: Mapping[str, Any], draw: Draw) -> Iterator[str]:
    for run in reversed(section["runs"]):
        threads, able = run["threads"], run["limits"]
        yield f"## {threads} thread{'s' if threads > 1 else ''}\n"
        peak = f", multiply-adds {able['peak'] / 1e9:.0f} GFLOP/s" if able["peak"] else ""
        best = f"Copies move {able['bandwidth'] / 1e9:.1f} GB/s{peak} at best"
        yield f"{best}; the roofline is what copies beside a run had of it.\n"
        if _paired(run["rows"]):
            yield (
                draw(f"{threads}", plots.ahead(f"{document['title']} beside other libraries", run["rows"], threads))
                + "\n"
            )
        yield _line(HEAD)
        yield "|---|---|---|---:|---:|---:|---:|---|---:|---:|---:|---:|"
        for row in run["rows"]:
            yield from _compared(row)
        yield ""
        kept = [each for row in run["rows"] for each in (row["ours"], *row["peers"]) if "kept" in each]
        dropped, all_runs = sum(each["dropped"] for each in kept), sum(each["kept"] + each["dropped"] for each in kept)
        yield (
            f"Dropped: {dropped} of {all_runs} runs, beside which copies were slow. "
            "An error in brackets: the peer's definition is another."
        )
        alone = sorted({peer["name"] for row in run["rows"] for peer in row["peers"] if peer["alone"]})
        if alone and threads > 1:
            yield f"On one thread whatever it is given: {', '.join(alone)}."
        for work, reason in run["failed"].items():
            yield f"Not measured: {work} ({reason})."
        yield ""
    yield from _behind(section["runs"])


def _behind(runs: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Where a peer is faster, by how much with each number of threads, how much of our time is kernels, and why."""
    rows = {row["work"]: row for run in runs for row in run["rows"]}
    found = {}
    for work, row in rows.items():
        ratios = [
            f"{peer['ms'] / other['ours']['ms']:.2f} of {peer['name']}'s speed on {run['threads']} thread"
            + "s" * (run["threads"] > 1)
            for run in reversed(runs)
            for other in run["rows"]
            for peer in plots.rivals(other)
            if other["work"] == work and peer["ms"] < other["ours"]["ms"]
        ]
        if ratios:
            kernels = f"kernels are {row['kernels_ms']:.3g} of {_ms(row['ours'])} ms"
            found[work] = f"- **{work}**: {', '.join(ratios)}; {kernels}. {REASONS.get(work, 'Not looked into.')}"
    if found:
        yield "## Where a peer is faster, and why\n"
        yield from found.values()
        yield ""


def _paired(rows: Sequence[Mapping[str, Any]]) -> bool:
    """Whether any rival has a time beside ours."""
    return any(plots.rivals(row) for row in rows)


def _compared(row: Mapping[str, Any]) -> Iterator[str]:
    ours = row["ours"]
    mine = [
        row["work"],
        row["size"],
        row["method"],
        _ms(ours),
        _half(ours),
        scientific(ours["error"] or 0),
        f"{row['fraction']:.0%}",
    ]
    for number, peer in enumerate(row["peers"] or [None]):
        left = mine if number == 0 else [""] * len(mine)
        if peer is None:
            theirs = [""] * 5
        elif "failed" in peer:
            theirs = [peer["name"], "not measured", peer["failed"].replace("|", " "), "", ""]
        else:
            error = "(other)" if peer["error"] is None else scientific(peer["error"])
            theirs = [peer["name"], _ms(peer), _half(peer), error, f"**{peer['ms'] / ours['ms']:.2f}**"]
        yield _line([*left, *theirs])


def _ms(figure: Mapping[str, Any]) -> str:
    said = f"{figure['ms']:.0f}" if figure["ms"] >= 100 else f"{figure['ms']:.3g}"
    return said if figure["steady"] else f"{said} {UNSTEADY}"


def _half(figure: Mapping[str, Any]) -> str:
    return f"{figure['low_ms']:.3g} to {figure['high_ms']:.3g}"


def _line(cells: Sequence[Any]) -> str:
    return f"| {' | '.join(_cell(each) for each in cells)} |"


def _cell(value: Any) -> str:
    return plots.plain(value) if isinstance(value, float) else "" if value is None else str(value).replace("|", "\\|")


def _table(document: Document, section: Mapping[str, Any], draw: Draw) -> Iterator[str]:
    if section["text"]:
        yield f"{section['text']}\n"
    if section["columns"]:
        yield _line(section["columns"])
        yield (
            "|"
            + "|".join("---" if _words(section["rows"], at) else "---:" for at in range(len(section["columns"])))
            + "|"
        )
        for row in section["rows"]:
            yield _line(row)
        yield ""


def _words(rows: Sequence[Sequence[Any]], column: int) -> bool:
    """Whether a column holds anything but numbers."""
    return any(
        not str(row[column]).replace(".", "").replace("-", "").replace("e", "").isdigit() for row in rows if row[column]
    )


def _lines(document: Document, section: Mapping[str, Any], draw: Draw) -> Iterator[str]:
    yield draw(section["name"], plots.curves(section)) + "\n"
    if section["text"]:
        yield f"{section['text']}\n"
    if fits := section.get("fits"):
        yield "| curve | exponent | fitted from | expected |\n|---|---:|---:|---|"
        for label, start, exponent, because in fits:
            yield _line([label, "" if exponent is None else f"{exponent:.2f}", start, because])
        yield ""


def _bars(document: Document, section: Mapping[str, Any], draw: Draw) -> Iterator[str]:
    yield draw(section["name"], plots.stacked(section)) + "\n"
    if section["text"]:
        yield f"{section['text']}\n"


KINDS: Mapping[str, Callable[[Document, Mapping[str, Any], Draw], Iterator[str]]] = {
    "comparison": _comparison,
    "table": _table,
    "lines": _lines,
    "bars": _bars,
}


# -------------------------------------------------------------------------------------------------------------- index


def _index(documents: Sequence[Document], draw: Draw) -> Iterator[str]:
    yield INTRODUCTION
    compared = [(document, run) for document in documents for run in _widest(document)]
    if compared:
        yield "## Beside other libraries\n"
        threads = compared[0][1]["threads"]
        chosen = [row for _, run in compared for row in run["rows"] if row["work"] in HIGHLIGHTS]
        if _paired(chosen):
            yield draw("highlights", plots.ahead("Lichen beside other libraries", chosen, threads)) + "\n"
            yield from _highlights(chosen)
        yield "| part | comparisons | Lichen is faster in | median of times as fast | slower than |"
        yield "|---|---:|---:|---:|---|"
        for document, run in compared:
            yield _summary(document, run)
        yield ""
    yield "## All parts\n"
    yield "| part | | commit | taken |\n|---|---|---|---|"
    for each in documents:
        yield _line([f"[{each['title']}]({each['part']}.md)", sentence(each["text"]), each["commit"], each["taken"]])
    yield ""
    yield f"{', '.join(documents[0]['machine'].values())}."
    yield ""


def sentence(text: str) -> str:
    """Its first, on one line."""
    return " ".join(text.split()).partition(". ")[0].rstrip(".")


HIGHLIGHTS = (
    "gaussian, sigma 1, RGBA",
    "gaussian, sigma 5, RGBA",
    "gaussian, sigma 50, RGBA",
    "convolve, 7 x 7 dense, RGBA",
    "median, 5 x 5, RGB",
    "transfer, sRGB decode, RGB",
    "table3d, 33^3 tetrahedral, RGB",
    "convert, sRGB to Lab",
    "homography, bicubic, RGBA",
    "resize, a quarter, lanczos3, RGBA",
    "composite, over, RGBA",
    "lic, nearest, step 1, 1024 px",
    "lic, rk4, step 1, 1024 px",
    "perlin_noise, 8 octaves, single",
)
"""Rows that the index and the README show."""


def _widest(document: Document) -> list[Mapping[str, Any]]:
    """The runs with the most threads."""
    return [section["runs"][-1] for section in document["sections"] if section["kind"] == "comparison"]


def _summary(document: Document, run: Mapping[str, Any]) -> str:
    pairs = [(row, peer, peer["ms"] / row["ours"]["ms"]) for row in run["rows"] for peer in plots.rivals(row)]
    ratios = [ratio for *_, ratio in pairs]
    behind = [f"{peer['name']} in {row['work']} ({ratio:.2f})" for row, peer, ratio in pairs if ratio < 1]
    name = f"[{document['title']}]({document['part']}.md)"
    if not ratios:
        return _line([name, 0, 0, "", ""])
    return _line(
        [name, len(ratios), sum(ratio >= 1 for ratio in ratios), f"{statistics.median(ratios):.1f}", "; ".join(behind)]
    )


def _highlights(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A table of one line for each, with its first peer."""
    yield "| work, float32 | Lichen, ms | error | peer | ms | error | times as fast |"
    yield "|---|---:|---:|---|---:|---:|---:|"
    for row in rows:
        ours = row["ours"]
        for peer in plots.rivals(row)[:1]:
            error = "(other)" if peer["error"] is None else scientific(peer["error"])
            name = f"{peer['name']} (1 thread)" if peer["alone"] else peer["name"]
            cells = [row["work"], _ms(ours), scientific(ours["error"] or 0), name, _ms(peer), error]
            yield _line([*cells, f"{peer['ms'] / ours['ms']:.2f}"])
    yield ""
