"""Carrying tasks out on an OpenCL device: the launches of lic.cl and nearest.cl."""

from __future__ import annotations

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Session
from lichen.operations.streamlines.adaptive import SHORTEST, spacing
from lichen.operations.streamlines.following import trapezoid
from lichen.operations.streamlines.parameters import Sampling
from lichen.operations.streamlines.task import FARTHEST, Task

SOURCE, NEAREST, ADAPTIVE = "streamlines/lic.cl", "streamlines/nearest.cl", "streamlines/adaptive.cl"
SEGMENT = 64
"""Pixels that one work-item follows at once; `SEGMENT` in field.clh."""
GROUP = (1, 16)
CHANNELS = 4
"""Channels of the texture that `follow` takes at once at most."""


def follow(device: Device, task: Task, step: float, order: int) -> Array:
    """The result by Runge-Kutta steps of order 1, 2 or 4 in the interpolated field, none longer than `step`."""
    count, p = task.p.steps(step), task.p
    with device.session() as session:
        now = decoded(session, task, task.field)
        later = now if task.later is None else decoded(session, task, task.later)
        texture, sizes, result = texels(session, task, padded=True)
        channels = result.shape[2]
        for first in range(0, channels, CHANNELS):
            session.launch(
                SOURCE,
                "follow",
                grid(task),
                now,
                later,
                texture,
                aligned(task.weights(count)),
                session.readwrite(result),
                *sizes,
                np.int32(first),
                np.int32(count),
                np.float32(p.length / max(count, 1)),
                np.int32(task.arc),
                np.float32(reach(task)),
                np.float32(task.time),
                np.float32(1 / (p.interval or 1.0)),
                local=GROUP,
                defines=defines(task, order=order, channels=min(CHANNELS, channels - first)),
            )
    return result


def adapt(device: Device, task: Task, tolerance: float) -> Array:
    """The result by steps as long as `tolerance` px of error allow."""
    p, apart = task.p, spacing(tolerance)
    count = p.steps(apart)
    apart = p.length / max(count, 1)
    with device.session() as session:
        now = decoded(session, task, task.field)
        later = now if task.later is None else decoded(session, task, task.later)
        texture, sizes, result = texels(session, task, padded=True)
        channels = result.shape[2]
        for first in range(0, channels, CHANNELS):
            session.launch(
                ADAPTIVE,
                "adapt",
                grid(task),
                now,
                later,
                texture,
                aligned(task.weights(count)),
                session.readwrite(result),
                *sizes,
                np.int32(first),
                np.int32(count),
                *(np.float32(each) for each in (apart, p.length, tolerance, apart * SHORTEST)),
                np.int32(task.arc),
                np.float32(task.time),
                np.float32(1 / (p.interval or 1.0)),
                local=GROUP,
                defines=defines(task, channels=min(CHANNELS, channels - first)),
            )
    return result


def walk(device: Device, task: Task, step: float) -> Array:
    """The result by Euler's steps through the vectors of whole pixels, reading whole texels."""
    count, p, alike = task.p.steps(step), task.p, same(task)
    step, pixels = p.length / max(count, 1), task.height * task.width
    bits = fraction_bits(step, max(task.height, task.width))
    built = {"SAME": int(alike), "ARC": int(task.arc)}
    with device.session() as session:
        texture, sizes, result = texels(session, task, padded=False)
        cells = session.scratch((pixels, 2))
        for channel in range(result.shape[2]):
            if channel == 0 or (alike and task.arc):  # texels lie beside the steps
                session.launch(
                    NEAREST,
                    "prepare",
                    (-(-pixels // SEGMENT),),
                    aligned(task.field, np.float32),
                    texture,
                    session.write(cells),
                    np.int32(pixels),
                    np.int32(task.field.shape[2]),
                    sizes[-1],
                    np.int32(channel),
                    *(np.float32(each) for each in (p.scale, p.bias, task.limit)),
                    np.float32(step * 2**bits if task.arc else step),
                    defines=built,
                )
            session.launch(
                NEAREST,
                "walk",
                grid(task),
                cells,
                texture,
                aligned(trapezoid(task.weights(count))),
                session.readwrite(result),
                *sizes,
                np.int32(channel),
                np.int32(count),
                np.int32(bits),
                np.float32(reach(task)),
                local=GROUP,
                defines=built,
            )
    return result


def fraction_bits(step: float, size: int) -> int:
    """Of places in whole numbers: a step fits into 16 bits then, and the size of the image into 31."""
    return min(int(np.log2(32767 / max(step, 2**-16))), 30 - (size - 1).bit_length())


def grid(task: Task) -> tuple[int, int]:
    return -(-task.width // SEGMENT), task.height


def reach(task: Task) -> float:
    """px; no line goes farther."""
    return task.p.length + 1 if task.arc else FARTHEST


def same(task: Task) -> bool:
    return task.texture_shape[:2] == (task.height, task.width)


def defines(task: Task, *, order: int = 1, channels: int = 1) -> dict[str, int]:
    kinds = list(Sampling)
    return {
        "ORDER": order,
        "CHANNELS": channels,
        "SAME": int(same(task)),
        "FIELD": kinds.index(task.p.field_sampling),
        "TEXTURE": kinds.index(task.p.sampling),
        "WRAP": int(task.wraps),
        "LATER": int(task.later is not None),
    }


PLAIN = {"ORDER": 1, "CHANNELS": 1, "SAME": 1, "FIELD": 1, "TEXTURE": 1, "WRAP": 0, "LATER": 0}
"""Any build will do for kernels that follow nothing."""


def decoded(session: Session, task: Task, field: Array) -> Array:
    """A pair per pixel, and one pair more: kernels read two neighbours at once."""
    height, width, channels = field.shape
    pairs = session.scratch((height * width + 1, 2))
    session.launch(
        SOURCE,
        "decode",
        (-(-height * width // SEGMENT),),
        aligned(field, np.float32),
        session.write(pairs),
        np.int32(height * width),
        np.int32(channels),
        np.float32(task.p.scale),
        np.float32(task.p.bias),
        np.float32(task.limit),
        defines=PLAIN,
    )
    return pairs


def texels(session: Session, task: Task, *, padded: bool) -> tuple[Array, tuple[np.int32, ...], Array]:
    """The texture, where `padded` with a value more; the sizes kernels take (width and height of the field, of the
    texture, its channels); and an empty result."""
    rows, columns, channels = task.texture_shape
    count = rows * columns * channels
    texture = session.scratch((count + 1,))
    if task.texture is None:
        session.launch(
            SOURCE,
            "noise",
            (columns, rows),
            session.write(texture),
            np.int32(columns),
            np.int32(rows),
            np.uint32(task.p.seed),
            np.float32(task.p.density),
            defines=PLAIN,
        )
    elif padded:
        texture[:count] = task.texture.reshape(-1)
        texture[count] = 0
    else:
        texture = aligned(task.texture, np.float32)
    sizes = tuple(np.int32(n) for n in (task.width, task.height, columns, rows, channels))
    return texture, sizes, aligned_empty((task.height, task.width, channels))
