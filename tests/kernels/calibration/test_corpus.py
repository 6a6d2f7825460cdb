"""The corpus: the same pixels everywhere, hard in the ways it says."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import pytest

from lichen.calibration.corpus import FIELDS, PICTURES, cases, field, picture, typical
from lichen.catalogue import operations
from lichen.image import as_image
from lichen.operation import Facts, Operation

OPERATIONS = operations()


@pytest.mark.parametrize("content", PICTURES)
def test_pictures_are_what_they_say(content: str) -> None:
    pixels = picture(content, 64)
    assert (pixels.shape, pixels.dtype) == ((64, 64, 3), np.float32)
    assert np.isfinite(pixels).all()
    assert pixels.min() >= 0
    assert (pixels.max() > 1e3) == (content == "highlights")
    if content != "highlights":
        assert pixels.max() <= 1
        assert np.ptp(pixels) > 0.9


def test_wedges_hold_nothing_but_black_and_white() -> None:
    assert set(np.unique(picture("wedges", 64))) == {0.0, 1.0}


def test_the_photograph_falls_with_frequency() -> None:
    power = np.abs(np.fft.rfft2(picture("photo", 128)[..., 1] - 0.45)) ** 2
    assert power[2:6, 2:6].mean() > 100 * power[40:60, 40:60].mean()


def test_fields_differ_in_smoothness() -> None:
    smooth, rough = (np.abs(np.diff(field(kind, 64), axis=0)).mean() for kind in FIELDS)
    assert rough > 5 * smooth
    assert max(np.hypot(*np.moveaxis(field("smooth field", 64), 2, 0)).ravel()) <= 1 + 1e-6


def test_pixels_do_not_change() -> None:
    """Up to the last bits of another processor's sines: figures of the error table rest on them."""
    for name in PICTURES:
        pixels = np.round(np.minimum(picture(name, 16), 2) * 100).astype(np.int16)
        assert hashlib.sha256(pixels.tobytes()).hexdigest()[:8] == DIGESTS[name], name


DIGESTS = {
    "zone plate": "a87662f7",
    "wedges": "26c557f9",
    "noise": "a12d472e",
    "photo": "2836ea94",
    "highlights": "ae1a9ac2",
    "gradient": "3a3a559b",
}


def fewest(operation: Operation[Any]) -> int:
    """Images of the corpus that an operation gets: all pictures, all fields, or the one case of nothing."""
    if operation.generates:
        return 1
    return 6 if any(each.picture and each.required for each in operation.inputs) else 2


@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=list(OPERATIONS))
def test_every_operation_has_images_it_works_on(operation: Operation[Any]) -> None:
    for example in operation.examples:
        parameters = operation.validate(example)
        found = list(cases(operation, parameters, 24))
        names = [case.name for case in found]
        assert len(set(names)) == len(names)
        assert len([name for name in names if not name.startswith("hard: ")]) >= fewest(operation)
        hard = [each.inputs() for each in operation.hard_cases]  # what only fills what is infinite has no other
        changed = [case.facts for case in found]
        changed += [{key: Facts.of(as_image(image)) for key, image in each.items()} for each in hard]
        assert any(operation.identity(parameters, facts) is None for facts in changed)
        main = typical(operation, parameters, 300)
        for image in main.inputs.values():
            assert (image.height, image.width) == (300, 300)
        assert main.name in names
