"""The error table says what is: a part of it is computed again, and every figure keeps what the methods state.

Of every operation that is one example, by every method at its finest, by one at its coarsest, and in all stores."""

from __future__ import annotations

from pathlib import Path

import pytest

from lichen.calibration import table
from lichen.calibration.corpus import typical
from lichen.calibration.sweep import PRECISION, ends, errors, settings
from lichen.calibration.table import Entry, Table
from lichen.calibration.variants import STORES
from lichen.catalogue import operations

OPERATIONS = operations()
AGAIN = "run `lichen calibrate --errors --operation NAME` and look at what changed"


def _cheapest(name: str) -> int:
    """The example whose truth is soonest known."""
    operation, entries = OPERATIONS[name], table.load().of(name)

    def cost(entry: Entry) -> float:
        parameters = operation.validate(operation.examples[entry.example])
        parameters = operation.sized(parameters, entry.size, entry.size)
        return operation.truth_seconds(parameters, typical(operation, parameters, entry.size).facts)

    return min(entries, key=lambda entry: (cost(entry), entry.example)).example


def test_every_setting_of_every_operation_is_in_it() -> None:
    for name, operation in OPERATIONS.items():
        entries = table.load().of(name)
        known = {(entry.method, entry.knob) for entry in entries if entry.precision == PRECISION}
        assert known == {(each.method.name, each.knob) for each in settings(operation)}, f"{name}: {AGAIN}"
        assert {entry.example for entry in entries} == set(range(len(operation.examples))), f"{name}: {AGAIN}"
    assert {entry.operation for entry in table.load().entries} == set(OPERATIONS)


def test_every_example_is_in_it_with_every_store() -> None:
    known: dict[tuple[str, int], set[str]] = {}
    for entry in table.load().entries:
        known.setdefault((entry.operation, entry.example), set()).add(entry.precision)
    assert [example for example, found in known.items() if found != {PRECISION, *STORES}] == []


def test_another_processor_s_last_digit_is_no_drift_and_all_else_is() -> None:
    kept = _entry(largest=2.25e-7, typical_rms=3e-8, stated=8.8e-7)
    assert kept.drift(_entry(largest=3.0e-7, typical_rms=5e-8)) == []
    assert len(kept.drift(_entry(largest=4e-7, typical_rms=3e-8))) == 1
    assert len(kept.drift(_entry(largest=2.25e-7, typical_rms=1e-7))) == 1
    coarse = _entry(largest=1e-3, typical_rms=1e-4)
    assert coarse.drift(_entry(largest=1.09e-3, typical_rms=0.91e-4)) == []
    (better,) = coarse.drift(_entry(largest=0.8e-3, typical_rms=1e-4))
    assert "largest was 0.001, is 0.0008" in better
    seen = _entry(delta_e=2.0, flip=0.02)
    assert seen.drift(_entry(delta_e=2.2, flip=0.022)) == []
    assert len(seen.drift(_entry(delta_e=2.5, flip=0.03))) == 2
    assert "delta_e was 2, is none" in seen.drift(_entry(flip=0.02))[0]
    assert not _entry(mismatched=1).holds
    assert _entry(mismatched=1, precision="fixed8").holds


def test_every_four_bits_divide_the_error_of_a_store_by_sixteen() -> None:
    kept = {entry.precision: entry for entry in table.load().of("transfer", 0)}
    for coarse, fine in (("fixed8", "fixed12"), ("fixed12", "fixed16")):
        assert kept[coarse].rms / kept[fine].rms == pytest.approx(16, rel=0.15)


def test_no_error_is_larger_than_stated() -> None:
    broken = [entry for entry in table.load().entries if not entry.holds]
    assert not broken


@pytest.mark.parametrize("name", sorted({entry.operation for entry in table.load().entries}))
def test_what_it_says_is_found_again(name: str) -> None:
    example = _cheapest(name)
    kept = {(entry.method, entry.knob, entry.precision): entry for entry in table.load().of(name, example)}
    drifted = []
    for found in errors(OPERATIONS[name], example, next(iter(kept.values())).size, ends):
        entry = kept[found.method, found.knob, found.precision]
        assert found.holds, found
        drifted += entry.drift(found)
    assert not drifted, "\n".join([f"{name}, example {example}: {AGAIN}", *drifted])


def _entry(**changes: object) -> Entry:
    values: dict[str, object] = {
        "operation": "blur", "example": 0, "method": "exact", "knob": None, "precision": "float32", "size": 64,
        "largest": 1.23456e-5, "worst_image": "noise", "p999": 1e-5, "rms": 1e-6, "typical_rms": 1e-6,
        "stated": 1.234561e-5, "kind": "bound", "mismatched": 0,
    }  # fmt: skip
    return Entry(**(values | changes))  # type: ignore[arg-type]


def test_three_digits_break_no_promise() -> None:
    for stated in (1.234561e-5, 1.0004e-3, 9.996e-1, 9.9999e9, 0.0):
        entry = _entry(largest=stated, stated=stated)
        (read,) = table.parse(Table((entry,)).to_text()).entries
        assert read.holds
        assert stated <= read.stated <= stated * 1.02


def test_a_line_for_each_entry_in_order() -> None:
    entries = (_entry(method="b"), _entry(method="a", knob=0.5), _entry(method="a", knob=0.25), _entry(operation="a"))
    text = Table(entries).to_text()
    assert len(text.splitlines()) == len(entries) + 2
    read = table.parse(text).entries
    assert [(e.operation, e.method, e.knob) for e in read] == [
        ("a", "exact", None), ("blur", "a", 0.25), ("blur", "a", 0.5), ("blur", "b", None)
    ]  # fmt: skip
    assert Table(read).to_text() == text


def test_saving_leaves_other_operations_alone(tmp_path: Path) -> None:
    path = tmp_path / "errors.json"
    table.save([_entry(operation="one"), _entry(operation="two")], path)
    table.save([_entry(operation="two", largest=1e-6)], path)
    one, two = table.parse(path.read_text()).entries
    assert (one.operation, one.largest) == ("one", 1.23e-5)
    assert (two.operation, two.largest) == ("two", 1e-6)
