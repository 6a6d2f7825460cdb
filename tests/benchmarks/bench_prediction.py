"""How well plans foretell: errors against what is stated, times against what is predicted, choices against the best.

The machine is calibrated first, quickly, as a service does at its first start. Then:

* random requests: any operation, random parameters, sides of 128 to 1536 px, an error asked for or not. Time is that of
  the kernels at that size; error is taken on the same picture made small enough for truth to be quick;
* the time it takes to choose, for parameters met before and for new ones;
* gaussian at many widths and errors: what is chosen beside the quickest way to compute it that meets the error.

Run: python tests/benchmarks/bench_prediction.py [requests]
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

os.environ["LICHEN_TIMES"] = tempfile.mkdtemp(prefix="lichen-times-")

import numpy as np
from interleaved import medians

import lichen
from lichen.accuracy.metrics import difference
from lichen.calibration.calibrate import Outcome, calibrate
from lichen.calibration.corpus import cases, picture, typical
from lichen.calibration.sweep import Setting, backends, settings
from lichen.calibration.timing import QUICK
from lichen.catalogue import operation, operations
from lichen.errors import InvalidRequest, Unattainable
from lichen.image import Image, as_image
from lichen.operation import Facts, Operation
from lichen.planning.choose import choose
from lichen.planning.graph import Graph, Node, Request
from lichen.planning.light import light

LONGEST = 1.5
"""Predicted seconds of one run at most; longer ones are drawn again."""
TRUTH = 0.4
"""Seconds that truth may be guessed to take."""
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
        return {
            name: image.replace(pixels=np.ascontiguousarray(image.pixels[:height, :width]))
            for name, image in whole.items()
        }

    def arguments(self, images: Mapping[str, Image]) -> dict[str, Any]:
        magnitude = next(iter(images.values())).extent.magnitude or 1.0
        wish = {} if self.relative_error is None else {"max_error": self.relative_error * magnitude}
        return {**images, **self.parameters, **wish, "device": self.device}


def drawn(rng: np.random.Generator) -> Iterator[Asked]:
    """Requests without end."""
    known = list(operations().values())
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
        if plan.seconds <= LONGEST and plan.nodes:
            yield asked


def seconds(asked: Asked) -> tuple[float, float]:
    """Predicted and measured, of all nodes; the quickest of five runs, as in calibration."""
    arguments = asked.arguments(asked.images(0, 0))
    predicted = lichen.explain(asked.operation.name, **arguments).seconds
    lichen.run(asked.operation.name, **arguments)
    return predicted, min(lichen.run(asked.operation.name, **arguments).timing["kernel"] for _ in range(5))


def errors(asked: Asked, content: int) -> tuple[float, float, str] | None:
    """Stated and measured, and how the stated one is known; None where the small picture cannot have it."""
    for side in (192, 128, 64, 32, 16):
        images = asked.images(side, content)
        facts = {name: Facts.of(image) for name, image in images.items()}
        if asked.operation.truth_seconds(asked.validated, facts) <= TRUTH:
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


def requests(count: int) -> None:
    rng = np.random.default_rng(2024)
    ratios: dict[str, list[float]] = {}
    kept = {"bound": [0, 0], "estimate": [0, 0]}
    for number, asked in zip(range(count), drawn(rng), strict=False):
        predicted, measured = seconds(asked)
        ratios.setdefault(f"{asked.operation.name}, {asked.device}", []).append(predicted / measured)
        for content in (number, number + 1):
            outcome = errors(asked, content)
            if outcome:
                stated, found, kind = outcome
                kept[kind][0] += found <= stated
                kept[kind][1] += 1
                if found > stated:
                    print(f"exceeded: {asked}: {found:.3g} beyond {stated:.3g} ({kind})", file=sys.stderr)
    print(f"### {count} random requests\n")
    print("| operation, device | requests | within 1.5 | median predicted / measured |\n|---|---:|---:|---:|")
    every = [ratio for each in ratios.values() for ratio in each]
    for name, each in [*sorted(ratios.items()), ("all", every)]:
        within = sum(1 / 1.5 <= ratio <= 1.5 for ratio in each)
        print(f"| {name} | {len(each)} | {within / len(each):.0%} | {statistics.median(each):.2f} |")
    for kind, (held, tried) in kept.items():
        print(f"\nmeasured error <= stated {kind}: {held} of {tried}")


def choosing() -> None:
    """Microseconds of `choose` alone."""
    rng = np.random.default_rng(1)
    print("\n### Choosing, microseconds\n")
    print("| operation | parameters met before | new parameters |\n|---|---:|---:|")
    for chosen in operations().values():
        parameters = chosen.validate(chosen.examples[0])
        facts = typical(chosen, parameters, 64).facts
        rows = []
        for varied in (False, True):
            taken = []
            for _ in range(60):
                values = dict(chosen.examples[0])
                for name, value in values.items():
                    if varied and isinstance(value, float):
                        values[name] = value * float(rng.uniform(0.5, 2))
                try:
                    node = Node(chosen.name, chosen, chosen.validate(values), {key: f"input.{key}" for key in facts})
                except InvalidRequest:
                    continue
                request = Request(backend=backends()[0], target=chosen.name)
                graph = light(Graph.of({f"input.{k}": f for k, f in facts.items()}, (node,), chosen.name), request)
                began = time.perf_counter()
                choose(graph, request)
                taken.append(time.perf_counter() - began)
            rows.append(statistics.median(taken) * 1e6)
        print(f"| {chosen.name} | {rows[0]:.0f} | {rows[1]:.0f} |")


def best(size: int = 512) -> None:
    """The blur that is chosen beside the quickest setting that meets the error."""
    image = as_image(np.tile(picture("photo", 256), (size // 256, size // 256, 1)))
    print(f"\n### gaussian, {size} x {size} x 3, {backends()[0]}: chosen beside the quickest\n")
    print("| sigma | error | chosen | ms | quickest | ms | chosen / quickest |\n|---:|---:|---|---:|---|---:|---:|")
    ratios = []
    for sigma in (0.5, 1, 2, 4, 7, 10, 15, 25, 50, 100, 200):
        for asked in (1e-2, 1e-3, 1e-4, 1e-6):
            contestants = _contestants(image, sigma, asked)
            if not contestants:
                print(f"| {sigma:g} | {asked:g} | none can promise it | | | | |")
                continue
            took = medians([partial(_blurred, setting, image, sigma) for setting in contestants], 9)
            quickest = min(range(len(took)), key=took.__getitem__)
            ratios.append(took[0] / took[quickest])
            names = [f"{setting.method.name} {setting.knob:g}" for setting in contestants]
            print(
                f"| {sigma:g} | {asked:g} | {names[0]} | {took[0]:.2f} | {names[quickest]} | {took[quickest]:.2f} "
                f"| {ratios[-1]:.2f} |"
            )
    print(f"\nnever slower than {max(ratios):.2f} times the quickest")


def _contestants(image: Image, sigma: float, asked: float) -> list[Setting]:
    """What the planner takes, then of each other method the setting with the least work that meets the error."""
    blur, facts = operation("gaussian"), {"image": Facts.of(image)}
    parameters = blur.validate({"sigma": sigma})
    try:
        plan = lichen.explain("gaussian", image, sigma=sigma, max_error=asked, device=backends()[0])
    except Unattainable:
        return []
    choice = plan.nodes[0].choice
    assert choice is not None
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


if __name__ == "__main__":
    began = time.perf_counter()
    for _ in calibrate(list(operations().values()), backends(), QUICK, Outcome()):
        pass
    print(f"Calibrated in {time.perf_counter() - began:.1f} s.\n")
    requests(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
    choosing()
    best()
