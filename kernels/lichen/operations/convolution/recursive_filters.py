"""Symmetric filters that a few recursions compute, how far they are from a Gaussian, and how they round.

Each is a sum of damped waves, h[n] = Re sum over k of a[k] p[k]^|n| with |p| < 1, normalised to sum to 1: a recursion
c[n] = p c[n - 1] + x[n] from either end of a line computes one of them, whatever the width.

* `deriche`: the Gaussian exp(-x^2 / 2) for x >= 0 as a sum of `order` exponentials, taken at x = n / sigma. Deriche's
  form; his coefficients minimise a squared error, these the l1 norm that the error of a blur is bounded by, and there
  are some for more exponentials than his four.
* `vliet_young`: the poles of an all-pole filter run forwards and backwards, powers of a prototype's with the exponent
  that gives the filter exactly the variance sigma^2. In partial fractions it is the same sum of damped waves. As a
  cascade, whose feedback coefficients lose |1 - p|^order of their digits, it would need doubles for wide kernels.

Since both the filter and the Gaussian sum to 1, a result changes by at most half the l1 norm of their difference times
the spread of the input: `distance` sums it, with the very poles that float32 holds.

Sources: Deriche, Recursively implementing the Gaussian and its derivatives, INRIA report 1893 (1993); van Vliet, Young
and Verbeek, Recursive Gaussian derivative filters, ICPR 1998; Getreuer, IPOL 3 (2013), for the error as an l1 norm.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from lichen.operation import ROUNDING
from lichen.operations.convolution.gaussian_weights import BARELY, half_kernel

Complex = npt.NDArray[np.complex128]

_EXPONENTIALS = {
    2: ((0.9229434082725071 - 2.2421931520827436j, 1.3475647278861258 - 0.8448809135580678j),),
    4: (
        (1.699499264146391 - 4.135295072148182j, 1.8304925036949884 - 0.6346407659004298j),
        (-0.7010759740355241 + 0.3617954751946j, 1.775739756581996 - 2.003266265854167j),
    ),
    6: (
        (3.2314679956992625 - 7.920633309923234j, 2.213997758701188 - 0.528730055913212j),
        (-2.4042235472779048 + 1.1389596315426633j, 2.185469500857933 - 1.6219212516840582j),
        (0.17272990139545996 + 0.0257082529637791j, 2.118111385595135 - 2.864259547732955j),
    ),
    8: (
        (6.314652094667587 - 15.551157962399497j, 2.5408232965959976 - 0.46260724282831106j),
        (-6.268312055153759 + 2.8972216102523523j, 2.522401199669343 - 1.4054699660874381j),
        (0.9776379869456457 + 0.2473085783024902j, 2.4823207208637927 - 2.4111379106847117j),
        (-0.023978399693391772 - 0.021360584846827457j, 2.410077548099213 - 3.578315579797239j),
    ),
}
"""By the number of exponentials: pairs (a, d) of exp(-x^2 / 2) = Re sum of a exp(-d x), the conjugates merged."""

_PROTOTYPES = {
    3: (1.4165 + 1.00829j, 1.86543 + 0j),
    4: (1.13228 + 1.28114j, 1.78534 + 0.46763j),
    5: (0.8643 + 1.45389j, 1.61433 + 0.83134j, 1.87504 + 0j),
}
"""Poles of van Vliet, Young and Verbeek for sigma = 2, by order; of conjugates one."""
NARROWEST = 0.5
"""px: no power of the prototypes' poles has a smaller variance, with some margin."""


@dataclass(frozen=True, eq=False)
class Filter:
    """h[n] = Re sum of `weights` x `poles`^|n|; it sums to 1. Its poles are numbers of float32."""

    poles: Complex
    weights: Complex

    @classmethod
    def of(cls, poles: Sequence[complex], weights: Sequence[complex]) -> Filter:
        held = np.array(poles, np.complex64).astype(np.complex128)
        sums = [(a * (1 + p) / (1 - p)).real for a, p in zip(weights, held.tolist(), strict=True)]
        return cls(held, np.array(weights) / sum(sums))

    @cached_property
    def damping(self) -> float:
        """What the wave that lasts longest loses with every sample."""
        slowest: float = max(map(abs, self.poles.tolist()))
        return max(slowest, 1e-300)

    @property
    def reach(self) -> int:
        """Samples after which a state has forgotten all but 1e-12 of itself."""
        return _forgotten(math.log(self.damping))

    def response(self, count: int) -> npt.NDArray[np.float64]:
        """h[0], h[1] ... h[count - 1]: of powers p^(s i + j), each the product of two of which there are few."""
        logs, side = [cmath.log(pole or 1e-300) for pole in self.poles.tolist()], math.isqrt(count - 1) + 1
        powers = np.exp(np.multiply.outer([*logs, *[side * each for each in logs]], np.arange(side)))
        near, far = powers[: len(logs)], powers[len(logs) :]
        made: npt.NDArray[np.float64] = (self.weights * far.T @ near).real.ravel()[:count]
        return made


@lru_cache(maxsize=256)
def rounding(filtered: Filter, block: int, gain: float) -> float:
    """Of one pass over values of magnitude 1 in float32, at most; `gain` is no less than the response's l1 norm.

    A state is at most C = 1 / (1 - |p|). A step rounds two products and two sums of its parts, and each of these
    errors dies away as the state itself does; so do those of the state that a line begins with, which is summed
    from the smallest weight on. The result adds two parts of every state of both ends, by rounded weights; where it
    is computed in blocks, `block` products more.
    """
    poles, total = filtered.poles.tolist(), 0.0
    for pole, weight in zip(poles, filtered.weights.tolist(), strict=True):
        damped = 1 / (1 - abs(pole))
        turned = (1 + abs(pole.imag)) * damped
        state = (math.hypot(turned + 1, turned) + 2 * damped + 2) * damped
        total += abs(weight) * (2 * state + (8 * len(poles) + 4) * damped)
    return 1.01 * ROUNDING * (total + block * gain)


@lru_cache(maxsize=256)
def deriche(sigma: float, order: int) -> Filter:
    """`order` 2, 4, 6 or 8."""
    pairs = _EXPONENTIALS[order]
    return Filter.of([cmath.exp(-exponent / sigma) for _, exponent in pairs], [weight for weight, _ in pairs])


@lru_cache(maxsize=256)
def deriche_extent(sigma: float, order: int) -> tuple[int, int]:
    """The reach of that filter, and how many poles it has, without making it."""
    exponents = [exponent.real for _, exponent in _EXPONENTIALS[order]]
    return _forgotten(-min(exponents) / sigma), len(exponents)


@lru_cache(maxsize=256)
def vliet_young_extent(sigma: float, order: int) -> tuple[int, int]:
    """As `deriche_extent`; nobody needs the exponent to its last digit for it."""
    return _forgotten(-_SLOWEST[order] / _power(sigma, order, 1e-4)), len(_PROTOTYPES[order])


def _forgotten(damping: float) -> int:
    """Samples after which 1e-12 is left, by the logarithm of what is left after one."""
    return max(math.ceil(math.log(1e-12) / damping), 1)


@lru_cache(maxsize=256)
def vliet_young(sigma: float, order: int) -> Filter:
    """`order` 3, 4 or 5; `sigma` at least `NARROWEST`."""
    prototype = np.array(_PROTOTYPES[order], np.complex128)
    single = np.where(prototype.imag == 0, 1, 2)
    poles = prototype ** (-1 / _power(sigma, order))
    everyone = np.concatenate([poles, poles[single == 2].conj()])
    weights = np.empty_like(poles)
    for k, pole in enumerate(poles):
        others = np.delete(everyone, k)
        weights[k] = single[k] / (np.prod(1 - others / pole) * np.prod(1 - everyone * pole))
    return Filter.of(poles.tolist(), weights.tolist())


@lru_cache(maxsize=256)
def _power(sigma: float, order: int, tolerance: float = 1e-14) -> float:
    """1 / it is the exponent that gives the prototype's poles the variance sigma^2."""
    logs, wide = _LOGS[order], sigma**2
    # A pole adds 1 / l^2 - 1/12 and less than l^2 / 240 more, with l = log p.
    added, share = _SUMS[order]
    found = math.sqrt((wide + added) / share)
    for _ in range(STEPS):
        variance, slope = _variance(logs, found)
        step = (wide - variance) / slope
        found += step
        if abs(step) <= tolerance * found:
            break
    return found


_LOGS = {
    order: tuple((2.0 if each.imag == 0 else 4.0, cmath.log(each)) for each in prototype)
    for order, prototype in _PROTOTYPES.items()
}
"""By order: how much each of the prototype's poles adds to a variance, and its logarithm."""
_SLOWEST = {order: math.log(min(map(abs, prototype))) for order, prototype in _PROTOTYPES.items()}
_SUMS = {
    order: (sum(each for each, _ in logs) / 12, sum((each / log**2).real for each, log in logs))
    for order, logs in _LOGS.items()
}
"""By order: the logarithm of the prototype's slowest pole; what its poles add to a variance at least, and by how much
that grows with the square of the power."""
STEPS = 20
"""Of Newton's method at most; three or four do."""


def _variance(logs: Sequence[tuple[float, complex]], power: float) -> tuple[float, float]:
    """Of the filter whose poles p are the prototype's inverse, to the power 1 / `power`, and how it grows with that
    power: the sum of p / (1 - p)^2 = 1 / (2 sinh(log p / 2))^2. Numbers of Python, since NumPy takes ten times as long
    for so few."""
    total, slope = 0.0, 0.0
    for each, log in logs:
        half = log / (2 * power)
        sinh = cmath.sinh(half)
        added = each / (4 * sinh * sinh)
        total += added.real
        slope += (added * half * cmath.cosh(half) / sinh).real
    return total, 2 * slope / power


@lru_cache(maxsize=256)
def distance(filtered: Filter, sigma: float) -> float:
    """Half the l1 norm of the filter less the Gaussian: what one pass does to values that differ by 1, at most."""
    half = half_kernel(sigma)
    count = max(len(half), math.ceil(math.log(BARELY) / math.log(filtered.damping)))
    apart = filtered.response(count)
    apart[: len(half)] -= half
    size = np.abs(apart)
    return float(size.sum()) - float(size[0]) / 2
