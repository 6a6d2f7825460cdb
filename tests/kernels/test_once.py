"""What is kept is found once, and anew for other arguments."""

from __future__ import annotations

from lichen.once import latest, once


def test_an_attribute_is_found_once_for_each_object() -> None:
    class Counted:
        found = 0

        @once
        def number(self) -> int:
            self.found += 1
            return self.found

    first, second = Counted(), Counted()
    assert [first.number, first.number, second.number] == [1, 1, 1]
    assert first.found == 1


def test_the_latest_is_of_the_very_same_arguments() -> None:
    asked: list[object] = []

    @latest
    def kept(given: list[int], beside: int = 0) -> int:
        asked.append(given)
        return sum(given) + beside

    one, other = [1, 2], [1, 2]
    assert [kept(one), kept(one), kept(other), kept(one)] == [3, 3, 3, 3]
    assert len(asked) == 3
    one.append(4)
    assert kept(one, 1) == 8
    assert kept(one, beside=2) == 9
    assert kept(one) == 7
