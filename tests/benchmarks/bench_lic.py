"""Line integral convolution beside rlic: 1024 x 1024, 20 unit steps each way, and the 512 x 512 of the pixel textures.

The field is a double gyre with a drift over white noise. Errors are the largest difference from truth in a window in
the middle, over the spread of the texture. rlic crosses one cell after the other with one weight a cell, so its lines
are shorter the more diagonal they run, and no setting brings it to the integral. It runs on one thread, ours on all.

Run: python tests/benchmarks/bench_lic.py
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import rlic
from interleaved import Row, medians, table
from scipy import ndimage
from skimage import data

import lichen
from lichen.image import Image, as_image
from lichen.opencl.device import default_device
from lichen.operations.streamlines.lic import Parameters, lic

WANTED = {"nearest": 0.085, "rk2": 0.35, "rk4": 0.6}
SETTINGS = {"rk45": ("tolerance", 0.03), "fastlic": ("distance", 0.25), "fixed": ("bits", 12)}
"""Of methods whose knob is not the step of one pixel that the others take."""
PIXEL_TEXTURES_MS = 300.0
"""512 x 512, 20 steps, on an SGI Octane MXE (250 MHz R10000): Heidrich and others 1999, section 3."""


def gyre(size: int) -> np.ndarray:
    y, x = (np.mgrid[:size, :size] + 0.5) * (2 * np.pi / size)
    return np.stack([np.sin(x) * np.cos(y), 0.1 - np.cos(x) * np.sin(y)], axis=-1).astype(np.float32)


def window_error(result: np.ndarray, inputs: dict[str, Image], length: int, window: int = 32) -> float:
    """Against truth in the window, which needs no more of the inputs than lines from it can reach."""
    low = result.shape[0] // 3 - window // 2
    part = slice(low - length - 2, low + window + length + 2)
    cut = {name: as_image(image.pixels[part, part].copy()) for name, image in inputs.items()}
    truth = lic.evaluate_truth(cut, Parameters(length=length))
    inner = slice(length + 2, -length - 2)
    return float(np.abs(result[low : low + window, low : low + window] - truth[inner, inner, 0]).max())


def compare(size: int, length: int = 20) -> list[Row]:
    texture = np.random.default_rng(0).random((size, size), dtype=np.float32)
    inputs = {"field": as_image(gyre(size)), "texture": as_image(texture)}
    u, v = (np.ascontiguousarray(inputs["field"].pixels[:, :, axis]) for axis in (0, 1))
    weights = np.full(2 * length + 1, 1 / (2 * length + 1), np.float32)  # rlic does not normalise

    def peer() -> np.ndarray:
        return rlic.convolve(texture, u, v, kernel=weights)

    peer_error = window_error(peer(), inputs, length)
    rows = []
    for method in lic.methods:

        def ours(method: str = method) -> lichen.Result:
            knob, setting = SETTINGS.get(method, ("step", 1.0))
            asked = {"length": length, "method": method, knob: setting}
            return lichen.run("lic", inputs["field"], texture=inputs["texture"], **asked)

        error = window_error(ours().image.pixels[:, :, 0], inputs, length)
        ours_ms, peer_ms = medians([ours, peer], rounds=7)
        wanted = WANTED.get(method) if size == 1024 else None
        rows.append(Row(f"{size} x {size}", method, ours_ms, error, "rlic", peer_ms, peer_error, wanted))
    return rows


def corpus(size: int = 96) -> dict[str, dict[str, Image]]:
    """Smooth flows, a photo's gradient and its edges, and noise; all over white noise."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:size, :size] + 0.5
    middle = size / 2
    photo = ndimage.zoom(data.astronaut()[:384, 64:448].mean(axis=2), size / 384, order=1)
    down, right = np.gradient(ndimage.gaussian_filter(photo, 1))
    fields: dict[str, tuple[Any, Any]] = {
        "circles": (middle - y, x - middle),
        "saddle": (x - middle - 0.3, middle - y),
        "double gyre": tuple(np.moveaxis(gyre(size), -1, 0)),
        "photo, gradient": (right, down),
        "photo, edges": (-down, right),
        "white noise": tuple(rng.standard_normal((2, size, size))),
    }
    texture = as_image(np.random.default_rng(1).random((size, size), dtype=np.float32))
    return {
        name: {"field": as_image(np.stack(vector, axis=-1).astype(np.float32)), "texture": texture}
        for name, vector in fields.items()
    }


def accuracy(length: int = 20) -> str:
    """What each method leaves on each field: RMS and largest error over the spread of the texture."""
    cases = corpus()
    truths = {name: lic.evaluate_truth(inputs, Parameters(length=length)) for name, inputs in cases.items()}
    lines = [f"### lic, RMS / largest error, length {length}", "", f"| method | step | {' | '.join(cases)} |"]
    lines.append("|---|---:|" + "---:|" * len(cases))
    for name, method in lic.methods.items():
        for step in method.knob.values if method.knob else ():
            cells = []
            for case, inputs in cases.items():
                result = method.implementation.opencl(default_device(), inputs, Parameters(length=length), step)
                wrong = result - truths[case]
                cells.append(f"{np.sqrt(np.square(wrong).mean()):.4f} / {np.abs(wrong).max():.3f}")
            lines.append(f"| {name} | {step:g} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def shared(size: int = 1024, length: int = 100) -> str:
    """Lines that serve many pixels beside a line for each: time and RMS error in a window, over the spread."""
    texture = np.random.default_rng(0).random((size, size), dtype=np.float32)
    inputs = {"field": as_image(gyre(size)), "texture": as_image(texture)}
    cases = [("rk4", 2.0), ("rk4", 1.5), ("rk4", 1.0), ("fastlic", 0.5), ("fastlic", 0.25), ("fastlic", 0.125)]
    device, parameters = default_device(), Parameters(length=length)
    half, low = 24, size // 3
    part = slice(low - half - length - 2, low + half + length + 2)
    cut = {name: as_image(image.pixels[part, part].copy()) for name, image in inputs.items()}
    exact = lic.methods["rk4"].implementation.opencl(device, cut, parameters, 1 / 16)[length + 2 : -length - 2]
    exact = exact[:, length + 2 : -length - 2]

    def job(method: str, setting: float) -> Callable[[], np.ndarray]:
        return lambda: lic.methods[method].implementation.opencl(device, inputs, parameters, setting)

    times = medians([job(*case) for case in cases], rounds=3)
    lines = [
        f"### lic, {size} x {size}, length {length}",
        "",
        "| method | knob | ms | RMS error |",
        "|---|---:|---:|---:|",
    ]
    for case, ms in zip(cases, times, strict=True):
        wrong = job(*case)()[low - half : low + half, low - half : low + half] - exact
        lines.append(f"| {case[0]} | {case[1]:g} | {ms:.0f} | {np.sqrt(np.square(wrong).mean()):.5f} |")
    return "\n".join(lines) + "\n"


def run() -> list[Row]:
    return [*compare(1024), *compare(512)]


if __name__ == "__main__":
    rows = run()
    print(table("lic, 20 unit steps each way", rows))
    best = min(row.ours_ms for row in rows if row.work == "512 x 512")
    print(f"512 x 512, 20 steps: {PIXEL_TEXTURES_MS:.0f} ms by pixel textures in 1999, {best:.1f} ms here.\n")
    print(shared())
    print(accuracy())
