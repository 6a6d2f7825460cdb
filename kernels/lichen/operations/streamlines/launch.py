"""Following streamlines on an OpenCL device: the launches of lic.cl."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Session
from lichen.operations.streamlines.lines import trapezoid

SOURCE, NEAREST = "streamlines/lic.cl", "streamlines/nearest.cl"
SEGMENT = 64
"""Pixels that one work-item follows at once; `SEGMENT` in lic.cl."""
GROUP = (1, 16)
CHANNELS = 4
"""Channels of the texture that `follow` takes at once at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What to follow. `field` and `texture` are float32 (height, width, channels); the vectors are
    (c - bias) * scale of the first two channels of `field`, their components no larger than `limit`."""

    field: Array
    texture: Array | None
    seed: int
    scale: float
    bias: float
    limit: float
    weights: Array
    """of the kernel at the ends of equal steps of length `step`"""
    step: float
    arc: bool
    reach: float
    """px; no line goes farther"""

    def follow(self, device: Device, order: int) -> Array:
        """The result by Runge-Kutta steps of order 1, 2 or 4 in the interpolated field."""
        with device.session() as session:
            vectors = self._decoded(session, SOURCE, "decode")
            texture, sizes, result = self._texture(session, padded=True)
            channels = result.shape[2]
            for first in range(0, channels, CHANNELS):
                session.launch(
                    SOURCE,
                    "follow",
                    self._grid,
                    vectors,
                    texture,
                    aligned(self.weights),
                    session.readwrite(result),
                    *sizes,
                    np.int32(first),
                    np.int32(len(self.weights) - 1),
                    np.float32(self.step),
                    np.int32(self.arc),
                    np.float32(self.reach),
                    local=GROUP,
                    defines=defines(
                        order=order, channels=min(CHANNELS, channels - first), same=sizes[:2] == sizes[2:4]
                    ),
                )
        return result

    def walk(self, device: Device) -> Array:
        """The result by Euler's steps through the vectors of whole pixels, reading whole texels."""
        with device.session() as session:
            steps = self._decoded(session, NEAREST, "prepare")
            unit = self.step / 32767 if self.arc else self.step
            texture, sizes, result = self._texture(session, padded=False)
            for channel in range(result.shape[2]):
                session.launch(
                    NEAREST,
                    "walk",
                    self._grid,
                    steps,
                    texture,
                    aligned(trapezoid(self.weights)),
                    session.readwrite(result),
                    *sizes,
                    np.int32(channel),
                    np.int32(len(self.weights) - 1),
                    np.float32(unit),
                    np.float32(self.reach),
                    local=GROUP,
                    defines=defines(same=sizes[:2] == sizes[2:4], arc=self.arc),
                )
        return result

    @property
    def _grid(self) -> tuple[int, int]:
        height, width, _ = self.field.shape
        return -(-width // SEGMENT), height

    def _decoded(self, session: Session, source: str, kernel: str) -> Array:
        """A pair per pixel by this kernel, and one pair more: kernels read two neighbours at once."""
        height, width, channels = self.field.shape
        pairs = session.scratch((height * width + 1, 2))
        session.launch(
            source,
            kernel,
            (-(-height * width // SEGMENT),),
            aligned(self.field),
            session.write(pairs),
            np.int32(height * width),
            np.int32(channels),
            np.float32(self.scale),
            np.float32(self.bias),
            np.float32(self.limit),
            defines=defines(arc=self.arc),
        )
        return pairs

    def _texture(self, session: Session, *, padded: bool) -> tuple[Array, tuple[np.int32, ...], Array]:
        """The texture, where `padded` with a value more; the sizes kernels take (width and height of the field, of the
        texture, its channels); and an empty result."""
        height, width, _ = self.field.shape
        shape = self.texture.shape if self.texture is not None else (height, width, 1)
        rows, columns, channels = shape
        count = rows * columns * channels
        texture = session.scratch((count + 1,))
        if self.texture is None:
            size = (np.int32(width), np.int32(height))
            session.launch(
                SOURCE, "noise", (width, height), session.write(texture), *size, np.uint32(self.seed), defines=defines()
            )
        elif padded:
            texture[:count] = self.texture.reshape(-1)
            texture[count] = 0
        else:
            texture = aligned(self.texture)
        sizes = tuple(np.int32(n) for n in (width, height, columns, rows, channels))
        return texture, sizes, aligned_empty((height, width, channels))


def defines(*, order: int = 1, channels: int = 1, same: bool = True, arc: bool = True) -> dict[str, int]:
    return {"ORDER": order, "CHANNELS": channels, "SAME": int(same), "ARC": int(arc)}
