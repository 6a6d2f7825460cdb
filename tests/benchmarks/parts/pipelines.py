"""What planning costs, and what fusing, pruning and regions save.

The chain decode, matrix, exposure, saturation, curve, encode on RGB runs as one kernel, its nodes one after the other,
and as one writes the same with NumPy, OpenCV and OpenImageIO. Planning is timed by the processor time of its thread.
Memory stands beside that of libvips, which is installed into an environment of its own, which is no part of Lichen.
"""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenImageIO as oiio
from measuring import Copies, Figure, Turns, available, quick
from rivals import environment
from sections import Section, bars, table

import lichen
from lichen.accuracy import times
from lichen.engine import prepare_pipeline, prepare_scene
from lichen.execution import exact
from lichen.image import Alpha, Extent, Image, Space
from lichen.memory import aligned
from lichen.operation import Facts
from lichen.order import read_pipeline_order
from lichen.planning.graph import Graph
from lichen.planning.plan import make_plan

TITLE = "Pipelines"
MATRIX = np.array([[0.8, 0.15, 0.05], [0.1, 0.8, 0.1], [0.05, 0.15, 0.8]])
POINTS = [[0, 0], [0.3, 0.2], [0.7, 0.8], [1, 1]]
GREY = np.array([0.2126390, 0.7151687, 0.0721923])
CHAIN = (
    f"transfer:direction=decode|matrix:matrix={MATRIX.tolist()}|levels:white=0.7|saturation:amount=1.2"
    f"|curve:points={POINTS}|transfer:direction=encode"
)

VIPS = """
import json, struct, sys, time
import pyvips

def most():
    (line,) = (line for line in open("/proc/self/status") if line.startswith("VmHWM"))
    return int(line.split()[1]) << 10

size, nodes = int(sys.argv[1]), int(sys.argv[2])
pixels = struct.pack("f", 0.5) * (size * size * 4)
before, began = most(), time.perf_counter()
image = pyvips.Image.new_from_memory(pixels, size, size, 4, "float")
mean = pyvips.Image.new_from_array([[1, 1, 1]] * 3, scale=9)
for i in range(nodes):
    black = 0.01 * (i % 9 + 1)
    image = image.linear(1 / (1 - black), -black / (1 - black)) if i % 2 else image.conv(mean, precision="float")
image = image.copy_memory()
took = time.perf_counter() - began
print(json.dumps({"grown": (most() - before) / len(pixels), "seconds": took}))
"""
"""The chain of `memory` by libvips, which computes all of it in small regions."""


def decoded(x: np.ndarray) -> np.ndarray:
    return np.where(
        x <= 0.04045, x / np.float32(12.92), ((x + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    )


def encoded(x: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        y = np.float32(1.055) * np.abs(x) ** np.float32(1 / 2.4) - np.float32(0.055)
    return np.where(np.abs(x) <= 0.0031308, np.float32(12.92) * x, np.copysign(y, x))


def knots() -> np.ndarray:
    """The curve as a table, as one makes it for NumPy."""
    line = Image(np.linspace(0, 1, 4097, dtype=np.float32).reshape(1, -1, 1))
    return lichen.run("curve", line, points=POINTS, device="numpy").image.pixels.reshape(-1)


def saturated() -> np.ndarray:
    return (1 - 1.2) * np.broadcast_to(GREY, (3, 3)) + 1.2 * np.eye(3)


def by_numpy(x: np.ndarray, table: np.ndarray) -> np.ndarray:
    y = decoded(x) @ MATRIX.T.astype(np.float32) / np.float32(0.7)
    y = y @ saturated().T.astype(np.float32)
    y = np.interp(y, np.linspace(0, 1, table.size), table).astype(np.float32)
    return encoded(y)


def by_opencv(x: np.ndarray, table: np.ndarray) -> np.ndarray:
    """As OpenCV does it best: powers and matrices by its own loops, the curve by remap."""
    low = x <= 0.04045
    y = cv2.pow((x + np.float32(0.055)) * np.float32(1 / 1.055), 2.4)
    np.copyto(y, x * np.float32(1 / 12.92), where=low)
    y = cv2.transform(cv2.transform(y, (MATRIX / 0.7).astype(np.float32)), saturated().astype(np.float32))
    at = np.clip(y, 0, 1).reshape(x.shape[0], -1) * np.float32(table.size - 1)
    y = cv2.remap(table.reshape(1, -1), at, np.zeros_like(at), cv2.INTER_LINEAR).reshape(x.shape)
    low = y <= 0.0031308
    z = cv2.pow(y, 1 / 2.4) * np.float32(1.055) - np.float32(0.055)
    np.copyto(z, y * np.float32(12.92), where=low)
    return z


def by_oiio(x: oiio.ImageBuf) -> oiio.ImageBuf:
    """As OpenImageIO does it: a call for every step; the curve, which it has no call for, is left out."""
    y = oiio.ImageBufAlgo.colorconvert(x, "sRGB", "lin_rec709")
    y = oiio.ImageBufAlgo.colormatrixtransform(y, tuple(embedded(MATRIX).T.reshape(-1).tolist()))
    y = oiio.ImageBufAlgo.mul(y, 1 / 0.7)
    y = oiio.ImageBufAlgo.colormatrixtransform(y, tuple(embedded(saturated()).T.reshape(-1).tolist()))
    return oiio.ImageBufAlgo.colorconvert(y, "lin_rec709", "sRGB")


def embedded(matrix: np.ndarray) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3] = matrix
    return made


def timed(runs: dict[str, Callable[[], Any]], rounds: int = 9) -> dict[str, Figure]:
    return Turns(Copies(len(available())), rounds, longest=12.0)(runs)


def chain(size: int) -> list[Section]:
    pixels = aligned(np.random.default_rng(1).random((size, size, 3), dtype=np.float32))
    image, bent = Image(pixels, Space.SRGB), knots()
    assert image.extent.high <= 1
    wish: dict[str, Any] = {"max_error": 1e-3, "device": "opencl"}
    fused = prepare_pipeline(CHAIN, image, **wish)
    alone = prepare_pipeline(CHAIN, image, **wish, prune=False)
    assert len(fused.plan.graph.fused) == 1, fused.plan.graph.fused
    copy = np.empty_like(pixels)
    runs: dict[str, Callable[[], Any]] = {
        "one kernel": fused.run,
        "one after the other": alone.run,
        "OpenCV": partial(by_opencv, pixels, bent),
        "NumPy": partial(by_numpy, pixels, bent),
        "OpenImageIO": partial(by_oiio, oiio.ImageBuf(pixels)),
        "copying": partial(np.copyto, copy, pixels),
    }
    took = timed(runs)
    small = Image(np.ascontiguousarray(pixels[:128, :128]), Space.SRGB)
    truth = exact(prepare_pipeline(CHAIN, small, **wish).plan.graph, {"input.image": small})
    found = {
        "one kernel": lichen.run_pipeline(CHAIN, small, **wish)["result"].image.pixels,
        "one after the other": lichen.run_pipeline(CHAIN, small, **wish, prune=False)["result"].image.pixels,
        "OpenCV": by_opencv(small.pixels, bent),
        "NumPy": by_numpy(small.pixels, bent),
    }
    rows = [
        [
            name,
            f"{each.median * 1e3:.1f}",
            f"{each.low * 1e3:.1f} to {each.high * 1e3:.1f}",
            f"{np.max(np.abs(found[name] - truth)):.1e}" if name in found else "",
        ]
        for name, each in took.items()
    ]
    title = f"Decode, matrix, exposure, saturation, curve, encode; {size} x {size} RGB"
    text = (
        f"Predicted: {fused.plan.seconds * 1e3:.1f} ms in one kernel, {alone.plan.seconds * 1e3:.1f} ms one after the "
        "other. OpenImageIO has no call for the curve, which it is spared."
    )
    shown = {name: {"run": each.median * 1e3} for name, each in took.items()}
    return [
        table(title, ["by", "ms", "middle half", "largest error"], rows, text),
        bars("chain", title, "ms", ["run"], shown),
    ]


def planning(nodes: int) -> Section:
    steps = [
        (f"gaussian:sigma={1 + i % 5}", f"levels:black=0.0{i % 9},white=0.9", f"saturation:amount=1.{1 + i % 8}")[i % 3]
        for i in range(nodes)
    ]
    image = Image(np.random.default_rng(1).random((64, 64, 3), dtype=np.float32), Space.LINEAR)

    def planned(backend: str) -> float:
        """Milliseconds, of an order that was just read."""
        order = read_pipeline_order("|".join(steps), {"image": image}, {}, backend)
        facts = {name: Facts.sized(each) for name, each in order.images.items()}
        request = dataclasses.replace(order.request, rates=times.current(backend))
        began = time.thread_time()
        make_plan(Graph(facts, order.nodes, order.outputs), request)
        return (time.thread_time() - began) * 1e3

    rows = []
    for backend in times.BACKENDS:
        first = planned(backend)
        took = [planned(backend) for _ in range(20)]
        rows.append([backend, f"{min(took):.1f}", f"{first:.1f}"])
    return table(f"Planning a graph of {nodes} nodes", ["backend", "ms", "ms when nothing is known yet"], rows)


def memory(size: int, nodes: int, tell: Callable[[str], None]) -> Section:
    """Each in a process of its own, whose peak is not that of what ran before."""
    code = f"from parts.pipelines import grown; print(grown({size}, {nodes}))"
    found = {
        "Lichen": told([sys.executable, "-c", code]),
        "libvips": told([str(environment(tell) / "python"), "-c", VIPS, str(size), str(nodes)]),
    }
    rows = [
        [name, *(f"{each[key]:.2f}" if key in each else "" for key in ("foreseen", "grown", "seconds"))]
        for name, each in found.items()
        if isinstance(each, dict)
    ]
    text = (
        "Means of 3 x 3 and levels in turn, from floats in memory to floats in memory. The process grew by its result "
        "and whatever else it held at the same time, beside the source."
    )
    missing = [f" {name} is not measured: {each}." for name, each in found.items() if isinstance(each, str)]
    title = f"Memory that {nodes} nodes take on {size} x {size} RGBA, in pictures"
    return table(title, ["by", "foreseen, with the source", "grew by", "s"], rows, text + "".join(missing))


def told(command: Sequence[str]) -> dict[str, Any] | str:
    """What a program says in JSON, or the last line of why it says nothing."""
    folder = Path(__file__).resolve().parents[1]
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=folder)
    except OSError as error:
        return str(error)
    if done.returncode:
        return (done.stderr.strip().splitlines() or [f"it ended with status {done.returncode}"])[-1]
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def grown(size: int, nodes: int) -> str:
    """Memory in pictures, and the time it took; as JSON."""
    image = Image(np.zeros((size, size, 4), np.float32))
    vars(image)["extent"] = Extent(0.0, 1.0, 0)
    text = "|".join(("box:width=3,height=3", f"levels:black=0.0{i % 9 + 1}")[i % 2] for i in range(nodes))
    image.pixels[...] = 0.5  # so that the process holds it already
    before = most()
    began = time.perf_counter()
    plan = lichen.run_pipeline(text, image, max_error=1e-3)["result"].plan
    took = time.perf_counter() - began
    more = (most() - before) / image.pixels.nbytes
    return json.dumps({"foreseen": plan.peak_bytes / image.pixels.nbytes, "grown": more, "seconds": took})


def most() -> int:
    """Bytes that this process has held at most. What `getrusage` tells begins with the most that its parent held."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) << 10


def part(size: int, side: int) -> Section:
    """A small part of a blur of a warp, whole pictures beside: what it costs from the plan to the pixels."""
    image = Image(aligned(np.random.default_rng(1).random((size, size, 3), dtype=np.float32)), Space.LINEAR)
    assert image.extent.high <= 1
    corner = [size // 3, size // 3, side, side]
    matrix = [[1.02, 0.05, -20], [-0.03, 0.98, 15], [2e-6, 3e-6, 1]]
    said = {
        "nodes": {
            "warp": {"operation": "homography", "parameters": {"matrix": matrix}},
            "blur": {"operation": "gaussian", "parameters": {"sigma": 8}, "inputs": {"image": "warp"}},
        },
        "outputs": {"x": {"node": "blur", "crop": corner}},
    }

    def run(prune: bool) -> None:
        prepare_pipeline(said, image, prune=prune).run()

    took = timed({"part": partial(run, True)}, 7)["part"].median * 1e3
    run(False)
    began = time.perf_counter()
    run(False)
    whole = (time.perf_counter() - began) * 1e3
    text = f"{took:.2f} ms, {whole:.0f} ms when all is computed: {whole / took:.0f} times."
    return table(f"{side} x {side} of a blur (sigma 8) of a homography of {size} x {size} RGB", [], [], text)


def layers(size: int) -> Section:
    """Ten layers, the last of which is opaque over half of the picture: only the others' other half is seen."""
    rng = np.random.default_rng(1)
    images = {}
    for number in range(10):
        pixels = rng.random((size, size, 4), dtype=np.float32)
        pixels[..., :3] *= pixels[..., 3:]
        if number == 9:
            pixels[: size // 2, :, 3] = 1
            pixels[size // 2 :] = 0
        images[f"l{number}"] = Image(aligned(pixels), Space.LINEAR, Alpha.ASSOCIATED)
        assert images[f"l{number}"].extent.high <= 1
    nodes = {
        f"n{i}": {
            "operation": "composite",
            "inputs": {"base": f"n{i - 1}" if i > 1 else "input.l0", "image": f"input.l{i}"},
        }
        for i in range(1, 10)
    }
    said = {"nodes": nodes, "outputs": {"x": "n9"}}
    runs: dict[str, Callable[[], Any]] = {
        name: prepare_pipeline(said, images=images, prune=prune).run
        for name, prune in (("pruned", True), ("all", False))
    }
    took = {name: each.median * 1e3 for name, each in timed(runs, 7).items()}
    text = f"{took['pruned']:.1f} ms, {took['all']:.1f} ms unpruned: {took['all'] / took['pruned']:.2f} times."
    return table(f"Ten layers of {size} x {size} RGBA, the top one opaque over half", [], [], text)


def invisible(size: int) -> Section:
    """A pipeline and a scene of which nothing can be seen: the picture is handed on, against a copy of it."""
    rng = np.random.default_rng(1)
    image = Image(aligned(rng.random((size, size, 3), dtype=np.float32)), Space.LINEAR)
    depth = Image(aligned(rng.uniform(1, 2, (size, size, 1)).astype(np.float32)))
    assert image.extent.high <= 1 <= depth.extent.low
    text = "gaussian:sigma=0.05|saturation:amount=1.00001|levels:white=1.00001|matrix|hue_rotate:angle=1e-4"
    lights = [{"kind": "point", "intensity": 0}]
    normal = Image(aligned(np.broadcast_to(np.array([0, 0, 1], np.float32), image.pixels.shape)))
    scene = {
        "buffers": {"albedo": "a", "depth": "d", "normal": "n"}, "ambient": [1, 1, 1], "lights": lights,
        "fog": {"density": 0}, "lens": {"focus": 1.5, "blur": 0},
    }  # fmt: skip
    pipeline = prepare_pipeline(text, image, max_error=1e-3)
    rendered = prepare_scene(scene, images={"a": image, "d": depth, "n": normal}, space="linear")
    copy = np.empty_like(image.pixels)
    runs = {
        "five effects": pipeline.run,
        "a scene": rendered.run,
        "copying": partial(np.copyto, copy, image.pixels),
    }
    took = {name: each.median * 1e3 for name, each in timed(runs, 25).items()}
    plans = {"five effects": pipeline.plan, "a scene": rendered.plan}
    rows = [
        [name, f"{each:.3f}", f"{len(plans[name].nodes)} nodes are left" if name in plans else ""]
        for name, each in took.items()
    ]
    return table(f"What cannot be seen, on {size} x {size} RGB", ["", "ms", ""], rows)


def sections(tell: Callable[[str], None]) -> list[Section]:
    found: list[Section] = []
    for name, work in FIGURES.items():
        made = work(tell)
        found += made if isinstance(made, list) else [made]
        tell(f"{name}: {found[-1]['text'] or found[-1]['title']}")
    return found


FIGURES: dict[str, Callable[[Callable[[str], None]], Any]] = {
    "chain": lambda tell: chain(512 if quick() else 2048),
    "planning": lambda tell: planning(100),
    "part": lambda tell: part(1024 if quick() else 8192, 256),
    "layers": lambda tell: layers(512 if quick() else 2048),
    "invisible": lambda tell: invisible(512 if quick() else 2048),
    "memory": lambda tell: memory(1024 if quick() else 8192, 12, tell),
}
