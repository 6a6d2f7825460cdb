"""What line integral convolution can do beside following lines: moving kernels, changing fields, passes, colour."""

from __future__ import annotations

from typing import Any

import colour
import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.operations.streamlines.lines import Grid
from lichen.operations.streamlines.maps import Map, coloured
from lichen.operations.streamlines.parameters import Kernel, Parameters, Sampling
from lichen.operations.streamlines.reuse import FREE, MEMORY, SEGMENT, portions
from lichen.operations.streamlines.task import Task, sharpened

Array = np.ndarray
BACKENDS = ("opencl", "numpy")


def run(field: Array, backend: str = "opencl", **values: Any) -> Array:
    asked = {"method": "rk2", "step": 1.0, **values}
    return lichen.run("lic", field, device=backend, **{k: v for k, v in asked.items() if v is not None}).image.pixels


def uniform(height: int, width: int, u: float, v: float) -> Array:
    return np.full((height, width, 2), (u, v), np.float32)


def noise(*shape: int) -> Array:
    return np.random.default_rng(3).random(shape, dtype=np.float32)


def swirl(size: int) -> Array:
    y, x = np.mgrid[:size, :size] * (2 * np.pi / size)
    return np.stack([np.sin(y), np.cos(x)], axis=-1).astype(np.float32)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("method", "sampling"),
    [("rk2", "nearest"), ("rk2", "bilinear"), ("rk2", "cubic"), ("rk45", "bilinear"), ("fastlic", "bilinear")],
)
def test_a_periodic_image_has_no_border(backend: str, method: str, sampling: str) -> None:
    """Moved around its edges, it gives the same picture moved."""
    field, texture = swirl(20), noise(20, 20, 1)
    asked = {"method": method, "border": "wrap", "length": 14, "sampling": sampling, "field_sampling": sampling}
    whole = lichen.run("lic", field, texture=texture, device=backend, **asked).image.pixels
    rolled = [np.roll(each, (7, -5), (0, 1)) for each in (field, texture)]
    moved = lichen.run("lic", rolled[0], texture=rolled[1], device=backend, **asked).image.pixels
    apart = np.abs(np.roll(whole, (7, -5), (0, 1)) - moved)
    assert np.median(apart) < (1e-5 if method != "rk45" else 5e-3)
    assert np.isfinite(moved).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_frames_are_the_phases_of_one_turn_and_ripples_move_along_the_field(backend: str) -> None:
    field, asked = uniform(12, 64, 1, 0), {"length": 16, "kernel": "ripple", "ripples": 2}
    drop = np.zeros((12, 64, 1), np.float32)
    drop[:, 20] = 1
    frames = run(field, backend, texture=drop, frames=4, **asked)
    assert frames.shape == (48, 64, 1)
    for frame in range(4):
        alone = run(field, backend, texture=drop, phase=frame / 4, **asked)
        assert np.array_equal(frames[12 * frame : 12 * frame + 12], alone)
    assert np.allclose(run(field, backend, texture=drop, phase=1, **asked), frames[:12], atol=1e-6)
    row = frames.reshape(4, 12, 64)[:, 6, 20:]
    assert np.argmax(row[0]) == 0
    assert 0 < np.argmax(row[1]) <= 4  # a quarter of a wave of 16 px further downstream, less the window's fall


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", ["euler", "rk2", "rk4", "rk45"])
def test_particles_in_a_field_that_turns_go_the_analytic_way(backend: str, method: str) -> None:
    """From (1, 0) to (0, 1) over the interval: (t - t^2 / 2 I, t^2 / 2 I) ahead, straight back before it."""
    x, y = np.meshgrid(np.arange(64), np.arange(64))
    ramp, interval, length = (x + 3 * y).astype(np.float32), 16.0, 12.0
    asked: dict[str, Any] = {"method": method, "length": length, "speed": "field", "interval": interval}
    asked |= {"tolerance": 0.01} if method == "rk45" else {"step": 0.5}
    later = uniform(64, 64, 0, 1)
    made = lichen.run("lic", uniform(64, 64, 1, 0), texture=ramp, later=later, device=backend, **asked).image.pixels
    exact = ramp + (3 - 1) * length**2 / (12 * interval)
    inner = slice(20, 44)
    assert np.abs(made[inner, inner, 0] - exact[inner, inner]).max() < (0.4 if method == "euler" else 0.02)


KERNELS: tuple[dict[str, Any], ...] = (
    *({"kernel": each.value} for each in Kernel),
    {"kernel": "ripple", "ripples": 1, "phase": 0.5},
    {"kernel": "ripple", "ripples": 3, "phase": 0.3},
)


@pytest.mark.parametrize("asked", KERNELS)
def test_kernels_are_sums_of_waves(asked: dict[str, Any]) -> None:
    p = Parameters(length=13, **asked)
    s = np.arange(41) / 40 * 13 * np.array([[1.0], [-1.0]])
    for phase in (0.0, 0.2):
        waves = sum(each.weight * np.cos(np.pi * each.turns * s / 13 + each.phase) for each in p.waves(phase))
        assert np.abs(waves - p.weights(40, phase)).max() < (2.5e-5 if p.kernel is Kernel.GAUSSIAN else 1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("asked", KERNELS)
def test_shared_lines_serve_every_kernel(backend: str, asked: dict[str, Any]) -> None:
    """As near the finest steps as a line for each pixel is in steps of a pixel, or half as far again, by RMS."""
    field, texture, length = swirl(48), noise(48, 48, 1), 10.0
    made = {
        method: run(field, backend, texture=texture, length=length, **{"step": None, "method": method, **knob}, **asked)
        for method, knob in (("rk4", {"step": 0.125}), ("rk2", {"step": 1}), ("fastlic", {"distance": 0.125}))
    }
    left, usual = (np.sqrt(np.square(made[each] - made["rk4"]).mean()) for each in ("fastlic", "rk2"))
    assert left < 1.5 * usual + 1e-4
    constant = np.full((48, 48, 1), 0.3, np.float32)
    alike = run(field, backend, texture=constant, length=length, method="fastlic", step=None, **asked)
    assert np.array_equal(alike, constant)


@pytest.mark.parametrize("length", [1, 20, 100, 1000])
@pytest.mark.parametrize("asked", KERNELS[::4])
def test_shared_lines_take_no_more_memory_than_their_portions_may(length: int, asked: dict[str, Any]) -> None:
    """Whatever the size of the picture: 4096 x 4096 by `rk2` took 0.27 GB beside a field of 0.13 GB and the program."""
    side = 300
    field = np.ones((side, side, 2), np.float32)
    task = Task(field, None, noise(side, side, 1), Parameters(length=length, **asked))
    for seeds, reach in portions(np.full(side * side, FREE, np.uint32), task, 0.03):
        assert 4 * (2 + reach.sums) * reach.samples * reach.lines <= max(MEMORY, 4 * 11 * reach.samples * SEGMENT)
        assert len(seeds) <= reach.lines
        break


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_field_between_two_slices_is_their_mixture(backend: str) -> None:
    one, two, texture = swirl(32), uniform(32, 32, 0.5, -1), noise(32, 32, 1)
    made = run(one, backend, texture=texture, later=two, time=0.25, length=8)
    mixed = run(one + np.float32(0.25) * (two - one), backend, texture=texture, length=8)
    assert np.array_equal(made, mixed)


@pytest.mark.parametrize("backend", BACKENDS)
def test_enhancing_smears_sharpens_and_smears(backend: str) -> None:
    field, texture = swirl(32), noise(32, 32, 1)
    once = run(field, backend, texture=texture, length=6)
    by_hand = run(field, backend, texture=sharpened(once, 9.0), length=6)
    assert np.array_equal(run(field, backend, texture=texture, length=6, enhance=9), by_hand)
    assert once.std() < by_hand.std()


def test_sharpening_is_the_customary_mask() -> None:
    """A gain of 9: nine times the pixel, less its eight neighbours."""
    pixels = noise(9, 11, 2).astype(np.float64)
    exact = 9 * pixels[1:-1, 1:-1]
    for i, j in np.ndindex(3, 3):
        if (i, j) != (1, 1):
            exact = exact - pixels[i : i + 7, j : j + 9]
    assert np.allclose(sharpened(pixels, 9.0)[1:-1, 1:-1], exact)


@pytest.mark.parametrize("backend", BACKENDS)
def test_contrast_is_the_deviation_around_one_half(backend: str) -> None:
    plain = run(swirl(48), backend, length=10)
    made = run(swirl(48), backend, length=10, contrast=0.15)
    assert abs(made.mean() - 0.5) < 0.01
    assert abs(made.std() - 0.15) < 0.01
    assert np.corrcoef(plain.ravel(), made.ravel())[0, 1] > 0.99
    assert (made >= 0).all()
    assert (made <= 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_colour_tells_the_length_of_vectors(backend: str) -> None:
    field = np.zeros((6, 11, 2), np.float32)
    field[:, :, 0] = np.arange(11) / 10
    field[2, 3] = np.nan
    made = run(field, backend, texture=np.ones((6, 11, 1)), length=2, colour="viridis")
    assert made.shape == (6, 11, 3)
    assert np.allclose(made[4, 0], [0x44 / 255, 0x01 / 255, 0x54 / 255], atol=1e-6)
    assert np.allclose(made[4, 10], [0xFD / 255, 0xE7 / 255, 0x25 / 255], atol=1e-6)
    assert (made[2, 3] == 1).all()
    half = run(field, backend, texture=np.full((6, 11, 1), 0.5), length=2, colour="viridis", fastest=2)
    assert np.allclose(half[4, 10], 0.5 * coloured(np.array(0.5), Map.VIRIDIS), atol=1e-6)


@pytest.mark.parametrize("name", [each for each in Map if each is not Map.NONE])
def test_maps_grow_evenly_lighter(name: Map) -> None:
    rgb = coloured(np.linspace(0, 1, 65), name)
    lightness = colour.XYZ_to_Lab(colour.sRGB_to_XYZ(rgb))[:, 0]
    steps = np.diff(lightness)
    assert (steps > 0).all()
    assert steps.max() < 2.2 * steps.mean()


@pytest.mark.parametrize("backend", BACKENDS)
def test_oriented_drops_become_comets_that_fly_with_the_field(backend: str) -> None:
    drop = np.zeros((9, 60, 1), np.float32)
    drop[4, 30] = 1
    trail = run(uniform(9, 60, 1, 0), backend, texture=drop, length=12, oriented=True)[4, :, 0]
    assert trail[38] > trail[30] > trail[22] > 0


def test_drops_have_their_density_and_grains_their_size() -> None:
    still = np.zeros((200, 300, 2), np.float32)
    drops = run(still, density=0.1)
    assert set(np.unique(drops)) == {0.0, 1.0}
    assert abs(drops.mean() - 0.1) < 0.01
    coarse = run(still, grain=4)
    assert np.corrcoef(coarse[:, 1:].ravel(), coarse[:, :-1].ravel())[0, 1] > 0.8


@pytest.mark.parametrize("backend", BACKENDS)
def test_lines_end_at_a_mask(backend: str) -> None:
    mask = np.ones((16, 40), np.float32)
    mask[:, 20:] = 0
    texture = noise(16, 40, 1)
    changed = texture.copy()
    changed[:, 21:] = 1 - changed[:, 21:]
    one, two = (run(uniform(16, 40, 1, 0), backend, texture=each, mask=mask, length=9) for each in (texture, changed))
    assert np.array_equal(one[:, :20], two[:, :20])
    assert np.array_equal(one[:, 20:], texture[:, 20:])


def test_cubics_pass_through_quadratics() -> None:
    y, x = np.mgrid[:12, :14].astype(np.float64)
    grid = Grid.of((x * x - 3 * x * y + 0.5 * y * y)[:, :, None], Sampling.CUBIC)
    at = np.random.default_rng(1).uniform(2, 9, (50, 2))
    found = grid.at((np.zeros(50, int), np.zeros(50, int)), at[:, 0], at[:, 1])[:, 0]
    assert np.allclose(found, at[:, 0] ** 2 - 3 * at[:, 0] * at[:, 1] + 0.5 * at[:, 1] ** 2)


def test_kernels_have_the_shapes_they_are_named_after() -> None:
    s = np.linspace(0, 1, 9)
    for name, exact in {
        "gaussian": np.exp(-2 * s**2),
        "hann": 0.5 + 0.5 * np.cos(np.pi * s),
        "box": np.ones(9),
    }.items():
        forwards, backwards = Parameters(kernel=name).weights(8)
        assert np.allclose(forwards, exact)
        assert np.allclose(backwards, exact)
    forwards, backwards = Parameters(oriented=True).weights(8)
    assert np.allclose(backwards - forwards, s)


def test_what_does_not_go_together_is_named() -> None:
    field = uniform(8, 9, 1, 0)
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("lic", field, texture=noise(8, 9, 3), colour="magma", frames=2, time=0.5, interval=1,
                   mask=np.ones((3, 3, 1)))  # fmt: skip
    pointers = {flaw.pointer for flaw in caught.value.flaws}
    assert pointers == {
        "/inputs/mask", "/inputs/later", "/parameters/interval", "/parameters/frames", "/parameters/colour",
    }  # fmt: skip
