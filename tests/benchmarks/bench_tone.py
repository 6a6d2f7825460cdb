"""Tone beside its peers on a 2048 x 2048 RGB float32 image.

Peers: scikit-image, OpenCV, NumPy as one types it, and OpenImageIO with OpenColorIO for a 33^3 table. The times are
processor time of all threads over the processors there are, so that other work on the machine does not count.

Run: python tests/benchmarks/bench_tone.py
"""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenImageIO as oiio
from interleaved import Row, table
from skimage import exposure

import lichen
from lichen.accuracy.metrics import difference
from lichen.image import Image, as_image
from lichen.operations.tone.cube import written

SIZE = 2048


def processor_ms(contestants: Sequence[Callable[[], object]], rounds: int = 7) -> list[float]:
    """Median processor milliseconds of each, in turn."""
    for contestant in contestants:
        contestant()
    times: list[list[float]] = [[] for _ in contestants]
    for _ in range(rounds):
        for contestant, kept in zip(contestants, times, strict=True):
            started = time.process_time()
            contestant()
            kept.append((time.process_time() - started) / (os.cpu_count() or 1))
    return [statistics.median(kept) * 1e3 for kept in times]


def compare(
    name: str, image: Image, values: dict[str, Any], peer: str, theirs: Callable[[], Any], wanted: float | None = None
) -> Row:
    """Ours by the method that is chosen for nothing asked, against `theirs`; both errors against our truth."""
    operation = lichen.operations()[name]
    inputs = {"image": image} | ({"base": as_image(values["base"])} if "base" in values else {})
    parameters = operation.validate({key: value for key, value in values.items() if key != "base"})
    truth = operation.evaluate_truth(inputs, parameters)

    def ours() -> Any:
        return lichen.run(name, image, **values)

    result = ours()
    made = np.asarray(theirs()).reshape(truth.shape)
    ours_ms, peer_ms = processor_ms([ours, theirs])
    work = f"{name} {values.get('preset', values.get('operator', values.get('dither', '')))}".strip()
    error, peer_error = (difference(each, truth).largest for each in (result.image.pixels, made))
    return Row(work, result.method, ours_ms, error, peer, peer_ms, peer_error, wanted)


def bent(size: int = 33) -> np.ndarray:
    axis = np.linspace(0, 1, size)
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    return np.stack([red**0.8, (green + 0.2 * red) / 1.2, blue**1.3], axis=-1)


def by_oiio(pixels: np.ndarray, cube: str, folder: Path) -> Callable[[], np.ndarray]:
    """The same table through OpenImageIO, which hands it to OpenColorIO."""
    path = folder / "table.cube"
    path.write_text(cube)
    before, after = oiio.ImageBuf(pixels), oiio.ImageBuf(oiio.ImageSpec(SIZE, SIZE, 3, oiio.FLOAT))

    def convert() -> np.ndarray:
        if not oiio.ImageBufAlgo.ociofiletransform(after, before, str(path)):
            raise RuntimeError(after.geterror())
        return np.empty(0)

    convert()
    convert.pixels = np.asarray(after.get_pixels(oiio.FLOAT))  # type: ignore[attr-defined]
    return convert


def tables(image: Image, folder: Path) -> list[Row]:
    cube = written(bent())
    theirs = by_oiio(image.pixels, cube, folder)
    rows = []
    for interpolation in ("tetrahedral", "trilinear"):
        operation = lichen.operations()["table3d"]
        values = {"cube": cube, "interpolation": interpolation}
        truth = operation.evaluate_truth({"image": image}, operation.validate(values))

        def ours(values: dict[str, str] = values) -> Any:
            return lichen.run("table3d", image, **values)

        errors = [difference(each, truth).largest for each in (ours().image.pixels, theirs.pixels)]  # type: ignore[attr-defined]
        ours_ms, peer_ms = processor_ms([ours, theirs], 5)
        rows.append(
            Row(f"33^3 {interpolation}", "exact", ours_ms, errors[0], "OIIO + OCIO file", peer_ms, errors[1], 0.5)
        )
    return rows


def run() -> list[Row]:
    random = np.random.default_rng(1)
    image, other = (as_image(random.random((SIZE, SIZE, 3), dtype=np.float32)) for _ in range(2))
    x, base, spare = image.pixels, other.pixels, np.empty_like(image.pixels)
    points = [[0, 0], [0.25, 0.15], [0.5, 0.5], [0.75, 0.88], [1, 1]]
    lut = np.interp(np.linspace(0, 1, 4096), *np.array(points).T).astype(np.float32)
    one = np.float32(1)
    rows = [
        compare(
            "levels", image, {"black": 0.2, "white": 0.7, "clamp": True},
            "skimage rescale_intensity", lambda: exposure.rescale_intensity(x, (0.2, 0.7), (0.0, 1.0)),
        ),
        compare("levels", image, {"gamma": 2.2}, "numpy **", lambda: x ** np.float32(1 / 2.2)),
        compare(
            "curve", image, {"points": points, "interpolation": "linear"},
            "numpy table 4096, nearest", lambda: lut[(x * 4095 + 0.5).astype(np.int32)],
        ),
        compare(
            "mix", image, {"base": other, "amount": 1.7},
            "cv2.addWeighted", lambda: cv2.addWeighted(base, -0.7, x, 1.7, 0, dst=spare),
        ),
        compare("tone_map", image, {"operator": "reinhard"}, "numpy x / (1 + x)", lambda: x / (one + x)),
        compare(
            "quantise", image, {"levels": 5, "dither": "none"},
            "numpy floor(4 x + 0.5) / 4", lambda: np.floor(x * 4 + np.float32(0.5)) / 4,
        ),
        compare(
            "equalise", image, {},
            "skimage equalize_hist", lambda: exposure.equalize_hist(x),
        ),
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        return rows + tables(image, Path(folder))


if __name__ == "__main__":
    print(table("tone, 2048 x 2048 RGB float32, processor time", run()))
