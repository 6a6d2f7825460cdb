"""Noise beside pyfastnoiselite, and what each noise is like: range, mean, variance, radial spectrum, anisotropy,
period.

pyfastnoiselite takes coordinates in float32 and runs on one thread. Its lattices and gradients are others than ours,
so there is no error of one by the other's definition; that of its coordinates is told below.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pyfastnoiselite.pyfastnoiselite as fast
from comparing import Call, Images, Peer, Row, Values, nothing
from measuring import Copies, Turns, available
from sections import Section, table

import lichen
from lichen.memory import Array
from lichen.opencl.device import default_device

TITLE = "Noise"
SIDE, CELL = 1024, 8
"""Of the pictures that spectra are taken from."""
RINGS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
PUBLISHED = {
    "value": ("value_noise", 776),
    "Perlin": ("perlin_noise", 624),
    "simplex": ("simplex_noise", 466),
    "Worley (cellular)": ("worley_noise", 194),
}
"""Operation, and Mpoint/s of FastNoise2 in two dimensions on one thread of an i7-7820X at 4.9 GHz (its README)."""
KINDS = {
    "perlin_noise": "Perlin",
    "simplex_noise": "OpenSimplex2",
    "value_noise": "Value",
    "worley_noise": "Cellular",
}


def generator(kind: str, octaves: int, frequency: float) -> Any:
    made = fast.FastNoiseLite(seed=1)
    made.noise_type = getattr(fast.NoiseType, f"NoiseType_{kind}")
    made.frequency = frequency
    if octaves > 1:
        made.fractal_type = fast.FractalType.FractalType_FBm
        made.fractal_octaves = octaves
    return made


def by_fastnoise(kind: str) -> Callable[[Images, Values], Call]:
    def prepare(inputs: Images, values: Values) -> Call:
        y, x = np.mgrid[: values["height"], : values["width"]].astype(np.float32)
        places = np.stack([x.ravel(), y.ravel()])
        made = generator(kind, values["octaves"], 1 / values["cell"])
        return lambda: made.gen_from_coords(places)

    return prepare


def row(name: str, octaves: int, method: str = "single") -> Row:
    values = {"cell": 64.0, "octaves": octaves, "antialias": False} | ({"fractal": "none"} if octaves == 1 else {})
    peer = Peer("pyfastnoiselite", by_fastnoise(KINDS[name]), same=False, alone=True)
    work = f"{name}, {octaves} octave{'s' if octaves > 1 else ''}, {method}"
    return Row(work, name, values, (peer,), nothing, {"method": method}, error_side=64)


ROWS = (*(row(name, 1) for name in KINDS), row("perlin_noise", 8), row("perlin_noise", 8, "double"))


# --------------------------------------------------------------------------------------------------------- characters


def noises() -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Operation, label and parameters of one octave of every noise."""
    lattice: dict[str, Any] = {"cell": CELL, "octaves": 1, "fractal": "none", "tile": True, "antialias": False}
    yield "white_noise", "white", {}
    for fade in ("quintic", "cubic"):
        yield "value_noise", f"value, {fade}", {**lattice, "fade": fade}
        yield "perlin_noise", f"Perlin, {fade}", {**lattice, "fade": fade}
    for d in (3, 4):
        yield "perlin_noise", f"Perlin, {d}-D slice", {**lattice, "dimensions": d, "z": 0.37}
    for d in (2, 3, 4):
        yield "simplex_noise", f"simplex, {d}-D", {**lattice, "dimensions": d, "z": 0.37 * (d > 2)}
    for metric in ("euclidean", "manhattan", "chebyshev"):
        yield "worley_noise", f"Worley F1, {metric}", {**lattice, "metric": metric}
    yield "worley_noise", "Worley F2-F1", {**lattice, "feature": "f2-f1"}
    yield "wavelet_noise", "wavelet", lattice
    yield "wavelet_noise", "wavelet, solid 3-D", {**lattice, "dimensions": 3, "z": 0.37, "depth": "solid"}
    yield "spot_noise", "spot", lattice
    yield "spot_noise", "spot, stretched 4", {**lattice, "stretch": 4}
    yield "gabor_noise", "Gabor, all directions", {**lattice, "waves": 1}
    yield "gabor_noise", "Gabor, one direction", {**lattice, "waves": 1, "spread": 0}
    for beta in (1, 2):
        yield "spectral_noise", f"spectral, beta {beta}", {"beta": beta}


def spectrum(pixels: Array) -> tuple[Array, Array, Array]:
    """Power, frequency in cycles per cell, and direction, of every bin."""
    power = np.abs(np.fft.fft2(pixels - pixels.mean())) ** 2
    f = np.fft.fftfreq(SIDE) * CELL
    return power, np.hypot(*np.meshgrid(f, f)), np.arctan2(*np.meshgrid(f, f, indexing="ij"))


def described(label: str, values: Array, seconds: float) -> list[Any]:
    power, length, direction = spectrum(values)
    order = np.argsort(length, axis=None)
    total = np.cumsum(power.ravel()[order])
    most = length.ravel()[order][np.searchsorted(total, 0.95 * total[-1])]
    rings = [
        power[(length > low) & (length <= high)].sum() / total[-1]
        for low, high in zip((0, *RINGS), RINGS, strict=False)
    ]
    middle = (length > most / 3) & (length < most)
    turned = np.degrees(direction) % 90
    axis = power[middle & ((turned < 15) | (turned > 75))].mean()
    diagonal = power[middle & (np.abs(turned - 45) < 15)].mean()
    shares = [f"{100 * share:.1f}" for share in rings]
    span = f"{values.min():.3f}, {values.max():.3f}"
    figures = [f"{values.mean():.3f}", f"{values.var():.4f}", *shares, f"{most:.2f}", f"{axis / diagonal:.2f}"]
    return [label, span, *figures, "yes" if repeats(values) else "no", f"{SIDE * SIDE / seconds / 1e6:.0f}"]


def repeats(values: Array) -> bool:
    """Whether the step across the seam is no larger than steps inside."""
    inside = np.abs(np.diff(values, axis=1)).mean(), np.abs(np.diff(values, axis=0)).mean()
    seam = np.abs(values[:, 0] - values[:, -1]).mean(), np.abs(values[0] - values[-1]).mean()
    return bool(seam[0] < 1.3 * inside[0] and seam[1] < 1.3 * inside[1])


def kernel(name: str, **values: Any) -> Callable[[], Array]:
    """One run of an operation's first method on the device."""
    operation = lichen.operations()[name]
    p = operation.validate(values)
    body = next(iter(operation.methods.values())).implementation
    return lambda: body.opencl(default_device(), {}, p, 0.0)


def sections(tell: Callable[[str], None]) -> list[Section]:
    turns = Turns(Copies(len(available())), rounds=5)
    rows = []
    for name, label, values in noises():
        run = kernel(name, **values, width=SIDE, height=SIDE, low=-1, high=1)
        seconds = turns({label: run})[label].median
        rows.append(described(label, run()[..., 0].astype(np.float64), seconds))
        tell(f"{label}: {rows[-1][-1]} Mpoint/s")
    head = ["noise", "range", "mean", "variance", *(f"to {ring:g}" for ring in RINGS), "95 %", "axis / diagonal"]
    text = (
        f"Of the first octave alone, {CELL} pixels a cell, over {SIDE} x {SIDE} pixels that repeat. `to 0.5` and so "
        "on: per cent of the power up to so many cycles per cell, from the ring before; `95 %`: the frequency below "
        "which so much of the power lies. Anisotropy is the power within 15 degrees of the axes over that within 15 "
        "degrees of the diagonals where most of it lies: 1 is the same everywhere."
    )
    found = [table("What each noise is like", [*head, "repeats", "Mpoint/s"], rows, text)]
    size, others = 2048, []
    for label, (name, theirs) in PUBLISHED.items():
        run = kernel(name, width=size, height=size, cell=64, octaves=1, fractal="none", antialias=False)
        others.append([label, f"{size * size / turns({label: run})[label].median / 1e6:.0f}", theirs])
    threads = len(available())
    head = ["noise", f"here, {threads} threads, Mpoint/s", "FastNoise2, 1 thread of an i7-7820X, Mpoint/s"]
    text = (
        "FastNoise2 is no Python package; what its README publishes, of one thread of an i7-7820X at 4.9 GHz with "
        f"AVX-512, stands beside what one octave takes here, {size} x {size} pixels."
    )
    found.append(table("Beside FastNoise2's own figures", head, others, text))
    text = (
        f"Two to the 20th cells from the origin pyfastnoiselite's float32 coordinates leave steps of "
        f"{far_error():.2g} between neighbours a hundredth of a cell apart, beyond the slope that Perlin noise has; "
        "ours split coordinates into a whole cell and a share of it, and leave none."
    )
    found.append(table("Far from the origin", [], [], text))
    return found


def far_error(cells: int = 2**20) -> float:
    """pyfastnoiselite's largest step between neighbours a hundredth of a cell apart, `cells` away, beyond the slope of
    4 that Perlin noise has."""
    steps = (cells + np.arange(4096) / 100).astype(np.float32)
    values = generator("Perlin", 1, 1.0).gen_from_coords(np.stack([steps, np.full_like(steps, 0.37)]))
    return float(max(np.abs(np.diff(values)).max() - 0.04, 0))
