"""What a noise is like: range, mean, variance, spectrum, anisotropy, period, and whether its seeds have anything in
common.

All is measured on pictures of 256 x 256 px that repeat, of one octave in cells of 8 px (or pixels, where a noise has no
cells), for four seeds, in doubles. Power is that of the Fourier transform, as a density over the plane of frequencies
that adds up to 1. Anisotropy is the power within 15 degrees of the axes over that within 15 degrees of the diagonals,
where most power lies: 1 is the same everywhere.

Pictures of different seeds have the correlation that chance gives: for pictures of power spectra P and Q its standard
deviation is sqrt(sum P Q) / sqrt(sum P sum Q). The largest of the six pairs is told in these units; a hash whose seeds
are alike shows here."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import combinations, pairwise
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import Operation
from lichen.study import Chart, Study, brief

SIDE = 256
CELL = 8
SEEDS = 4
RINGS = 22
"""Of the spectrum, each as much wider than the one before."""
LEAST = 1e-5
"""Of the highest density: what is less is left out of the spectrum."""


def studied(operation: Operation[Any], own: Mapping[str, Any], unit: int, period: str) -> Callable[[], Study]:
    """The study of a noise with its `own` parameters, whose cells are `unit` px."""

    def study() -> Study:
        values = {**own, "width": SIDE, "height": SIDE, "low": -1.0, "high": 1.0}
        asked = [operation.validate({**values, "seed": seed}) for seed in range(SEEDS)]
        pictures = [operation.evaluate_truth({}, p)[..., 0] for p in asked]
        extent = operation.result(asked[0], {}).extent
        return described(pictures, unit, (extent.low, extent.high), period)

    return study


def described(pictures: list[Array], unit: int, proved: tuple[float, float], period: str) -> Study:
    spectra = [np.fft.fft2(picture - picture.mean()) for picture in pictures]
    power = np.mean([np.abs(each) ** 2 for each in spectra], axis=0)
    f = np.fft.fftfreq(SIDE) * unit
    length = np.hypot(f[:, None], f)
    most = _below(power, length, 0.95)
    turned = np.degrees(np.arctan2(f[:, None], f)) % 90
    middle = (length > most / 3) & (length < most)
    axes = power[middle & ((turned < 15) | (turned > 75))].mean()
    anisotropy = float(axes / power[middle & (np.abs(turned - 45) < 15)].mean())
    numbers: dict[str, Any] = {
        "range_proved": [brief(each) for each in proved],
        "range_found": [brief(min(p.min() for p in pictures)), brief(max(p.max() for p in pictures))],
        "mean": round(float(np.mean(pictures)), 3) + 0.0,  # and no -0
        "variance": brief(float(np.mean([picture.var() for picture in pictures]))),
        "frequency_95": brief(most),
        "anisotropy": round(anisotropy, 2),
        "period": period,
        "seeds": round(_alike(spectra), 2),
    }
    what = "cell" if unit > 1 else "px"
    (low, high), (least, largest) = numbers["range_proved"], numbers["range_found"]
    return Study(
        sentences=(
            f"Noise between low = -1 and high = 1: [{low:g}, {high:g}] is proved, [{least:g}, {largest:g}] was found; "
            f"mean {numbers['mean']:g}, variance {numbers['variance']:g}.",
            f"95 % of its power lies below {most:.2g} cycles per {what}; along the axes there is {anisotropy:.2f} "
            "times the power of the diagonals.",
            f"It repeats {period}. Of {SEEDS * (SEEDS - 1) // 2} pairs of seeds none is more alike than "
            f"{numbers['seeds']:g} standard deviations of chance.",
        ),
        numbers=numbers,
        charts=(_spectrum(power, length, unit, f"frequency, cycles per {what}"),),
    )


def _below(power: Array, length: Array, share: float) -> float:
    """The frequency below which this share of the power lies."""
    order = np.argsort(length, axis=None, kind="stable")
    total = np.cumsum(power.ravel()[order])
    return float(length.ravel()[order][np.searchsorted(total, share * total[-1])])


def _spectrum(power: Array, length: Array, unit: int, across: str) -> Chart:
    """Mean densities in rings, by their middles."""
    density = power / power.sum() * (SIDE / unit) ** 2
    edges = np.geomspace(0.7 * unit / SIDE, unit / 2, RINGS + 1)
    found = []
    for low, high in pairwise(edges):
        ring = density[(length > low) & (length <= high)]
        if ring.size and ring.mean() > 0:
            found.append((brief(math.sqrt(low * high)), brief(float(ring.mean()))))
    floor = max(value for _, value in found) * LEAST
    places, densities = zip(*(point for point in found if point[1] >= floor), strict=True)
    return Chart(across, "power, as a density", places, {"radial spectrum": densities})


def _alike(spectra: list[Array]) -> float:
    """The largest correlation of two pictures, in standard deviations of chance."""
    found = []
    for one, two in combinations(spectra, 2):
        product = float((one * two.conj()).sum().real)
        chance = math.sqrt(float((np.abs(one) ** 2 * np.abs(two) ** 2).sum()))
        found.append(abs(product) / chance)
    return max(found)
