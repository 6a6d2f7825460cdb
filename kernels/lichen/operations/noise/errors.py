"""What a sum of octaves can be wrong by: roundings counted through the sum, and what the knob leaves out.

A basis states the error of one octave in units of the roundoff u, counted over its arithmetic. The sum adds it with
each octave's amplitude, a ridge also with the weight that the octave before it gave. Places that are moved are wrong by
what moves them, which counts by the slope of the noise. Derivatives count by the frequency of their octave; where an
octave goes in by its magnitude, or the basis has creases itself, a rounding beside the crease turns a slope over, and
nothing less than twice the slope can be promised."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from lichen.operation import ROUNDING, Error
from lichen.operations.noise.basis import Basis
from lichen.operations.noise.octaves import Cut, cut, visible
from lichen.operations.noise.parameters import Fractal, Output

DOUBLE = 2.0**-53


@dataclass(frozen=True, slots=True)
class Wrong:
    """Of the sum, and of its derivatives per px."""

    value: float
    slope: float


def factor(p: Any) -> float:
    return 2.0 if p.fractal is Fractal.BILLOW else 1.0


def steepest(p: Any, basis: Basis[Any], shown: Cut) -> float:
    """Bound of the derivative of the sum along x or y, per px."""
    own = _steepest(p, basis, shown, p.fractal)
    return own * (1 + 2 * p.warp * _steepest(p, basis, shown, Fractal.FBM)) if p.warp else own


def _steepest(p: Any, basis: Basis[Any], shown: Cut, fractal: Fractal) -> float:
    slope, total, weight = basis.slope(p), 0.0, 0.0
    by = factor(p) if fractal is p.fractal else 1.0
    for octave in shown.computed:
        rise = octave.kept * slope * max(octave.frequency)
        if fractal is Fractal.RIDGED:
            signal = weight + 2 * rise
            total, weight = total + 2 * octave.amplitude * signal, 2 * signal
        else:
            total += by * octave.amplitude * rise
    return total + 2 * weight if fractal is Fractal.RIDGED else total


def _rounded(p: Any, basis: Basis[Any], computed: Cut, unit: float, moved: float, fractal: Fractal) -> Wrong:
    """Roundings of the sum; `moved` px is how wrong places are."""
    value = slope = weight = 0.0
    rounded, steep, by = basis.rounding(p) * unit, basis.slope(p), factor(p)
    wrong_slope = by * ((basis.slope_rounding(p) or 0.0) + 4 * steep) * unit
    for octave in computed.computed:
        far = max(octave.frequency)
        away = 2 * steep * (moved * far + 4 * unit * (1 + p.warp * far) * (p.warp > 0))
        own = min(rounded + away, 2.0)
        if fractal is Fractal.RIDGED:
            signal = min(2 * (octave.kept * own + 3 * unit) + weight + 2 * unit, 1.0)
            value += octave.amplitude * (2 * signal + 4 * unit)
            weight = min(2 * signal, 1.0)
        else:
            value += (by * octave.kept * own + 4 * unit) * octave.amplitude
        slope += octave.amplitude * octave.kept * far * wrong_slope
    for octave in computed.left if fractal is Fractal.RIDGED else ():
        value += octave.amplitude * (2 * weight + 6 * unit)
        weight = min(2 * weight + 2 * unit, 1.0)
    return Wrong(value + (len(computed.computed) + 4) * unit, slope)


def error(p: Any, basis: Basis[Any], tail: float, *, double: bool) -> Error:
    """Of the picture, by the octaves that `tail` leaves."""
    shown = visible(p, basis.lattice(p))
    computed, lost = cut(p, basis.lattice(p), tail)
    unit = DOUBLE if double else ROUNDING
    moving = Fractal.NONE if p.fractal is Fractal.NONE else Fractal.FBM
    drift = p.warp * (_rounded(p, basis, computed, unit, 0.0, moving).value + 4 * unit) if p.warp else 0.0
    if p.warp:
        lost = _moved(p, basis, shown, computed, lost)
    found = _rounded(p, basis, computed, unit, drift, p.fractal)
    half = abs(p.half)
    stored = ROUNDING * (2 * abs(p.middle) + 3 * half)
    rounding = half * found.value + stored
    if p.output is Output.VALUE:
        return Error(half * lost + rounding, "bound", rounding)
    steep = half * steepest(p, basis, shown)
    sloped = half * found.slope + 4 * ROUNDING * steep
    certain = not (p.folds or p.warp or basis.slope_rounding(p) is None)
    gone = shown.computed[len(computed.computed) :]
    dropped = half * basis.slope(p) * factor(p) * sum(o.amplitude * o.kept * max(o.frequency) for o in gone)
    if certain:
        return Error(max(half * lost + rounding, dropped + sloped), "bound", max(rounding, sloped))
    usual = max(half * lost + rounding, dropped + sloped)
    return Error(max(half * lost + rounding, 2 * steep + sloped), "bound", max(rounding, sloped), usual)


def _moved(p: Any, basis: Basis[Any], shown: Cut, computed: Cut, lost: float) -> float:
    """What is lost where places are moved by a sum that lost as much: no more than the range."""
    away = p.warp * sum(2 * o.amplitude * o.kept for o in shown.computed[len(computed.computed) :])
    slope = _steepest(p, basis, shown, p.fractal)
    return min(lost + 2 * away * slope, 2.0) if math.isfinite(slope) else 2.0
