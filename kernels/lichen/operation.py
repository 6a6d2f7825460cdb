"""What an operation is: the one declaration from which everything else is derived.

An operation's file declares its parameters, inputs, footprint, identity, working light, methods with their knobs, its
truth and its hard cases. Validation, JSON Schema, the command line, the HTTP routes, the generic tests, the benchmarks
and the accuracy tables read that declaration; none of them knows any operation by name.

The parts, in the order a reader meets them:

* `OperationParameters` (in `parameters`): a frozen pydantic model; units are annotations (`Pixels`, `Degrees`).
* `Footprint`, `Part` (in `part`): which input pixels an output pixel depends on, and how a part of a result is made.
* `Input`: a named image the operation reads.
* `Facts`: what is known of an image without its pixels; predictions are made from facts alone.
* `Method`: one way to compute the operation, on every backend, with the error it can make and the work it takes.
* `HardCase`: an input that breaks naive code, and what must hold.
* `Operation`: all of these under one name, and the findings that it reports beside its pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Generic, Literal, Protocol, TypeVar

import numpy as np
from pydantic import ValidationError

from lichen.errors import Flaw, InvalidRequest, parameter_flaws
from lichen.image import Alpha, Extent, Image, Space
from lichen.joining import Link
from lichen.memory import Array
from lichen.parameters import Border as Border
from lichen.parameters import Degrees as Degrees
from lichen.parameters import OperationParameters as OperationParameters
from lichen.parameters import Pixels as Pixels
from lichen.parameters import from_text
from lichen.part import POINTWISE as POINTWISE
from lichen.part import WHOLE as WHOLE
from lichen.part import Footprint as Footprint
from lichen.part import Part, Rectangle
from lichen.part import halo as halo
from lichen.rate import Knob as Knob
from lichen.rate import Rate as Rate
from lichen.stage import Head, Stage, no_head, no_stage
from lichen.study import Study

if TYPE_CHECKING:
    from lichen.opencl.device import Device

P = TypeVar("P", bound=OperationParameters)
P_contra = TypeVar("P_contra", bound=OperationParameters, contravariant=True)

# -------------------------------------------------------------------------------------------------------- inputs


@dataclass(frozen=True, slots=True)
class Input:
    """An image the operation reads.

    `channels` is the smallest and the largest channel count it takes (None: no upper end). An input that is a
    picture takes part in the operation's working light; one that is data (a field, a table) never does.
    """

    name: str
    description: str = ""
    channels: tuple[int, int | None] = (1, None)
    required: bool = True
    picture: bool = True


class Light(StrEnum):
    """In which light the definition of an operation holds."""

    LINEAR = "linear"
    """sums of light: pictures are brought to scene-linear, associated alpha before, and back after"""
    STORED = "stored"
    """the numbers as they are"""


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known of an image without its pixels."""

    height: int
    width: int
    channels: int
    space: Space = Space.DATA
    alpha: Alpha = Alpha.NONE
    extent: Extent = Extent(0.0, 1.0, 0)
    pages: int = 1
    """pictures of equal height, one below the other; only results have more than one"""

    @property
    def pixels(self) -> int:
        return self.height * self.width

    @property
    def samples(self) -> int:
        return self.height * self.width * self.channels

    @classmethod
    def of(cls, image: Image) -> Facts:
        sized = image.height, image.width, image.channels, image.space, image.alpha
        return cls(*sized, extent=image.extent, pages=image.pages)

    @classmethod
    def sized(cls, image: Image) -> Facts:
        """What is known of a picture without a look at its pixels: its extent means nothing."""
        return cls(image.height, image.width, image.channels, image.space, image.alpha, pages=image.pages)


Inputs = Mapping[str, Image]
InputFacts = Mapping[str, Facts]

# ------------------------------------------------------------------------------------------------- error and work


@dataclass(frozen=True, slots=True)
class Error:
    """The largest absolute difference from truth, in output units, over all finite pixels, borders included.

    `kind` says how it is known: a `bound` is proved, an `estimate` comes from a calibration corpus, and a `measured`
    error was found on this very image. `rounding` is the part of `value` that is the rounding of float32 arithmetic, or
    of the precision that values are to be kept in: what a caller who asks for nothing else accepts anyway. Underflow is
    not counted: no difference below the smallest normal float32 breaks a bound. `typical` is the RMS error to expect,
    where a corpus gave one: it ranks methods whose worst case no proof separates.
    """

    value: float
    kind: Literal["bound", "estimate", "measured"]
    rounding: float = 0.0
    typical: float | None = None

    @property
    def usual(self) -> float:
        """The typical error, or the largest where nothing better is known."""
        return self.value if self.typical is None else self.typical

    def __str__(self) -> str:
        return f"{self.value:.3g} ({self.kind})"


EXACT = Error(0.0, "bound")
ROUNDING = float(np.finfo(np.float32).eps) / 2
"""Unit roundoff of float32: the largest relative error of one correctly rounded operation."""


class Implementation(Protocol[P_contra]):
    """The bodies of a method: a class without state whose two functions return an array of the output's shape."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: P_contra, knob: float, /) -> Array: ...

    @staticmethod
    def numpy(inputs: Inputs, parameters: P_contra, knob: float, /) -> Array: ...


@dataclass(frozen=True)
class Method(Generic[P]):
    """One way to compute an operation.

    `error` and `work` predict from parameters, knob and facts alone; `unfit` gives the reason why the method cannot
    take a case, or None. `work` counts the method's own elementary steps (multiply-adds, samples); `rates` turn it
    into seconds per backend, as measured.
    """

    name: str
    description: str
    implementation: type[Implementation[P]]
    error: Callable[[P, float, InputFacts], Error]
    work: Callable[[P, float, InputFacts], float]
    rates: Mapping[str, Rate]
    knob: Knob | None = None
    unfit: Callable[[P, InputFacts], str | None] = lambda parameters, facts: None
    stage: Callable[[P, InputFacts], Stage | None] = no_stage
    """what it is as a step of a fused chain on OpenCL, where it is pointwise and reads one picture or two"""
    scratch: float | None = None
    """what it takes for itself while it runs on OpenCL, in float32 pictures as large as the largest that it reads or
    makes, as measured; None: nothing where the operation is pointwise, else one"""
    body: str = ""
    """a name for what runs: methods of an operation that have the same take the same time for a step of their work, and
    are timed together, so that how they compare is not left to chance. Without one it runs what no other does."""
    least: Callable[[P, float, InputFacts], float] | None = None
    """what its error is at least, and its usual one, rounding aside: known at once where `error` takes long to prove,
    so that methods that cannot be accurate enough need not be asked; None where `error` does not take long"""
    head: Callable[[P, float, InputFacts], Head | None] = no_head
    """what it is at the head of a fused chain on OpenCL, where its kernel goes on with one"""
    coded: bool = False
    """whether its kernel looks up what stored samples mean itself (`StoredImage`), where there are tables of it"""
    lightest: Callable[[P, float, InputFacts], float] | None = None
    """what its work is at least, at this setting and at all that follow it: known at once where `work` or `error` take
    long, so that methods that cannot be quick enough need not be asked"""
    orderly: bool = False
    """whether its error is known at once, and no value of its knob makes it larger, rounding aside, than one before:
    the first that is accurate enough is then found in a few steps, and where no value takes less work than one before
    it, only the last is looked at of values that all take the same"""
    finding: Callable[[Device, Inputs, P, float], tuple[Array, Mapping[str, Any]] | None] | None = None
    """what its body for OpenCL makes, and what the operation reports of it, where both come out of one pass; None of
    what is done in two"""

    @property
    def settings(self) -> tuple[float | None, ...]:
        """Of its knob, where it has one."""
        return self.knob.values if self.knob else (None,)

    def seconds(self, backend: str, parameters: P, knob: float, facts: InputFacts) -> float:
        return self.rates[backend].seconds(self.work(parameters, knob, facts))


# ------------------------------------------------------------------------------------------------------ hard cases


@dataclass(frozen=True)
class HardCase:
    """An input that breaks naive code.

    `inputs` makes the images (arrays or `Image`s by input name); `holds` receives them and the result's pixels and
    returns what is wrong, or None. Every method is held to it on every backend.
    """

    name: str
    why: str
    inputs: Callable[[], Mapping[str, Any]]
    parameters: Mapping[str, Any]
    holds: Callable[[Mapping[str, Any], Array], str | None]
    methods: tuple[str, ...] | None = None
    """the methods it is meant for; None means all"""


# -------------------------------------------------------------------------------------------------------- operation


def _first(facts: InputFacts) -> Facts:
    return next(iter(facts.values()))


@dataclass(eq=False)
class Operation(Generic[P]):
    """One named image function. Immutable once its file is loaded."""

    name: str
    family: str
    summary: str
    parameters: type[P]
    inputs: tuple[Input, ...]
    light: Light
    footprint: Callable[[P, InputFacts], Footprint]
    identity: Callable[[P, InputFacts], str | None] = lambda parameters, facts: None
    """the reason why the output equals the first input bit for bit, or None"""
    result: Callable[[P, InputFacts], Facts] = lambda parameters, facts: _first(facts)
    """facts of the output; its extent must contain every finite output value"""
    propagate: Callable[[P, InputFacts, float], float] = lambda parameters, facts, error: error
    """the largest change of the output when the pictures change by at most `error` (the modulus of continuity)"""
    departure: Callable[[P, InputFacts], Mapping[str, float]] = lambda parameters, facts: {}
    """how far the output is from an input at most, by the input's name, where that is known: an operation whose work
    would not be seen hands on that input instead"""
    hides: Callable[[P, InputFacts], str | None] | None = None
    """the picture, by its input's name, whose pixels it hands on wherever they cover wholly, whatever else it reads"""
    implied: Callable[[P, InputFacts], Mapping[str, Array] | str] = lambda parameters, facts: {}
    """inputs by name that were left out and depend on where a pixel lies: with them, crops of the inputs, wider by the
    footprint, give the crop of the result. Text says why nothing makes them do so."""
    part: Callable[[P, InputFacts, Rectangle], Part | None] | None = None
    """how a rectangle of the result is made where the footprint does not tell; None where only the whole can be. What
    it declares holds for its findings, too: those of a part are those of the whole."""
    link: Callable[[P, InputFacts], Link | None] = lambda parameters, facts: None
    """what it is for neighbours that might be joined with it"""
    inverse: Callable[[P], P | None] = lambda parameters: None
    """parameters with which this operation undoes itself, or None"""
    wants_alpha: Alpha | None = None
    """the kind of alpha the definition holds for, where the input has one; None: alpha is a channel like the others"""
    as_stored: Callable[[P], bool] = lambda parameters: False
    """whether these parameters ask for the numbers as they are, although `light` is linear"""
    check: Callable[[P, InputFacts], list[Flaw]] = lambda parameters, facts: []
    """flaws that only parameters and inputs together show, found before any pixel is computed"""
    customary: tuple[str, float | None] | None = None
    """the method and knob that the field takes for granted: run where a caller asks for nothing and no method's error
    lies below what the output could show; the most accurate where nothing is declared"""
    examples: tuple[Mapping[str, Any], ...] = ({},)
    """parameter sets that show what it does; tests, benchmarks and documentation run all of them"""
    hard_cases: tuple[HardCase, ...] = ()
    description: str = ""
    study: Callable[[], Study] | None = None
    """measures what is worth knowing of it beside its errors; made once, and kept"""
    table: Callable[[Mapping[str, Any]], Array] | None = None
    """its findings as rows of numbers, float64 (n, columns), where they are such; `table_columns` names the columns"""
    table_columns: tuple[str, ...] = ()
    find_on: Callable[[Device, Inputs, P, Array], Mapping[str, Any]] | None = None
    """the same findings by a device, where that is quicker"""
    methods: dict[str, Method[P]] = field(default_factory=dict, init=False)
    _truth: Callable[[Inputs, P], Array] | None = field(default=None, init=False)
    _findings: Callable[[Inputs, P, Array], Mapping[str, Any]] | None = field(default=None, init=False)

    def truth(self, function: Callable[[Inputs, P], Array]) -> Callable[[Inputs, P], Array]:
        """Decorator: the float64 definition. It receives float64 images and returns a float64 array."""
        self._truth = function
        return function

    def findings(
        self, function: Callable[[Inputs, P, Array], Mapping[str, Any]]
    ) -> Callable[[Inputs, P, Array], Mapping[str, Any]]:
        """Decorator: what the operation reports beside its pixels. It receives the inputs as its method did, the
        parameters and the resulting pixels, and returns JSON values; a number that is not finite becomes null."""
        self._findings = function
        return function

    def method(
        self,
        name: str,
        *,
        error: Callable[[P, float, InputFacts], Error],
        work: Callable[[P, float, InputFacts], float],
        rates: Mapping[str, Rate],
        knob: Knob | None = None,
        unfit: Callable[[P, InputFacts], str | None] = lambda parameters, facts: None,
        stage: Callable[[P, InputFacts], Stage | None] = no_stage,
        scratch: float | None = None,
        body: str = "",
        least: Callable[[P, float, InputFacts], float] | None = None,
        head: Callable[[P, float, InputFacts], Head | None] = no_head,
        coded: bool = False,
        lightest: Callable[[P, float, InputFacts], float] | None = None,
        orderly: bool = False,
        finding: Callable[[Device, Inputs, P, float], tuple[Array, Mapping[str, Any]] | None] | None = None,
    ) -> Callable[[type[Implementation[P]]], type[Implementation[P]]]:
        """Class decorator: registers a method; its docstring is the method's description."""

        def register(implementation: type[Implementation[P]]) -> type[Implementation[P]]:
            description = " ".join((implementation.__doc__ or "").split())
            further = knob, unfit, stage, scratch, body, least, head, coded, lightest, orderly, finding
            self.methods[name] = Method(name, description, implementation, error, work, rates, *further)
            return implementation

        return register

    def evaluate_truth(self, inputs: Inputs, parameters: P) -> Array:
        """The exact result as float64, shape (height, width, channels)."""
        if self._truth is None:
            raise TypeError(f"operation {self.name} declares no truth")
        doubled = {name: image.replace(pixels=image.pixels.astype(np.float64)) for name, image in inputs.items()}
        return self._truth(doubled, parameters)

    @property
    def generates(self) -> bool:
        """Whether it can make a picture from no other; `width` and `height` are then parameters."""
        return (
            not any(each.required for each in self.inputs)
            and {"width", "height"} <= self.parameters.model_fields.keys()
        )

    def sized(self, parameters: P, height: int, width: int) -> P:
        """The parameters with which an operation that makes pictures makes them of this size; others as they are."""
        return parameters.model_copy(update={"height": height, "width": width}) if self.generates else parameters

    @property
    def finds(self) -> bool:
        """Whether it reports anything beside its pixels."""
        return self._findings is not None

    def find(self, inputs: Inputs, parameters: P, pixels: Array, device: Device | None = None) -> Mapping[str, Any]:
        """What it reports; empty where it declares nothing to report."""
        if device is not None and self.find_on is not None:
            return self.find_on(device, inputs, parameters, pixels)
        return {} if self._findings is None else self._findings(inputs, parameters, pixels)

    def truth_seconds(self, parameters: P, facts: InputFacts) -> float:
        """A guess at the time that `evaluate_truth` takes: ten times that of the dearest method on NumPy."""
        settings = [(each, each.knob.values[-1] if each.knob else 0.0) for each in self.methods.values()]
        return 10 * max(method.seconds("numpy", parameters, knob, facts) for method, knob in settings)

    @property
    def knobs(self) -> dict[str, Knob]:
        """Knobs of all methods by name; methods that share a name share its meaning."""
        return {method.knob.name: method.knob for method in self.methods.values() if method.knob}

    def validate(self, values: Mapping[str, Any]) -> P:
        """Parameters from a mapping. Raises `InvalidRequest` naming every bad field at once.

        Text is accepted for every field, as a URL gives it: numbers and enumerations plain, the rest as JSON.
        """
        fields = self.parameters.model_fields
        prepared = {name: from_text(value, fields.get(name)) for name, value in values.items()}
        try:
            return self.parameters.model_validate(prepared)
        except ValidationError as invalid:
            flaws = parameter_flaws(invalid, self.name, fields)
            raise InvalidRequest(f"{len(flaws)} parameter(s) of {self.name} are not valid.", flaws) from None

    def schema(self) -> dict[str, Any]:
        """JSON Schema (2020-12) of the parameters."""
        return self.parameters.model_json_schema()
