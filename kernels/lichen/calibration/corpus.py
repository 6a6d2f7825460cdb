"""The images on which methods are compared with truth: the same pixels everywhere, at any size.

Six pictures, each hard for another reason: a zone plate (every frequency and direction), wedges (step edges at every
angle), white noise, a photograph-like picture of natural statistics, the same with highlights up to 1e4, and a gradient
(where a quantum shows). Vector fields are smooth, or as rough as noise. To these come the inputs of the operation's own
hard cases, but those with NaN or infinity: a method whose kernel is shorter than truth's rightly keeps them nearer, and
the cases themselves say what must hold. All values of pictures but the highlights lie in [0, 1].

No operation gets the same image twice, since what it makes of equal ones may be nothing: an input that would hold what
an earlier one does holds it shifted, what leaves at one side entering at the other.

Nothing is read from a file: the photograph is made by shaping noise as photographs are shaped, with amplitudes that
fall with frequency (Field, J. Opt. Soc. Am. A 4, 1987) and a few large areas of their own brightness.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image, as_image
from lichen.memory import Array, aligned
from lichen.operation import Facts, Input, InputFacts, Inputs, Operation, OperationParameters

BRIGHTEST = 1e4
TILE = 256
"""px; larger pictures repeat one of this size where only their time matters."""
MOST_FURTHER = 3
"""Optional inputs that are tried, one more at a time."""
COLOURS = (3, 4, 1)
"""Channels of a picture, in the order in which an operation is offered them."""


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """Inputs under a name."""

    name: str
    inputs: Inputs

    @property
    def facts(self) -> InputFacts:
        return {name: Facts.of(image) for name, image in self.inputs.items()}


def cases(operation: Operation[Any], parameters: OperationParameters, size: int) -> Iterator[Case]:
    """All inputs of the corpus that the operation takes with these parameters, the main one first.

    Where the required inputs are data (a field), they vary over fields, and pictures over the smooth one. Operations
    that need no input get none.
    """
    for content, inputs in _drawn(operation, parameters, size):
        case = Case(content, _unlike(inputs))
        if not operation.check(parameters, case.facts):
            yield case
    for hard in operation.hard_cases:
        try:
            case = Case(f"hard: {hard.name}", {name: as_image(value) for name, value in hard.inputs().items()})
        except InvalidRequest:  # a case of something that is no image at all
            continue
        finite = all(image.extent.nonfinite == 0 for image in case.inputs.values())
        if finite and _complete(operation, case.inputs) and not operation.check(parameters, case.facts):
            yield case


def typical(operation: Operation[Any], parameters: OperationParameters, size: int) -> Case:
    """The inputs on which times are measured: the photograph, or the smooth field with the default of the rest.

    Large ones repeat a smaller one: no time depends on what a pixel's distant neighbours hold.
    """
    part = min(size, TILE)
    if _led_by_picture(operation):
        name, inputs = "photo", _covered(operation, parameters, "photo", part)
    elif operation.generates:
        name, inputs = "nothing", {}
    else:
        name, inputs = "smooth field", _fields(operation, parameters, "smooth field", part)
    return Case(name, {key: _repeated(image, size) for key, image in _unlike(inputs).items()})


def _unlike(inputs: Inputs) -> dict[str, Image]:
    """The inputs with those shifted that hold the same as an earlier one, further for each."""
    made, seen = dict(inputs), list[Array]()
    for name, image in inputs.items():
        times = sum(np.array_equal(image.pixels, other) for other in seen)
        seen.append(image.pixels)
        if times:
            down, right = (times * side // 3 for side in image.pixels.shape[:2])
            made[name] = image.replace(pixels=aligned(np.roll(image.pixels, (down, right), (0, 1))))
    return made


def _repeated(image: Image, size: int) -> Image:
    count = -(-size // image.height)
    pixels = image.pixels if count == 1 else np.tile(image.pixels, (count, count, 1))[:size, :size]
    return image.replace(pixels=aligned(pixels))


def _drawn(operation: Operation[Any], parameters: OperationParameters, size: int) -> Iterator[tuple[str, Inputs]]:
    if _led_by_picture(operation):
        for content in PICTURES:
            yield content, _covered(operation, parameters, content, size)
        return
    if not any(each.required for each in operation.inputs):
        yield "nothing", {}
        return
    for kind in FIELDS:
        yield kind, _fields(operation, parameters, kind, size)
    pictures = [each for each in operation.inputs if each.picture]
    for content in PICTURES if pictures else ():
        drawn = {each.name: as_image(_fitting(each, content, size)) for each in pictures}
        yield content, _fields(operation, parameters, "smooth field", size) | drawn


def _led_by_picture(operation: Operation[Any]) -> bool:
    return any(each.picture and each.required for each in operation.inputs)


def _fields(operation: Operation[Any], parameters: OperationParameters, kind: str, size: int) -> dict[str, Image]:
    """The required inputs, and as few of the optional ones as these parameters are satisfied with."""
    required = {each.name: as_image(_vectors(each, kind, size)) for each in operation.inputs if each.required}
    made = dict(required)
    for further in [each for each in operation.inputs if not each.required][:MOST_FURTHER]:
        if not operation.check(parameters, {name: Facts.of(image) for name, image in made.items()}):
            return made
        drawn = _fitting(further, "photo", size) if further.picture else _vectors(further, kind, size)
        made[further.name] = as_image(drawn)
    return required if operation.check(parameters, {name: Facts.of(each) for name, each in made.items()}) else made


def _vectors(declared: Input, kind: str, size: int) -> Array:
    """A field of the components that the input takes, of two where it may be; a third, as normals have it, completes
    vectors of the first two to a length of 1 where they are shorter."""
    fewest, most = declared.channels
    made = field(kind, size)
    if fewest <= 2:
        return aligned(made[..., :most])
    third = np.sqrt(np.maximum(1 - np.square(made.astype(np.float64)).sum(axis=-1, keepdims=True), 0))
    return aligned(np.concatenate([made, third] + [made] * (fewest - 3), axis=-1)[..., :fewest])


def _covered(operation: Operation[Any], parameters: OperationParameters, content: str, size: int) -> dict[str, Image]:
    """The picture in the first shape that the operation takes and changes: without coverage if it may be, and with as
    few of the optional inputs as these parameters are satisfied with."""
    offered, taken = [], []
    optional = [each for each in operation.inputs if not each.required]
    for further in range(min(len(optional), MOST_FURTHER) + 1):
        declared = [each for each in operation.inputs if each.required] + optional[:further]
        for inputs in _shapes(declared, content, size):
            offered.append(inputs)
            facts = {name: Facts.of(image) for name, image in inputs.items()}
            if not operation.check(parameters, facts):
                if operation.identity(parameters, facts) is None:
                    return inputs
                taken.append(inputs)
        if taken:
            return taken[0]
    return offered[0]


def _shapes(declared: Sequence[Input], content: str, size: int) -> Iterator[dict[str, Image]]:
    """Pictures of several channel counts, then with coverage."""
    for count in COLOURS:
        yield {each.name: as_image(_fitting(each, content, size, count)) for each in declared}
    coverage = picture("gradient", size)[..., :1]
    for alpha in (Alpha.STRAIGHT, Alpha.ASSOCIATED):
        inputs = {each.name: as_image(_fitting(each, content, size)) for each in declared}
        for name, image in inputs.items():
            colours = image.pixels * coverage if alpha is Alpha.ASSOCIATED else image.pixels
            inputs[name] = Image(aligned(np.concatenate([colours, coverage], axis=2)), alpha=alpha)
        yield inputs


def _fitting(declared: Input, content: str, size: int, count: int = 3) -> Array:
    """The picture with `count` channels, or as near to it as the input takes."""
    fewest, most = declared.channels
    if not declared.picture:
        return _vectors(declared, "smooth field", size)
    count = max(fewest, min(count, most or count))
    colours = picture(content, size)
    return aligned(np.concatenate([colours] * -(-count // 3), axis=2)[..., :count])


def _complete(operation: Operation[Any], inputs: Inputs) -> bool:
    """Whether these are inputs of the operation, none is missing and the channels fit."""
    declared = {each.name: each for each in operation.inputs}
    if not inputs.keys() <= declared.keys() or any(d.required and n not in inputs for n, d in declared.items()):
        return False
    counts = {name: declared[name].channels for name in inputs}
    return all(counts[n][0] <= image.channels <= (counts[n][1] or image.channels) for n, image in inputs.items())


# -------------------------------------------------------------------------------------------------------- the images


@lru_cache(maxsize=24)
def picture(content: str, size: int) -> Array:
    """One of `PICTURES`, float32 (size, size, 3)."""
    made = PICTURES[content](size)
    colours = np.broadcast_to(made if made.ndim == 3 else made[..., None], (size, size, 3))
    pixels = aligned(colours.astype(np.float32))
    pixels.flags.writeable = False
    return pixels


@lru_cache(maxsize=8)
def field(kind: str, size: int) -> Array:
    """One of `FIELDS`, float32 (size, size, 2): x to the right, y down, components in [-1, 1]."""
    pixels = aligned(FIELDS[kind](size).astype(np.float32))
    pixels.flags.writeable = False
    return pixels


def _centred(size: int) -> tuple[Array, Array]:
    """x and y of the pixel centres, in [-1, 1]."""
    at = (2 * np.arange(size) + 1) / size - 1
    return at[None, :], at[:, None]


def _zone_plate(size: int) -> Array:
    """Reaches the highest frequency at the middle of each side."""
    x, y = _centred(size)
    wave: Array = 0.5 + 0.5 * np.cos(np.pi / 4 * size * (x * x + y * y))
    return wave


def _wedges(size: int) -> Array:
    """32 sectors, black and white in turn, the colours turned against each other."""
    x, y = _centred(size)
    turns = np.arctan2(y - 0.013, x + 0.007) / (2 * np.pi)
    return np.stack([np.floor(16 * turns + shift) % 2 for shift in (0.0, 0.21, 0.43)], axis=-1)


def _noise(size: int) -> Array:
    noise: Array = np.random.default_rng(size).random((size, size, 3))
    return noise


def _photo(size: int) -> Array:
    """Amplitudes that fall as 1 / frequency, colours that agree in the main, areas of their own brightness."""
    rng = np.random.default_rng([size, 1])
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    frequency[0, 0] = 1.0
    layers = [np.fft.irfft2(np.fft.rfft2(rng.standard_normal((size, size))) / frequency, (size, size)) for _ in "abcd"]
    grey, *tints = (layer / layer.std() for layer in layers)
    x, y = _centred(size)
    for _ in range(6):
        a, b, turn = rng.uniform(-1, 1, 3)
        grey = grey + rng.uniform(-1, 1) * ((x - a) * np.cos(np.pi * turn) + (y - b) * np.sin(np.pi * turn) > 0)
    colours = np.stack([grey + 0.3 * tint for tint in tints], axis=-1)
    photo: Array = np.clip(0.45 + 0.2 * (colours - colours.mean()) / colours.std(), 0, 1)
    return photo


def _highlights(size: int) -> Array:
    """The photograph with one sample in fifty raised, to 10 or to anything up to 1e4."""
    rng = np.random.default_rng([size, 2])
    raised = 10 ** rng.uniform(1, np.log10(BRIGHTEST), (size, size, 1))
    return np.where(rng.random((size, size, 1)) < 0.02, raised, picture("photo", size).astype(np.float64))


def _gradient(size: int) -> Array:
    x, y = _centred(size)
    return np.stack(np.broadcast_arrays((x + 1) / 2, (y + 1) / 2, (2 + x + y) / 4), axis=-1)


def _smooth_field(size: int) -> Array:
    """Vortices and saddles, a few across the image; no vector is longer than 1."""
    x, y = _centred(size)
    smooth: Array = np.stack([np.sin(5 * y + np.cos(3 * x)), np.cos(4 * x - np.sin(3 * y))], axis=-1) / np.sqrt(2)
    return smooth


def _rough_field(size: int) -> Array:
    noise: Array = np.random.default_rng([size, 3]).uniform(-1, 1, (size, size, 2))
    return noise


PICTURES: Mapping[str, Callable[[int], Array]] = {
    "zone plate": _zone_plate,
    "wedges": _wedges,
    "noise": _noise,
    "photo": _photo,
    "highlights": _highlights,
    "gradient": _gradient,
}
FIELDS: Mapping[str, Callable[[int], Array]] = {"smooth field": _smooth_field, "rough field": _rough_field}
