"""A checkerboard to the horizon by every kind of filter: docs/pictures/horizon.png.

From left to right, the upper row nearest, bilinear and mip, the lower row 8 x 8 samples, ewa of 1 and of 4 samples; the
board goes on without end. Printed are RMS errors against the definition, of the light, and times: medians of nine runs
in turn, without encoding.

Run: python docs/pictures/horizon.py
"""

from __future__ import annotations

import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np

import lichen
from lichen.files import encode
from lichen.image import Image, Space, Storage
from lichen.memory import aligned

WIDTH, HEIGHT, CELL = 320, 200, 64
TARGET = Path(__file__).parent / "horizon.png"
WAYS: tuple[dict[str, Any], ...] = (
    {"method": "nearest"},
    {"method": "bilinear"},
    {"method": "mip"},
    {"method": "supersampled", "points": 8},
    {"method": "ewa", "samples": 1},
    {"method": "ewa", "samples": 4},
)
ROUNDS = 9


def view() -> dict[str, Any]:
    """From the result to the board: an eye above it looks a little down, its horizon a fifth below the upper edge, and
    nothing on the board is shown larger than it is."""
    turn, middle, horizon, near = np.radians(25), WIDTH / 2, HEIGHT / 5, 40.0
    c, s = np.cos(turn), np.sin(turn)
    # (right, ahead) on the board are (x - middle, HEIGHT) near / (y - horizon)
    flat = np.array([[1, 0, -middle], [0, 0, HEIGHT], [0, 1 / near, -horizon / near]])
    matrix = np.diag([4, 4, 1]) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ flat
    return {"matrix": matrix.tolist(), "inverse": True, "border": "wrap", "width": WIDTH, "height": HEIGHT}


def main() -> None:
    row, column = np.mgrid[: 4 * CELL, : 4 * CELL] // CELL
    board = Image(aligned(((row + column) % 2).astype(np.float32)[..., None] * 0.9 + 0.05), Space.LINEAR)
    plane = view()
    true = lichen.evaluate_truth("homography", board, **plane)
    made = [lichen.run("homography", board, **plane, **way).image.pixels for way in WAYS]
    taken: list[list[float]] = [[] for _ in WAYS]
    for _ in range(ROUNDS):
        for way, times in zip(WAYS, taken, strict=True):
            began = time.perf_counter()
            lichen.run("homography", board, **plane, **way)
            times.append(time.perf_counter() - began)
    for way, pixels, times in zip(WAYS, made, taken, strict=True):
        off = float(np.sqrt(np.square(pixels - true).mean()))
        print(", ".join(map(str, way.values())), f"RMS {off:.2g}, {statistics.median(times) * 1e3:.1f} ms")
    rows = [np.concatenate(made[first : first + 3], axis=1) for first in (0, 3)]
    light = Image(aligned(np.concatenate(rows), np.float32), Space.LINEAR)
    shown = lichen.run("transfer", light, curve="srgb", direction="encode").image
    TARGET.write_bytes(encode(shown, "png", storage=Storage.UINT8).data)


if __name__ == "__main__":
    main()
