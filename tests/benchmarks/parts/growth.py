"""How time grows with what is asked for: pixels, sigma, taps, lengths, octaves, lights, nodes.

Times are medians of interleaved runs; a curve ends where one run would take longer than seconds. Exponents are slopes
of straight lines through the logarithms, from where a curve has left behind what it costs to begin. The sentence
beside each says what theory expects.
"""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from measuring import Copies, Turns, available, growth, quick
from parts import scenes as stage
from parts.streamlines import gyre
from sections import Point, Section, lines, table

import lichen
from lichen.image import Extent, Image, Space, as_image
from lichen.memory import aligned_empty

TITLE = "Growth"
LONGEST = 2.5
"""Seconds that one run may be expected to take."""
PATIENCE = 2.0
"""Seconds for all runs of one point."""
Make = Callable[[float], Callable[[], Any]]
"""Receives x and returns what is timed, its images made before."""


@dataclass(frozen=True)
class Curve:
    """Seconds over x; the exponent is fitted from `start` on, and `because` says what it should be."""

    label: str
    make: Make
    because: str
    start: float = 0.0
    low: float = 0.0
    """the least x it is meant for"""


@dataclass(frozen=True)
class Study:
    name: str
    title: str
    across: str
    xs: Sequence[float]
    curves: Sequence[Curve]


@functools.lru_cache(maxsize=2)
def noise(pixels: int, channels: int = 1) -> Image:
    """About so many pixels of noise, made of one band again and again; its extremes are known already."""
    side = round(pixels**0.5)
    band = np.random.default_rng(1).random((min(side, 256), side, channels), dtype=np.float32)
    made = aligned_empty((side, side, channels))
    for top in range(0, side, len(band)):
        made[top : top + len(band)] = band[: side - top]
    image = Image(made, Space.DATA)
    vars(image)["extent"] = Extent(0.0, 1.0, 0)
    return image


@functools.lru_cache(maxsize=2)
def flow(side: int) -> Image:
    return as_image(gyre(side))


def over_pixels(name: str, **values: Any) -> Make:
    def make(x: float) -> Callable[[], Any]:
        image = noise(int(x))
        return lambda: lichen.run(name, image, **values)

    return make


def over(name: str, values: Callable[[float], Mapping[str, Any]], side: int = 1024, **ask: Any) -> Make:
    """An operation on noise of `side`, its parameters by x."""
    return lambda x: functools.partial(lichen.run, name, noise(side * side), **values(x), **ask)


def streaks(x: float) -> Callable[[], Any]:
    side = round(x**0.5)
    field, texture = flow(side), noise(int(x))
    return lambda: lichen.run("lic", field, texture=texture, length=10, method="nearest", step=1.0)


def turned(x: float) -> Callable[[], Any]:
    image = noise(int(x))
    return lambda: lichen.run("rotate", image, angle=30, method="bilinear")


def clouds(x: float) -> Callable[[], Any]:
    side = round(x**0.5)
    return lambda: lichen.run("perlin_noise", width=side, height=side, octaves=4, antialias=False)


def length_of(method: str, **knob: float) -> Make:
    field, texture = flow(512), noise(512 * 512)
    return lambda x: functools.partial(lichen.run, "lic", field, texture=texture, length=x, method=method, **knob)


def octaves(name: str) -> Make:
    values = {"width": 1024, "height": 1024, "cell": 256, "antialias": False, "gain": 0.9}
    return lambda x: functools.partial(lichen.run, name, octaves=int(x), **values)


@functools.lru_cache(1)
def buffers() -> dict[str, Image]:
    return stage.buffers(640, 480, "position", "normal", "albedo")


def lamps(outer: float, prune: bool = True) -> Make:
    """x spots over the floor."""

    def make(x: float) -> Callable[[], Any]:
        images = buffers()
        scene = {
            "camera": {"eye": stage.CAMERA["eye"], "fov": 45}, "buffers": {name: name for name in images},
            "lights": stage.spots(int(x), outer),
        }  # fmt: skip
        return lambda: lichen.render(scene, images=images, prune=prune)

    return make


def chain(*steps: str, side: int = 512, **wish: Any) -> Make:
    """x nodes in a row, of these kinds in turn, each with numbers of its own."""

    def make(x: float) -> Callable[[], Any]:
        image = noise(side * side)
        text = "|".join(steps[i % len(steps)].format(1 + i / 100) for i in range(int(x)))
        return lambda: lichen.run_pipeline(text, image, **wish)

    return make


def planned(*steps: str) -> Make:
    def make(x: float) -> Callable[[], Any]:
        image = noise(64 * 64)
        text = "|".join(steps[i % len(steps)].format(1 + i / 100) for i in range(int(x)))
        return lambda: lichen.explain_pipeline(text, image)

    return make


POINTWISE = ("levels:white={}", "levels:out_white={}")
PIXELS = Study("pixels", "Pixels", "pixels, one channel", [2.0**n for n in range(14, 27, 2)], (
    Curve("transfer, sRGB", over_pixels("transfer"), "every pixel costs the same: 1", 2**18),
    Curve("gaussian, sigma 5", over_pixels("gaussian", sigma=5), "as many taps for every pixel: 1", 2**18),
    Curve("median, 5 x 5", over_pixels("median", size=5), "one network for every pixel: 1", 2**18),
    Curve("rotate, bilinear", turned, "four samples for every pixel, farther apart in memory: 1 or little more", 2**18),
    Curve("lic, nearest, length 10", streaks, "as many steps for every pixel: 1", 2**18),
    Curve("perlin_noise, 4 octaves", clouds, "nothing is read: 1", 2**18),
))  # fmt: skip
STUDIES = (
    Study("sigma", "Width of a Gaussian", "sigma, px; 1024 x 1024, one channel", [0.5, 1, 2, 4, 8, 16, 32, 64, 128], (
        Curve("as planned", over("gaussian", lambda x: {"sigma": x}),
              "the quickest method that meets the error: flat once transforms take over", 16),
        Curve("fir, tail 1e-4", over("gaussian", lambda x: {"sigma": x}, method="fir", tail=1e-4),
              "two passes whose taps grow with sigma: 1", 8),
        Curve("dct, tail 1e-4", over("gaussian", lambda x: {"sigma": x}, method="dct", tail=1e-4),
              "keeps as many waves as 1 / sigma, so it falls until reading and writing is what is left", 8, 8),
        Curve("box3", over("gaussian", lambda x: {"sigma": x}, method="box3"),
              "running sums: 0", 2),
    )),
    Study("taps", "Side of a window", "side, px; 1024 x 1024, one channel", [3, 5, 7, 9, 15, 21, 31, 51], (
        Curve("convolve, dense, direct", over("convolve", lambda x: {"kernel": dense(int(x))}, method="direct"),
              "side squared products for every pixel: 2", 7),
        Curve("convolve, dense, as planned", over("convolve", lambda x: {"kernel": dense(int(x))}),
              "flat once transforms take over", 15),
        Curve("median, as planned", over("median", lambda x: {"size": int(x)}, side=256),
              "sorting networks, then bisection, on 256 x 256: about the side squared by definition, near flat only "
              "for histograms of few values", 9),
        Curve("box, running", over("box", lambda x: {"width": int(x), "height": int(x)}, method="running"),
              "running sums: 0", 5),
    )),
    Study("length", "Steps of line integral convolution", "length each way, px; 512 x 512", [5, 10, 20, 40, 80, 160], (
        Curve("nearest, step 1", length_of("nearest", step=1.0), "steps for every pixel: 1", 10),
        Curve("rk4, step 1", length_of("rk4", step=1.0), "steps for every pixel: 1", 10),
        Curve("fastlic, 0.25", length_of("fastlic", distance=0.25),
              "a line serves all pixels it runs through, so longer ones add little: well below 1", 10),
    )),
    Study("octaves", "Octaves of noise", "octaves; 1024 x 1024", [1, 2, 3, 4, 6, 8, 12], (
        Curve("perlin_noise", octaves("perlin_noise"), "one evaluation an octave: 1", 2),
        Curve("simplex_noise", octaves("simplex_noise"), "one evaluation an octave: 1", 2),
        Curve("worley_noise", octaves("worley_noise"), "one search an octave: 1", 2),
    )),
    Study("lights", "Lights of a scene", "spot lights; 640 x 480", [1, 4, 9, 16, 36, 64, 144], (
        Curve("wide cones, all seen", lamps(60), "every lamp reaches most tiles: towards 1", 9),
        Curve("narrow cones, pruned", lamps(15), "tiles hold few lamps each: below 1, linear in what is seen", 9),
        Curve("narrow cones, everything run", lamps(15, False), "every lamp for every pixel: 1", 9),
    )),
    Study("nodes", "Nodes of a pipeline", "nodes; 2048 x 2048 pointwise, 1024 x 1024 with boxes, one channel",
          [1, 2, 4, 8, 16, 32, 64], (
        Curve("pointwise, one kernel", chain(*POINTWISE, side=2048, max_error=1e-2),
              "arithmetic alone, no memory: 1 at last, from a low start", 8),
        Curve("pointwise, one after the other", chain(*POINTWISE, side=2048, max_error=1e-2, prune=False),
              "one pass over memory each: 1", 8),
        Curve("box and levels in turn", chain("box:width=3,height=3", "levels:white={}", side=1024, max_error=1e-1),
              "one pass each: 1", 8),
        Curve("planning alone", planned("box:width=3,height=3", "levels:gamma={}"), "passes over the graph: 1", 8),
    )),
)  # fmt: skip


@functools.cache
def dense(size: int) -> list[list[float]]:
    kernel = np.random.default_rng(size).random((size, size))
    return (kernel / kernel.sum()).tolist()  # type: ignore[no-any-return]


def measured(study: Study, copies: Copies, tell: Callable[[str], None]) -> dict[str, list[Point]]:
    """Milliseconds by curve. The curves of one x take turns; one that grew too slow is left out from there on."""
    found: dict[str, list[Point]] = {curve.label: [] for curve in study.curves}
    ended: set[str] = set()
    for x in [x for x in study.xs if x <= 2**18] if quick() else study.xs:
        runs = {}
        for curve in study.curves:
            if curve.label in ended or x < curve.low:
                continue
            try:
                run = curve.make(x)
                began = time.perf_counter()
                run()
                took = time.perf_counter() - began
                if not 0.3 < took < LONGEST:  # kernels may have been built in it
                    began = time.perf_counter()
                    run()
                    took = time.perf_counter() - began
            except lichen_errors() as failure:
                tell(f"{study.name} {x:g}, {curve.label}: {failure}")
                ended.add(curve.label)
                continue
            if took > LONGEST:
                ended.add(curve.label)
            runs[curve.label] = run
        taken = Turns(copies, rounds=7, longest=PATIENCE, warm=False, least=2)(runs) if runs else {}
        for label, each in taken.items():
            found[label].append((x, each.median * 1e3))
        tell(
            f"{study.name} {x:g}: " + ", ".join(f"{label} {each.median * 1e3:.2f} ms" for label, each in taken.items())
        )
    return found


def lichen_errors() -> tuple[type[Exception], ...]:
    from lichen.errors import LichenError

    return LichenError, MemoryError


def drawn(study: Study, series: Mapping[str, Sequence[Point]], text: str = "") -> Section:
    fits = []
    for curve in study.curves:
        points = series.get(curve.label, ())
        fitted = growth([(x, ms) for x, ms in points], curve.start)
        fits.append([curve.label, f"{curve.start:g}", fitted.exponent, curve.because])
    return lines(study.name, study.title, study.across, "ms", series, text, fits=fits)


def held(tell: Callable[[str], None]) -> dict[str, list[Point]]:
    """Growth over pixels, with as many processors as this process is held to."""
    threads = len(available())
    study = PIXELS if threads > 1 else dataclasses.replace(PIXELS, xs=PIXELS.xs[:-1])
    return measured(study, Copies(threads), tell)


def sections(tell: Callable[[str], None]) -> list[Section]:
    import bench

    by_threads = {count: bench.child("growth", count) or {} for count in bench.thread_counts()}
    most = max(by_threads)
    found = [drawn(PIXELS, by_threads[most], f"With {most} threads."), gains(by_threads)]
    copies = Copies(len(available()))
    return found + [drawn(study, measured(study, copies, tell)) for study in STUDIES]


def gains(by_threads: Mapping[int, Mapping[str, Sequence[Point]]]) -> Section:
    """How many times faster all threads are than one."""
    one, most = by_threads[min(by_threads)], max(by_threads)
    rows = []
    for label, points in by_threads[most].items():
        alone = dict(one.get(label, ()))
        rows.append([label, *(f"{alone[x] / ms:.2f}" if x in alone else "" for x, ms in points)])
    head = ["pixels", *(f"2^{round(np.log2(x))}" for x in PIXELS.xs)]
    width = len(head)
    text = "The small ones end before a second thread is awake; what memory bounds gains what memory gives."
    return table(
        f"{most} threads: how many times as fast as one",
        head,
        [each + [""] * (width - len(each)) for each in rows],
        text,
    )
