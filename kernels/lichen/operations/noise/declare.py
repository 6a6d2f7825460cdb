"""The declaration of a noise on a lattice, from its basis: what does not differ between them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from lichen.errors import Flaw
from lichen.memory import Array
from lichen.opencl.device import Device
from lichen.operation import POINTWISE, HardCase, InputFacts, Inputs, Knob, Light, Operation, Rate
from lichen.operations.noise.basis import Basis
from lichen.operations.noise.character import CELL, studied
from lichen.operations.noise.errors import error, steepest
from lichen.operations.noise.launch import Task
from lichen.operations.noise.octaves import Cut, cut, too_far, visible
from lichen.operations.noise.parameters import Fractal, LatticeParameters, Output, no_inputs, unused
from lichen.operations.noise.summing import picture

TAIL = Knob("tail", (1e-2, 1e-3, 0.0), "share of the output's range that octaves may be left out for", 0.0, 0.5)


def declared(
    basis: Basis[Any],
    *,
    name: str,
    summary: str,
    description: str,
    parameters: type[LatticeParameters],
    examples: tuple[Mapping[str, Any], ...],
    hard_cases: tuple[HardCase, ...],
    rates: Mapping[str, tuple[Rate, Rate]],
    period: str = "after 2^32 cells",
) -> Operation[Any]:
    """The operation; `rates` are those in single and in double precision by backend, `period` says when a picture that
    is not to repeat does so all the same."""
    operation: Operation[Any] = Operation(
        name=name,
        family="noise",
        summary=summary,
        description=description,
        parameters=parameters,
        inputs=(),
        light=Light.STORED,
        footprint=lambda p, facts: POINTWISE,
        result=lambda p, facts: _result(basis, p),
        implied=no_inputs,
        check=partial(_check, basis),
        examples=examples,
        hard_cases=hard_cases,
    )

    one = {"fractal": Fractal.NONE, "cell": CELL, "tile": True, "antialias": False}
    operation.study = studied(operation, one, CELL, period)

    @operation.truth
    def truth(inputs: Inputs, p: LatticeParameters) -> Array:
        return picture(p, basis, visible(p, basis.lattice(p)), np.float64)

    @operation.findings
    def findings(inputs: Inputs, p: LatticeParameters, pixels: Array) -> Mapping[str, Any]:
        return found(basis, p)

    @operation.method(
        "single",
        error=lambda p, tail, facts: error(p, basis, tail, double=False),
        work=lambda p, tail, facts: work(basis, p, cut(p, basis.lattice(p), tail)[0]),
        rates={backend: pair[0] for backend, pair in rates.items()},
        knob=TAIL,
        orderly=True,
    )
    class Single:
        """Arithmetic in float32; octaves that add less than `tail` are left out."""

        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: Any, tail: float) -> Array:
            return Task(p, basis, cut(p, basis.lattice(p), tail)[0], np.float32).run(device)

        @staticmethod
        def numpy(inputs: Inputs, p: Any, tail: float) -> Array:
            return picture(p, basis, cut(p, basis.lattice(p), tail)[0], np.float32)

    @operation.method(
        "double",
        error=lambda p, tail, facts: error(p, basis, 0.0, double=True),
        work=lambda p, tail, facts: work(basis, p, visible(p, basis.lattice(p))),
        rates={backend: pair[1] for backend, pair in rates.items()},
    )
    class Double:
        """Arithmetic in float64 with every octave; the result is rounded to float32 once."""

        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: Any, knob: float) -> Array:
            return Task(p, basis, visible(p, basis.lattice(p)), np.float64).run(device)

        @staticmethod
        def numpy(inputs: Inputs, p: Any, knob: float) -> Array:
            return picture(p, basis, visible(p, basis.lattice(p)), np.float64).astype(np.float32)

    return operation


def _result(basis: Basis[Any], p: LatticeParameters) -> Any:
    facts = p.facts(slack=1e-4 * (abs(p.middle) + abs(p.half)), channels=p.channels)
    if p.output is Output.VALUE:
        return facts
    steep = abs(p.half) * steepest(p, basis, visible(p, basis.lattice(p))) * (1 + 1e-3)
    extent = facts.extent
    return _widened(facts, min(extent.low, -steep), max(extent.high, steep))


def _widened(facts: Any, low: float, high: float) -> Any:
    from dataclasses import replace

    return replace(facts, extent=replace(facts.extent, low=low, high=high))


def work(basis: Basis[Any], p: LatticeParameters, computed: Cut) -> float:
    passes = 3 if p.warp else 1
    more = 1.6 if p.output is Output.DERIVATIVES else 1.0
    return float(p.width * p.height) * (0.2 + len(computed.computed) * basis.work(p) * passes * more)


def _check(basis: Basis[Any], p: LatticeParameters, facts: InputFacts) -> list[Flaw]:
    flaws = unused(p)
    far = too_far(p, visible(p, basis.lattice(p)).computed)
    if far is not None:
        flaws.append(
            Flaw(
                "/parameters/octaves",
                f"cells of octave {far.index} cannot be told apart so far from the origin, or are too many to number; "
                "take fewer octaves, or antialias",
            )
        )
    return flaws


def found(basis: Basis[Any], p: LatticeParameters) -> dict[str, Any]:
    """What became of the octaves, and the range that is proved."""
    shown = visible(p, basis.lattice(p))
    scale = 1.0 if p.fractal is Fractal.TURBULENCE else 2.0
    left = sum(scale * octave.amplitude * (1 - octave.kept) for octave in shown.asked)
    low = 0.0 if p.fractal is Fractal.TURBULENCE and p.asked else -1.0
    ends = sorted((p.middle + low * p.half, p.middle + p.half))
    return {
        "octaves": {
            "asked": len(shown.asked),
            "computed": len(shown.computed),
            "beyond_nyquist": shown.beyond,
            "fading": [octave.index for octave in shown.asked if 0 < octave.kept < 1],
            "kept": [round(octave.kept, 4) for octave in shown.asked],
            "left_out_at_most": abs(p.half) * left,
        },
        "range": ends,
    }
