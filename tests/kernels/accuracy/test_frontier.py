"""The Pareto front against its definition, on drawn costs with ties, zeros and failures."""

from __future__ import annotations

import math
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from lichen.accuracy.frontier import Cost, compare, dominators, front, prices, worthwhile

LEVELS = st.sampled_from([0.0, 1e-6, 1e-4, 1.1e-4, 1e-2, 1.0, math.nan, math.inf])
COSTS = st.lists(st.builds(Cost, LEVELS, LEVELS), max_size=12)


@given(COSTS)
def test_the_front_is_what_nothing_dominates(costs: list[Cost]) -> None:
    kept = front(costs)
    known = [cost for cost in costs if cost.known]
    assert {costs[i] for i in kept} == {c for c in known if not any(other.dominates(c) for other in known)}
    assert len({costs[i] for i in kept}) == len(kept)
    for i in kept:
        assert i == costs.index(costs[i])  # the first of equals


@given(COSTS)
def test_the_front_runs_from_fast_to_accurate(costs: list[Cost]) -> None:
    kept = [costs[i] for i in front(costs)]
    assert all(a.seconds < b.seconds and a.error > b.error for a, b in pairwise(kept))


@given(COSTS)
def test_who_is_dominated_learns_what_to_take_instead(costs: list[Cost]) -> None:
    kept = front(costs)
    for i, instead in enumerate(dominators(costs)):
        if instead is None:
            assert i in kept or not costs[i].known
        else:
            assert instead in kept
            assert costs[instead].dominates(costs[i]) or costs[instead] == costs[i]
            faster = [j for j in kept if costs[j].seconds < costs[instead].seconds]
            assert all(costs[j].error > costs[i].error for j in faster)


@given(COSTS, st.floats(1, 4), st.floats(0, 0.5))
def test_what_is_worthwhile_is_on_the_front_and_reaches_as_far(costs: list[Cost], gain: float, saving: float) -> None:
    kept, chosen = front(costs), worthwhile(costs, gain=gain, saving=saving)
    assert [i for i in kept if i in chosen] == chosen
    assert chosen[-1:] == kept[-1:]
    for a, b in pairwise(chosen):
        assert costs[b].seconds > costs[a].seconds * (1 + saving)
        assert costs[b].error * gain <= costs[a].error or b == kept[-1]


def test_a_step_that_saves_next_to_nothing_is_not_worthwhile() -> None:
    costs = [Cost(1e-2, 1.00), Cost(1e-4, 1.01), Cost(9e-5, 1.5), Cost(1e-6, 2.0)]
    assert front(costs) == [0, 1, 2, 3]
    assert worthwhile(costs) == [1, 3]


@given(COSTS, LEVELS.filter(math.isfinite))
def test_a_price_is_the_least_time(costs: list[Cost], error: float) -> None:
    (price,) = prices(costs, [error])
    meeting = [cost.seconds for cost in costs if cost.known and cost.error <= error]
    assert price.seconds == min(meeting, default=math.inf)
    assert (price.index is None) == (not meeting)


def test_a_comparison_reads_as_a_sentence() -> None:
    assert compare(Cost(1e-2, 3e-3), Cost(1e-2, 2e-3)) == "1.5 times as fast and as accurate"
    assert compare(Cost(1e-3, 2e-3), Cost(0.0, 2e-3)) == "as fast and exact"
    assert compare(Cost(1e-3, 2e-3), Cost(2e-5, 2e-3)) == "as fast and 50 times as accurate"
