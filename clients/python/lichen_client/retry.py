"""When to try again, and how long to wait: the whole rule, without a socket and without a clock of its own.

`conversation` is a generator. It yields what shall happen next (`Send` or `Wait`), is sent what came of it, and
returns the answer to give to the caller. The blocking and the asynchronous client both drive this one generator.

The rule:

* Every request of this client is safe (it changes nothing on the server), so it may be repeated whatever became of it.
* Tried again: no whole answer, 408, 429, 502, 503 and 504. Everything else is final.
* The wait before try n is drawn evenly from [0, min(longest, first * 2^n)] ("full jitter": clients that failed together
  do not return together), and is never shorter than the server's Retry-After.
* A Retry-After beyond `patience`, or beyond the time left, is not waited for: the refusal is given to the caller,
  who knows better what to do with two minutes.
* One deadline spans all tries and waits.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass

from lichen_client.errors import ConnectionFailed, TimedOut

REPEATED = frozenset({408, 429, 502, 503, 504})


@dataclass(frozen=True, slots=True)
class Reply:
    """A whole answer. `headers` has lower-case names."""

    status: int
    headers: Mapping[str, str]
    body: bytearray


@dataclass(frozen=True, slots=True)
class Send:
    """Send the request now; the whole answer must be there at `deadline` (in the time of `clock`)."""

    deadline: float


@dataclass(frozen=True, slots=True)
class Wait:
    seconds: float


@dataclass(frozen=True, slots=True)
class Retries:
    """How often and how patiently to try again. Times in seconds."""

    count: int = 2
    first: float = 0.5
    longest: float = 8.0
    patience: float = 120.0

    def wait(self, tried: int, retry_after: float | None, uniform: Callable[[float, float], float]) -> float | None:
        """Seconds to wait after `tried` failed tries (1 is the first); None when there shall be no further one."""
        if tried > self.count or (retry_after is not None and retry_after > self.patience):
            return None
        drawn = uniform(0.0, min(self.longest, self.first * 2.0 ** (tried - 1)))
        return max(drawn, retry_after or 0.0)


def retry_after(headers: Mapping[str, str], now: float | None = None) -> float | None:
    """Seconds named by Retry-After, given as a number or as a date; None where it is absent or makes no sense."""
    value = headers.get("retry-after", "").strip()
    if value.isascii() and value.isdigit():
        return float(value)
    if not value:
        return None
    from email.utils import parsedate_to_datetime  # a slow import, rarely wanted

    try:
        moment = parsedate_to_datetime(value).timestamp()
    except (ValueError, OverflowError):
        return None
    return max(0.0, moment - (time.time() if now is None else now))


def conversation(
    timeout: float,
    retries: Retries,
    *,
    clock: Callable[[], float] = time.monotonic,
    uniform: Callable[[float, float], float] = random.uniform,
) -> Generator[Send | Wait, Reply | ConnectionFailed | None, Reply]:
    """Yields steps, is sent the outcome of each `Send`, returns the final answer (of any status).

    Raises the last `ConnectionFailed` when there is no answer at all.
    """
    deadline = clock() + timeout
    tried = 0
    while True:
        outcome = yield Send(deadline)
        if outcome is None:
            raise TypeError("a Send is answered with a Reply or a ConnectionFailed")
        tried += 1
        if isinstance(outcome, Reply):
            if outcome.status not in REPEATED:
                return outcome
            wait = retries.wait(tried, retry_after(outcome.headers), uniform)
        else:
            wait = retries.wait(tried, None, uniform)
        if wait is None or clock() + wait >= deadline:
            if isinstance(outcome, Reply):
                return outcome
            raise _told(outcome, tried, timeout, clock() >= deadline)
        yield Wait(wait)


def _told(failure: ConnectionFailed, tried: int, timeout: float, late: bool) -> ConnectionFailed:
    """The failure with the number of tries, as `TimedOut` where the time is used up."""
    kind = TimedOut if late else type(failure)
    tries = f"{tried} {'try' if tried == 1 else 'tries'}"
    told = kind(f"{failure} ({tries}, {timeout:g} s allowed)")
    told.__cause__ = failure.__cause__ or failure
    return told
