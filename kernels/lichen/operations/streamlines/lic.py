"""Line integral convolution: a texture smeared along the lines of a vector field.

Truth: sigma is the streamline through a pixel's centre, sigma' = v / |v| (`speed=arc`, s in pixels) or sigma' = v
(`speed=field`, s in units of time in which the vector (1, 0) moves one pixel). The result is

    integral of k(s) T(sigma(s)) ds / integral of k(s) ds      over those s in [-length, length] where the line exists.

Vectors are v = (c - bias) * scale, x to the right and y down, interpolated component by component and normalised
afterwards; T covers the rectangle of the field, whatever its own size. A line ends at the border (or goes on at the
opposite one), where v is zero or not finite or the mask below 1/2, and at critical points, which show themselves by a
field that opposes the step just made; truth looks for them every 1/16 px. A pixel without a line keeps its own texture
value. Sums are of differences from that value, so a constant texture comes back bit for bit. A field given in two
slices is linear in time between them.

Methods divide `length` into equal steps no longer than the knob `step` and weigh their samples by the trapezoid rule:

* `nearest`: Euler's steps through the vectors of whole pixels, reading whole texels. The floor of both cost and care.
* `euler`, `rk2` (midpoint), `rk4`: Runge-Kutta of order 1, 2 and 4 in the interpolated field; steps that meet the
  border or a critical point are cut there.
* `rk45`: Dormand and Prince's pair with steps as long as their error allows, the texture read at equal distances.
* `fastlic`: a line serves all pixels whose centres it passes within the knob `distance`, by running sums along it: of
  the texture, and of its products with the waves that the kernel consists of.
* `fixed`: what a frame buffer of few `bits` makes of it, as pixel textures did: positions and the positive and negative
  parts of the vectors are rounded to its codes.

Errors. A line beside a saddle goes one way or the other, whatever the step, and noise tells two texels apart
completely. Every method and the truth are weighted means of texture values, so the spread of the texture bounds the
largest error over an image; no smaller figure can be promised, since rough fields over textures with edges come within
5 % of it at any step. What a dearer method buys is the error of all but those lines. `typical` holds it as found on the
roughest field of the benchmark (RMS over the spread); in smooth flows it is 10 to 100 times smaller and falls with the
square of the step, for `euler` with the step. The midpoint rule is not worse than `rk4` there: the interpolated field
has a kink at every pixel, and its shorter stencil meets fewer of them.

Sources: Cabral and Leedom, Imaging vector fields using line integral convolution, SIGGRAPH 1993 (kernels, phase);
Stalling and Hege, Fast and resolution independent line integral convolution, SIGGRAPH 1995 (`fastlic`, `rk45`);
Heidrich, Westermann, Seidel and Ertl, Applications of pixel textures in visualization and realistic image synthesis,
I3D 1999, section 3 (`fixed`); Okada and Lane, Enhanced line integral convolution with flow feature detection, SPIE
3017, 1997 (`enhance`); Wegenkittl, Groeller and Purgathofer, Animating flow fields: rendering of oriented line integral
convolution, Computer Animation 1997 (`oriented`); Dormand and Prince, J. Comp. Appl. Math. 6, 1980.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from lichen.image import Alpha
from lichen.memory import Array
from lichen.opencl.device import Device
from lichen.operation import Input, InputFacts, Inputs, Knob, Light, Operation, Rate
from lichen.operations.streamlines import predict
from lichen.operations.streamlines.adaptive import AdaptiveLines, spacing
from lichen.operations.streamlines.fixed import advanced_numpy, advanced_opencl
from lichen.operations.streamlines.following import Lines
from lichen.operations.streamlines.hard import HARD_CASES
from lichen.operations.streamlines.launch import adapt, follow, walk
from lichen.operations.streamlines.lines import euler, runge_kutta_2, runge_kutta_4
from lichen.operations.streamlines.parameters import Edge, Kernel, Parameters, Speed
from lichen.operations.streamlines.predict import Ladder
from lichen.operations.streamlines.reuse import reused_numpy, reused_opencl
from lichen.operations.streamlines.task import Task, decode, pictured

lic = Operation(
    name="lic",
    family="streamlines",
    summary="Line integral convolution: smears a texture, or noise, along the lines of a vector field.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("field", "vectors: x to the right, y down; further channels are not read", (2, 4), picture=False),
        Input("texture", "what is smeared; covers the field's rectangle. White noise by default", required=False),
        Input("later", "the field at the end of the interval", (2, 4), required=False, picture=False),
        Input("mask", "where it is below 1/2 there is no field", (1, 4), required=False, picture=False),
    ),
    light=Light.STORED,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=predict.footprint,
    result=predict.result_facts,
    propagate=predict.propagate,
    implied=predict.implied,
    check=predict.check,
    customary=("rk2", 1.0),
    hard_cases=HARD_CASES,
    examples=(
        {"length": 10},
        {"length": 3.5, "kernel": "hann", "seed": 7, "border": "wrap", "sampling": "cubic"},
    ),
)


@lic.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """Classical Runge-Kutta at 1/16 px, trapezoid rule, float64."""

    def carry(task: Task) -> Array:
        slices = [task.vectors(np.float64)]
        if task.later is not None:
            slices.append(decode(task.later, p, task.limit, np.float64))
        largest = max(float(np.nanmax(np.abs(vectors), initial=1.0)) for vectors in slices)
        fastest = 1.0 if task.arc else float(np.clip(largest, 1, 32))
        return Lines(task, 1 / (16 * fastest), np.float64).convolve(runge_kutta_4)

    return pictured(inputs, p, carry)


# ------------------------------------------------------------------------------------------------------------ methods

STEP = Knob(
    "step", (2.0, 1.0, 0.5, 0.25), "longest step along the line, px (units of time for speed=field)", 0.125, 8.0
)
SAMPLING = {"opencl": Rate(5e-4, 1.4e-9), "numpy": Rate(1e-3, 1.0e-7)}
WALKING = {"opencl": Rate(5e-4, 1.1e-9), "numpy": Rate(1e-3, 1.1e-7)}
SHARING = {"opencl": Rate(5e-3, 3e-9), "numpy": Rate(2e-3, 2.0e-7)}
"""Seconds per sample on 2 cores."""


def work(samples: int, p: Parameters, step: float, facts: InputFacts) -> float:
    """Samples taken: `samples` of the field and one per channel of the texture, at every step of every pixel."""
    steps = facts["field"].pixels * (2.0 * p.steps(step) + 1) * predict.pictures(p)
    return steps * predict.reads(p, facts, samples)


def by_pixels_alone(p: Parameters, facts: InputFacts) -> str | None:
    if p.border is Edge.WRAP:
        return "its lines end at the border"
    return "it knows no field that changes" if p.interval else None


NEAREST = Ladder(STEP, (0.150, 0.129, 0.127, 0.127))


@lic.method(
    "nearest", error=NEAREST.error, orderly=True, work=partial(work, 0), rates=WALKING, knob=STEP, unfit=by_pixels_alone
)
class Nearest:
    """Euler's steps through the vectors of whole pixels, reading whole texels."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: walk(device, task, knob))

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: Lines(task, knob, np.float32).walk())


EULER = Ladder(STEP, (0.125, 0.111, 0.085, 0.063))


@lic.method(
    "euler", error=EULER.error, orderly=True, work=partial(work, 1), rates=SAMPLING, knob=replace(STEP, order=1)
)
class Euler:
    """Euler's steps in the interpolated field: lines drift outwards in every bend, by half a step per radian."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: follow(device, task, knob, order=1))

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: Lines(task, knob, np.float32).convolve(euler))


RK2 = Ladder(STEP, (0.124, 0.092, 0.063, 0.042))


@lic.method("rk2", error=RK2.error, orderly=True, work=partial(work, 2), rates=SAMPLING, knob=replace(STEP, order=2))
class RungeKutta2:
    """The midpoint rule in the interpolated field: two vectors a step, second order."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: follow(device, task, knob, order=2))

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: Lines(task, knob, np.float32).convolve(runge_kutta_2))


RK4 = Ladder(STEP, (0.119, 0.099, 0.072, 0.048))


@lic.method("rk4", error=RK4.error, orderly=True, work=partial(work, 4), rates=SAMPLING, knob=replace(STEP, order=2))
class RungeKutta4:
    """The classical Runge-Kutta rule in the interpolated field: four vectors a step, fourth order."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: follow(device, task, knob, order=4))

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: Lines(task, knob, np.float32).convolve(runge_kutta_4))


TOLERANCE = Knob("tolerance", (0.3, 0.03, 0.003), "error of a step along the line, px", 1e-4, 1.0)
RK45 = Ladder(TOLERANCE, (0.092, 0.053, 0.029))


def adaptive_work(p: Parameters, tolerance: float, facts: InputFacts) -> float:
    """Samples, and eight vectors between two of them."""
    steps = facts["field"].pixels * (2.0 * p.steps(spacing(tolerance)) + 1) * predict.pictures(p)
    return steps * predict.reads(p, facts, 8)


@lic.method("rk45", error=RK45.error, orderly=True, work=adaptive_work, rates=SAMPLING, knob=TOLERANCE)
class RungeKutta45:
    """Dormand and Prince's pair of orders 5 and 4 in the interpolated field: steps as long as their error allows, the
    texture read at equal distances along the cubics between their ends."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: adapt(device, task, knob))

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: AdaptiveLines(task, knob, np.float32).adapted())


DISTANCE = Knob("distance", (0.5, 0.25, 0.125), "from a line to the centres of the pixels it serves, px", 0.03, 0.5)
FASTLIC = Ladder(DISTANCE, (0.107, 0.105, 0.103))


def shared_work(p: Parameters, distance: float, facts: InputFacts) -> float:
    """Samples of the lines that are followed: as measured on smooth fields, some (1 + 2 / distance) steps a pixel, or
    the pixel's own line where that is shorter; once for each channel."""
    own = 2.0 * p.steps(min(max(8 * distance, 0.25), 1.0)) + 1
    steps = (min(own, 2 + 4 / distance) + 2) * (1 + 0.2 * (len(p.waves()) - 1))
    channels = predict.texture_facts(p, facts).channels
    return facts["field"].pixels * steps * channels * predict.pictures(p) * 3


def unshared(p: Parameters, facts: InputFacts) -> str | None:
    if p.oriented:
        return "its running sums are of kernels made of waves, which do not grow along the line"
    if p.kernel is Kernel.RIPPLE and 2 * (p.ripples + 1) > p.length:
        return "its steps are too long for so many ripples"
    if p.speed is Speed.FIELD:
        return "its lines go by arc length"
    if predict.texture_facts(p, facts).extent.nonfinite:
        return "its running sums would carry a texel that is not finite along the whole line"
    return None


@lic.method(
    "fastlic", error=FASTLIC.error, orderly=True, work=shared_work, rates=SHARING, knob=DISTANCE, unfit=unshared
)
class FastLic:
    """The midpoint rule along lines that serve all pixels near them; means are differences of running sums."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: reused_opencl(device, task, knob))

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: reused_numpy(task, knob))


BITS = Knob("bits", (8.0, 12.0, 16.0), "of a stored position or vector", 4.0, 16.0)
FIXED = Ladder(BITS, (0.106, 0.098, 0.098))


def fixed_work(p: Parameters, bits: float, facts: InputFacts) -> float:
    return work(2, p, 1.0, facts)


def unfixed(p: Parameters, facts: InputFacts) -> str | None:
    return "its lines go by arc length" if p.speed is Speed.FIELD else by_pixels_alone(p, facts)


@lic.method("fixed", error=FIXED.error, orderly=True, work=fixed_work, rates=SAMPLING, knob=BITS, unfit=unfixed)
class Fixed:
    """Positions and the parts of the vectors rounded to the codes of a frame buffer, as pixel textures made it."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: advanced_opencl(device, task, knob))

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return pictured(inputs, parameters, lambda task: advanced_numpy(task, knob))
