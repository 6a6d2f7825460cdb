"""With which order in its step each rule follows the lines of two fields: where they end, against where they should.

A circular field (-y, x) and a saddle (x, -y), by arc length, in doubles: lines of 8 px from 24 places 5 to 13 px from
the middle, in steps of 2 to 1/8 px. On the circle the end is known; beside the saddle it is that of fourth-order steps
of 1/256 px. Orders are the slopes of straight lines through the logarithms, as far as roundings do not show.

`rk45` is the rule of order 5 that its adaptive steps take, here in equal ones; on both
fields its errors fall with the sixth power, as far as doubles show them. `nearest` and `fixed` look up one vector
a pixel, so they have no order.

The picture is a mean along the line, by trapezoids between samples of the texture: of order 2 in their distance."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from lichen.memory import Array
from lichen.operations.streamlines.adaptive import STAGES
from lichen.operations.streamlines.lic import lic
from lichen.operations.streamlines.lines import Advance, Slope, euler, runge_kutta_2, runge_kutta_4
from lichen.study import Chart, Study, brief

LENGTH = 8.0
STEPS = (2.0, 1.0, 0.5, 0.25, 0.125)
FINEST = 256
"""Steps a pixel of the line that others are held against."""
ROUNDED = 1e-12
"""px; errors below say nothing."""


def dormand_prince(slope: Slope, at: Array, first: Array) -> Array:
    """The solution of order 5."""
    stages = [first]
    for row in STAGES:
        moves = np.asarray(sum(weight * stage for weight, stage in zip(row, stages, strict=True)))
        if row is not STAGES[-1]:
            stages.append(slope(at + moves, 0.0))
    return moves


RULES: Mapping[str, Advance] = {
    "euler": euler,
    "rk2": runge_kutta_2,
    "rk4": runge_kutta_4,
    "rk45": dormand_prince,
}
FIELDS: Mapping[str, Callable[[Array], Array]] = {
    "circular": lambda at: np.stack([-at[:, 1], at[:, 0]], axis=1),
    "saddle": lambda at: np.stack([at[:, 0], -at[:, 1]], axis=1),
}


def starts() -> Array:
    turn, far = np.arange(24) * 2.4, 5.0 + np.arange(24) / 3
    return np.stack([far * np.cos(turn), far * np.sin(turn)], axis=1)


def ends(rule: Advance, field: Callable[[Array], Array], step: float) -> Array:
    def slope(at: Array, part: float) -> Array:
        vectors = field(at)
        return np.asarray(step * vectors / np.linalg.norm(vectors, axis=1, keepdims=True))

    at = starts()
    for _ in range(round(LENGTH / step)):
        at = at + rule(slope, at, slope(at, 0.0))
    return at


def errors(rule: Advance, name: str, wanted: Array) -> list[tuple[float, float]]:
    """Largest distances from where lines should end, by the step."""
    found = [(step, np.linalg.norm(ends(rule, FIELDS[name], step) - wanted, axis=1).max()) for step in STEPS]
    return [(step, brief(float(error))) for step, error in found if error > ROUNDED]


def exact(name: str) -> Array:
    if name != "circular":
        return ends(runge_kutta_4, FIELDS[name], 1 / FINEST)
    at = starts()
    turn = (LENGTH / np.linalg.norm(at, axis=1))[:, None]
    return np.asarray(np.cos(turn) * at + np.sin(turn) * FIELDS[name](at))


def order(curve: list[tuple[float, float]]) -> float:
    """The slope over all but the two longest steps, where the first term of the error leads."""
    steps, wrong = np.log(np.array(curve[2:])).T
    return float(np.polyfit(steps, wrong, 1)[0])


def study() -> Study:
    curves: dict[str, tuple[float | None, ...]] = {}
    orders: dict[str, dict[str, float]] = {}
    for name in FIELDS:
        wanted = exact(name)
        for method, rule in RULES.items():
            curve = errors(rule, name, wanted)
            known = dict(curve)
            curves[f"{method}, {name}"] = tuple(known.get(step) for step in STEPS)
            orders.setdefault(name, {})[method] = round(order(curve), 2)
    told = [
        f"Fitted orders in the step, {name} field: "
        + ", ".join(f"{method} {found:.2f}" for method, found in own.items())
        for name, own in orders.items()
    ]
    mean = "The mean along a line is of order 2 in the distance of its samples, whatever rule the line is followed by."
    return Study(
        sentences=(*(f"{each}." for each in told), mean),
        numbers={"orders": orders},
        charts=(Chart("step, px", "distance from where the line should end, px", STEPS, curves),),
    )


lic.study = study
