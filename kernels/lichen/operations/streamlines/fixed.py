"""Line integral convolution in the arithmetic of a frame buffer, as pixel textures made it, in NumPy and on a device.

A pixel's position is a colour: the place in the image as two numbers in [0, 1], rounded to codes of so many `bits`
whenever it is stored. The field is a pair of textures, for the positive and for the negative parts of the direction,
whose texels are codes as well and which are interpolated when they are read. A step of at most one pixel adds what the
one says and is stored; then it subtracts what the other says at the same place and is stored again. Samples of the
texture are weighed in an accumulation buffer that does not round.

Where a code is wider than a pixel, lines of neighbours begin at one place, and a step of less than half a code is none.
A position that has strayed farther from its pixel than the line is long counts nothing, so no more than the footprint
is read; one that meets the border stays there.

Source: W. Heidrich, R. Westermann, H.-P. Seidel and T. Ertl, Applications of pixel textures in visualization and
realistic image synthesis, I3D 1999, section 3.
"""

from __future__ import annotations

import numpy as np

from lichen.memory import Array, aligned
from lichen.opencl.device import Device
from lichen.operations.streamlines.following import Reader, trapezoid
from lichen.operations.streamlines.launch import GROUP, grid, texels
from lichen.operations.streamlines.lines import Grid, displacements
from lichen.operations.streamlines.parameters import Sampling
from lichen.operations.streamlines.task import Task

SOURCE = "streamlines/fixed.cl"
MARGIN = 0.25
"""px by which a position may be farther away than the line is long: no more than that is due to rounding alone."""


def levels(bits: float) -> int:
    """The largest code."""
    return int(2 ** round(bits) - 1)


def parts(task: Task, bits: float) -> Array:
    """Codes of the directions' positive and negative parts (x+, y+, x-, y-), float32 (height, width, 4); 0 where there
    is no direction."""
    vectors = task.vectors(np.float32)
    height, width, _ = vectors.shape
    with np.errstate(all="ignore"):
        directions = displacements(vectors.reshape(-1, 2), 1.0, True)
    directions = np.where(np.isnan(directions), 0, directions)
    both = np.concatenate([np.maximum(directions, 0), np.maximum(-directions, 0)], axis=1)
    return aligned(np.rint(both * np.float32(levels(bits))).reshape(height, width, 4), np.float32)


def advanced_numpy(task: Task, bits: float) -> Array:
    """The result, (height, width, channels)."""
    top, codes = np.float32(levels(bits)), Grid.of(parts(task, bits))
    texture = Grid.of(task.texels(np.float32), task.p.sampling)
    height, width = task.height, task.width
    size = np.array([width, height], np.float32)
    texel_size = np.array([texture.width, texture.height], np.float32)
    count = task.p.steps(1.0)
    kernel = trapezoid(task.weights(count).astype(np.float32))
    unit = np.float32(task.p.length / max(count, 1)) / size  # codes of position for one code of direction
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    centre = np.stack([column, row], axis=-1).reshape(-1, 2).astype(np.float32) + np.float32(0.5)
    origin = (np.zeros(height * width, np.int64),) * 2
    rests = (codes.samples == 0).all(axis=1, keepdims=True)
    pixels = np.arange(height * width)
    own = Reader(texture, codes, (pixels % width, pixels // width), np.float32).own
    total, weight = np.zeros_like(own), np.zeros_like(own[:, :1])
    far = np.float32(task.p.length + MARGIN)
    with np.errstate(all="ignore"):
        for sign, k in zip((1, -1), kernel, strict=True):
            at = np.rint(centre / size * top)
            for j in range(count + 1):
                if j:
                    place = at / top * size - np.float32(0.5)
                    moves = codes.at(origin, place[:, 0], place[:, 1])
                    ahead, behind = (moves[:, :2], moves[:, 2:])[::sign]
                    at = np.clip(np.rint(at + unit * ahead), 0, top)
                    at = np.clip(np.rint(at - unit * behind), 0, top)
                place = at / top * size
                near = (np.abs(place - centre).max(axis=1, keepdims=True) <= far) & ~rests
                share = np.where(near, k[j], np.float32(0))
                sample = texture.at(origin, *(place / size * texel_size - np.float32(0.5)).T)
                total += np.where(share != 0, share * (sample - own), 0)
                weight += share
        made: Array = np.where(weight > 0, own + total / weight, own)
    return made.reshape(height, width, -1)


def advanced_opencl(device: Device, task: Task, bits: float) -> Array:
    count = task.p.steps(1.0)
    with device.session() as session:
        texture, sizes, result = texels(session, task, padded=True)
        codes = parts(task, bits)
        for channel in range(result.shape[2]):
            session.launch(
                SOURCE,
                "advance_codes",
                grid(task),
                codes,
                texture,
                aligned(trapezoid(task.weights(count))),
                session.readwrite(result),
                *sizes,
                np.int32(channel),
                np.int32(count),
                np.float32(task.p.length / max(count, 1)),
                np.float32(levels(bits)),
                np.float32(task.p.length + MARGIN),
                local=GROUP,
                defines={
                    "CHANNELS": 1,
                    "FIELD": 1,
                    "TEXTURE": list(Sampling).index(task.p.sampling),
                    "WRAP": 0,
                    "LATER": 0,
                },
            )
    return result
