"""Tables of curves that are made of pieces: their bounds, their ends, and which curves have none."""

from __future__ import annotations

import numpy as np
import pytest

import lichen
from lichen.errors import LichenError
from lichen.image import Extent, as_image
from lichen.opencl.device import default_device
from lichen.operation import Facts
from lichen.operations.tone.curves import WHOLE, Curve, Direction
from lichen.operations.tone.definitions import definition
from lichen.operations.tone.tabled import Tabled, pays, tabled
from lichen.operations.tone.transfer import transfer
from lichen.operations.tone.transfer_parameters import Parameters

TABLE = transfer.methods["table"]
WAYS = [
    (curve, way)
    for curve in Curve
    for way in Direction
    if curve not in WHOLE and TABLE.unfit(Parameters(curve=curve, direction=way), {}) is None
]
SHAPES = [
    ("bt2020", "decode", "mirror"), ("bt2020", "encode", "clamp"), ("bt1361", "encode", "mirror"),
    ("apple_log", "encode", "mirror"), ("apple_log", "decode", "clamp"), ("nikon_nlog", "encode", "mirror"),
    ("nikon_nlog", "decode", "mirror"), ("dicom_gsdf", "decode", "mirror"), ("filmic_pro6", "decode", "mirror"),
]  # fmt: skip
"""Mirrored about zero and elsewhere or not at all; with lines below, with a curve below, and from zero on; held."""


def made(curve: Curve, way: Direction, size: int) -> Tabled:
    encode = way is Direction.ENCODE
    own = definition(curve, white=100.0, exposure_index=800)
    return tabled(own.curve(encode), own.curve(encode=False).at(1.0) if encode else 1.0, size)


@pytest.mark.parametrize("size", [300, 4096])
@pytest.mark.parametrize(("curve", "way"), WAYS)
def test_no_cell_is_beyond_the_bound(curve: Curve, way: Direction, size: int) -> None:
    """Nine places in each cell; and somewhere a quarter of the bound occurs, so that it is worth something."""
    it = made(curve, way, size)
    table = it.table
    starts = table.first + (np.arange(len(table.columns[0]) - 1, dtype=np.int64) << table.shift)
    nodes = starts.astype(np.int32).view(np.float32).astype(np.float64)
    width = (starts + (1 << table.shift)).astype(np.int32).view(np.float32).astype(np.float64) - nodes
    first = nodes[0] * np.geomspace(1e-6, 0.999, 50)  # the line from zero, which a knee above zero leaves unused
    chord = table.nodes[0, 0] + table.nodes[0, 1].astype(np.float64) * first
    worst = float(np.abs(chord - bare(it, first))[first >= it.knee].max(initial=0.0))
    for part in np.linspace(0, 1, 9, endpoint=False) + 1e-9:
        a = nodes + part * width
        chord = table.columns[0][:-1] + part * table.columns[1][:-1].astype(np.float64)
        wrong = np.abs(chord - bare(it, a))[(a >= it.knee) & (a <= it.top)]
        worst = max(worst, float(wrong.max()))
    assert worst <= table.bound + table.rounding
    assert worst >= table.bound / 4 - table.rounding or curve is Curve.DICOM_GSDF  # the cell of its knee decides


def bare(it: Tabled, a: np.ndarray) -> np.ndarray:
    """The curve of distances, without its centre."""
    centre = it.curve.centre or (0.0, 0.0)
    made: np.ndarray = it.curve(a + centre[0]) - centre[1]
    return made


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
@pytest.mark.parametrize(("curve", "way", "negative"), SHAPES)
def test_samples_keep_the_error_they_state(curve: str, way: str, negative: str, backend: str) -> None:
    """Within the table, where all is proved; and far around it with what is not finite."""
    p = Parameters(curve=curve, direction=way, negative=negative)
    it = made(p.curve, p.direction, 1024)
    middle = it.curve.centre[0] if it.curve.centre else 0.0
    random = np.random.default_rng(5)
    near = middle + np.concatenate([random.uniform(it.knee, it.top, 3000), it.knee + 10 ** random.uniform(-9, -2, 999)])
    knees = np.array([piece.start for piece in it.curve.pieces[1:]], np.float32).view(np.int32)[:, np.newaxis]
    around = (knees + np.arange(-2, 3, dtype=np.int32)).view(np.float32).reshape(-1)
    far = np.concatenate([near, around, random.uniform(-2, 2, 500), [np.nan, np.inf, -np.inf, -0.0, 4.0]])
    for values, proved in ((near.clip(middle + it.knee, middle + it.top), True), (far, False)):
        image = as_image(values.astype(np.float32).reshape(1, -1, 1))
        extent = Extent(middle + it.knee, middle + it.top, 0) if proved else image.extent
        stated = TABLE.error(p, 1024, {"image": Facts(1, values.size, 1, extent=extent)})
        assert (stated.kind == "bound") == proved
        truth = transfer.evaluate_truth({"image": image}, p)
        body = TABLE.implementation
        if backend == "numpy":
            found = body.numpy({"image": image}, p, 1024)
        else:
            device = default_device()
            assert device is not None
            found = body.opencl(device, {"image": image}, p, 1024)
        fine = np.isfinite(truth)
        np.testing.assert_array_equal(found[~fine], truth[~fine])
        assert np.abs(found[fine] - truth[fine]).max() <= stated.value


def test_curves_of_logarithms_have_no_table() -> None:
    assert not pays(definition(Curve.ACESCCT, white=1.0, exposure_index=800).curve(encode=True))
    with pytest.raises(LichenError, match="logarithm"):
        lichen.run("transfer", np.ones((2, 2, 1), np.float32), curve="slog3", method="table")


def test_the_dearest_curve_is_looked_up_where_an_error_is_allowed() -> None:
    plan = lichen.run("transfer", np.full((64, 64, 3), 0.4, np.float32), curve="filmic_pro6", max_error=1e-2)
    assert plan.method.startswith("table")
