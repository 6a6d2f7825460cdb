"""Line integral convolution beside rlic: 20 unit steps each way over white noise, along a double gyre with a drift.

rlic crosses one cell after the other with one weight a cell, so its lines are shorter the more diagonal they run, and
no setting brings it to the integral. It runs on one thread. Of pixel textures in hardware (Heidrich and others, 1999,
section 3) 512 x 512 pixels of 20 steps took 300 ms on an SGI Octane MXE with an R10000 of 250 MHz.
"""

from __future__ import annotations

import numpy as np
import rlic
from comparing import Call, Images, Peer, Row, Values

from lichen.image import Image, as_image
from lichen.operations.streamlines.lic import lic

TITLE = "Line integral convolution"
LENGTH = 20
SETTINGS = {"rk45": ("tolerance", 0.03), "fastlic": ("distance", 0.25), "fixed": ("bits", 12)}
"""Of methods whose knob is not the step of one pixel that the others take."""


def gyre(side: int) -> np.ndarray:
    y, x = (np.mgrid[:side, :side] + 0.5) * (2 * np.pi / side)
    return np.stack([np.sin(x) * np.cos(y), 0.1 - np.cos(x) * np.sin(y)], axis=-1).astype(np.float32)


def flow(side: int) -> dict[str, Image]:
    texture = np.random.default_rng(0).random((side, side), dtype=np.float32)
    return {"field": as_image(gyre(side)), "texture": as_image(texture)}


def by_rlic(inputs: Images, values: Values) -> Call:
    texture = np.ascontiguousarray(inputs["texture"].pixels[..., 0])
    u, v = (np.ascontiguousarray(inputs["field"].pixels[..., axis]) for axis in (0, 1))
    weights = np.full(2 * LENGTH + 1, 1 / (2 * LENGTH + 1), np.float32)  # rlic does not normalise
    return lambda: rlic.convolve(texture, u, v, kernel=weights)


def row(method: str, side: int = 1024) -> Row:
    knob, setting = SETTINGS.get(method, ("step", 1.0))
    return Row(
        f"lic, {method}, {knob} {setting:g}, {side} px", "lic", {"length": LENGTH},
        (Peer("rlic", by_rlic, alone=True),), flow, {"method": method, knob: setting}, side, 64,
    )  # fmt: skip


ROWS = (*(row(method) for method in lic.methods), row("nearest", 512))
