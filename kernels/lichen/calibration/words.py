"""How reports put numbers: errors, times, knobs, names of settings."""

from __future__ import annotations

import math

PLAIN, DOUBLES = "float32", "float64"
SHORT = 1.2
"""Digits that a front must span to speak of digits; one that spans less is told in halves."""


def scientific(value: float, digits: int = 2, plain: float = 0.01) -> str:
    """Short and the same everywhere; without an exponent from `plain` to 1000.

    >>> scientific(0.000123), scientific(1e-3), scientific(0.25), scientific(0.0), scientific(214)
    ('1.2e-4', '1e-3', '0.25', '0', '210')
    """
    if value == 0:
        return "0"
    if not math.isfinite(value):
        return str(value)
    if plain <= abs(value) < 1000:
        return f"{float(f'{value:.{digits}g}'):g}"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return f"{mantissa.rstrip('0').rstrip('.') if '.' in mantissa else mantissa}e{int(power)}"


def label_of(method: str, knob: float | None, precision: str) -> str:
    """
    >>> label_of("fir", 1e-4, PLAIN), label_of("truth", None, DOUBLES)
    ('fir at 1e-4', 'truth, float64')
    """
    name = method if knob is None else f"{method} at {short(knob)}"
    return name if precision == PLAIN else f"{name}, {precision}"


def round_errors(most: float, least: float) -> list[float]:
    """Powers of ten from just above `most` down to above `least`; with twos and fives where they are few.

    >>> round_errors(3e-3, 2e-5), round_errors(0.15, 0.04)
    ([0.01, 0.001, 0.0001], [0.2, 0.1, 0.05])
    """
    digits = math.log10(most / least)
    steps = (1,) if digits >= SHORT else (5, 2, 1)
    first, last = math.ceil(math.log10(most)), math.floor(math.log10(least))
    ladder = [float(f"{step}e{power}") for power in range(first, last - 1, -1) for step in steps]
    above = [error for error in ladder if error >= most]
    return [*above[-1:], *(error for error in ladder if least <= error < most)]


def short(knob: float) -> str:
    """A knob's value as its author wrote it: 1e-4, 0.25, 4096."""
    return f"{knob:g}" if 0.1 <= abs(knob) < 1e6 else scientific(knob, plain=0.1)


def milliseconds(seconds: float) -> str:
    """Two significant digits: 0.042 ms, 1.8 ms, 240 ms; seconds from ten on."""
    value = seconds * 1e3
    if not math.isfinite(value):
        return "-"
    if seconds >= 9.95:
        return f"{seconds:.0f} s"
    return f"{value:.0f} ms" if value >= 9.95 else f"{value:.2g} ms"


def more(ratio: float) -> str:
    """How much longer: as a share below two, as a multiple above.

    >>> more(1.18), more(3.1)
    ('18 % more time', '3.1 times the time')
    """
    if ratio < 1.95:
        return f"{max(0.0, ratio - 1) * 100:.0f} % more time"
    return f"{ratio:.0f} times the time" if ratio >= 9.95 else f"{ratio:.1f} times the time"


def capital(text: str) -> str:
    return text[:1].upper() + text[1:]
