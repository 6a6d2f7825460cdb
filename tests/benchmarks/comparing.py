"""Comparisons as data: an operation with its parameters, a size, and the functions of other libraries beside it.

A `Row` is timed as `lichen.run` does it, planning included, on images that exist; a peer as its own call does it, on
arrays that exist, into an array made beforehand where it takes one. Errors of both sides are their largest distances
from the float64 definition, on smaller images of the same kind, so that the definition is quick.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from measuring import Copies, Limits, Noted, Turns, limits, quick

import lichen
from lichen.accuracy.metrics import difference
from lichen.image import Alpha, Image, Space
from lichen.memory import Array, aligned, aligned_empty

Images = Mapping[str, Image]
Values = Mapping[str, Any]
Call = Callable[[], Any]
Prepare = Callable[[Images, Values], Call]
"""Receives inputs and parameters and returns the call that is timed, which returns the result's array."""


@dataclass(frozen=True)
class Peer:
    """Another library's function."""

    name: str
    prepare: Prepare
    same: bool = True
    """whether it computes the same thing, so that its distance from our definition means something"""
    alone: bool = False
    """whether it runs on one thread whatever it is given"""
    yardstick: bool = False
    """whether it stands there to measure by, such as a copy, and not to compete"""


def noise(channels: int = 3, **about: Any) -> Callable[[int], dict[str, Image]]:
    """One image of uniform noise."""
    return lambda side: {"image": image(random(side, channels), **about)}


def pair(channels: int, first: str, second: str, **about: Any) -> Callable[[int], dict[str, Image]]:
    """Two of them."""
    return lambda side: {
        name: image(random(side, channels, seed), **about) for seed, name in enumerate((first, second), 1)
    }


def random(side: int, channels: int, seed: int = 1) -> Array:
    return np.random.default_rng(seed).random((side, side, channels), dtype=np.float32)


def image(pixels: Array, space: Space = Space.LINEAR, alpha: Alpha = Alpha.NONE) -> Image:
    """Aligned, so that nothing is copied before a kernel reads it."""
    return Image(aligned(pixels), space, alpha)


def nothing(side: int) -> dict[str, Image]:
    """The inputs of an operation that has none."""
    return {}


RGB = noise()


@dataclass(frozen=True)
class Row:
    work: str
    """what the table calls it"""
    operation: str
    parameters: Values | Callable[[int], Values]
    """of a given side where they depend on it"""
    peers: tuple[Peer, ...]
    inputs: Callable[[int], Images] = RGB
    ask: Values = field(default_factory=dict)
    """method, knob or error, where others than the planner's choice are meant"""
    side: int = 2048
    error_side: int = 192
    flops: float = 0.0
    """of each sample of the result, where they may be what bounds it"""

    def values(self, side: int) -> dict[str, Any]:
        """The parameters at this size."""
        known = dict(self.parameters(side) if callable(self.parameters) else self.parameters)
        made = lichen.operations()[self.operation].parameters.model_fields
        return {"width": side, "height": side} | known if not self.inputs(1) and "width" in made else known


def measured(row: Row, copies: Copies, able: Limits, device: str | None = None) -> dict[str, Any]:
    """A row's numbers. A peer that fails costs its own figures alone."""
    side = min(row.side, 512) if quick() else row.side
    inputs, values = row.inputs(side), row.values(side)

    def ours() -> lichen.Result:
        return lichen.run(row.operation, **inputs, **values, **row.ask, device=device)

    result, noted = ours(), Noted(ours)
    contestants: dict[str, Call] = {"lichen": noted}
    failed: dict[str, str] = {}
    for peer in row.peers:
        try:
            call = peer.prepare(inputs, values)
            call()
        except Exception as failure:  # whatever another library raises
            failed[peer.name] = brief(failure)
        else:
            contestants[peer.name] = call
    figures = Turns(copies, warm=False)(contestants)  # each has run once
    mine, theirs = errors(row, row.error_side, device)
    moved = sum(each.pixels.nbytes for each in inputs.values()) + result.image.pixels.nbytes
    least = able.seconds(moved, row.flops * result.image.pixels.size) * figures["lichen"].pace
    return {
        "work": row.work,
        "operation": row.operation,
        "size": " x ".join(str(side) for side in result.image.pixels.shape),
        "method": result.method,
        "ours": figures["lichen"].to_json() | {"error": mine, "stated": result.error.value},
        "bytes": moved,
        "flops": row.flops * result.image.pixels.size,
        "least_ms": least * 1e3,
        "fraction": least / figures["lichen"].median,
        "kernels_ms": noted.share * figures["lichen"].median * 1e3,
        "peers": [
            (figures[peer.name].to_json() if peer.name in figures else {"failed": failed[peer.name]})
            | {"name": peer.name, "alone": peer.alone, "yardstick": peer.yardstick, "error": theirs.get(peer.name)}
            for peer in row.peers
        ],
    }


def errors(row: Row, side: int, device: str | None = None) -> tuple[float, dict[str, float]]:
    """Ours, and those of the peers that compute the same thing and do not fail."""
    inputs, values = row.inputs(side), row.values(side)
    asked = {**inputs, **values}
    truth = exact(row, side)
    result = lichen.run(row.operation, **asked, **row.ask, device=device)
    found = {}
    for peer in row.peers:
        if peer.same:
            try:
                made = np.asarray(peer.prepare(inputs, values)())
                found[peer.name] = difference(made.reshape(truth.shape), truth).largest
            except Exception as failure:  # as above
                print(f"{row.work}, {peer.name}: {brief(failure)}", flush=True)
    return difference(result.image.pixels, truth).largest, found


_known: dict[tuple[Any, ...], Array] = {}


def exact(row: Row, side: int) -> Array:
    """The definition's result; rows that differ in methods alone share it."""
    values = row.values(side)
    key = (row.operation, row.inputs, repr(values), side)
    if key not in _known:
        _known[key] = lichen.evaluate_truth(row.operation, **row.inputs(side), **values)
    return _known[key]


def compared(rows: tuple[Row, ...], threads: int, tell: Callable[[str], None]) -> dict[str, Any]:
    """All rows with this process's threads. A row that fails is left out, with the reason."""
    able, copies = limits(threads), Copies(threads)
    tell(f"{able.bandwidth / 1e9:.1f} GB/s, {able.peak / 1e9:.0f} GFLOP/s")
    found, failed = [], {}
    for row in rows:
        try:
            found.append(measured(row, copies, able))
        except Exception as failure:  # the other rows are worth having
            traceback.print_exc()
            failed[row.work] = brief(failure)
            continue
        ours, peers = found[-1]["ours"], found[-1]["peers"]
        beside = ", ".join(f"{each['name']} {each['ms']:.1f}" for each in peers if "ms" in each)
        tell(f"{row.work}: {ours['ms']:.1f} ms ({found[-1]['fraction']:.0%} of the roofline); {beside}")
    return {"threads": threads, "limits": asdict(able), "rows": found, "failed": failed}


def brief(failure: BaseException) -> str:
    """The first line of what it says."""
    return f"{type(failure).__name__}: {failure}".splitlines()[0][:160]


def target(inputs: Images, name: str = "image") -> Array:
    """An array as large as an input, for a peer to write to."""
    return aligned_empty(inputs[name].pixels.shape)
