"""Line integral convolution against analytic results, and what its pictures must not depend on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.image import Image, as_image
from lichen.opencl.device import default_device
from lichen.operation import Extent, Facts
from lichen.operations.streamlines.lic import Parameters, lic
from lichen.operations.streamlines.lines import Grid, displacements, euler, runge_kutta_2, runge_kutta_4
from lichen.operations.streamlines.task import noise

Array = np.ndarray
INTERPOLATED = ("euler", "rk2", "rk4")
STEPPED = ("nearest", *INTERPOLATED)
"""Methods whose knob is a step."""
BACKENDS = ("opencl", "numpy")


def centres(height: int, width: int) -> tuple[Array, Array]:
    y, x = np.mgrid[:height, :width] + 0.5
    return x, y


def field_of(u: Any, v: Any) -> Array:
    return np.stack(np.broadcast_arrays(u, v), axis=-1).astype(np.float32)


def uniform(size: int, degrees: float, length: float = 1.0) -> Array:
    angle = np.radians(degrees)
    return np.full((size, size, 2), (length * np.cos(angle), length * np.sin(angle)), np.float32)


def images(field: Array, texture: Array | None = None) -> dict[str, Image]:
    made = {"field": as_image(field)}
    return made if texture is None else {**made, "texture": as_image(texture.astype(np.float32))}


def compute(method: str, backend: str, step: float, inputs: dict[str, Image], **values: Any) -> Array:
    body, parameters = lic.methods[method].implementation, Parameters(**values)
    if backend == "numpy":
        return body.numpy(inputs, parameters, step)
    device = default_device()
    assert device is not None, "the tests need OpenCL"
    return body.opencl(device, inputs, parameters, step)


# ---------------------------------------------------------------------------------------------- analytic results


def circles(size: int = 64, waves: int = 3, finer: int = 8) -> tuple[dict[str, Image], Array, Array]:
    """Circles about the middle over cos(waves phi), a texture fine enough that its interpolation hardly counts; the
    angle and the radius of each pixel."""
    middle = size / 2
    x, y = centres(size, size)
    u, v = (axis / finer for axis in centres(size * finer, size * finer))
    texture = np.cos(waves * np.arctan2(v - middle, u - middle))
    inputs = images(field_of(middle - y, x - middle), texture)
    return inputs, np.arctan2(y - middle, x - middle), np.hypot(x - middle, y - middle)


def test_truth_is_the_analytic_result_on_circles() -> None:
    inputs, angle, radius = circles()
    ring = (radius > 14) & (radius < 31)
    exact = np.cos(3 * angle) * np.sinc(3 * 10 / radius / np.pi)
    truth = lic.evaluate_truth(inputs, Parameters(length=10))[:, :, 0]
    assert np.abs(truth - exact)[ring].max() < 2e-4


@pytest.mark.parametrize("backend", BACKENDS)
def test_methods_converge_to_the_analytic_result_on_circles(backend: str) -> None:
    inputs, angle, radius = circles()
    ring = (radius > 14) & (radius < 31)
    exact = np.cos(3 * angle) * np.sinc(3 * 12 / radius / np.pi)
    errors = {
        name: [
            np.sqrt(np.square(compute(name, backend, step, inputs, length=12)[:, :, 0] - exact)[ring].mean())
            for step in (2.0, 1.0, 0.5)
        ]
        for name in INTERPOLATED
    }
    orders = {name: float(np.polyfit(np.log([4, 2, 1]), np.log(found), 1)[0]) for name, found in errors.items()}
    # Euler's drift is of first order; from the midpoint rule on, the trapezoid rule along the line is what is left.
    assert 0.8 < orders["euler"] < 1.3, (orders, errors)
    assert 1.8 < orders["rk2"] < 2.4, (orders, errors)
    assert 1.8 < orders["rk4"] < 2.4, (orders, errors)
    assert errors["rk4"][-1] < 2e-3


@pytest.mark.parametrize(("advance", "order"), [(euler, 1), (runge_kutta_2, 2), (runge_kutta_4, 4)])
def test_paths_have_the_order_of_their_method(advance: Any, order: int) -> None:
    """Where a line on a circle of radius 20 ends after 20 px. The field is linear, so its interpolation is exact."""
    x, y = centres(64, 64)
    grid = Grid.of(np.stack([32 - y, x - 32], axis=-1))
    start = np.array([[20.0, 0.0]])
    middle = (np.array([32]), np.array([32]))  # positions count from the centre of this pixel, half a pixel off
    errors = []
    for count in (10, 20, 40, 80):

        def slope(at: Array, part: float, count: int = count) -> Array:
            return displacements(grid.at(middle, at[:, 0] - 0.5, at[:, 1] - 0.5), 20 / count, True)

        at = start
        for _ in range(count):
            at = at + advance(slope, at, slope(at, 0.0))
        errors.append(float(np.hypot(*(at[0] - 20 * np.array([np.cos(1), np.sin(1)])))))
    fitted = -np.polyfit(np.log([10, 20, 40, 80]), np.log(errors), 1)[0]
    assert abs(fitted - order) < 0.15, errors


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", INTERPOLATED)
@pytest.mark.parametrize(
    ("kernel", "transform"),
    [
        ("box", lambda a: np.sin(a) / a),
        ("hann", lambda a: np.sin(a) / a / (1 - (a / np.pi) ** 2)),
        ("cosine", lambda a: np.cos(a) / (1 - (2 * a / np.pi) ** 2)),
    ],
)
def test_a_wave_along_the_flow_keeps_its_amplitude_in_every_direction(
    backend: str, method: str, kernel: str, transform: Any
) -> None:
    """The amplitude is the kernel's Fourier transform: 0.192 for the box of 41 px on a wave of 32 px."""
    amplitudes = []
    for degrees in (0.0, 22.5, 45.0):
        x, y = centres(96, 96)
        phase = 2 * np.pi / 32 * (x * np.cos(np.radians(degrees)) + y * np.sin(np.radians(degrees)))
        inputs = images(uniform(96, degrees), np.cos(phase))
        result = compute(method, backend, 1.0, inputs, length=20.5, kernel=kernel)[:, :, 0]
        inner = (slice(24, -24), slice(24, -24))
        basis = np.stack([np.cos(phase[inner]).ravel(), np.sin(phase[inner]).ravel()], axis=1)
        amplitudes.append(np.linalg.lstsq(basis, result[inner].ravel(), rcond=None)[0])
    exact = transform(2 * np.pi / 32 * 20.5)
    found = np.array(amplitudes)
    assert np.abs(found[:, 0] - exact).max() < 0.006 * max(1.0, abs(exact) / 0.2), (found, exact)
    assert np.abs(found[:, 1]).max() < 1e-3


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", INTERPOLATED)
def test_lines_end_exactly_at_the_border(backend: str, method: str) -> None:
    x, _ = centres(8, 40)
    ramp = images(np.broadcast_to(np.float32([1, 0]), (8, 40, 2)).copy(), x / 40)
    result = compute(method, backend, 1.0, ramp, length=10.25)[4, :, 0]
    fine = np.linspace(0, 40, 40 * 256 + 1)
    values = np.clip(fine, 0.5, 39.5) / 40
    for column in range(40):
        inside = np.abs(fine - (column + 0.5)) <= 10.25
        exact = np.trapezoid(values[inside], fine[inside]) / np.ptp(fine[inside])
        assert abs(result[column] - exact) < 5e-4, column


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", INTERPOLATED)
@pytest.mark.parametrize("sign", [1, -1])
def test_lines_end_exactly_at_a_sink_or_source(backend: str, method: str, sign: int) -> None:
    """Straight lines through a centre between pixels; the texture is the distance from it."""
    x, y = centres(64, 64)
    radius = np.hypot(x - 31.7, y - 32.2)
    inputs = images(field_of(sign * (x - 31.7), sign * (y - 32.2)), radius)
    result = compute(method, backend, 1.0, inputs, length=12)[:, :, 0]
    near, clear = (radius > 1) & (radius < 11), (radius > 14) & (radius < 19)
    assert np.abs(result - (radius + 12) / 2)[near].max() < 0.15
    assert np.abs(result - radius)[clear].max() < 0.03


# -------------------------------------------------------------------------------------- what results do not depend on


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", STEPPED)
def test_a_part_of_a_picture_is_the_picture_of_a_part(backend: str, method: str) -> None:
    rng = np.random.default_rng(4)
    field, texture = rng.standard_normal((70, 200, 2)).astype(np.float32), rng.random((70, 200, 2), np.float32)
    whole = compute(method, backend, 0.5, images(field, texture), length=9)
    part = compute(method, backend, 0.5, images(field[5:65, 37:170], texture[5:65, 37:170]), length=9)
    assert np.array_equal(whole[16:54, 48:159], part[11:49, 11:122])


@pytest.mark.parametrize("method", STEPPED)
def test_channels_do_not_mix(method: str) -> None:
    rng = np.random.default_rng(5)
    field, texture = rng.standard_normal((20, 30, 2)).astype(np.float32), rng.random((20, 30, 7), np.float32)
    for backend in BACKENDS:
        together = compute(method, backend, 1.0, images(field, texture), length=6)
        for channel in range(7):
            alone = compute(method, backend, 1.0, images(field, texture[:, :, channel]), length=6)
            assert np.abs(together[:, :, channel] - alone[:, :, 0]).max() < 1e-6


@pytest.mark.parametrize("method", INTERPOLATED)
def test_backends_agree_in_smooth_flows(method: str) -> None:
    inputs, _, _ = circles(finer=1)
    texture = np.random.default_rng(6).random((64, 64))
    inputs = {**inputs, **images(inputs["field"].pixels, texture)}
    results = [compute(method, backend, 0.5, inputs, length=15, kernel="hann") for backend in BACKENDS]
    assert np.abs(results[0] - results[1]).max() < 1e-4


def test_speed_does_not_matter_to_arc_length_and_direction_not_to_symmetric_kernels() -> None:
    field = uniform(40, 30.0)
    texture = np.random.default_rng(8).random((40, 40))
    base = compute("rk2", "opencl", 1.0, images(field, texture), length=8)
    for factor in (1e-20, 3.0, 1e20, -1.0):
        other = compute("rk2", "opencl", 1.0, images(field * np.float32(factor), texture), length=8)
        assert np.abs(other - base).max() < 1e-5


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", STEPPED)
def test_field_speed_is_length_times_magnitude(backend: str, method: str) -> None:
    texture = np.random.default_rng(9).random((40, 40))
    timed = compute(method, backend, 0.5, images(uniform(40, 0.0, 2.0), texture), length=4, speed="field")
    arc = compute(method, backend, 1.0, images(uniform(40, 0.0, 2.0), texture), length=8)
    assert np.abs(timed - arc).max() < 1e-5


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", STEPPED)
def test_nothing_is_seen_through_a_hole(backend: str, method: str) -> None:
    field = uniform(32, 0.0)
    field[10, 20] = np.nan
    texture = np.random.default_rng(10).random((32, 32))
    changed = texture.copy()
    changed[:, 22:] = 1 - changed[:, 22:]
    one, two = (compute(method, backend, 1.0, images(field, given), length=9) for given in (texture, changed))
    assert np.array_equal(one[10, :20], two[10, :20])
    assert not np.array_equal(one[11, 14:20], two[11, 14:20])  # a row further the way is free
    assert np.isfinite(one).all()


# ------------------------------------------------------------------------------------------------ inputs, noise, errors


def test_generated_noise_has_the_same_bits_everywhere() -> None:
    field = uniform(70, 10.0)
    for method in STEPPED:
        results = [compute(method, backend, 1.0, images(field), length=0, seed=11) for backend in BACKENDS]
        assert np.array_equal(results[0], results[1])
        assert np.array_equal(results[0], noise(70, 70, Parameters(seed=11)))
    values = noise(300, 300, Parameters())
    assert not np.array_equal(values, noise(300, 300, Parameters(seed=1)))
    counts = np.histogram(values, bins=16, range=(0, 1))[0]
    assert np.square(counts - 300 * 300 / 16).sum() / (300 * 300 / 16) < 45  # chi-squared, 15 degrees of freedom
    assert abs(np.corrcoef(values[:, :-1].ravel(), values[:, 1:].ravel())[0, 1]) < 0.02


@pytest.mark.parametrize("levels", [255, 65535])
def test_integer_fields_are_read_with_scale_and_bias(levels: int) -> None:
    """A component stored as the bias is exactly zero: no line starts there."""
    middle = (levels + 1) // 2
    codes = np.full((30, 30, 3), middle, np.uint8 if levels == 255 else np.uint16)
    codes[:, :, 0] = levels
    codes[:, :15, 0] = middle
    texture = np.random.default_rng(12).random((30, 30))
    asked = {"length": 5, "bias": middle / levels, "scale": 2}
    result = compute("rk2", "opencl", 1.0, images(codes, texture), **asked)
    assert np.array_equal(result[:, :14, 0], texture[:, :14].astype(np.float32))
    straight = compute("rk2", "opencl", 1.0, images(uniform(30, 0.0), texture), length=5)
    assert np.abs(result - straight)[:, 21:].max() < 1e-6
    assert np.array_equal(compute("rk2", "numpy", 1.0, images(codes, texture), **asked)[:, :14], result[:, :14])


def test_a_texture_of_another_size_covers_the_field() -> None:
    """Pixel centres map in proportion: a linear texture gives the same values at any size."""
    inner = (slice(4, -4), slice(4, -4))
    for rows, columns in ((16, 48), (64, 64), (97, 203)):
        u, v = centres(rows, columns)
        texture = u / columns + 2 * v / rows
        x, y = centres(32, 32)
        for backend in BACKENDS:
            result = compute("rk4", backend, 1.0, images(uniform(32, 30.0), texture), length=2)
            assert np.abs(result[:, :, 0] - (x / 32 + 2 * y / 32))[inner].max() < 1e-5


@pytest.mark.parametrize("backend", BACKENDS)
def test_stated_errors_hold_in_the_roughest_fields(backend: str) -> None:
    rng = np.random.default_rng(13)
    texture = (rng.random((28, 28)) > 0.5).astype(np.float32)
    for field in (rng.standard_normal((28, 28, 2)), np.sign(rng.standard_normal((28, 28, 2)))):
        inputs = images(field.astype(np.float32), texture)
        facts = {name: Facts.of(image) for name, image in inputs.items()}
        parameters = Parameters(length=7)
        truth = lic.evaluate_truth(inputs, parameters)
        for name, method in lic.methods.items():
            for step in method.knob.values if method.knob else ():
                found = np.abs(compute(name, backend, step, inputs, length=7) - truth).max()
                assert found <= method.error(parameters, step, facts).value


def test_dearer_settings_never_state_a_larger_error() -> None:
    facts = {"field": Facts(100, 100, 2)}
    for method in lic.methods.values():
        assert method.knob is not None
        stated = [method.error(Parameters(), setting, facts).value for setting in method.knob.values]
        assert stated == sorted(stated, reverse=True)
        assert max(stated) < 1 + 1e-3


def test_work_beyond_index_range_is_refused() -> None:
    facts = {"field": Facts(50_000, 50_000, 2, extent=Extent(0, 1, 0))}
    assert [flaw.pointer for flaw in lic.check(Parameters(), facts)] == ["/inputs/texture"]


def test_the_default_is_the_typically_best_line_and_knobs_choose_another() -> None:
    field = uniform(20, 45.0)
    assert "rk2" in lichen.run("lic", field, length=4).method
    assert "nearest" in lichen.run("lic", field, length="4", method="nearest", step=1).method
    assert lichen.run("lic", field, texture=np.ones((5, 6, 3)), length=4, method="rk2").image.pixels.shape == (
        20,
        20,
        3,
    )
