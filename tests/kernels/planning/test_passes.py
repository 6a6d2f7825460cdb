"""Each pass by itself: what it drops, what that costs at most, and what it predicts."""

from __future__ import annotations

import dataclasses
import itertools
import weakref
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import lichen
from lichen import execution
from lichen.image import Alpha, Extent, Image, Space
from lichen.operation import Facts, Operation
from lichen.planning.budget import Problem, within_error
from lichen.planning.candidates import Candidate, Offers
from lichen.planning.error import errors, total_error, total_seconds
from lichen.planning.graph import Asked, Graph, Node, Output, Request
from lichen.planning.join import join
from lichen.planning.memory import peak_bytes
from lichen.planning.plan import Plan, make_plan
from lichen.planning.prune import cancelled, identity, shared, unread
from lichen.planning.settle import effect

from ..accuracy import drawing

OPERATIONS = dict(lichen.operations())
PICTURE = Facts(64, 96, 3, Space.DATA, Alpha.NONE, Extent(0.0, 1.0, 0))


def node(name: str, operation: str, *sources: str, **parameters: Any) -> Node:
    declared = OPERATIONS[operation]
    names = [each.name for each in declared.inputs]
    return Node(name, declared, declared.validate(parameters), dict(zip(names, sources, strict=False)))


def graph(*nodes: Node, outputs: tuple[str, ...] = (), facts: Facts = PICTURE) -> Graph:
    return Graph({"in": facts}, nodes, {name: Output(name) for name in outputs or (nodes[-1].name,)})


def names(made: Graph | Plan) -> list[str]:
    return [each.name for each in made.nodes]


def dropped(made: Graph | Plan, pass_: str) -> list[str]:
    return [each.node for each in made.decisions if each.pass_ == pass_ and each.action == "dropped"]


# ------------------------------------------------------------------------------------------------ unread and shared


def test_unread_floods_back_from_every_output() -> None:
    made = unread(
        graph(
            node("a", "gaussian", "in", sigma=1),
            node("b", "gaussian", "a", sigma=2),
            node("c", "gaussian", "b", sigma=3),
            node("d", "gaussian", "a", sigma=4),
            outputs=("b", "in"),
        ),
        Request(),
    )
    assert names(made) == ["a", "b"]
    assert dropped(made, "unread") == ["c", "d"]
    assert all(each.saved_ms > 0 for each in made.decisions)


def test_what_a_node_that_reports_reads_is_read() -> None:
    made = unread(
        graph(
            node("a", "levels", "in"),
            node("b", "arrange", "in", flip="both"),
            node("c", "lens_distort", "b"),
            outputs=("a",),
        ),
        Request(),
    )
    assert names(made) == ["a", "b", "c"]
    assert names(made.only("a")) == ["a"]


def test_an_identity_that_depends_on_the_range_is_told_in_the_light_it_is_computed_in() -> None:
    """Display values from -5 to 5 are light from -48 to 48: more than the threshold."""
    wide = dataclasses.replace(PICTURE, space=Space.SRGB, extent=Extent(-5.0, 5.0, 0))
    sharper = node("a", "sharpen", "in", threshold=20)
    assert names(identity(graph(sharper, facts=wide), Request())) == ["a"]
    assert names(identity(graph(sharper, facts=dataclasses.replace(wide, space=Space.DATA)), Request())) == []


def test_equal_work_is_done_once_along_whole_chains() -> None:
    nodes = [
        node(f"{letter}{number}", "gaussian", "in" if number == 1 else f"{letter}{number - 1}", sigma=number)
        for letter, number in itertools.product("ab", (1, 2, 3))
    ]
    made = shared(graph(*nodes, outputs=("a3", "b3")), Request())
    assert names(made) == ["a1", "a2", "a3"]
    assert {name: each.source for name, each in made.outputs.items()} == {"a3": "a3", "b3": "a3"}


@pytest.mark.parametrize("other", [{"sigma": 2}, {"sigma": 1, "border": "clamp"}])
def test_work_that_differs_is_not_shared(other: dict[str, Any]) -> None:
    two = graph(node("a", "gaussian", "in", sigma=1), node("b", "gaussian", "in", **other), outputs=("a", "b"))
    assert names(shared(two, Request())) == ["a", "b"]


# ---------------------------------------------------------------------------------------------------------- identity


def test_identity_says_what_it_saved() -> None:
    made = identity(graph(node("a", "gaussian", "in", sigma=0), node("b", "levels", "a", black=0.1)), Request())
    assert names(made) == ["b"]
    assert made.nodes[0].inputs == {"image": "in"}
    (decision,) = made.decisions
    assert (decision.pass_, decision.node, decision.bound) == ("identity", "a", 0.0)
    assert decision.saved_ms > 0


def test_pairs_that_undo_each_other_are_dropped_inside_out() -> None:
    chain = [
        node("a", "transfer", "in", curve="hlg", direction="encode"),
        node("b", "transfer", "a", direction="encode"),
        node("c", "transfer", "b", direction="decode"),
        node("d", "transfer", "c", curve="hlg", direction="decode"),
        node("e", "levels", "d", black=0.1),
    ]
    made = identity(graph(*chain), Request())
    assert names(made) == ["e"]
    assert dropped(made, "identity") == ["a", "b", "c", "d"]


def test_what_others_read_of_a_pair_stays() -> None:
    made = identity(
        graph(
            node("a", "transfer", "in", direction="encode"),
            node("b", "transfer", "a", direction="decode"),
            node("c", "levels", "a", black=0.1),
            outputs=("b", "c"),
        ),
        Request(),
    )
    assert names(made) == ["a", "c"]
    assert made.outputs["b"].source == "in"


def test_a_pair_passes_on_what_it_inherited() -> None:
    first = dataclasses.replace(node("a", "transfer", "in", direction="encode"), inherited={"image": 1e-3})
    made = cancelled(graph(first, node("b", "transfer", "a", direction="decode")), Request(), "light")
    assert made.outputs["b"].source == "in"
    assert made.outputs["b"].inherited >= 1e-3


# --------------------------------------------------------------------------------------------------------- invisible


@pytest.mark.parametrize(
    ("name", "parameters", "asked", "left_out"),
    [
        ("gaussian", {"sigma": 0.2}, 1e-3, True),
        ("gaussian", {"sigma": 0.3}, 1e-3, False),
        ("saturation", {"amount": 1.0001}, 1e-3, True),
        ("saturation", {"amount": 1.01}, 1e-3, False),
        ("matrix", {"matrix": [[1, 1e-4, 0], [0, 1, 0], [0, 0, 1]]}, 1e-3, True),
        ("levels", {"white": 1.0001}, 1e-3, True),
        ("levels", {"white": 1.01}, 1e-3, False),
        ("mix", {"preset": "contrast", "amount": 1.0005}, 1e-3, True),
        ("hue_rotate", {"angle": 0.001}, 1e-3, True),
    ],
)
def test_what_would_not_be_seen_is_left_out(
    name: str, parameters: dict[str, Any], asked: float, left_out: bool
) -> None:
    plan = make_plan(graph(node("a", name, "in", **parameters)), Request(max_error=asked))
    assert (names(plan) == []) == left_out
    assert dropped(plan, "invisible") == (["a"] if left_out else [])
    assert plan.error.value <= asked
    unpruned = make_plan(graph(node("a", name, "in", **parameters)), Request(max_error=asked, prune=False))
    assert names(unpruned) == ["a"]
    if left_out:
        (decision,) = [each for each in plan.decisions if each.pass_ == "invisible"]
        assert 0 < decision.bound == plan.error.value
        assert decision.saved_ms > 0


def test_a_constant_picture_needs_no_blur() -> None:
    flat = dataclasses.replace(PICTURE, extent=Extent(0.25, 0.25, 0))
    assert names(make_plan(graph(node("a", "gaussian", "in", sigma=9), facts=flat), Request())) == []
    assert names(make_plan(graph(node("a", "gaussian", "in", sigma=9, border="constant"), facts=flat), Request()))


def test_an_operand_of_no_weight_is_not_computed() -> None:
    nodes = node("dear", "gaussian", "in", sigma=40), node("mixed", "mix", "dear", "in", amount=1e-5)
    plan = make_plan(graph(*nodes), Request(max_error=1e-3))
    assert names(plan) == []
    assert dropped(plan, "invisible") == ["mixed"]
    assert dropped(plan, "unread") == ["dear"]
    assert plan.graph.output == "in"


def test_conversions_go_with_what_they_were_for() -> None:
    facts = dataclasses.replace(PICTURE, space=Space.SRGB)
    plan = make_plan(graph(node("a", "gaussian", "in", sigma=0.25), facts=facts), Request(max_error=1e-1))
    assert names(plan) == []
    assert plan.error.value > 0
    assert dropped(plan, "light") == ["in.transfer", "a.transfer"]


def test_what_changes_nothing_is_asked_of_pictures_as_they_reach_it() -> None:
    facts = dataclasses.replace(PICTURE, channels=4, alpha=Alpha.STRAIGHT)
    nodes = node("a", "composite", "in", "in", blend="multiply"), node("b", "premultiply", "a")
    plan = make_plan(graph(*nodes, facts=facts), Request())
    assert dropped(plan, "identity") == [], "what is composed with associated alpha comes back straight"
    assert plan.graph.facts()[plan.graph.output].alpha is Alpha.ASSOCIATED


def test_neither_nan_nor_a_time_asked_for_lets_work_go() -> None:
    blur = node("a", "gaussian", "in", sigma=0.2)
    spoilt = dataclasses.replace(PICTURE, extent=Extent(0.0, 1.0, 3))
    assert names(make_plan(graph(blur, facts=spoilt), Request(max_error=1e-2))) == ["a"]
    assert names(make_plan(graph(blur), Request(max_ms=1e4))) == ["a"]


def test_the_bound_of_a_decision_is_carried_to_the_outputs() -> None:
    nodes = node("a", "gaussian", "in", sigma=0.2), node("b", "levels", "a", white=0.1)
    two = graph(*nodes)
    assert effect(two, two.facts(), "a", 1e-3) == pytest.approx(1e-2)
    read = graph(nodes[0], node("b", "pixel_texture", "a", "in"))
    assert effect(read, read.facts(), "a", 1e-9) >= 1, "coordinates that change a little may show another texel"


SILENT = Operation.__dataclass_fields__["departure"].default
DEPARTING = {name: each for name, each in OPERATIONS.items() if each.departure is not SILENT}


@pytest.mark.parametrize("operation", list(DEPARTING.values()), ids=list(DEPARTING))
def test_no_picture_departs_further_than_declared(operation: Operation[Any]) -> None:
    """Drawn pictures and parameters, against truth."""

    @settings(max_examples=60, derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck))
    @given(st.data())
    def holds(data: st.DataObject) -> None:
        inputs, parameters, facts = data.draw(drawing.cases(operation.name))
        made = operation.evaluate_truth(inputs, parameters)
        for key, most in operation.departure(parameters, facts).items():
            before = inputs[key].pixels.astype(np.float64)
            if made.shape == before.shape and not any(each.extent.nonfinite for each in facts.values()):
                rounding = 1e-12 * max(np.max(np.abs(made)), np.max(np.abs(before)))
                assert np.max(np.abs(made - before)) <= most + rounding, (parameters, key)

    holds()


# ------------------------------------------------------------------------------------------------------------ choose


def cheapest(made: Graph, request: Request, asked: float) -> float:
    """Seconds of the best of all combinations, by trying them."""
    facts = made.facts()
    plan = make_plan(made, request)
    usable = [[offer for offer in each.alternatives if offer.unfit is None] for each in plan.nodes]
    trials = (dict(zip(names(made), each, strict=True)) for each in itertools.product(*usable))
    return min(total_seconds(made, trial) for trial in trials if total_error(made, facts, trial).value <= asked)


@pytest.mark.parametrize("asked", [3e-1, 1e-2, 1e-3, 1e-4])
def test_a_small_graph_is_divided_as_well_as_by_trying_everything(asked: float) -> None:
    few = Asked(method="fir")  # of all methods there would be tens of thousands of combinations
    made = graph(
        node("a", "gaussian", "in", sigma=3).replace(asked=few),
        node("b", "gaussian", "in", sigma=8).replace(asked=few),
        node("c", "mix", "a", "b", amount=0.5),
        node("d", "gaussian", "c", sigma=2).replace(asked=few),
        outputs=("d", "b"),
    )
    request = Request(max_error=asked, prune=False)
    plan = make_plan(made, request)
    assert plan.error.value <= asked
    assert plan.seconds <= 1.25 * cheapest(made, request, asked)


@pytest.mark.parametrize("asked", [1.0, 1e-1, 1e-2, 1e-3])
def test_a_long_chain_meets_its_target_and_uses_it(asked: float) -> None:
    chain = [node(f"n{i}", "gaussian", f"n{i - 1}" if i else "in", sigma=1 + i % 7) for i in range(40)]
    plan = make_plan(graph(*chain), Request(max_error=asked))
    assert plan.error.value <= asked
    accurate = [min(each.alternatives, key=lambda offer: offer.error.value) for each in plan.nodes]
    assert plan.seconds < sum(offer.seconds for offer in accurate)
    assert plan.error.value > asked / 20


def test_every_output_keeps_its_own_quantum() -> None:
    two = graph(node("a", "gaussian", "in", sigma=5), node("b", "levels", "a", gamma=0.5), outputs=("a", "b"))
    wanted = {
        "a": dataclasses.replace(two.outputs["a"], storage=lichen.Storage.UINT16),
        "b": dataclasses.replace(two.outputs["b"], storage=lichen.Storage.UINT8),
    }
    plan = make_plan(two.replace(outputs=wanted), Request())
    assert plan.errors["a"].value - plan.errors["a"].rounding <= 0.25 / 65535
    assert plan.errors["b"].value - plan.errors["b"].rounding <= 0.25 / 255


def test_where_a_modulus_jumps_no_change_passes_for_rounding() -> None:
    """One level more or less moves a whole step of an equalised picture, however little it was."""
    plan = make_plan(
        graph(node("a", "box", "in"), node("b", "levels", "a", black=0.1), node("c", "equalise", "b")), Request()
    )
    assert names(plan) == ["a", "b", "c"]


def test_what_is_inherited_counts() -> None:
    late = dataclasses.replace(node("a", "levels", "in", white=0.5), inherited={"image": 1e-3})
    made = graph(late)
    choice = make_plan(graph(node("a", "levels", "in", white=0.5)), Request()).nodes[0].choice
    assert choice is not None
    found = errors(made, made.facts(), {"a": choice})["a"]
    assert found.value == pytest.approx(2e-3 + choice.error.value)
    problem = Problem(
        made, made.facts(), Request(), {"a": Offers((choice,))}, {"a": 1e-6}, [("an error", lambda e: e.value)]
    )
    assert isinstance(next(iter(within_error(problem).values())), Candidate)


# ------------------------------------------------------------------------------------------------------------ memory


def test_a_chain_holds_three_pictures() -> None:
    size = PICTURE.samples * 4
    chain = [node(f"n{i}", "levels", f"n{i - 1}" if i else "in", black=0.1) for i in range(12)]
    long = graph(*chain)
    assert peak_bytes(long, long.facts()) == 2 * size  # the source goes once it was read
    kept = graph(*chain, outputs=("n0", "n11"))
    assert peak_bytes(kept, kept.facts()) == 3 * size
    fork = graph(
        node("a", "levels", "in", black=0.1),
        node("b", "levels", "in", black=0.2),
        node("c", "mix", "a", "b", amount=0.5),
    )
    assert peak_bytes(fork, fork.facts()) == 3 * size


def test_pictures_are_let_go_after_their_last_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many are alive at once as the plan foresees, the caller's own aside."""
    made: list[weakref.ref[Any]] = []
    most = 0
    method = execution.by_method

    def counted(*arguments: Any) -> np.ndarray:
        nonlocal most
        pixels = method(*arguments).view(type("Watched", (np.ndarray,), {}))
        made.append(weakref.ref(pixels))
        most = max(most, sum(each() is not None for each in made))
        return pixels

    monkeypatch.setattr(execution, "by_method", counted)
    picture = Image(np.random.default_rng(1).random((8, 8, 3), dtype=np.float32))
    text = "|".join(f"levels:black=0.0{number + 1}" for number in range(8))
    result = lichen.run_pipeline(text, picture, device="numpy")["result"]
    assert len(result.plan.nodes) == 8
    assert most == 2


# ---------------------------------------------------------------------------------------------- join and concatenate


MIXED = {"matrix": [[0.8, 0.15, 0.05, 0.1], [0.1, 0.8, 0.1, 0], [0.05, 0.15, 0.8, -0.1]]}
SECOND: dict[str, dict[str, Any]] = {"levels": {"white": (0.7, -0.8, 0.9)}, "saturation": {"amount": 1.4}}


@pytest.mark.parametrize("alpha", list(Alpha))
def test_matrices_that_follow_one_another_are_multiplied(alpha: Alpha) -> None:
    facts = Facts(9, 7, 3 + (alpha is not Alpha.NONE), Space.LINEAR, alpha)
    name = "saturation" if alpha is Alpha.ASSOCIATED else "levels"  # which are of straight colours
    chain = [node("a", "matrix", "in", **MIXED), node("b", name, "a", **SECOND[name])]
    before = graph(*chain, node("c", "hue_rotate", "b", angle=40), facts=facts)
    made = join(before, Request())
    assert [(each.name, each.operation.name) for each in made.nodes] == [("c", "matrix")]
    assert [(each.pass_, each.node) for each in made.decisions] == [("join", "a"), ("join", "b")]
    assert all(0 < each.bound < 1e-13 and each.saved_ms > 0 for each in made.decisions)
    pixels = np.random.default_rng(3).random((9, 7, facts.channels)).astype(np.float32)
    pixels[2, 3, 1] = np.nan
    image = Image(pixels, Space.LINEAR, alpha)
    one, three = (execution.exact(each, {"in": image}) for each in (made, before))
    np.testing.assert_allclose(one, three, rtol=0, atol=1e-14)


def test_what_is_asked_of_a_node_or_read_by_others_is_not_joined() -> None:
    first, second = node("a", "matrix", "in", **MIXED), node("b", "saturation", "a")
    assert names(join(graph(first, second, outputs=("a", "b")), Request())) == ["a", "b"]
    assert names(join(graph(first, second.replace(asked=Asked(method="exact"))), Request())) == ["a", "b"]
    large = node("a", "matrix", "in", matrix=[[1e5, 0, 0], [0, 1e5, 0], [0, 0, 1]])
    assert names(join(graph(large, large.replace(name="b", inputs={"image": "a"})), Request())) == ["a", "b"]
    extreme = dataclasses.replace(PICTURE, extent=Extent(0.0, 1e37, 0))
    less = node("b", "matrix", "a", matrix=[[1e-3, 0, 0], [0, 1e-3, 0], [0, 0, 1]])
    assert names(join(graph(large, less, facts=extreme), Request())) == ["a", "b"]


def test_warps_are_one_only_where_that_is_asked_for() -> None:
    turned = node("a", "affine", "in", matrix=[[1.2, 0.1, -3], [0.05, 1.3, -4]], border="clamp")
    chain = graph(turned, node("b", "homography", "a", matrix=[[1.5, 0.1, -20], [0.1, 1.6, -25], [1e-3, 5e-4, 1]]))
    for prune in (True, False):
        assert names(make_plan(chain, Request(prune=prune))) == ["a", "b"]
        plan = make_plan(chain, Request(prune=prune, concatenate=True))
        assert names(plan) == ["b"]
        (told,) = [each for each in plan.decisions if each.pass_ == "concatenate"]
        assert (told.node, told.action) == ("a", "joined with b")
        assert "asked for" in told.reason
    away = graph(turned, node("b", "affine", "a", matrix=[[1, 0, 30], [0, 1, 0]]))
    plan = make_plan(away, Request(concatenate=True))
    assert names(plan) == ["a", "b"]
    assert [each.action for each in plan.decisions if each.pass_ == "concatenate"] == ["kept apart"]
