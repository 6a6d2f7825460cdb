"""The same kernels on a graphics processor, where OpenCL lists one; otherwise nothing is measured here.

Images lie in the host's memory before and after: a whole run holds planning, both transfers and the kernels, whose own
time the device tells. Peers run on the processors of that machine, all of them.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from comparing import Row, errors
from measuring import Copies, Noted, Turns, available
from parts import colours, compositing, convolution, streamlines, tone, warps
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
    "convert, sRGB to Lab",
    "composite, over, RGBA",
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

        result, noted = ours(), Noted(ours)
        contestants: dict[str, Callable[[], object]] = {"lichen": noted}
        for peer in row.peers[:1]:
            contestants[peer.name] = peer.prepare(inputs, values)
        figures = turns(contestants)
        error, _ = errors(row, row.error_side, "opencl")
        moved = sum(each.pixels.nbytes for each in inputs.values()) + result.image.pixels.nbytes
        took = figures.pop("lichen").median
        kernels = noted.share * took
        peer, figure = next(iter(figures.items()), ("", None))
        rows.append([
            row.work, f"{took * 1e3:.1f}", f"{kernels * 1e3:.3f}", f"{moved / kernels / 1e9:.0f}", f"{error:.1e}",
            f"{result.error.value:.1e}", peer, "" if figure is None else f"{figure.median * 1e3:.1f}",
        ])  # fmt: skip
        shown[row.work] = {"kernels": kernels * 1e3}
        tell(f"{row.work}: {took * 1e3:.1f} ms, of which kernels {kernels * 1e3:.3f}")
    head = ["work", "whole run, ms", "kernels, ms", "GB/s", "largest error", "stated", "peer", "its ms"]
    return [
        table("", head, rows, f"On {found[0]}. GB/s: pictures read and written, over the time of the kernels."),
        bars("gpu", f"Kernels on {found[0]}, transfers left out", "ms", ["kernels"], shown),
    ]


def chosen() -> list[Row]:
    every = (*tone.ROWS, *convolution.ROWS, *warps.ROWS, *streamlines.ROWS, *colours.ROWS, *compositing.ROWS)
    return [row for row in every if row.work in WORKS]
