"""Every pointwise operation against a copy: which share of the machine's bandwidth it reaches.

A pointwise operation reads its pictures and writes one, so it can be no faster than a copy of as many bytes. Each runs
by its default method, with its first example, on pictures of straight numbers; `kernels` are what the device alone
takes of the same runs, where there are any. Copies stand between the runs, and shares are of what those had. What
bounds those that stand far below a copy is told below.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
from measuring import Copies, Limits, Noted, Turns, available, limits, quick
from reasons import BOUNDS
from sections import Section, table

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image, Space
from lichen.memory import aligned
from lichen.operation import POINTWISE, Facts, Operation

TITLE = "Pointwise operations"
FAR = 0.75
"""Shares of a copy below which a reason is given."""
GIVEN = ((3, Alpha.NONE), (4, Alpha.STRAIGHT), (1, Alpha.NONE), (2, Alpha.NONE))
"""Channels and coverage of the pictures; the first that an operation takes. Inputs that are no pictures have as few
channels as they may."""


def sections(tell: Callable[[str], None]) -> list[Section]:
    side, able = 256 if quick() else 2048, limits(len(available()))
    turns = Turns(Copies(len(available())), rounds=15, longest=1.0)
    rows = []
    for operation in lichen.operations().values():
        found = row(operation, side, able, turns)
        if found is not None:
            rows.append(found)
            tell(f"{operation.name}: {found[5]}")
    rows.sort(key=share)
    columns = ["operation", "with", "by", "ms", "kernels, ms", "of a copy", "kernels, of a copy"]
    text = f"{side} x {side} pixels; copies move {able.bandwidth / 1e9:.1f} GB/s at best. The slowest first."
    below = [[each[0], reason] for each in rows if share(each) < FAR and (reason := held_up(each))]
    return [
        table(f"Pointwise operations on {len(available())} threads", columns, rows, text),
        table(f"What bounds those below {FAR:.0%} of a copy", ["operation", "what bounds it"], below),
    ]


def share(row: list[str], column: int = 5) -> float:
    """Of a copy, as the row says it; 0 where it says nothing."""
    return float(row[column].rstrip("%") or 0) / 100


def held_up(row: list[str]) -> str | None:
    """Why an operation is slower than a copy, where that is known."""
    if share(row, 6) >= FAR:
        beside = float(row[3]) - float(row[4])
        return (
            f"Its kernels are not: planning, checking, launching and waiting take {beside:.1f} ms beside them. Of a "
            "tiny picture they take 0.4 ms; large ones drive what they need out of the caches."
        )
    return BOUNDS.get(row[0])


def row(operation: Operation[Any], side: int, able: Limits, turns: Turns) -> list[str] | None:
    """None of operations that are not pointwise, take no picture or leave it as it is."""
    values = dict(operation.examples[0]) if operation.examples else {}
    runs = (
        (images, partial(lichen.run, operation.name, **images, **values)) for images in fitting(operation, values, side)
    )
    working = ((images, run, result) for images, run in runs if (result := run()).method != "identity")
    images, run, result = next(working, ({}, None, None))
    if run is None or result is None:
        return None
    moved = sum(each.pixels.nbytes for each in images.values()) + result.image.pixels.nbytes
    noted = Noted(run)
    found = turns({"run": noted})["run"]
    least, took = able.seconds(moved) * found.pace, found.median
    kernels = noted.share * took
    said = ", ".join(f"{name}={brief(value)}" for name, value in values.items())
    alone = [f"{kernels * 1e3:.2f}", f"{least / kernels:.0%}"] if kernels else ["", ""]
    return [operation.name, said, result.method, f"{took * 1e3:.2f}", alone[0], f"{least / took:.0%}", alone[1]]


def brief(value: Any) -> str:
    text = " ".join(str(value).split())
    return text if len(text) <= 24 else f"{text[:21]}..."


def fitting(operation: Operation[Any], values: Mapping[str, Any], side: int) -> Iterator[dict[str, Image]]:
    """Pictures that the operation takes with these parameters, where it is pointwise with them."""
    declared = [each for each in operation.inputs if each.required]
    for channels, alpha in GIVEN if declared else ():
        images = {}
        for number, each in enumerate(declared):
            fewest, most = each.channels
            count = channels if each.picture else fewest
            if fewest <= count <= (count if most is None else most):
                images[each.name] = picture(side, count, alpha if each.picture else Alpha.NONE, number)
        if len(images) < len(declared) or not taken(operation, values, images):
            continue
        facts = {name: Facts.of(each) for name, each in images.items()}
        if operation.footprint(operation.validate(values), facts) is POINTWISE:
            yield images


def taken(operation: Operation[Any], values: Mapping[str, Any], images: Mapping[str, Image]) -> bool:
    try:
        lichen.explain(operation.name, **images, **values)
    except InvalidRequest:
        return False
    return True


def picture(side: int, channels: int, alpha: Alpha, seed: int) -> Image:
    space = Space.LINEAR if channels >= 3 else Space.DATA
    return Image(aligned(np.random.default_rng(seed).random((side, side, channels), dtype=np.float32)), space, alpha)
