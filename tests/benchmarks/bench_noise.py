"""What each noise is like, and how fast: range, mean, variance, radial spectrum, anisotropy, period, Mpoint/s; and
Perlin noise beside pyfastnoiselite.

Spectra are of the first octave alone, at eight pixels a cell, over pictures that repeat: power is summed over rings of
the transform, in cycles per cell. `95 %` is the frequency below which that much of the power lies. Anisotropy is the
power within 15 degrees of the axes over that within 15 degrees of the diagonals, where most power lies: 1 is the same
everywhere.

pyfastnoiselite takes coordinates in float32, one thread, and ours all of them; the seconds of processors say what
either costs. Its error is that of its own coordinates: its noise 2^20 cells away, beside its own at the origin, by the
jumps between neighbours. FastNoise2 is no Python package; what its README publishes, of one thread of an i7-7820X at
4.9 GHz with AVX-512, stands beside what one octave takes here, by the clock and by the time of all threads.

Run: python tests/benchmarks/bench_noise.py
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyfastnoiselite.pyfastnoiselite as fast
from interleaved import Row, medians, table

import lichen
from lichen.memory import Array
from lichen.opencl.device import default_device

SIDE = 1024
CELL = 8
WANTED = 0.12
"""Of pyfastnoiselite's time, by processor seconds."""


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


RINGS = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)


def described(label: str, values: Array, seconds: float, period: bool) -> str:
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
    shares = " | ".join(f"{100 * share:.1f}" for share in rings)
    return (
        f"| {label} | {values.min():.3f}, {values.max():.3f} | {values.mean():.3f} | {values.var():.4f} | {shares} | "
        f"{most:.2f} | {axis / diagonal:.2f} | {'yes' if period else 'no'} | {SIDE * SIDE / seconds / 1e6:.0f} |"
    )


def repeats(values: Array) -> bool:
    """Whether the step across the seam is no larger than steps inside."""
    inside = np.abs(np.diff(values, axis=1)).mean(), np.abs(np.diff(values, axis=0)).mean()
    seam = np.abs(values[:, 0] - values[:, -1]).mean(), np.abs(values[0] - values[-1]).mean()
    return bool(seam[0] < 1.3 * inside[0] and seam[1] < 1.3 * inside[1])


def characters() -> str:
    cells = " | ".join(f"to {ring:g}" for ring in RINGS)
    lines = [
        f"| noise | range | mean | variance | % of power {cells} | 95 % | axis / diagonal | repeats | Mpoint/s |",
        "|---|---|---:|---:|" + "---:|" * (len(RINGS) + 4),
    ]
    for name, label, values in noises():
        operation = lichen.operations()[name]
        p = operation.validate({**values, "width": SIDE, "height": SIDE, "low": -1, "high": 1})
        method = next(iter(operation.methods.values())).implementation

        def run(method: Any = method, p: Any = p) -> Array:
            return method.opencl(default_device(), {}, p, 0.0)

        (ms,) = medians([run], rounds=3)
        pixels = run()[..., 0].astype(np.float64)
        lines.append(described(label, pixels, ms / 1e3, repeats(pixels)))
    return "\n".join(lines) + "\n"


PUBLISHED = {
    "value": ("value_noise", 776),
    "Perlin": ("perlin_noise", 624),
    "simplex": ("simplex_noise", 466),
    "Worley (cellular)": ("worley_noise", 194),
}
"""Operation, and Mpoint/s of FastNoise2 in two dimensions on one thread of an i7-7820X at 4.9 GHz (its README)."""


def published(size: int = 2048) -> str:
    """Mpoint/s of one octave, beside FastNoise2's own figures."""
    told = Path("/proc/cpuinfo").read_text().partition("model name")[2]
    model = told.partition(":")[2].partition("\n")[0].strip() or "?"
    threads = len(os.sched_getaffinity(0))
    lines = [
        f"### one octave, {size} x {size}, Mpoint/s",
        "",
        f"| noise | {threads} threads of {model} | a second of its processors | FastNoise2, 1 thread of i7-7820X |",
        "|---|---:|---:|---:|",
    ]
    for label, (name, theirs) in PUBLISHED.items():
        operation = lichen.operations()[name]
        values = {"width": size, "height": size, "cell": 64, "octaves": 1, "fractal": "none", "antialias": False}
        p = operation.validate(values)
        body = operation.methods[next(iter(operation.methods))].implementation

        def ours(body: Any = body, p: Any = p) -> Array:
            return body.opencl(default_device(), {}, p, 0.0)

        (ms,) = medians([ours], rounds=5)
        points = size * size / 1e3
        lines.append(f"| {label} | {points / ms:.0f} | {points / processor_ms(ours):.0f} | {theirs} |")
    return "\n".join(lines) + "\n"


def peer(octaves: int, frequency: float) -> fast.FastNoiseLite:
    made = fast.FastNoiseLite(seed=1)
    made.noise_type = fast.NoiseType.NoiseType_Perlin
    made.frequency = frequency
    made.fractal_type = fast.FractalType.FractalType_FBm
    made.fractal_octaves = octaves
    return made


def processor_ms(work: Callable[[], object], rounds: int = 5) -> float:
    """The least processor time of all threads."""
    work()
    found = []
    for _ in range(rounds):
        began = time.process_time()
        work()
        found.append(time.process_time() - began)
    return min(found) * 1e3


def beside(size: int = 2048, octaves: int = 8, cell: float = 64.0) -> list[Row]:
    """fBm of eight octaves; `wall` by the clock, `processor` by the time of all threads."""
    y, x = np.mgrid[:size, :size].astype(np.float32)
    places = np.stack([x.ravel(), y.ravel()])
    other = peer(octaves, 1 / cell)
    operation = lichen.operations()["perlin_noise"]
    p = operation.validate({"width": size, "height": size, "cell": cell, "octaves": octaves, "antialias": False})
    truth_p = operation.sized(p, 64, 64)
    truth = operation.evaluate_truth({}, truth_p)
    rows = []
    for name in ("single", "double"):
        body = operation.methods[name].implementation

        def ours(body: Any = body) -> Array:
            return body.opencl(default_device(), {}, p, 0.0)

        def theirs() -> Array:
            return other.gen_from_coords(places)

        error = float(np.abs(ours()[:64, :64] - truth).max())
        ours_ms, peer_ms = medians([ours, theirs], rounds=5)
        label = f"{size} x {size}, {octaves} octaves"
        rows.append(Row(f"{label}, wall", name, ours_ms, error, "pyfastnoiselite", peer_ms, far_error(), None))
        ours_ms, peer_ms = processor_ms(ours), processor_ms(theirs)
        rows.append(Row(f"{label}, processor", name, ours_ms, error, "pyfastnoiselite", peer_ms, far_error(), WANTED))
    return rows


def far_error(cells: int = 2**20) -> float:
    """pyfastnoiselite's largest step between neighbours a hundredth of a cell apart, `cells` away, beyond the slope of
    4 that Perlin noise has."""
    steps = (cells + np.arange(4096) / 100).astype(np.float32)
    values = peer(1, 1.0).gen_from_coords(np.stack([steps, np.full_like(steps, 0.37)]))
    return float(max(np.abs(np.diff(values)).max() - 0.04, 0))


if __name__ == "__main__":
    print(characters())
    print(published())
    print(table("fBm of Perlin noise", beside()))
