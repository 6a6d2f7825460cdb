"""Measures what stores of 8, 12 and 16 bits and half floats cost, and writes precision.svg, .png and .md beside itself.

Three jobs made film and visualisation leave 8-bit frame buffers: integrals along the lines of a stored vector field,
the exponential of a stored depth (fog), and accumulation, where every pass rounds once more. The first two stand on the
left, the third on the right. Errors are RMS, against the same steps with nothing stored.

Run: make accuracy, or python docs/accuracy/precision.py
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

import lichen
from lichen.accuracy.metrics import difference
from lichen.accuracy.precision import Precision
from lichen.calibration.chart import Scale
from lichen.calibration.drawing import Area, Dot, Drawing, Line, Shape, Text, to_png, to_svg
from lichen.calibration.words import scientific
from lichen.memory import Array

HERE = Path(__file__).resolve().parent
STORES = (Precision.FIXED8, Precision.FIXED12, Precision.FIXED16, Precision.FLOAT16)
NAMES = {"fixed8": "8 bits", "fixed12": "12 bits", "fixed16": "16 bits", "float16": "half"}
PASSES = (1, 2, 4, 8, 16, 32, 64)
SIDE = 96
DENSITY = 4.0
"""Of the fog: what lies at the far end is dimmed to exp(-4)."""
Errors = Mapping[str, Mapping[Precision, float]]


def lines() -> dict[Precision, float]:
    """Line integrals, 20 px each way, through a vortex stored with bias and scale as frame buffers hold vectors."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] - SIDE / 2 + 0.3
    around = np.stack([-y, x], axis=-1) / np.hypot(y, x)[..., None]
    texture = np.random.default_rng(1).random((SIDE, SIDE, 1), np.float32)
    values = {"texture": texture, "length": 20, "scale": 2, "bias": 0.5, "method": "rk4", "step": 0.25}
    field = (0.5 + 0.45 * around).astype(np.float32)
    made = {each: lichen.run("lic", field, precision=each, **values).image.pixels for each in STORES}
    truth = lichen.run("lic", field, **values).image.pixels
    return {each: difference(pixels, truth).rms for each, pixels in made.items()}


def fog() -> dict[Precision, float]:
    """White seen through black fog: the transmittance exp(-4 z) of a stored depth, stored."""
    depth = np.linspace(0, 1, SIDE * SIDE, dtype=np.float32).reshape(SIDE, SIDE, 1)
    values = {"depth": depth, "kind": "exponential", "density": DENSITY, "colour": 0.0, "method": "exact"}
    white = np.ones_like(depth)
    made = {each: lichen.run("fog", white, precision=each, **values).image.pixels for each in STORES}
    truth = lichen.run("fog", white, **values).image.pixels
    return {each: difference(pixels, truth).rms for each, pixels in made.items()}


def accumulation() -> dict[Precision, list[float]]:
    """Errors after 1, 2, 4 ... blurs of 0.6 px, each of them stored."""
    picture = np.random.default_rng(2).uniform(0.05, 0.95, (SIDE, SIDE, 1)).astype(np.float32)
    kept = {each: list(_blurred(picture, each)) for each in (*STORES, Precision.FLOAT32)}
    truth = kept.pop(Precision.FLOAT32)
    return {
        each: [difference(a, b).rms for a, b in zip(pictures, truth, strict=True)] for each, pictures in kept.items()
    }


def _blurred(picture: Array, precision: Precision) -> Iterator[Array]:
    for count in range(1, PASSES[-1] + 1):
        picture = lichen.run("gaussian", picture, sigma=0.6, precision=precision).image.pixels
        if count in PASSES:
            yield picture


# ------------------------------------------------------------------------------------------------------------ drawing

WIDTH, HEIGHT, TOP, BOTTOM = 960, 390, 96.0, 350.0
LEFT_PANEL, RIGHT_PANEL = (80.0, 430.0), (560.0, 880.0)
HUES = {"line integrals": "first", "fog, exp(-4 z)": "second"}
STORE_HUES = dict(zip(STORES, ("third", "fourth", "fifth", "sixth"), strict=True))


def draw(jobs: Errors, passes: Mapping[Precision, Sequence[float]]) -> Drawing:
    everything = [
        *(error for job in jobs.values() for error in job.values()),
        *(e for row in passes.values() for e in row),
    ]
    up = Scale(min(everything) / 2, max(everything) * 2, BOTTOM, TOP)
    shapes: list[Shape] = [
        Text(24, 36, "What a store of few bits costs", size=21, bold=True),
        Text(
            24,
            60,
            "Four bits more are a sixteenth of the error, whatever is computed; each pass adds its own.",
            "ink",
            14,
        ),
        *_panel(LEFT_PANEL, up, "one pass: RMS error by store"),
        *_panel(RIGHT_PANEL, up, "repeated blurs: RMS error by number of passes"),
    ]
    shapes += _by_store(jobs, up) + _by_count(passes, up)
    return Drawing(WIDTH, HEIGHT, "What a store of few bits costs", __doc__ or "", tuple(shapes))


def _panel(span: tuple[float, float], up: Scale, title: str) -> list[Shape]:
    left, right = span
    corners = [(left, TOP), (right, TOP), (right, BOTTOM), (left, BOTTOM)]
    shapes: list[Shape] = [Area(corners, "panel"), Text(left, TOP - 10, title, "muted", 13)]
    for tick in up.ticks():
        shapes += [Line([(left, up(tick)), (right, up(tick))], "grid")]
        shapes += [Text(left - 8, up(tick) + 4, scientific(tick), "muted", 12, "end")]
    return shapes


def _by_store(jobs: Errors, up: Scale) -> list[Shape]:
    left, right = LEFT_PANEL
    places = {each: left + (right - left) * (0.12 + 0.25 * n) for n, each in enumerate(STORES)}
    shapes: list[Shape] = [Text(x, BOTTOM + 20, NAMES[each], "ink", 13, "middle") for each, x in places.items()]
    for name, errors in jobs.items():
        points = [(places[each], up(errors[each])) for each in STORES]
        shapes.append(Line(points[:3], HUES[name], 2))
        shapes += [
            Dot(x, y, HUES[name], title=f"{name}, {NAMES[each]}: {scientific(errors[each])}")
            for (x, y), each in zip(points, STORES, strict=True)
        ]
        shapes.append(Text(points[0][0] + 12, points[0][1] - 4, name, HUES[name], 13, bold=True, halo="panel"))
    return shapes


def _by_count(passes: Mapping[Precision, Sequence[float]], up: Scale) -> list[Shape]:
    left, right = RIGHT_PANEL
    across = Scale(PASSES[0] / 1.2, PASSES[-1] * 1.2, left, right)
    shapes: list[Shape] = [Text(across(n), BOTTOM + 20, str(n), "ink", 13, "middle") for n in PASSES]
    for store, errors in passes.items():
        points = [(across(n), up(error)) for n, error in zip(PASSES, errors, strict=True)]
        shapes += [Line(points, STORE_HUES[store], 2), *(Dot(x, y, STORE_HUES[store], 3) for x, y in points)]
        shapes.append(Text(right + 6, points[-1][1] + 4, NAMES[store], STORE_HUES[store], 13, bold=True))
    return shapes


def page(jobs: Errors, passes: Mapping[Precision, Sequence[float]]) -> str:
    head = " | ".join(NAMES[each] for each in STORES)
    rows = [f"| {name} | " + " | ".join(scientific(job[each]) for each in STORES) + " |" for name, job in jobs.items()]
    rows += [
        f"| {count} blur{'s' * (count > 1)} | " + " | ".join(scientific(passes[each][n]) for each in STORES) + " |"
        for n, count in enumerate(PASSES)
    ]
    return f"""# What a store of few bits costs

![RMS errors by store and by number of passes](precision.svg)

`precision=fixed8` and its kin keep every input and every result in a store of so many bits, on any operation; inside a
step the arithmetic stays float32. RMS errors against the same steps with nothing stored, {SIDE} x {SIDE} px. Written
by `make accuracy` ([precision.py](precision.py)).

| job | {head} |
|---|---:|---:|---:|---:|
{chr(10).join(rows)}

Frame buffers of 8 bits, of 12, and float32, in pictures ([quantisation.py](../pictures/quantisation.py)), from above:
the depths of a shadow map, whose edges move; exponential fog, which shows bands (contrast times 12); and fog counted
along two directions of view, as hardware once did, whose seam no number of bits mends. On the right it is counted from
the eye.

![shadows and fog from 8 bits, from 12 and in float32](../pictures/quantisation.png)
"""


def main() -> None:
    jobs, passes = {"line integrals": lines(), "fog, exp(-4 z)": fog()}, accumulation()
    drawing = draw(jobs, passes)
    (HERE / "precision.svg").write_bytes(to_svg(drawing))
    (HERE / "precision.png").write_bytes(to_png(drawing))
    (HERE / "precision.md").write_text(page(jobs, passes), encoding="utf-8")


if __name__ == "__main__":
    main()
