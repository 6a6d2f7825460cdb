"""What an operation reports beside its pixels, and results of several pictures, from the declaration to the file."""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import Image as Pictures

import lichen
from lichen import catalogue
from lichen.errors import InvalidRequest, UnsupportedFormat
from lichen.files import FORMATS, encode, probe
from lichen.image import Image, Space, Storage
from lichen.memory import Array, aligned
from lichen.opencl.device import default_device
from lichen.operation import (
    EXACT,
    POINTWISE,
    Facts,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)


class Parameters(OperationParameters):
    lift: float = 1.0
    """what is added"""


def _lifted(inputs: Inputs, p: Parameters) -> Array:
    return inputs["image"].pixels + inputs["image"].pixels.dtype.type(p.lift)


@pytest.fixture
def lift(monkeypatch: pytest.MonkeyPatch) -> Operation[Parameters]:
    """An operation that reports the mean of what came in and of what goes out."""
    made = Operation(
        name="lift",
        family="trial",
        summary="Adds.",
        parameters=Parameters,
        inputs=(Input("image"),),
        light=Light.STORED,
        footprint=lambda p, facts: POINTWISE,
        identity=lambda p, facts: "nothing is added" if p.lift == 0 else None,
    )
    made.truth(_lifted)

    @made.findings
    def found(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
        return {"before": float(inputs["image"].pixels.mean()), "after": float(pixels.mean())}

    def cost(p: Parameters, knob: float, facts: InputFacts) -> float:
        return 0.0

    @made.method(
        "exact", error=lambda p, knob, facts: EXACT, work=cost, rates={"numpy": Rate(0, 0), "opencl": Rate(0, 0)}
    )
    class Exact:
        @staticmethod
        def opencl(device: Any, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
            return _lifted(inputs, parameters)

        @staticmethod
        def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
            return _lifted(inputs, parameters)

    known = MappingProxyType({**catalogue.operations(), "lift": made})
    monkeypatch.setattr(catalogue, "operations", lambda: known)
    return made


def test_findings_come_with_the_result(lift: Operation[Parameters]) -> None:
    assert lift.finds
    result = lichen.run("lift", np.full((2, 2), 0.5), lift=0.25, device="numpy")
    assert result.findings == {"before": 0.5, "after": 0.75}
    assert result.timing["findings"] >= 0


def test_what_changes_nothing_still_reports(lift: Operation[Parameters]) -> None:
    result = lichen.run("lift", np.full((2, 2), 0.5), lift=0, device="numpy")
    assert result.method == "identity"
    assert result.findings == {"before": 0.5, "after": 0.5}


@pytest.mark.parametrize(
    ("name", "values"),
    [("compare", {}), ("compare", {"map": "signed", "metrics": []}), ("gamut", {"action": "report", "peak": 0.9})],
)
def test_what_one_pass_makes_and_finds_is_what_two_do(name: str, values: dict[str, Any]) -> None:
    device = default_device()
    if device is None:
        pytest.skip("there is one pass on devices alone")
    operation = lichen.operations()[name]
    drawn = np.random.default_rng(4).random((2, 300, 301, 3), dtype=np.float32)
    inputs = {each.name: Image(aligned(pixels)) for each, pixels in zip(operation.inputs, drawn, strict=False)}
    result = lichen.run(name, **inputs, **values, device="opencl")
    assert "findings" not in result.timing, "they came with the pixels"
    parameters, method = operation.validate(values), operation.methods[result.method]
    assert np.array_equal(result.image.pixels, method.implementation.opencl(device, inputs, parameters, 0.0))
    assert result.findings == operation.find(inputs, parameters, result.image.pixels, device)


def test_most_report_nothing() -> None:
    assert lichen.run("gaussian", np.ones((2, 2)), sigma=1, device="numpy").findings == {}


# Several pictures

STRIP = np.arange(3 * 4 * 5 * 3, dtype=np.float32).reshape(12, 5, 3) / 180
PAGES = STRIP.reshape(3, 4, 5, 3)


def strip(space: Space = Space.LINEAR, storage: Storage = Storage.FLOAT32) -> Image:
    return Image(STRIP, space, storage=storage, pages=3)


def test_tiff_holds_them_as_pages() -> None:
    data = encode(strip(), "tiff").data
    assert probe(data).pages == 3
    with tifffile.TiffFile(io.BytesIO(data)) as file:
        assert np.array_equal(np.stack([page.asarray() for page in file.pages]), PAGES)


def test_tiff_holds_grey_ones_as_pages() -> None:
    data = encode(Image(STRIP[:, :, :1], pages=3), "tiff").data
    with tifffile.TiffFile(io.BytesIO(data)) as file:
        assert np.array_equal(np.stack([page.asarray() for page in file.pages]), PAGES[..., 0])


def test_npy_holds_them_along_a_first_axis() -> None:
    assert np.array_equal(np.load(io.BytesIO(encode(strip(), "npy").data)), PAGES)


def test_webp_holds_them_as_an_animation() -> None:
    encoded = encode(strip(Space.SRGB, Storage.UINT8), "webp")
    assert probe(encoded.data).pages == 3
    with Pictures.open(io.BytesIO(encoded.data)) as file:
        for number, page in enumerate(PAGES):
            file.seek(number)
            assert np.array_equal(np.asarray(file.convert("RGB")), np.rint(page * 255).astype(np.uint8))


@pytest.mark.parametrize("name", [name for name, each in FORMATS.items() if not each.paged])
def test_other_formats_say_that_they_hold_one(name: str) -> None:
    storage = FORMATS[name].storages[0]
    space = FORMATS[name].natural_space(storage)
    with pytest.raises(UnsupportedFormat) as caught:
        encode(strip(space, storage), name)
    assert "the result has 3" in caught.value.flaws[0].detail


def test_operations_take_one_picture() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("gaussian", strip(), sigma=1)
    assert caught.value.flaws[0].detail == "must be one picture (has 3 pages)"
    assert Facts.of(strip()).pages == 3


def test_infinities_are_no_reason_to_warn() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = lichen.run("spherical_harmonics", np.full((4, 8, 3), np.inf, np.float32), bands=5)
    assert result.findings
