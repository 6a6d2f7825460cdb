"""Distortion of lenses: how far from its centre an image point comes to lie, and back.

Points are in units of the focal length, from the centre of distortion; u is where a pinhole shows them (u = tan theta),
d where the lens does.

* brown_conrady: d = u (1 + k1 r^2 + k2 r^4 + k3 r^6) + tangential terms, r = |u|;
  (2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y).
* division: u = d / (1 + k1 r^2 + k2 r^4), r = |d|.
* kannala_brandt: |d| = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).

Each radial function rises from 0 up to where its derivative first is 0; beyond, the polynomial would fold the image
back over itself, and no lens does. That is the end of the lens: places beyond it are background. Below it a value has
one argument, found by Newton's steps kept inside a bracket that every step halves at least every other time, until it
is known to a rounding. Tangential terms are undone by Newton's method in two dimensions from the radial answer, with
steps halved until the residual falls; a point that does not come within 1e-10 in 60 steps is background and counted.

Sources: Brown, Decentering distortion of lenses, Photogrammetric Engineering 32, 1966; Fitzgibbon, Simultaneous linear
estimation of multiple view geometry and lens distortion, CVPR 2001; Kannala and Brandt, A generic camera model, IEEE
PAMI 28, 2006; Press et al., Numerical Recipes, 2007, section 9.4, for the bracketed steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np

from lichen.operations.warp.maps import Doubles

BRACKETS = 256
"""In which a device begins its searches."""
STEPS = 100
"""Steps that a bracketed search takes at most: 53 halvings give all bits."""
CLOSE = 1e-10
DISTANT = 1e12
"""Squared radius that no image reaches."""
WIDEST = math.pi
"""Of an angle from the axis: no lens sees further than straight back."""


class Model(StrEnum):
    """The formula of a distortion."""

    BROWN_CONRADY = "brown_conrady"
    DIVISION = "division"
    KANNALA_BRANDT = "kannala_brandt"


@dataclass(frozen=True)
class Rising:
    """A function that rises from f(0) = 0 to its value at `end`; neither it nor its derivative is asked for beyond."""

    value: Callable[[Doubles], Doubles]
    slope: Callable[[Doubles], Doubles]
    end: float

    def at(self, x: Doubles) -> Doubles:
        """f(x); NaN beyond the end."""
        inside = x <= self.end
        return np.where(inside, self.value(np.where(inside, x, 0.0)), np.nan)

    @property
    def top(self) -> float:
        """The value at the end; infinite where neither ends."""
        return float(self.value(np.array(self.end))) if math.isfinite(self.end) else math.inf

    def numbers(self, k: tuple[float, ...], largest: float) -> list[float]:
        """For a device: the end, the value there, the coefficients `k` filled up to four, and brackets of the arguments
        of all values up to `largest`: how many, up to which value, and their edges."""
        reached = min(self.top, largest)
        edges = self.solve(np.arange(BRACKETS + 1) * (reached / BRACKETS))
        edges[-1] = self.end if math.isnan(edges[-1]) else edges[-1]
        return [self.end, self.top, *k, *[0.0] * (4 - len(k)), BRACKETS, reached, *edges]

    def solve(self, y: Doubles) -> Doubles:
        """x with f(x) = y >= 0; NaN where no x up to the end has it."""
        y = np.asarray(y, np.float64)
        end = self.end
        if math.isinf(end):
            # It grows at least as its argument; or it is bounded, and what it does not reach has no answer.
            end = max(float(np.nanmax(y, initial=1.0)), 1.0)
            while float(self.value(np.array(end))) < np.nanmax(y, initial=0.0) and end < 1e12:
                end *= 2
        top = float(self.value(np.array(end)))
        there = (y >= 0) & (y <= top)
        wanted = np.where(there, y, 0.0)
        low, high = np.zeros_like(wanted), np.full_like(wanted, end)
        x = np.minimum(wanted, end / 2)
        for turn in range(STEPS):
            off = self.value(x) - wanted
            low, high = np.where(off <= 0, x, low), np.where(off >= 0, x, high)
            with np.errstate(all="ignore"):
                step = x - off / self.slope(x)
            inside = (step > low) & (step < high)
            new = np.where(off == 0, x, np.where(inside, step, (low + high) / 2))
            # A step that barely narrows a wide bracket gives way to a halving at every other turn.
            if turn % 2 and turn > 10:
                new = np.where(off == 0, x, (low + high) / 2)
            done = np.abs(new - x) <= 2e-16 * np.abs(new)
            x = new
            if done.all():
                break
        return np.where(there, x, np.nan)


def _first_root(coefficients: tuple[float, ...]) -> float:
    """The smallest positive root of 1 + c1 s + c2 s^2 + ...; infinite where there is none.

    Its inverse is the largest root of t^n + c1 t^(n-1) + ..., whose companion matrix holds the coefficients undivided.
    """
    roots = np.roots([1.0, *coefficients])
    real = roots.real[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0)]
    largest = float(real.max(initial=0.0))
    return 1 / largest if largest * DISTANT > 1 else math.inf


def odd_polynomial(k: tuple[float, ...], limit: float) -> Rising:
    """x (1 + k1 x^2 + k2 x^4 + ...), as far as it rises, and no further than `limit`."""
    slopes = tuple((2 * i + 3) * each for i, each in enumerate(k))

    def even(x: Doubles, coefficients: tuple[float, ...]) -> Doubles:
        s, sum_ = x * x, np.zeros_like(x)
        for each in reversed(coefficients):
            sum_ = (sum_ + each) * s
        return 1 + sum_

    return Rising(lambda x: x * even(x, k), lambda x: even(x, slopes), min(math.sqrt(_first_root(slopes)), limit))


def division(k: tuple[float, ...]) -> Rising:
    """x / (1 + k1 x^2 + k2 x^4), as far as it rises."""
    k1, k2 = (*k, 0.0, 0.0)[:2]

    def below(x: Doubles) -> Doubles:
        return 1 + x * x * (k1 + k2 * x * x)

    def slope(x: Doubles) -> Doubles:
        s = x * x
        made: Doubles = (1 - s * (k1 + 3 * k2 * s)) / np.square(below(x))
        return made

    pole, turn = _first_root((k1, k2)), _first_root((-k1, -3 * k2))
    end = math.sqrt(min(pole * (1 - 1e-9), turn))
    return Rising(lambda x: x / below(x), slope, end)


@dataclass(frozen=True)
class Lens:
    """A lens without its focal length."""

    model: Model
    k: tuple[float, ...]
    p: tuple[float, float]

    @property
    def radial(self) -> Rising:
        """From |u| to |d|, or for the division model from |d| to |u|, or for kannala_brandt from theta to |d|."""
        return _radial(self.model, self.k)

    def numbers(self, largest: float) -> tuple[float, ...]:
        """See `Rising.numbers`; kept, since pictures of one lens come one after the other."""
        return _numbers(self, largest)

    def answers(self, r: Doubles, *, distorts: bool) -> Doubles:
        """Whether places at these radii have a distorted, or an undistorted, place; without tangential terms."""
        radial = self.radial
        if self.model is Model.KANNALA_BRANDT:
            ahead = radial.end < math.pi / 2
            side = radial.top if ahead else float(radial.value(np.array(math.pi / 2)))
            shown: Doubles = np.arctan(r) <= radial.end if distorts else (r <= side if ahead else r < side)
            return shown
        within: Doubles = r <= (radial.top if (self.model is Model.DIVISION) == distorts else radial.end)
        return within

    def distort(self, x: Doubles, y: Doubles) -> tuple[Doubles, Doubles]:
        """From u to d; NaN beyond the end of the lens."""
        r = np.hypot(x, y)
        match self.model:
            case Model.DIVISION:
                return _scaled(x, y, r, self.radial.solve(r))
            case Model.KANNALA_BRANDT:
                return _scaled(x, y, r, self.radial.at(np.arctan(r)))
            case _:
                dx, dy = _scaled(x, y, r, self.radial.at(r))
                tx, ty = self._tangential(x, y, r * r)
                there = self._determinant(x, y) > 0 if self.p != (0, 0) else np.isfinite(dx)
                return np.where(there, dx + tx, np.nan), np.where(there, dy + ty, np.nan)

    def undistort(self, x: Doubles, y: Doubles) -> tuple[Doubles, Doubles]:
        """From d to u; NaN where the lens shows nothing, or the search did not end."""
        r = np.hypot(x, y)
        match self.model:
            case Model.DIVISION:
                return _scaled(x, y, r, self.radial.at(r))
            case Model.KANNALA_BRANDT:
                theta = self.radial.solve(r)
                ahead = theta < math.pi / 2
                return _scaled(x, y, r, np.where(ahead, np.tan(np.where(ahead, theta, 0.0)), np.nan))
            case _:
                u, v = _scaled(x, y, r, self.radial.solve(r))
                return (u, v) if self.p == (0, 0) else self._newton(x, y, u, v)

    def _tangential(self, x: Doubles, y: Doubles, rr: Doubles) -> tuple[Doubles, Doubles]:
        p1, p2 = self.p
        return 2 * p1 * x * y + p2 * (rr + 2 * x * x), p1 * (rr + 2 * y * y) + 2 * p2 * x * y

    def _jacobian(self, x: Doubles, y: Doubles) -> tuple[Doubles, Doubles, Doubles, Doubles]:
        """Of d by u: xx, xy, yx, yy."""
        s = x * x + y * y
        factor, change = np.ones_like(s), np.zeros_like(s)
        for power, each in enumerate(self.k, start=1):
            factor = factor + each * s**power
            change = change + 2 * power * each * s ** (power - 1)
        p1, p2 = self.p
        xx = factor + x * x * change + 2 * p1 * y + 6 * p2 * x
        yy = factor + y * y * change + 6 * p1 * y + 2 * p2 * x
        mixed = x * y * change + 2 * p1 * x + 2 * p2 * y
        return xx, mixed, mixed, yy

    def _determinant(self, x: Doubles, y: Doubles) -> Doubles:
        xx, xy, yx, yy = self._jacobian(x, y)
        made: Doubles = xx * yy - xy * yx
        return made

    def _newton(self, x: Doubles, y: Doubles, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        """From a first guess; what has none begins at the place itself, brought into the lens."""
        start = np.minimum(1, 0.5 * self.radial.end / np.maximum(np.hypot(x, y), 1e-300))
        u, v = np.where(np.isnan(u), x * start, u), np.where(np.isnan(v), y * start, v)
        error = self._miss(u, v, x, y)
        for _ in range(60):
            if np.all(error[0] <= CLOSE**2) or not np.isfinite(error[0]).any():
                break
            xx, xy, yx, yy = self._jacobian(u, v)
            with np.errstate(all="ignore"):
                determinant = xx * yy - xy * yx
                du = (yy * error[1] - xy * error[2]) / determinant
                dv = (xx * error[2] - yx * error[1]) / determinant
            step = np.ones_like(u)
            for _ in range(12):
                trial = self._miss(u - step * du, v - step * dv, x, y)
                worse = ~(trial[0] < error[0])
                if not worse.any():
                    break
                step = np.where(worse, step / 2, step)
            better = trial[0] < error[0]
            u, v = np.where(better, u - step * du, u), np.where(better, v - step * dv, v)
            error = tuple(np.where(better, new, old) for new, old in zip(trial, error, strict=True))
            if not better.any():
                break
        good = (error[0] <= CLOSE**2) & (self._determinant(u, v) > 0)
        return np.where(good, u, np.nan), np.where(good, v, np.nan)

    def _miss(self, u: Doubles, v: Doubles, x: Doubles, y: Doubles) -> tuple[Doubles, ...]:
        """Squared distance of the distorted point, and its parts; infinite beyond the end of the lens."""
        r = np.hypot(u, v)
        dx, dy = _scaled(u, v, r, self.radial.at(r))
        tx, ty = self._tangential(u, v, r * r)
        ex, ey = dx + tx - x, dy + ty - y
        squared = ex * ex + ey * ey
        return np.where(np.isnan(squared), np.inf, squared), ex, ey


def _scaled(x: Doubles, y: Doubles, r: Doubles, to: Doubles) -> tuple[Doubles, Doubles]:
    """The point moved along its ray from radius r to another; the centre stays."""
    factor = np.divide(to, r, out=np.where(np.isnan(to), np.nan, np.ones_like(r)), where=r > 0)
    return x * factor, y * factor


@lru_cache(64)
def _radial(model: Model, k: tuple[float, ...]) -> Rising:
    if model is Model.DIVISION:
        return division(k)
    return odd_polynomial(k, WIDEST if model is Model.KANNALA_BRANDT else math.inf)


@lru_cache(16)
def _numbers(lens: Lens, largest: float) -> tuple[float, ...]:
    return tuple(lens.radial.numbers(lens.k, largest))
