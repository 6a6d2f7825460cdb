"""Samples of files to floats and back, on a device that works in the host's memory: see `lichen.files.samples`."""

from __future__ import annotations

from typing import Any

import numpy as np

from lichen.memory import Array, aligned_empty
from lichen.opencl.device import Device

WORTH = 1 << 20
"""Samples; below it a launch, and the program that it needs, cost as much as they save."""
_BLOCK = 1 << 14
"""Samples of a work-item."""
_INTEGERS = {np.dtype(np.uint8): "uchar", np.dtype(np.uint16): "ushort"}
_HALVES = np.dtype(np.float16)


def codes(kind: np.dtype[Any]) -> bool:
    """Whether these are samples of files that a device knows."""
    return kind in _INTEGERS or kind == _HALVES


def widened(device: Device, samples: Array) -> Array:
    """Stored samples, uint8 or uint16 as float32 in [0, 1], float16 as they are: `to_floats`."""
    pixels, (source, defines) = aligned_empty(samples.shape), _program(samples.dtype)
    with device.session() as session:
        session.launch(
            source, "widen", (-(-samples.size // _BLOCK),), _bits(samples), session.write(pixels),
            np.uint64(samples.size), np.int32(_BLOCK), local=(1,), defines=defines,
        )  # fmt: skip
    return pixels


def looked_up(device: Device, table: Array, samples: Array) -> Array:
    """The float32 that a table of 256 has for each sample, uint8."""
    pixels, (source, defines) = aligned_empty(samples.shape), _program(samples.dtype)
    with device.session() as session:
        session.launch(
            source, "look_up", (-(-samples.size // _BLOCK),), samples, table, session.write(pixels),
            np.uint64(samples.size), np.int32(_BLOCK), local=(1,), defines=defines,
        )  # fmt: skip
    return pixels


def quantised(device: Device, pixels: Array, kind: np.dtype[Any]) -> tuple[Array, int, int]:
    """float32 of any shape as samples of a kind, how many were clipped, and how many were not finite: `to_storage`."""
    samples, blocks = aligned_empty(pixels.shape, kind), -(-pixels.size // _BLOCK)
    moved, (source, defines) = np.zeros((blocks, 2), np.int32), _program(kind)
    with device.session() as session:
        session.launch(
            source, "quantise", (blocks,), pixels, session.write(_bits(samples)), session.write(moved),
            np.uint64(pixels.size), np.int32(_BLOCK), local=(1,), defines=defines,
        )  # fmt: skip
    clipped, nonfinite = moved.sum(axis=0, dtype=np.int64).tolist()
    return samples, clipped, nonfinite


def _program(kind: np.dtype[Any]) -> tuple[str, dict[str, int | float | str]]:
    """The source, and what is defined for it."""
    if kind == _HALVES:
        return "halves.cl", {}
    return "samples.cl", {"CODE": _INTEGERS[kind], "LEVELS": float(np.iinfo(kind).max)}


def _bits(samples: Array) -> Array:
    """What kernels read and write: halves are no type of every device."""
    return samples.view(np.uint16) if samples.dtype == _HALVES else samples
