"""The same kernels on a graphics processor, where OpenCL lists one; otherwise nothing is measured here.

Images lie in the host's memory before and after, so that what is timed holds both transfers.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from comparing import Row, errors
from measuring import Copies, Turns, available
from parts import convolution, streamlines, tone, warps
from sections import Section, bars, table

import lichen

TITLE = "Graphics processors"
WORKS = (
    "transfer, sRGB decode, RGB",
    "gaussian, sigma 5, RGBA",
    "convolve, 7 x 7 dense, RGBA",
    "median, 3 x 3, RGB",
    "homography, bicubic, RGBA",
    "lic, nearest, step 1, 1024 px",
)


def listed() -> tuple[list[str], list[str]]:
    """The names of all devices, and of those that are graphics processors."""
    import pyopencl as cl

    devices = [device for platform in cl.get_platforms() for device in platform.get_devices()]
    names = [str(device.name).strip() for device in devices]
    return names, [name for name, each in zip(names, devices, strict=True) if each.type & cl.device_type.GPU]


def sections(tell: Callable[[str], None]) -> list[Section]:
    names, found = listed()
    if not found:
        return [
            table(
                "",
                [],
                [],
                f"Not measured: OpenCL lists {', '.join(names) or 'no device'} here, and no graphics processor.",
            )
        ]
    os.environ["LICHEN_DEVICE"] = found[0]  # nothing has chosen a device before
    turns = Turns(Copies(len(available())))
    rows: list[list[Any]] = []
    shown: dict[str, dict[str, float]] = {}
    for row in chosen():
        inputs, values = row.inputs(row.side), row.values(row.side)

        def ours(row: Row = row, inputs: Any = inputs, values: Any = values) -> lichen.Result:
            return lichen.run(row.operation, **inputs, **values, **row.ask, device="opencl")

        result = ours()
        taken = turns({row.work: ours})[row.work].median * 1e3
        error, _ = errors(row, row.error_side, "opencl")
        rows.append([row.work, result.device, f"{taken:.2f}", f"{error:.1e}", f"{result.error.value:.1e}"])
        shown[row.work] = {"run": taken}
        tell(f"{row.work}: {taken:.2f} ms")
    return [
        table("", ["work", "device", "ms", "largest error", "stated"], rows),
        bars("gpu", f"On {found[0]}, transfers included", "ms", ["run"], shown),
    ]


def chosen() -> list[Row]:
    every = (*tone.ROWS, *convolution.ROWS, *warps.ROWS, *streamlines.ROWS)
    return [row for row in every if row.work in WORKS]
