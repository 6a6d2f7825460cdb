"""What breaks naive depth of field: depths at their ends, lenses at theirs, and edges between near and far."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase


def _depths(*values: float) -> Mapping[str, Any]:
    depth = np.array(values, np.float32).reshape(1, -1, 1)
    return {"image": np.full(depth.shape, 0.7, np.float32), "depth": depth}


def _grey(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    lost = np.isnan(inputs["depth"])
    good = np.isnan(pixels[lost]).all() and np.abs(pixels[~lost] - np.float32(0.7)).max(initial=0.0) <= 1e-6
    return None if good else f"a constant became {pixels.reshape(-1).tolist()}"


def _leak(far: float = 1e6) -> Mapping[str, Any]:
    """A dark thing in focus before a bright ground far away."""
    near = np.arange(32) < 16
    depth = np.where(near, 1.0, far).astype(np.float32).reshape(1, -1, 1)
    return {
        "image": np.repeat(np.where(near, 0.0, 1e4).astype(np.float32).reshape(1, -1, 1), 9, axis=0),
        "depth": np.repeat(depth, 9, axis=0),
    }


def _stars() -> Mapping[str, Any]:
    """Points of light infinitely far away, beside something near."""
    far = np.arange(32) < 16
    image = np.where(far, np.where(np.arange(32) % 3 == 1, 1e4, 0.0), 0.5).astype(np.float32).reshape(1, -1, 1)
    depth = np.where(far, np.inf, 1.0).astype(np.float32).reshape(1, -1, 1)
    return {"image": np.repeat(image, 9, axis=0), "depth": np.repeat(depth, 9, axis=0)}


def _sharp(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    most = float(pixels[:, :16].max())
    return None if most == 0 else f"the edge shows {most:g}"


def _still(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """Where nothing near comes in, 4 pixels off."""
    off = float(np.abs(pixels[:, :12] - inputs["image"][:, :12]).max())
    return None if off <= 1e-2 else f"a star lost {off:g}"


CASES = (
    HardCase(
        name="depths of 0, infinity and NaN",
        why="focus / 0, inf / inf, and a radius that is none",
        inputs=lambda: _depths(0.0, -0.0, np.inf, np.nan, 1.0, 1e-30, 1e30, -1.0, -np.inf),
        parameters={"largest": 3.0},
        holds=_grey,
    ),
    HardCase(
        name="what is bright and far does not leak over what is in focus",
        why="a gather by radii alone spreads the ground over the edge before it",
        inputs=_leak,
        parameters={"blur": 8},
        holds=_sharp,
    ),
    HardCase(
        name="focused at infinity",
        why="|1 - focus / z| is inf / inf where the plane in focus and what is seen are infinitely far away",
        inputs=_stars,
        parameters={"focus": 1e9, "blur": 3e-9, "largest": 3},
        holds=_still,
    ),
    HardCase(
        name="focused at its own focal length, where circles have no end",
        why="1 / (s - f); what lies in the plane in focus is 0 of infinitely many pixels wide",
        inputs=lambda: _leak(np.inf),
        parameters={"focus": 1, "blur": 1e4, "largest": 6},
        holds=_sharp,
    ),
    HardCase(
        name="one pixel",
        why="a neighbourhood of nothing",
        inputs=lambda: _depths(5.0),
        parameters={},
        holds=_grey,
    ),
)
