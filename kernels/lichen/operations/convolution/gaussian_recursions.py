"""What recursions and boxes in place of a Gaussian are predicted to cost and to be wrong by."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from lichen.once import latest
from lichen.operation import Error, InputFacts
from lichen.operations.convolution.boxes import Boxes, boxes, boxes_distance
from lichen.operations.convolution.gaussian_base import Parameters, asked, not_plain, spread, within
from lichen.operations.convolution.recursive import BLOCK
from lichen.operations.convolution.recursive_filters import (
    NARROWEST,
    Filter,
    deriche,
    deriche_extent,
    distance,
    rounding,
    vliet_young,
    vliet_young_extent,
)

RECURSIVE = 1000.0
"""px; wider filters have poles so near to 1 that float32 keeps too little of their distance from it."""


def deriche_filters(p: Parameters, order: float) -> tuple[Filter, Filter]:
    """Down and across, of the largest even order that is not above the knob."""
    down, across = within(p, 1e-2, RECURSIVE)
    return deriche(down, int(order) // 2 * 2), deriche(across, int(order) // 2 * 2)


def vliet_young_filters(p: Parameters, order: float) -> tuple[Filter, Filter]:
    down, across = within(p, NARROWEST, RECURSIVE)
    return vliet_young(down, int(order)), vliet_young(across, int(order))


Filters = Callable[[Parameters, float], tuple[Filter, Filter]]


def recursive_error(filters: Filters) -> Callable[[Parameters, float, InputFacts], Error]:
    """The filters' distances from the Gaussian, the second meeting what the first has made; and rounding."""

    def error(p: Parameters, order: float, facts: InputFacts) -> Error:
        wide, magnitude = spread(p, facts)
        (down, across), (below, beside) = filters(p, order), within(p, 1e-2, RECURSIVE)
        first, second = distance(down, below), distance(across, beside)
        gain, following = 1 + 2 * first, 1 + 2 * second  # no l1 norm is larger: that of the Gaussian is 1
        apart = first * following + second
        rounded = rounding(down, BLOCK, gain) * following + rounding(across, BLOCK, following) * gain
        least = 1.01 * rounded * magnitude
        return Error(1.001 * apart * wide + least, "bound", least)

    return error


PASSED = 80.0
"""Multiply-adds that take as long as moving a sample through one pass along lines."""


Extent = Callable[[float, int], tuple[int, int]]
"""The reach of a filter of some deviation and order, and how many poles it has."""


def recursive_work(extent: Extent, even: int = 1, low: float = NARROWEST) -> Callable[..., float]:
    """Steps of the states, beside what it takes to read, turn and write the image twice; and sums before each line.
    Orders are multiples of `even`, deviations at least `low`."""

    def work(p: Parameters, order: float, facts: InputFacts) -> float:
        total, whole = 0.0, int(order) // even * even
        for sigma, side in asked(p, facts).sides:
            reach, poles = extent(min(max(sigma, low), RECURSIVE), whole)
            total += PASSED + poles * (10.5 + 19 * min(reach / side, 1.0))
        return facts["image"].samples * total

    return work


deriche_work = recursive_work(deriche_extent, 2, 1e-2)
vliet_young_work = recursive_work(vliet_young_extent)


APART: Mapping[str, Mapping[float, float]] = {
    "deriche": {2: 0.016, 4: 2.4e-4, 6: 3.3e-6, 8: 4.9e-8},
    "vliet-young": {3: 9.9e-3, 4: 3.1e-3, 5: 1.0e-3},
    "box3": {0: 0.018, 1: 4.8e-3},
}
"""What one pass errs by at least, over the spread of its input, from a deviation of 1 px to `RECURSIVE`."""


def least_error(method: str) -> Callable[[Parameters, float, InputFacts], float]:
    """Of the worse pass, by whole values of the knob."""
    known = APART[method]
    return lambda p, knob, facts: known.get(knob, 0.0) * _apart(p, facts)


@latest
def _apart(p: Parameters, facts: InputFacts) -> float:
    """What the numbers of `APART` are times; nothing where they say nothing."""
    turned, _, ((down, _), (across, _)), _ = asked(p, facts)
    return spread(p, facts)[0] if turned is None and 1 <= max(down, across) <= RECURSIVE else 0.0


def recursive_unfit(p: Parameters, facts: InputFacts, narrowest: float = 1e-2) -> str | None:
    if reason := not_plain(p, facts):
        return reason
    if facts["image"].extent.nonfinite:
        return "a recursion never forgets NaN or infinity"
    sigmas = [sigma for sigma, _ in asked(p, facts).sides]
    if max(sigmas) > RECURSIVE:
        return f"beyond {RECURSIVE:g} px the poles lie too near to 1 for float32"
    if min(sigmas) < narrowest:
        return f"no such filter is as narrow as {min(sigmas):g} px"
    return None


def vliet_young_unfit(p: Parameters, facts: InputFacts) -> str | None:
    return recursive_unfit(p, facts, NARROWEST)


def both_boxes(p: Parameters, extended: float) -> tuple[Boxes, Boxes]:
    down, across = within(p, 0.0, RECURSIVE)
    return boxes(down, extended >= 0.5), boxes(across, extended >= 0.5)


def boxes_error(p: Parameters, extended: float, facts: InputFacts) -> Error:
    image, (wide, magnitude) = facts["image"], spread(p, facts)
    (down, across), (below, beside) = both_boxes(p, extended), within(p, 0.0, RECURSIVE)
    rounding = 1.01 * (down.rounding(image.height) + across.rounding(image.width)) * magnitude
    return Error((boxes_distance(down, below) + boxes_distance(across, beside)) * wide + rounding, "bound", rounding)


def boxes_work(p: Parameters, extended: float, facts: InputFacts) -> float:
    widths = [(boxes(min(sigma, RECURSIVE), extended >= 0.5), side) for sigma, side in asked(p, facts).sides]
    beyond = sum(2 * each.reach / side for each, side in widths)
    return facts["image"].samples * (2 + beyond / 3) * (PASSED + 16)
