"""What a viewer sees of errors: where the result is a colour picture, its colour difference and its FLIP.

Both are taken on the photograph of the corpus, borders included, as a display shows it: pictures are scene-linear light
for operations whose definition is one of light, and sRGB for the others. A result that is data, has not three colours
or is several pages is nothing to look at; one that is not finite everywhere has no score, since it would look perfect.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lichen.accuracy.colour import Viewed, delta_e, emitted, flip_between
from lichen.calibration.corpus import Case
from lichen.image import Image, Space
from lichen.memory import Array
from lichen.operation import Facts, Light, Operation, OperationParameters

SHOWN = "photo"
"""The picture of the corpus that is looked at."""


class Look(NamedTuple):
    """How a result differs from truth to the eye."""

    delta_e: float
    """CIEDE2000, largest of all pixels"""
    flip: float
    """mean of all pixels"""


class Viewer:
    """Looks at results beside one truth."""

    def __init__(self, form: Image, truth: Array) -> None:
        self._form, self._truth = form, Viewed(emitted(form, truth))

    def look(self, pixels: Array) -> Look | None:
        """None where there is NaN or infinity."""
        if not np.isfinite(pixels).all():
            return None
        shown = Viewed(emitted(self._form, pixels))
        apart, seen = delta_e(shown.lab, self._truth.lab), flip_between(shown, self._truth)
        return Look(float(apart.max()), float(seen.mean()))


def viewer(operation: Operation[Any], parameters: OperationParameters, case: Case, truth: Array) -> Viewer | None:
    """None where the result is nothing to look at."""
    if case.name != SHOWN or not np.isfinite(truth).all():
        return None
    made = operation.result(parameters, _lit(operation, case.facts))
    form = Image(truth.astype(np.float32), space=made.space, alpha=made.alpha)
    return Viewer(form, truth) if made.space is not Space.DATA and form.colours == 3 and made.pages == 1 else None


def _lit(operation: Operation[Any], facts: Mapping[str, Facts]) -> dict[str, Facts]:
    """With pictures in the light that the operation is defined in."""
    space = Space.LINEAR if operation.light is Light.LINEAR else Space.SRGB
    pictures = {each.name for each in operation.inputs if each.picture}
    return {name: dataclasses.replace(each, space=space) if name in pictures else each for name, each in facts.items()}
