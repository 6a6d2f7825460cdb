"""How well plans foretell: errors against what is stated, times against what is predicted, choices against the best.

Operations are calibrated before they are first asked for, quickly, as a service does at its first start. Random
requests ask for any operation with random parameters, sides of 128 to 1536 px, an error or none; random pipelines for
two to four of them in a row. Time is that of the kernels at that size, the lower quartile of nine runs at the machine's
usual pace, as in calibration; error is taken on the same picture made small enough for the definition to be quick. The
blur that is chosen stands beside the quickest way to compute it that meets the error. Two minutes do for two hundred
times where kernels are built already; `LICHEN_PATIENCE=2` gives twice the time, and `LICHEN_PIECES=FOLDER` keeps what
was found there and goes on behind it, with rates and all.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from measuring import Copies, Turns, available, quick
from sections import Section, table

import lichen
from lichen.accuracy import times
from lichen.accuracy.metrics import difference
from lichen.calibration.corpus import cases, picture, typical
from lichen.calibration.pace import lower_quartile, pace
from lichen.calibration.sweep import Setting, backends, settings
from lichen.calibration.timing import QUICK, Timing
from lichen.catalogue import operation, operations
from lichen.errors import InvalidRequest, Unattainable
from lichen.image import Image, Space, as_image
from lichen.memory import aligned
from lichen.operation import Facts, Operation
from lichen.planning.choose import choose
from lichen.planning.graph import TRUTH, Graph, Node, Request
from lichen.planning.light import light

TITLE = "Prediction"
COUNT = 200
"""Of random requests, as far as time allows."""
PATIENCE = 1.0 if quick() else 25.0 * float(os.environ.get("LICHEN_PATIENCE", "1"))
"""Seconds after which errors of random requests, pipelines and blurs begin nothing further."""
TIMES = 5 * PATIENCE
"""Seconds after which no further request is timed."""
LONGEST = 0.3
"""Predicted seconds of one run at most; longer ones are drawn again."""
AFFORDABLE = 0.4
"""Seconds that truth may be guessed to take."""
PIPELINES = 40
"""Random ones, of as many requests."""
LISTED = 40
"""Rows of the table of times."""
SIGMAS = (0.5, 1, 2, 4, 7, 10, 15, 25, 50, 100, 200)
CLOSE = 1.03
"""Where the choice takes so many times as long as the quickest, the two are measured again, four times as often."""
BLUR_ERRORS = (1e-2, 1e-3, 1e-4, 1e-6)
ERRORS = (None, None, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
"""Relative to the magnitude of the input."""


@dataclass(frozen=True)
class Asked:
    """A random request."""

    operation: Operation[Any]
    parameters: Mapping[str, Any]
    shape: tuple[int, int]
    relative_error: float | None
    device: str

    @property
    def validated(self) -> Any:
        return self.operation.validate(self.parameters)

    def images(self, side: int, content: int) -> dict[str, Image]:
        """Its inputs: of its own shape for `side` 0, else pictures of the corpus of that side."""
        if side:
            offered = [case for case in cases(self.operation, self.validated, side) if "hard" not in case.name]
            return dict(offered[content % len(offered)].inputs)
        height, width = self.shape
        whole = typical(self.operation, self.validated, max(self.shape)).inputs
        return {name: image.replace(pixels=aligned(image.pixels[:height, :width])) for name, image in whole.items()}

    def arguments(self, images: Mapping[str, Image]) -> dict[str, Any]:
        first = next(iter(images.values()), None)
        magnitude = (first.extent.magnitude if first else 1.0) or 1.0
        wish = {} if self.relative_error is None else {"max_error": self.relative_error * magnitude}
        return {**images, **self.parameters, **wish, "device": self.device}


def drawn(number: int) -> Asked:
    """Request `number`, the same whenever it is asked for, but for those that take too long by the rates of now."""
    rng, known = np.random.default_rng([2024, number]), list(operations().values())
    while True:
        chosen = known[rng.integers(len(known))]
        parameters = dict(chosen.examples[rng.integers(len(chosen.examples))])
        for name, value in parameters.items():
            if isinstance(value, float | int) and not isinstance(value, bool):
                varied = value * float(np.exp(rng.uniform(-1.5, 1.5)))
                parameters[name] = round(varied) if isinstance(value, int) else varied
        shape = tuple(int(side) for side in np.exp(rng.uniform(np.log(128), np.log(1536), 2)))
        asked = Asked(chosen, parameters, shape, ERRORS[rng.integers(len(ERRORS))], backends()[rng.integers(2) % 2])
        try:
            plan = lichen.explain(chosen.name, **asked.arguments(asked.images(0, 0)))
        except (InvalidRequest, Unattainable):
            continue
        if plan.seconds <= LONGEST and plan.nodes and plan.method != TRUTH:
            return asked


def seconds(asked: Asked) -> dict[str, Any]:
    """Predicted and measured, of all nodes."""
    arguments = asked.arguments(asked.images(0, 0))
    plan = lichen.explain(asked.operation.name, **arguments)

    def run() -> Mapping[str, float]:
        unseen = {name: each.replace() if isinstance(each, Image) else each for name, each in arguments.items()}
        return lichen.run(asked.operation.name, **unseen).timing

    took = usual(run, asked.device)
    return {"method": plan.method, "predicted": plan.seconds, "measured": took}


def usual(run: Callable[[], Mapping[str, float]], device: str) -> float:
    """Seconds of the kernels, the lower quartile of nine runs at the machine's usual pace, as in calibration."""
    run()
    beside = pace(device)
    return lower_quartile([beside.paced(lambda: run()["kernel"]) for _ in range(9)])


def errors(asked: Asked, content: int) -> tuple[float, float, str] | None:
    """Stated and measured, and how the stated one is known; None where the small picture cannot have it."""
    for side in (192, 128, 64, 32, 16):
        images = asked.images(side, content)
        facts = {name: Facts.of(image) for name, image in images.items()}
        if asked.operation.truth_seconds(asked.validated, facts) <= AFFORDABLE:
            break
    arguments = asked.arguments(images)
    try:
        result = lichen.run(asked.operation.name, **arguments)
    except (InvalidRequest, Unattainable):
        return None
    truth = lichen.evaluate_truth(asked.operation.name, **arguments)
    found = difference(result.image.pixels, truth, result.image.alpha)
    allowance = float(np.finfo(np.float32).tiny)
    return result.error.value + allowance, found.largest, result.error.kind


@dataclass(frozen=True)
class Kept:
    """What was found of requests, a line of JSON for each."""

    path: Path

    @property
    def rows(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.path.read_text().splitlines()] if self.path.exists() else []

    def fill(self, count: int, until: float, find: Callable[[int], list[dict[str, Any]]]) -> None:
        """Rows of all requests below `count` that have none."""
        known = {row["number"] for row in self.rows}
        for number in [number for number in range(count) if number not in known]:
            if time.perf_counter() > until:
                return
            with self.path.open("a") as file:
                for row in find(number) or [{}]:
                    file.write(json.dumps({"number": number} | row) + "\n")


def timed(number: int) -> list[dict[str, Any]]:
    asked = drawn(number)
    calibrated(asked.operation, asked.device)
    return [{"operation": asked.operation.name, "device": asked.device} | seconds(asked)]


def calibrated(wanted: Operation[Any], device: str) -> None:
    """Its rates, as a service would have measured them."""
    if not any(name == wanted.name for name, _ in times.current(device)):
        timing = Timing(wanted, device, QUICK)
        for _ in timing.steps():
            pass
        times.store(device, timing.rates(), pace(device).usual)


def chains(number: int) -> list[dict[str, Any]]:
    """Random pipeline `number`: two to four operations on one picture, at their examples."""
    rng, device = np.random.default_rng([2025, number]), backends()[number % len(backends())]
    known = [each for each in operations().values() if each.inputs and each.inputs[0].picture]
    known = [each for each in known if sum(one.required for one in each.inputs) == 1]
    image = as_image(np.tile(picture("photo", 256), (1 + number % 4, 3, 1))).replace(space=Space.SRGB)
    while True:
        steps = [known[rng.integers(len(known))] for _ in range(rng.integers(2, 5))]
        nodes = {
            f"n{at}": {
                "operation": each.name,
                "parameters": dict(each.examples[rng.integers(len(each.examples))]),
                "inputs": {each.inputs[0].name: f"n{at - 1}" if at else "input.image"},
            }
            for at, each in enumerate(steps)
        }
        said = {"nodes": nodes, "outputs": {"result": {"node": f"n{len(steps) - 1}"}}}
        try:
            for each in steps:
                calibrated(each, device)
            plan = lichen.explain_pipeline(said, image, device=device)
        except (InvalidRequest, Unattainable):
            continue
        if plan.seconds <= LONGEST and plan.nodes and TRUTH not in plan.method:
            took = usual(partial(_timing, said, image, device), device)
            name = " | ".join(each.name for each in steps)
            return [{"operation": name, "method": plan.method, "predicted": plan.seconds, "measured": took}]


def _timing(said: Mapping[str, Any], image: Image, device: str) -> Mapping[str, float]:
    return lichen.run_pipeline(said, image, device=device)["result"].timing


def compared(number: int) -> list[dict[str, Any]]:
    """On two pictures."""
    asked, rows = drawn(number), []
    for content in (number, number + 1):
        if outcome := errors(asked, content):
            stated, found, kind = outcome
            rows.append({"operation": asked.operation.name, "stated": stated, "found": found, "kind": kind})
    return rows


def table_of_times(rows: list[dict[str, Any]]) -> Section:
    """The share that is told well, and what is told worst."""
    ratios: dict[str, list[float]] = {}
    for row in rows:
        name = f"{row['operation']}, {row['device']}, {row['method'].partition(';')[0]}"
        ratios.setdefault(name, []).append(row["predicted"] / row["measured"])
    every = [ratio for each in ratios.values() for ratio in each]
    worst = sorted(ratios.items(), key=lambda each: -max(abs(math.log(ratio)) for ratio in each[1]))
    head = ["operation, device, method", "requests", "within 1.5 times", "predicted / measured, median"]
    text = f"Of {len(every)} requests these {min(len(worst), LISTED)} kinds are foretold worst."
    return table(f"Times of {len(rows)} random requests", head, _told([("all", every), *worst[:LISTED]]), text)


def _told(named: list[tuple[str, list[float]]]) -> list[list[Any]]:
    told = []
    for name, each in named:
        if each:
            within = sum(1 / 1.5 <= ratio <= 1.5 for ratio in each)
            told.append([name, len(each), f"{within / len(each):.0%}", f"{statistics.median(each):.2f}"])
    return told


def table_of_pipelines(rows: list[dict[str, Any]]) -> Section:
    ratios = [(row["operation"], row["predicted"] / row["measured"]) for row in rows if "measured" in row]
    worst = sorted(ratios, key=lambda each: -abs(math.log(each[1])))
    named = [("all", [ratio for _, ratio in ratios]), *((name, [ratio]) for name, ratio in worst[:10])]
    head = ["pipeline", "requests", "within 1.5 times", "predicted / measured, median"]
    return table(f"Times of {len(rows)} random pipelines", head, _told(named))


def table_of_errors(rows: list[dict[str, Any]]) -> Section:
    told = []
    for kind in ("bound", "estimate"):
        own = [row for row in rows if row.get("kind") == kind]
        held = sum(row["found"] <= row["stated"] for row in own)
        broken = ", ".join(sorted({row["operation"] for row in own if row["found"] > row["stated"]}))
        told.append([kind, len(own), held, broken])
    return table("Errors of random requests", ["stated as", "pictures", "held", "broken by"], told)


def choosing() -> Section:
    """Microseconds of `choose` alone, for every example of every operation."""
    rng = np.random.default_rng(1)
    taken: dict[str, list[tuple[float, float]]] = {}
    for chosen in operations().values():
        for example in chosen.examples:
            facts = typical(chosen, chosen.validate(example), 64).facts
            known = [_choice(chosen, example, facts) for _ in range(15)]
            unseen = [_choice(chosen, _varied(example, rng), _unlike(facts, rng)) for _ in range(15)]
            if any(known) and any(unseen):
                taken.setdefault(chosen.name, []).append((_middle(known), _middle(unseen)))
    before, every = (np.array(each) for each in zip(*(each for rows in taken.values() for each in rows), strict=True))
    text = (
        f"Microseconds that the choice of a method takes, for {len(every)} examples: {np.median(before):.0f} in the "
        f"median where the same was asked before; {np.median(every):.0f} for parameters and a picture that were never "
        f"seen, of which all but {np.sum(every >= 200)} take less than 200. The slowest examples of those operations "
        "that take longest:"
    )
    slowest = [[name, *(f"{max(each):.0f}" for each in zip(*rows, strict=True))] for name, rows in taken.items()]
    slowest.sort(key=lambda row: -int(row[2]))
    return table("Choosing", ["operation", "asked before, us", "never seen, us"], slowest[:12], text)


def _choice(chosen: Operation[Any], values: Mapping[str, Any], facts: Mapping[str, Facts]) -> float | None:
    """Seconds; None for parameters that are refused."""
    try:
        node = Node(chosen.name, chosen, chosen.validate(values), {key: f"input.{key}" for key in facts})
    except InvalidRequest:
        return None
    request = Request(backend=backends()[0], target=chosen.name, rates=times.current(backends()[0]))
    graph = light(Graph.of({f"input.{key}": each for key, each in facts.items()}, (node,), chosen.name), request)
    began = time.perf_counter()
    choose(graph, request)
    return time.perf_counter() - began


def _middle(taken: list[float | None]) -> float:
    return statistics.median(each for each in taken if each is not None) * 1e6


def _varied(example: Mapping[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Its numbers half or twice as large, and what lies between."""
    return {
        name: value * float(rng.uniform(0.5, 2)) if isinstance(value, float) else value
        for name, value in example.items()
    }


def _unlike(facts: Mapping[str, Facts], rng: np.random.Generator) -> dict[str, Facts]:
    """Those of other pictures of the same sizes."""
    made = {}
    for name, each in facts.items():
        low, high = each.extent.low + float(rng.uniform(0, 0.01)), each.extent.high + float(rng.uniform(0.01, 0.1))
        made[name] = replace(each, extent=replace(each.extent, low=low, high=high))
    return made


def best(until: float, size: int = 512) -> Section:
    """The blur that is chosen beside the quickest setting that meets the error."""
    calibrated(operation("gaussian"), backends()[0])
    image = as_image(np.tile(picture("photo", 256), (size // 256, size // 256, 1)))
    copies, told, ratios = Copies(len(available())), [], []
    turns, again = Turns(copies, rounds=15, longest=1.5), Turns(copies, rounds=60, longest=4.0)
    for sigma, asked in product(SIGMAS, BLUR_ERRORS):
        if time.perf_counter() > until:
            break
        runs = {
            f"{setting.method.name} {setting.knob:g}": partial(_blurred, setting, image, sigma)
            for setting in _contestants(image, sigma, asked)
        }
        if not runs:
            told.append([f"{sigma:g}", f"{asked:g}", "no method promises it", "", "", "", ""])
            continue
        took = {name: each.median * 1e3 for name, each in turns(runs).items()}
        chosen, quickest = next(iter(took)), min(took, key=took.__getitem__)
        if took[chosen] > CLOSE * took[quickest]:
            both = {name: runs[name] for name in (chosen, quickest)}
            took = {name: each.median * 1e3 for name, each in again(both).items()}
            quickest = min(took, key=took.__getitem__)
        ratios.append(took[chosen] / took[quickest])
        fastest = f"{took[quickest]:.2f}"
        told.append([f"{sigma:g}", f"{asked:g}", chosen, f"{took[chosen]:.2f}", quickest, fastest, f"{ratios[-1]:.2f}"])
    title = f"gaussian, {size} x {size} RGB, {backends()[0]}: chosen beside the quickest"
    text = f"Never slower than {max(ratios, default=math.nan):.2f} times the quickest."
    return table(title, ["sigma", "error", "chosen", "ms", "quickest", "ms", "chosen / quickest"], told, text)


def _contestants(image: Image, sigma: float, asked: float) -> list[Setting]:
    """What the planner takes, then of each other method the setting with the least work that meets the error; nothing
    where only the definition meets it."""
    blur, facts = operation("gaussian"), {"image": Facts.of(image)}
    parameters = blur.validate({"sigma": sigma})
    try:
        plan = lichen.explain("gaussian", image, sigma=sigma, max_error=asked, device=backends()[0])
    except Unattainable:
        return []
    choice = plan.nodes[0].choice
    assert choice is not None
    if choice.method not in blur.methods:
        return []
    meeting = [
        setting
        for setting in settings(blur)
        if setting.method.unfit(parameters, facts) is None
        and setting.method.error(parameters, setting.knob, facts).value <= asked
    ]
    meeting.sort(key=lambda setting: setting.method.work(parameters, setting.knob, facts), reverse=True)
    others = {each.method.name: each for each in meeting if each.method.name != choice.method}
    return [Setting(blur.methods[choice.method], choice.knob), *others.values()]


def _blurred(setting: Setting, image: Image, sigma: float) -> object:
    parameters = operation("gaussian").validate({"sigma": sigma})
    return setting.compute(backends()[0], {"image": image}, parameters)


def sections(tell: Callable[[str], None]) -> list[Section]:
    """In a folder of its own, so that the machine's rates stay what they are."""
    with tempfile.TemporaryDirectory(prefix="lichen-") as name:
        folder = Path(os.environ.get("LICHEN_PIECES", name))
        os.environ["LICHEN_TIMES"] = str(folder / "times")
        took, chained, found = (Kept(folder / f"{each}.jsonl") for each in ("times", "pipelines", "errors"))
        took.fill(COUNT, time.perf_counter() + TIMES, timed)
        tell(f"{len(took.rows)} times")
        chained.fill(PIPELINES, time.perf_counter() + PATIENCE, chains)
        tell(f"{len(chained.rows)} pipelines")
        found.fill(COUNT, time.perf_counter() + PATIENCE, compared)
        tell(f"{len(found.rows)} errors")
        made = [table_of_times(took.rows), table_of_pipelines(chained.rows), table_of_errors(found.rows), choosing()]
        tell("gaussian")
        return [*made, best(time.perf_counter() + 3 * PATIENCE)]
