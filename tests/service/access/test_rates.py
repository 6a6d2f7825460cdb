"""Rates and proxies: how many requests pass, for whom, and whose word is taken on who asks."""

from __future__ import annotations

from pathlib import Path

import pytest

from lichen_service.access.proxies import Proxies
from lichen_service.access.rates import Rates


def test_a_burst_passes_and_then_the_rate_holds() -> None:
    rates = Rates()
    verdicts = [rates.ask("a", 2.0, 5, now=100.0) for _ in range(6)]
    assert [each.allowed for each in verdicts] == [True] * 5 + [False]
    assert [each.remaining for each in verdicts] == [4, 3, 2, 1, 0, 0]
    assert verdicts[-1].retry_after == pytest.approx(0.5)
    assert rates.ask("b", 2.0, 5, now=100.0).allowed
    assert not rates.ask("a", 2.0, 5, now=100.4).allowed
    assert rates.ask("a", 2.0, 5, now=100.51).allowed
    passed = sum(rates.ask("a", 2.0, 5, now=100.51 + at / 100).allowed for at in range(1000))
    assert passed in (19, 20)


def test_all_processes_of_a_service_count_together(tmp_path: Path) -> None:
    first, second = Rates(tmp_path / "rates"), Rates(tmp_path / "rates")
    assert first.ask("a", 1.0, 2, now=50.0).allowed
    assert second.ask("a", 1.0, 2, now=50.0).allowed
    assert not first.ask("a", 1.0, 2, now=50.0).allowed


@pytest.mark.parametrize(
    ("trusted", "peer", "forwarded", "client"),
    [
        ("", "198.51.100.1", "203.0.113.7", "198.51.100.1"),
        ("198.51.100.0/24", "198.51.100.1", "203.0.113.7", "203.0.113.7"),
        ("198.51.100.0/24", "198.51.100.1", "127.0.0.1, 203.0.113.7", "203.0.113.7"),
        ("198.51.100.0/24", "198.51.100.1", "203.0.113.7, 198.51.100.9", "203.0.113.7"),
        ("198.51.100.0/24", "198.51.100.1", "", "198.51.100.1"),
        ("198.51.100.0/24", "198.51.100.1", "somebody", "198.51.100.1"),
        ("198.51.100.0/24", "203.0.113.9", "203.0.113.7", "203.0.113.9"),
        ("::1, 127.0.0.0/8", "::ffff:127.0.0.1", "2001:db8::1", "2001:db8::1"),
        ("unix", "", "203.0.113.7", "203.0.113.7"),
        ("127.0.0.1", "", "203.0.113.7", ""),
    ],
)
def test_only_trusted_proxies_are_believed(trusted: str, peer: str, forwarded: str, client: str) -> None:
    assert Proxies.parse(trusted).client(peer, {"x-forwarded-for": forwarded}) == client


def test_a_list_of_proxies_that_makes_no_sense_is_refused() -> None:
    with pytest.raises(ValueError, match="somewhere"):
        Proxies.parse("127.0.0.1, somewhere")
