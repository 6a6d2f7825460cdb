"""Compositing, expressions and lookups at 2048 x 2048 RGBA float32, beside a copy and NumPy.

`over` reads two pictures and writes one, so at the bandwidth of a copy, which reads one and writes one, it would take
1.5 times as long; the aim of 80 % of that bandwidth is a ratio of 1.875. An expression is held against NumPy as one
types it, one array after the other.

Run: python tests/benchmarks/bench_compositing.py
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from interleaved import Row, medians, table

import lichen
from lichen.accuracy.metrics import difference
from lichen.image import Alpha, Image
from lichen.memory import aligned_empty
from lichen.opencl.device import default_device

SIZE = 2048
TEXT = "(a * b + 0.5) * (a - b) / (a + 1.5) - 0.25 * a * b + abs(a - 0.5)"


def typed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    half, more, quarter = (np.float32(v) for v in (0.5, 1.5, 0.25))
    return (a * b + half) * (a - b) / (a + more) - quarter * a * b + np.abs(a - half)


def by_method(name: str, inputs: dict[str, Image], values: dict[str, Any]) -> tuple[Callable[[], np.ndarray], float]:
    """The first method on the device, and its largest error on a part of the images."""
    operation = lichen.operations()[name]
    parameters = operation.validate(values)
    body = next(iter(operation.methods.values())).implementation
    device = default_device()
    assert device is not None, "there is no OpenCL device"
    part = {key: image.replace(pixels=image.pixels[:64].copy()) for key, image in inputs.items()}
    error = difference(body.opencl(device, part, parameters, 0.0), operation.evaluate_truth(part, parameters)).largest
    return lambda: body.opencl(device, inputs, parameters, 0.0), error


def run() -> list[Row]:
    random = np.random.default_rng(1)
    pictures = []
    for _ in range(2):
        pixels = aligned_empty((SIZE, SIZE, 4))
        pixels[...] = random.random((SIZE, SIZE, 4), dtype=np.float32)
        pictures.append(Image(pixels, alpha=Alpha.ASSOCIATED))
    first, second = pictures
    target = aligned_empty(first.pixels.shape)
    rows = []
    for name, values, aim in (
        ("over", {}, 1.5 / 0.8),
        ("multiply", {"blend": "multiply"}, None),
        ("soft_light", {"blend": "soft_light"}, None),
        ("luminosity", {"blend": "luminosity"}, None),
    ):
        ours, error = by_method("composite", {"image": first, "base": second}, values)
        times = medians([ours, lambda: np.copyto(target, first.pixels)])
        rows.append(Row(f"composite {name}", "exact", times[0], error, "copy", times[1], 0.0, aim))
    plain = {"a": first.replace(alpha=Alpha.NONE), "b": second.replace(alpha=Alpha.NONE)}
    ours, error = by_method("expression", plain, {"expression": TEXT})
    a, b = first.pixels, second.pixels
    times = medians([ours, lambda: typed(a, b)], 5)
    peer = float(np.abs(typed(a[:64], b[:64]) - typed(*(x[:64].astype(np.float64) for x in (a, b)))).max())
    rows.append(Row("expression, 13 operators", "compiled", times[0], error, "numpy", times[1], peer, 0.25))
    images = {f"image_{n + 1}": pictures[n % 2].replace(alpha=Alpha.NONE) for n in range(8)}
    ours, error = by_method("accumulate", images, {})
    times = medians([ours, lambda: np.mean([image.pixels for image in images.values()], axis=0)], 3)
    rows.append(Row("mean of 8 images", "compensated", times[0], error, "numpy", times[1], 6e-8))
    return rows


if __name__ == "__main__":
    print(table("compositing, 2048 x 2048 RGBA float32", run()))
