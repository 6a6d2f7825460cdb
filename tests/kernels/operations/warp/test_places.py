"""Places that a device finds, against those of the definition: all maps, places and footprints, in several bands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from lichen.image import as_image
from lichen.memory import aligned, aligned_empty
from lichen.opencl.device import Device, default_device
from lichen.opencl.programs import compose
from lichen.operation import Border, Inputs
from lichen.operations.warp import displace, launch, lens_distort, mesh, panorama, polar, remap, thin_plate
from lichen.operations.warp.charts import SHAPE, Chart
from lichen.operations.warp.kernels import BILINEAR, NEAREST
from lichen.operations.warp.maps import Map, Places, Windowed
from lichen.operations.warp.reference import Source, interpolate, resample


@pytest.fixture(scope="module")
def device() -> Device:
    found = default_device()
    assert found is not None
    return found


WIDE, TALL = 150, 90
RANDOM = np.random.default_rng(0)
GIVEN = RANDOM.normal(size=(TALL, WIDE, 3)).astype(np.float32)
GIVEN[3, 4, 0], GIVEN[10:20, 50:60], GIVEN[0, 0] = np.nan, np.inf, np.nan
BENT = {"k": [-0.3, 0.9, -0.2], "p": [0.02, -0.01], "focal": 80, "centre": [0.3, 0.6]}
CASES: list[tuple[Any, Mapping[str, Any]]] = [
    *((polar, {"log": log, "start": 33, "inner": 2}) for log in (False, True)),
    *((polar, {"log": log, "start": -400, "inner": 3, "outer": 60, "direction": "inverse"}) for log in (False, True)),
    (displace, {"pattern": "ripple", "amplitude": 7, "length": 7.7, "phase": 1e3, "centre": [-1, 3], "reach": 80}),
    (displace, {"pattern": "swirl", "angle": 1000}),
    (displace, {"pattern": "taper", "amplitude": -2}),
    (displace, {"pattern": "haze", "amplitude": 5, "length": 9, "seed": 4_000_000_000, "phase": -3.2}),
    (displace, {"pattern": "haze", "length": 0.01, "phase": -3.2e5, "octaves": 12, "lacunarity": 3.1}),
    (displace, {"amplitude": 5, "bias": 0.2}),
    (remap, {"units": "unit", "origin": "bottom"}),
    (mesh, {"grid": mesh.EXAMPLE}),
    (mesh, {"grid": (RANDOM.normal(size=(7, 256, 2)) * 9).tolist(), "patches": "bilinear"}),
    (thin_plate, {"source_points": thin_plate.FOUR, "target_points": thin_plate.MOVED}),
    *((lens_distort, {**BENT, "direction": way}) for way in ("distort", "undistort")),
    *(
        (lens_distort, {"model": model, "k": k, "direction": way, "focal": 40})
        for model, k in (("brown_conrady", [-0.9]), ("kannala_brandt", [0.05, -0.01]), ("division", [0.2, 0.1]))
        for way in ("distort", "undistort")
    ),
]


def tables(device: Device, map_: Map, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    found: list[tuple[np.ndarray, np.ndarray]] = []
    with device.session() as session:
        for band in launch.bands(session, map_, width, height, steps=True):
            session.finish()
            assert band.table is not None
            assert band.steps is not None
            found.append((band.table[: band.rows].copy(), band.steps[: band.rows].copy()))
    assert len(found) == -(-height // 16)
    places, steps = (np.concatenate(each) for each in zip(*found, strict=True))
    return places, steps


def hold(device: Device, map_: Map, width: int, height: int) -> None:
    with np.errstate(all="ignore"):
        wanted = map_.places(np.arange(width) + 0.5, np.arange(height) + 0.5)
    wanted = Places(*(np.broadcast_to(each, (height, width)) for each in wanted))
    places, steps = tables(device, map_, width, height)
    seen = np.isfinite(wanted.x) & np.isfinite(wanted.y)
    np.testing.assert_array_equal(np.isfinite(places).all(axis=-1), seen)
    for axis, exact in enumerate(wanted[:2]):
        apart = places[seen, axis] - exact[seen]
        if np.isfinite(map_.periods[axis]):
            apart -= map_.periods[axis] * np.rint(apart / map_.periods[axis])
        # Searches end 1e-10 focal lengths from their answer, and beside a right angle a tangent doubles roundings.
        assert (np.abs(apart) <= 1e-8 + 1e-10 * np.abs(exact[seen])).all(), np.abs(apart).max()
    for number, exact in enumerate(wanted[2:]):
        np.testing.assert_allclose(steps[seen, number], exact[seen], rtol=1e-5, atol=2e-6)


@pytest.mark.parametrize(("module", "parameters"), CASES)
def test_places_of_a_device_are_those_of_the_definition(
    device: Device, monkeypatch: pytest.MonkeyPatch, module: Any, parameters: Mapping[str, Any]
) -> None:
    monkeypatch.setattr(launch, "BAND", 1)
    p = module.Parameters.model_validate(parameters)
    inputs: Inputs = {"image": as_image(np.zeros((TALL, WIDE, 1), np.float32)), "map": as_image(GIVEN)}
    map_ = thin_plate.Bending(thin_plate._plate(p)) if module is thin_plate else module._map(p, inputs)
    assert map_.recipe() is not None
    hold(device, map_, WIDE, TALL)


@pytest.mark.parametrize(
    ("module", "parameters"),
    [
        (displace, {"amplitude": 5}),
        (remap, {"units": "unit"}),
        *((polar, {"log": log, "start": 33, "inner": 2, "width": WIDE, "height": TALL}) for log in (False, True)),
    ],
)
def test_a_part_of_what_filters_find_themselves_is_that_of_the_whole(
    device: Device, monkeypatch: pytest.MonkeyPatch, module: Any, parameters: Mapping[str, Any]
) -> None:
    """Of what a picture gives and of rays: places and steps, also at edges, and what the filters make of them."""
    picture = RANDOM.random((TALL, WIDE, 4), np.float32)
    inputs: Inputs = {"image": as_image(picture), "map": as_image(GIVEN)}
    whole = module._map(module.Parameters.model_validate(parameters), inputs)
    part, source = Windowed(whole, (37, 21), (0, 0)), Source(picture, Border.CLAMP, 0.0)
    for kernel, name in ((NEAREST, "nearest"), (BILINEAR, "linear")):
        all_of_it = launch.sampled(device, source, whole, (WIDE, TALL), name)
        plain = resample(source, whole, WIDE, TALL, lambda s, at, by=kernel: interpolate(s, at.x, at.y, by))
        np.testing.assert_allclose(all_of_it, plain, atol=1e-6, rtol=0)
        made = launch.sampled(device, source, part, (70, 40), name)
        np.testing.assert_array_equal(made, all_of_it[21:61, 37:107])
    monkeypatch.setattr(launch, "BAND", 1)
    hold(device, part, 70, 40)


@pytest.mark.parametrize("source", list(Chart))
def test_directions_of_a_device_are_those_of_the_definition(
    device: Device, monkeypatch: pytest.MonkeyPatch, source: Chart
) -> None:
    """Turned by odd angles, so that no pixel's middle lies between two charts."""
    monkeypatch.setattr(launch, "BAND", 1)
    across, down = SHAPE[source]
    inputs: Inputs = {"image": as_image(np.zeros((24 * down, 24 * across, 1), np.float32))}
    for target in Chart:
        wide, tall = (12 * each for each in SHAPE[target])
        given = {"source": source, "target": target, "width": wide, "height": tall, "view": 200}
        p = panorama.Parameters.model_validate({**given, "yaw": 33, "pitch": 20, "roll": -50})
        hold(device, panorama._map(p, inputs), wide, tall)


TRIAL = """
#include "warp/doubles.clh"
kernel void trial(global const double *x, global const double *y, global double *out, int count) {
    const int i = get_global_id(0);
    if (i >= count) return;
    double s, c;
    turn_sincos(x[i], &s, &c);
    const double made[5] = {s, c, arc_of(x[i], y[i]), log_of(fabs(x[i])), exp_of(x[i])};
    for (int k = 0; k < 5; ++k) out[5 * i + k] = made[k];
}
"""


def test_functions_of_doubles_are_as_exact_as_they_say(device: Device) -> None:
    random = np.random.default_rng(1)
    count, spread = 40_000, 10.0 ** random.uniform(-12, 5, 40_000)
    x, y = (aligned(each * spread, np.float64) for each in random.uniform(-1, 1, (2, count)))
    x[:4], y[:4] = (0.0, 0.25, -1e5, 700.0), (0.0, -1.0, 1e-300, -1e-300)
    out = aligned_empty((count, 5), np.float64)
    source = compose(TRIAL)
    assert source is not None
    with device.session() as session:
        session.launch(source, "trial", (count,), x, y, session.write(out), np.int32(count))
    wide = x.astype(np.longdouble)
    turned = 2 * np.longdouble("3.14159265358979323846264338328") * (wide - np.rint(wide))
    for made, exact in zip(out.T[:2], (np.sin(turned), np.cos(turned)), strict=True):
        assert np.abs(made - exact).max() <= 1.7e-16
    small = np.abs(x) < 700
    with np.errstate(divide="ignore"):
        wanted = np.arctan2(wide, y.astype(np.longdouble)), np.log(np.abs(wide)), np.exp(np.where(small, wide, 0))
    for number, (exact, stated, held) in enumerate(zip(wanted, (2.5, 0.95, 1.0), (x != 0, x != 0, small), strict=True)):
        unit = np.spacing(np.abs(exact[held]).astype(np.float64))
        off = np.abs((out[held, 2 + number] - exact[held]) / unit)
        assert off.max() <= stated, (number, off.max())
    assert out[0, 2] == 0
    assert (out[x < -708, 4] == 0).all()
    assert np.isinf(out[x > 710, 4]).all()
