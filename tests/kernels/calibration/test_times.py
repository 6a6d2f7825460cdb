"""Measured times: found from runs, kept in a folder, used by plans, and left aside where they make no sense."""

from __future__ import annotations

import json
import os
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

import lichen
from lichen.accuracy import times
from lichen.calibration import turns
from lichen.calibration.calibrate import Outcome, calibrate
from lichen.calibration.corpus import typical
from lichen.calibration.fit import Sample, fit, misses
from lichen.calibration.kinds import NAME, PLAIN, compared, general, known, save
from lichen.calibration.pace import Pace
from lichen.calibration.timing import QUICK, THOROUGH, Cell, Plan, Timing, cells
from lichen.calibration.turns import REPEATS, Effort, timed
from lichen.catalogue import operation, operations
from lichen.image import Image
from lichen.kind import kind
from lichen.operation import Rate
from lichen.operations.streamlines import streamlines

SHORT = Plan(longest=0.002, cells=3, passes=1)


@pytest.fixture
def steady(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that always runs at its usual pace."""
    monkeypatch.setattr(Pace, "paced", lambda self, run: run())


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LICHEN_TIMES", str(tmp_path / "times"))
    return tmp_path / "times"


# --------------------------------------------------------------------------------------------------------- the rates


@pytest.mark.parametrize("rate", [Rate(1e-4, 2e-9), Rate(0.0, 1e-7), Rate(5e-4, 1e-12)])
def test_a_rate_is_found_from_noisy_runs(rate: Rate) -> None:
    rng = np.random.default_rng(0)
    work = 10 ** rng.uniform(3, 9, 60)
    noise = np.exp(np.abs(rng.normal(0, 0.05, 60)) + (rng.random(60) < 0.1) * 2)
    samples = [Sample(w, (rate.start + rate.step * w) * n) for w, n in zip(work, noise, strict=True)]
    found = fit(samples)
    for w in (1e3, 1e6, 1e9):
        assert found.start + found.step * w == pytest.approx(rate.start + rate.step * w, rel=0.12)
    assert misses(found, samples) <= 12


def test_a_rate_is_never_negative() -> None:
    assert fit([Sample(1e6, 1e-3), Sample(1e3, 2e-3)]).step > 0
    assert fit([Sample(1e3, 1e-6), Sample(1e6, 2e-3)]).start >= 0
    assert fit([Sample(1e3, 1e-6)]).start >= 0


# ----------------------------------------------------------------------------------------------------------- storage


def test_what_is_stored_is_read_and_added_to() -> None:
    assert times.current("numpy") == {}
    times.store("numpy", {("gaussian", "fir"): Rate(1e-4, 2e-11)})
    path = times.store("numpy", {("lic", "rk2"): Rate(0.0, 1e-9)})
    assert path == times.path_of("numpy")
    assert times.current("numpy") == {("gaussian", "fir"): Rate(1e-4, 2e-11), ("lic", "rk2"): Rate(0.0, 1e-9)}
    assert times.current("opencl") == {}
    assert [each.name for each in path.parent.iterdir()] == [path.name]
    assert times.pace("numpy") == ()
    apart = Rate(1e-4, 2e-11, {"cafe": Rate(2e-4, 3e-11)})
    times.store("numpy", {("gaussian", "fir"): apart}, [1e-3, 2e-3])
    assert (times.current("numpy")["gaussian", "fir"], times.pace("numpy")) == (apart, (1e-3, 2e-3))


def test_what_another_process_stores_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    path = times.store("numpy", {("gaussian", "fir"): Rate(1e-4, 2e-11)})
    assert path is not None
    assert len(times.current("numpy")) == 1
    told = json.loads(path.read_text())
    told["rates"] += [["lic", "rk2", *told["rates"][0][2:]]]
    path.write_text(json.dumps(told))
    monkeypatch.setattr(times, "AGAIN", 0.0)
    assert {name for name, _ in times.current("numpy")} == {"gaussian", "lic"}


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{", '{"rates": 3}', '{"rates": [["a", "b", 1]]}', '{"rates": [["a", "b", NaN, 1], ["a", "c", 1, -1]]}'],
)
def test_a_file_that_makes_no_sense_is_left_aside(folder: Path, text: str) -> None:
    folder.mkdir()
    times.path_of("numpy").write_text(text)
    assert times.current("numpy") == {}
    times.store("numpy", {("gaussian", "fir"): Rate(1e-4, 2e-11)})
    assert len(times.current("numpy")) == 1


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_that_cannot_be_written_is_no_error(folder: Path) -> None:
    folder.parent.chmod(0o500)
    assert times.store("numpy", {("gaussian", "fir"): Rate(1e-4, 2e-11)}) is None
    assert times.current("numpy") == {}


def test_a_folder_that_cannot_be_is_no_error(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.write_text("a file stands where the folder should")
    assert times.store("numpy", {("gaussian", "fir"): Rate(1e-4, 2e-11)}) is None
    assert times.current("numpy") == {}


# ------------------------------------------------------------------------------------------------------------- plans


def test_plans_use_what_was_measured() -> None:
    image = np.random.default_rng(1).random((64, 64), np.float32)
    slow, quick = Rate(5.0, 1e-3), Rate(1e-9, 1e-15)
    for name, other in (("fir", "dct"), ("dct", "fir")):
        times.store("numpy", {("gaussian", name): quick, ("gaussian", other): slow})
        plan = lichen.explain("gaussian", image, sigma=2.0, max_error=1e-3, device="numpy")
        assert plan.method.startswith(name)
        assert plan.seconds < 1e-6
    assert lichen.explain("gaussian", image, sigma=2.0, device="numpy", method="fir").seconds > 5


def test_requests_of_a_kind_have_their_own_times() -> None:
    image, told = np.ones((64, 64), np.float32), {"sigma": 2.0, "border": "wrap"}
    own = kind(operation("gaussian").validate(told), ["image"])
    times.store("numpy", {("gaussian", "fir"): Rate(1e-3, 1e-15, {own: Rate(7.0, 1e-15)})})
    found = [
        lichen.explain("gaussian", image, device="numpy", method="fir", **{**told, **further}).seconds
        for further in ({}, {"sigma": 3.0}, {"border": "clamp"}, {"sigma_x": 3.0})
    ]
    assert found == pytest.approx([7.0, 7.0, 1e-3, 1e-3], rel=1e-3)


# ------------------------------------------------------------------------------------------------------- calibration


@pytest.mark.parametrize("name", operations())
@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_cells_cover_every_method_with_short_runs(name: str, backend: str) -> None:
    chosen = cells(operation(name), backend, THOROUGH)
    owner, taken = operation(name), set()
    for example in owner.examples:
        parameters = owner.sized(owner.validate(example), 32, 32)
        facts = typical(owner, parameters, 32).facts
        fit = [method.name for method in owner.methods.values() if method.unfit(parameters, facts) is None]
        taken |= {(method, kind(parameters, facts)) for method in fit}
    assert taken
    assert {(cell.method, cell.kind) for cell in chosen} == taken
    assert len(set(chosen)) == len(chosen)
    for way in taken:
        own = [cell.predicted for cell in chosen if (cell.method, cell.kind) == way]
        assert max(own) <= THOROUGH.longest or len(own) == 1
    quick = cells(owner, backend, QUICK)
    assert {cell.method for cell in quick} == {method for method, _ in taken}
    for method in {cell.method for cell in quick}:
        own = [cell for cell in quick if cell.method == method]
        assert len({(cell.example, cell.knob) for cell in own}) == 1
        assert len(own) <= 2
        assert max(cell.predicted for cell in own) <= QUICK.longest or len(own) == 1


def test_kinds_that_were_not_measured_are_known_by_one_that_was() -> None:
    told = {"plain": Rate(1e-3, 1e-9), "masked": Rate(2e-3, 5e-9), "small": Rate(0.0, 3e-9)}
    twice = compared(told, "plain", [Sample(work, 2 * told["plain"].seconds(work)) for work in (1e3, 1e7)], 2.0)
    for name, rate in told.items():
        assert (twice[name].start, twice[name].step) == pytest.approx((2 * rate.start, 2 * rate.step), rel=1e-3)
    runs = [Sample(work, 1e-3 + 12e-9 * work) for work in (1e3, 1e7)]
    slow = compared(told, "small", runs)  # four times as slow as the table, of which half is believed
    assert slow["masked"].seconds(1e9) == pytest.approx(2 * told["masked"].seconds(1e9), rel=0.1)
    assert compared(told, "unheard", runs) == {}
    alone = compared({PLAIN: told["plain"]}, "any", [Sample(work, told["plain"].seconds(work)) for work in (1e3, 1e7)])
    assert alone[PLAIN].step == pytest.approx(1e-9, rel=1e-3)


def test_methods_that_run_the_same_are_timed_together() -> None:
    timing = Timing(operation("gaussian"), "numpy", QUICK)
    for place, (cell, kept) in enumerate(timing.seconds.items()):
        kept.extend([1e-3 * (1 + place % 3) + 1e-11 * cell.work] * 3)
    rates = timing.rates()
    assert {method for _, method in rates} == set(operation("gaussian").methods)
    assert rates["gaussian", "deriche"] == rates["gaussian", "vliet-young"]
    assert rates["gaussian", "deriche"] != rates["gaussian", "fir"]


def test_a_kind_that_takes_as_long_as_the_others_is_none() -> None:
    """Few runs of each tell it apart by chance alone; what is slower by more than that is no part of the others."""
    timing = Timing(operation("gaussian"), "numpy", SHORT)
    fir = {cell: kept for cell, kept in timing.seconds.items() if cell.method == "fir"}
    odd = min(cell.kind for cell in fir)
    for place, (cell, kept) in enumerate(fir.items()):
        scatter = 1.1 if place % 2 else 0.9
        kept.extend([(1e-3 + 1e-11 * cell.work) * (5 if cell.kind == odd else scatter)] * 3)
    rate = timing.rates()["gaussian", "fir"]
    assert set(rate.kinds) == {odd}
    for each, times_as_long in (("", 1), (odd, 5)):
        assert rate.seconds(1e6, each) == pytest.approx(times_as_long * 1.01e-3, rel=0.15)


def test_kinds_are_written_down_at_the_pace_of_the_table(tmp_path: Path) -> None:
    """Some operations are measured later than others, on a machine that is slower just then."""
    rows = [row for row in json.loads(files("lichen.calibration").joinpath(NAME).read_text()) if row[0] == "numpy"]
    ((_, usual),) = [row for row in rows if len(row) == 2]
    times.store("numpy", {("premultiply", "exact"): Rate(2e-4, 4e-9)}, [2 * each for each in usual])
    written = [row for row in json.loads(save(tmp_path / NAME).read_text()) if row[0] == "numpy"]
    assert written[0] == rows[0]
    changed = [new for new in written if new not in rows]
    assert changed == [["numpy", "premultiply", "exact", {PLAIN: [1e-4, 2e-9]}]]


def test_the_table_of_kinds_is_of_this_catalogue() -> None:
    listed = json.loads(files("lichen.calibration").joinpath(NAME).read_text())
    rows = [row for row in listed if len(row) == 4]
    for backend in ("opencl", "numpy"):
        (usual,) = [row[1] for row in listed if len(row) == 2 and row[0] == backend]
        assert general(backend, [2 * each for each in usual]) == pytest.approx(2.0)
    for backend, name, method, own in rows:
        assert operation(name).methods[method].rates[backend]
        assert known(backend, name, method).keys() == own.keys()
    told = {(name, each) for _, name, _, own in rows for each in own}
    plain = {name for name, each in told if each == PLAIN}
    examples = set()
    for owner in operations().values():
        for example in owner.examples:
            parameters = owner.sized(owner.validate(example), 32, 32)
            examples.add((owner.name, kind(parameters, typical(owner, parameters, 32).inputs)))
    found = [each for each in examples if each in told or each[0] in plain]
    # Of operations that were given another parameter the kinds have other names until they are measured again.
    assert len(found) > 0.75 * len(examples)


@pytest.mark.usefixtures("steady")
def test_calibration_measures_every_method_and_goes_on_where_it_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Cell, "run", lambda cell, backend: cell.predicted)
    chosen, outcome = [operation("premultiply"), operation("transfer")], Outcome()
    for step in calibrate(chosen, ["numpy"], SHORT, outcome):
        if step.operation == "transfer":
            break
    assert set(times.current("numpy")) == {("premultiply", "exact")}

    again = Outcome()
    steps = list(calibrate(chosen, ["numpy"], SHORT, again))
    assert {step.operation for step in steps} == {"transfer"}
    assert steps[-1].done == steps[-1].total
    assert (again.resumed, again.kept) == (1, True)
    assert again.samples == len(cells(operation("transfer"), "numpy", SHORT))
    assert {name for name, _ in times.current("numpy")} == {"premultiply", "transfer"}
    assert {method for name, method in times.current("numpy") if name == "transfer"} == {*operation("transfer").methods}

    third = Outcome()
    list(calibrate(chosen, ["numpy"], SHORT, third))
    assert third.resumed == 0


def test_what_a_slow_machine_takes_counts_as_it_would_be_at_its_usual_pace(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]

    def elapse(seconds: float) -> float:
        now[0] += seconds
        return seconds

    monkeypatch.setattr("lichen.calibration.pace.time.perf_counter", lambda: now[0])
    slow = [1.0]
    beside = Pace([lambda: elapse(1e-3 * slow[0]), lambda: elapse(2e-3)], known=[1e-3, 2e-3])
    assert beside.paced(lambda: elapse(5.0)) == pytest.approx(5.0)
    slow[0] = 4.0
    found = [beside.paced(lambda: elapse(5.0 * 2)) for _ in range(9)]
    assert found[0] == pytest.approx(10.0)  # one slow run may be anything
    assert found[-1] == pytest.approx(5.0)


def test_every_run_is_of_a_picture_that_was_never_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """What an operation keeps of a picture is no part of the time that a new one takes."""
    followed: list[object] = []

    def lines(image: Image, p: object) -> list[object]:
        followed.append(image)
        return []

    monkeypatch.setattr(streamlines, "_lines", lines)
    for _ in range(2):
        Cell("streamlines", 2, "direct", None, 32, 0.0).run("numpy")
    assert len(followed) == 2


def test_a_disturbed_run_is_made_again() -> None:
    measured = Timing(operation("premultiply"), "numpy", SHORT)
    answers = iter([False, *[True] * 100])
    steps = list(measured.steps(lambda: next(answers)))
    assert len(steps) == measured.runs + 1
    assert all(len(kept) == SHORT.passes for kept in measured.seconds.values())


def test_what_short_runs_cannot_tell_is_known_from_elsewhere() -> None:
    same = [Sample(1e3, 4e-3), Sample(1e3, 4.1e-3), Sample(1e3, 3.9e-3)]
    assert fit(same).step < 1e-9
    scaled = fit(same, Rate(1e-3, 1e-6))
    assert scaled.start + 1e3 * scaled.step == pytest.approx(4e-3, rel=0.05)
    assert scaled.step == pytest.approx(2e-6, rel=0.05)
    telling = [Sample(n, 1e-4 + 2e-9 * n) for n in (1e3, 1e4, 1e5, 1e6, 1e7)]
    for wrong in (Rate(1e-4, 1e-8), Rate(1e-4, 4e-10)):
        assert fit(telling, wrong).step == pytest.approx(2e-9, rel=0.1)


@pytest.mark.usefixtures("steady")
def test_a_machine_quicker_than_foretold_gets_longer_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Cell, "run", lambda cell, backend: cell.predicted / 50)
    quick = Timing(operation("premultiply"), "numpy", Plan(longest=0.004, cells=3, passes=3))
    planned = set(quick.seconds)
    assert len(list(quick.steps())) == quick.runs
    (added,) = set(quick.seconds) - planned
    assert 2 * max(cell.predicted for cell in planned) < added.predicted <= 50 * 0.004
    assert len(quick.seconds[added]) == 1
    monkeypatch.setattr(Cell, "run", lambda cell, backend: cell.predicted)
    foretold = Timing(operation("premultiply"), "numpy", Plan(longest=0.004, cells=3, passes=3))
    assert len(list(foretold.steps())) == foretold.runs == 4 * len(foretold.seconds)


@pytest.mark.usefixtures("steady")
def test_no_run_is_begun_that_would_take_far_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[float] = []

    def run(cell: Cell, backend: str) -> float:
        ran.append(50 * cell.predicted)
        return ran[-1]

    monkeypatch.setattr(Cell, "run", run)
    monkeypatch.setattr("lichen.calibration.timing.known", lambda *told: {})
    allowed = Plan(longest=0.016, cells=6, passes=3)
    slow = Timing(operation("premultiply"), "numpy", allowed)
    planned = set(slow.seconds)
    assert max(50 * cell.predicted for cell in planned) > 4 * allowed.longest
    list(slow.steps())
    assert max(ran) <= 4 * allowed.longest
    instead = set(slow.seconds) - planned
    assert instead
    assert max(50 * cell.predicted for cell in instead) <= allowed.longest


def test_calls_take_turns_as_often_as_is_affordable() -> None:
    ran: list[str] = []

    def fails() -> None:
        raise ValueError("no such border\nfurther lines")

    calls = {"quick": lambda: ran.append("quick"), "slow": lambda: ran.append("slow"), "fails": fails}
    found = timed(calls, Effort((2, 2), seconds=5.0, turn=0.0, longest=1.0))
    assert ran == ["quick"] * 2 + ["slow"] * 2 + ["quick", "slow"] * 2
    assert (found["fails"].failed, found["slow"].failed) == ("no such border", None)
    assert found["quick"].seconds > 0
    ran.clear()
    assert timed(calls, Effort((2, 2), seconds=0.0, turn=0.0, longest=1.0))["quick"].seconds > 0
    assert ran == ["quick"] * 2 + ["slow"] * 2
    ran.clear()
    timed({"quick": calls["quick"]}, Effort((2, 5), seconds=60.0, turn=1.0, longest=1.0))
    assert len(ran) == 2 + 5 * REPEATS


@pytest.mark.parametrize(("first", "told"), [(2.0, 1e-3), (turns.BUILT, turns.BUILT)])
def test_what_a_first_run_builds_is_not_its_time(first: float, told: float, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = iter([first, *[1e-3] * 100])
    monkeypatch.setattr(turns, "_seconds", lambda call: next(taken))
    found = timed({"built": lambda: None}, Effort((2, 2), seconds=0.1, turn=0.0, longest=0.5))
    assert found["built"].seconds == told


def test_times_are_lower_quartiles_of_runs() -> None:
    measured = Timing(operation("premultiply"), "numpy", SHORT)
    for number, kept in enumerate(measured.seconds.values(), 1):
        kept.extend([number, 1e3, 99.0, number, number])
    assert [sample.seconds for sample in measured.samples()["exact"]] == [*range(1, len(measured.seconds) + 1)]
