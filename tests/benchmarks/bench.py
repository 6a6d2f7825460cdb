"""Measures how fast everything is, part by part, and writes docs/performance from what was found.

    python tests/benchmarks/bench.py [PART ...] [--page] [--quick]

Every part runs in a process of its own and writes its numbers as soon as it ends, so that parts can be measured one at
a time, whenever the machine is at rest, and one that fails costs nothing but itself. Comparisons run twice, held to
one processor and with all of them: what a library makes of its threads is its affair, but nobody gets more than
another. Progress goes to the standard error. `--page` makes the pages anew from the numbers that lie there.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from measuring import QUICK, quick

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAGES = ROOT / "docs" / "performance"
PARTS = (
    "convolution",
    "tone",
    "colours",
    "warps",
    "compositing",
    "pointwise",
    "streamlines",
    "noises",
    "growth",
    "requests",
    "servers",
    "pipelines",
    "scenes",
    "clients",
    "prediction",
    "gpu",
)
"""In the order of the pages; each is a module of `parts`: `ROWS` to compare, `sections` that it finds, or both."""
LONGEST = 600.0
"""Seconds that one run of one part may take."""


def main() -> int:
    parser = argparse.ArgumentParser(description="Measure how fast everything is and write docs/performance.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all")
    parser.add_argument("--page", action="store_true", help="only make the pages anew from the numbers there are")
    parser.add_argument("--quick", action="store_true", help="everything small and once or twice, to try the suite")
    parser.add_argument("--child", type=Path, metavar="FILE", help=argparse.SUPPRESS)
    parser.add_argument("--compare", type=int, metavar="THREADS", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if unknown := set(given.parts) - set(PARTS):
        parser.error(f"no part is called {', '.join(sorted(unknown))}")
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # so that servers are ended
    if given.child:
        found = alone(given.parts[0], given.compare)
        given.child.write_text(json.dumps(found, default=float), encoding="utf-8")
        return 0
    began = time.perf_counter()
    if given.quick:
        os.environ[QUICK] = "on"
    failed = [] if given.page else [name for name in given.parts or PARTS if not measured(name)]
    import page

    page.write(PAGES)
    tell(f"{time.perf_counter() - began:.0f} s in all")
    if failed:
        tell(f"failed: {', '.join(failed)}")
    return len(failed)


def measured(part: str) -> bool:
    """Whether a part's numbers were found and written."""
    began = time.perf_counter()
    module = importlib.import_module(f"parts.{part}")
    tell(f"{part}: {module.TITLE}")
    sections: list[Any] = []
    if hasattr(module, "ROWS"):
        runs = [child(part, threads) for threads in thread_counts()]
        if None in runs:
            return False
        import sections as made

        sections.append(made.comparison("", runs))
    if hasattr(module, "sections"):
        found = child(part, None)
        if found is None:
            return False
        sections += found
    path = PAGES / f"{part}.json"
    if path.exists() and all(each.get("columns") == [] for each in sections):
        tell(f"{part}: nothing could be measured here; the page keeps what its machine found")
        return True
    document = {
        "part": part,
        "title": module.TITLE,
        "text": (module.__doc__ or "").strip(),
        "seconds": round(time.perf_counter() - began, 1),
        **about(part),
        "sections": sections,
    }
    PAGES.mkdir(parents=True, exist_ok=True)
    text = json.dumps(finite(document), indent=1, ensure_ascii=False) + "\n"
    path.write_text(text, encoding="utf-8")
    tell(f"{part}: {document['seconds']:.0f} s")
    return True


def child(part: str, threads: int | None) -> Any:
    """What a process of its own finds, None where it failed. It is held to as many processors as threads."""
    with tempfile.TemporaryDirectory(prefix="lichen-bench-") as folder:
        out = Path(folder) / "found.json"
        command = [sys.executable, str(HERE / "bench.py"), part, "--child", str(out)]
        command += [] if threads is None else ["--compare", str(threads)]
        try:
            status = subprocess.run(
                command,
                check=False,
                timeout=LONGEST,
                stdout=sys.stderr,
                env=installed(),
                preexec_fn=lambda: hold(threads),
            ).returncode
        except subprocess.TimeoutExpired:
            tell(f"{part} took more than {LONGEST:.0f} s and was ended")
            return None
        if status or not out.exists():
            tell(f"{part} ended with status {status}")
            return None
        return json.loads(out.read_text(encoding="utf-8"))


def installed() -> dict[str, str]:
    """The environment in which modules are compiled once and kept, as an installation has them."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    compiled = Path(tempfile.gettempdir()) / "lichen-bench-compiled"
    return kept | {"PYTHONWARNINGS": "ignore", "PYTHONPYCACHEPREFIX": str(compiled)}


def hold(threads: int | None) -> None:
    """Hold this process and all that it will start to so many processors, before anything counts them."""
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-(threads or 0) :])


def alone(part: str, threads: int | None) -> Any:
    """In the process of its own: a comparison with so many threads, what a module finds when it is held to so many, or
    its sections."""
    module = importlib.import_module(f"parts.{part}")
    if threads is None:
        return module.sections(tell)
    if not hasattr(module, "ROWS"):
        return module.held(tell)
    from comparing import compared

    return compared(module.ROWS, threads, tell)


def thread_counts() -> list[int]:
    """One, and all there are."""
    return sorted({1, len(os.sched_getaffinity(0))})


def about(part: str) -> dict[str, Any]:
    """The machine, the tree and the command, for the caption."""
    from lichen.calibration.gather import machine
    from lichen.opencl.device import status

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, check=False, capture_output=True, text=True).stdout.strip()

    changed = [line for line in git("status", "--porcelain").splitlines() if "docs/performance" not in line]
    backend = "opencl" if status().name else "numpy"
    return {
        "taken": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
        "commit": git("rev-parse", "--short", "HEAD") + (" and changes that are not committed" if changed else ""),
        "command": shlex.join(["make", "bench", f"ARGS={part}"]),
        "quick": quick(),
        "machine": machine(backend, {}),
    }


def finite(value: Any) -> Any:
    """JSON knows no NaN: null stands for it."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: finite(each) for key, each in value.items()}
    return [finite(each) for each in value] if isinstance(value, list | tuple) else value


def tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
