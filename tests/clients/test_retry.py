"""The retry rule, by table and with a clock of the test's own."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lichen_client.errors import ConnectionFailed, TimedOut
from lichen_client.retry import REPEATED, Reply, Retries, Send, Wait, conversation, retry_after

NOW = 1_700_000_000.0  # Tue, 14 Nov 2023 22:13:20 GMT


@pytest.mark.parametrize(
    ("value", "seconds"),
    [
        ("0", 0.0),
        ("7", 7.0),
        (" 120 ", 120.0),
        ("Tue, 14 Nov 2023 22:13:30 GMT", 10.0),
        ("Tue, 14 Nov 2023 22:13:10 GMT", 0.0),
        ("Tuesday, 14-Nov-23 22:13:30 GMT", 10.0),
        ("", None),
        ("-1", None),
        ("1.5", None),
        ("soon", None),
        ("٣", None),
        ("Tue, 99 Nov 2023 22:13:30 GMT", None),
    ],
)
def test_retry_after_is_read_in_both_forms_and_ignored_when_senseless(value: str, seconds: float | None) -> None:
    assert retry_after({"retry-after": value}, NOW) == seconds


def test_retry_after_may_be_absent() -> None:
    assert retry_after({}, NOW) is None


@given(st.text())
def test_no_retry_after_text_raises(value: str) -> None:
    seconds = retry_after({"retry-after": value}, NOW)
    assert seconds is None or seconds >= 0.0


@pytest.mark.parametrize(("tried", "ceiling"), [(1, 0.5), (2, 1.0), (3, 2.0), (5, 8.0), (9, 8.0)])
def test_the_wait_is_drawn_from_zero_to_a_doubling_ceiling(tried: int, ceiling: float) -> None:
    rule = Retries(count=10)
    assert rule.wait(tried, None, lambda low, high: high) == ceiling
    assert rule.wait(tried, None, lambda low, high: low) == 0.0


@pytest.mark.parametrize(
    ("tried", "asked", "waits"),
    [
        (1, 3.0, 3.0),
        (1, 0.1, 0.5),
        (1, 120.0, 120.0),
        (1, 121.0, None),
        (2, None, 1.0),
        (3, None, None),
        (3, 1.0, None),
    ],
)
def test_a_server_is_left_alone_as_long_as_it_asks_but_not_beyond_patience(
    tried: int, asked: float | None, waits: float | None
) -> None:
    assert Retries(count=2).wait(tried, asked, lambda low, high: high) == waits


class Told:
    """Drives a conversation with scripted outcomes and a clock that moves only by waiting."""

    def __init__(self, *outcomes: Reply | ConnectionFailed, timeout: float = 60.0, duration: float = 0.0) -> None:
        self.sent = 0
        self.waited: list[float] = []
        self.reply: Reply | None = None
        now = 0.0
        steps = conversation(timeout, Retries(), clock=lambda: now, uniform=lambda low, high: high)
        outcome: Reply | ConnectionFailed | None = None
        remaining = list(outcomes)
        try:
            while True:
                step = steps.send(outcome)
                if isinstance(step, Wait):
                    self.waited.append(step.seconds)
                    now += step.seconds
                    outcome = None
                else:
                    assert isinstance(step, Send)
                    assert step.deadline == timeout
                    self.sent += 1
                    now += duration
                    outcome = remaining.pop(0)
        except StopIteration as end:
            self.reply = end.value


def reply(status: int, **headers: str) -> Reply:
    return Reply(status, {name.replace("_", "-"): value for name, value in headers.items()}, bytearray())


@pytest.mark.parametrize("status", [200, 204, 304, 400, 401, 403, 404, 405, 409, 413, 415, 422, 431, 500, 501, 505])
def test_final_statuses_are_not_tried_again(status: int) -> None:
    told = Told(reply(status), reply(200))
    assert (told.sent, told.reply and told.reply.status) == (1, status)


@pytest.mark.parametrize("status", sorted(REPEATED))
def test_passing_statuses_are_tried_twice_again(status: int) -> None:
    told = Told(reply(status), reply(status), reply(200))
    assert (told.sent, told.waited, told.reply and told.reply.status) == (3, [0.5, 1.0], 200)


def test_the_last_refusal_is_given_to_the_caller() -> None:
    told = Told(reply(503), reply(502), reply(429))
    assert (told.sent, told.reply and told.reply.status) == (3, 429)


def test_a_lost_connection_is_tried_again() -> None:
    told = Told(ConnectionFailed("reset"), TimedOut("connect"), reply(200))
    assert (told.sent, told.reply and told.reply.status) == (3, 200)


def test_a_connection_lost_three_times_is_an_error_that_says_so() -> None:
    lost = ConnectionFailed("reset")
    with pytest.raises(ConnectionFailed, match=r"reset \(3 tries, 60 s allowed\)") as raised:
        Told(lost, lost, lost)
    assert not isinstance(raised.value, TimedOut)


@pytest.mark.parametrize(("asked", "status"), [("121", 503), ("61", 429), ("60", 503)])
def test_a_wait_beyond_patience_or_deadline_is_not_begun(asked: str, status: int) -> None:
    told = Told(reply(status, retry_after=asked), reply(200))
    assert (told.sent, told.waited, told.reply and told.reply.status) == (1, [], status)


def test_a_wait_within_both_is_kept_to() -> None:
    assert Told(reply(503, retry_after="59"), reply(200)).waited == [59.0]


def test_a_failure_at_the_end_of_the_time_is_a_timeout() -> None:
    with pytest.raises(TimedOut, match=r"1 try, 5 s allowed"):
        Told(ConnectionFailed("reset"), timeout=5.0, duration=5.0)


def test_the_deadline_spans_all_tries() -> None:
    told = Told(reply(503), reply(503), reply(200), timeout=10.0, duration=6.0)
    assert (told.sent, told.reply and told.reply.status) == (2, 503)
