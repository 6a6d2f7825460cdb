"""The shared core against SciPy, OpenCV and what can be said in a line; work that is counted, and precision far out."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy import ndimage

import lichen
from lichen.image import as_image
from lichen.opencl.device import default_device
from lichen.operation import Border
from lichen.operations.warp import effort, kernels
from lichen.operations.warp.affine import affine
from lichen.operations.warp.footprints import Ellipses
from lichen.operations.warp.homography import homography
from lichen.operations.warp.maps import Map, Places, Projective
from lichen.operations.warp.matrices import output_to_input
from lichen.operations.warp.prediction import most_of, reach_of
from lichen.operations.warp.reference import REACH, Source, interpolate, level_of, resample, truth_sampler

NOISE = np.random.default_rng(7).random((40, 52, 2))
SCIPY = {Border.REFLECT: "reflect", Border.REFLECT101: "mirror", Border.CLAMP: "nearest", Border.WRAP: "grid-wrap"}


def scattered(count: int = 400, beyond: float = 30.0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    return rng.uniform(-beyond, 52 + beyond, count), rng.uniform(-beyond, 40 + beyond, count)


@pytest.mark.parametrize("border", list(SCIPY))
def test_bilinear_and_spline_agree_with_scipy(border: Border) -> None:
    x, y = scattered()
    source = Source(NOISE, border, 0.0)
    expected = ndimage.map_coordinates(NOISE[..., 0], [y - 0.5, x - 0.5], order=1, mode=SCIPY[border])
    np.testing.assert_allclose(interpolate(source, x, y, kernels.BILINEAR)[:, 0], expected, atol=1e-12)
    if border is Border.CLAMP:
        return  # SciPy's prefilter goes on by another border there
    example = {"matrix": [[1, 0, 3.3], [0, 1, -2.6]], "border": border}
    made = lichen.run("affine", NOISE, method="bspline", **example).image.pixels
    columns, rows = np.arange(52) + 0.0, np.arange(40) + 0.0
    at = np.meshgrid(rows + 2.6, columns - 3.3, indexing="ij")
    spline = ndimage.map_coordinates(NOISE[..., 0], at, order=3, mode=SCIPY[border])
    np.testing.assert_allclose(made[..., 0], spline, atol=3e-6)


def test_cubic_agrees_with_opencv() -> None:
    """Whose cubic is Keys' with a = -0.75; ours with the same parameter, in the interior."""
    x, y = (np.clip(each, 4, 35).astype(np.float32) for each in scattered())
    sharper = kernels.Kernel("keys", 2, kernels.cubic(0, 0.75), 0)
    expected = cv2.remap(NOISE.astype(np.float32), (x - 0.5)[None], (y - 0.5)[None], cv2.INTER_CUBIC)[0]
    found = interpolate(Source(NOISE, Border.REFLECT, 0.0), x.astype(float), y.astype(float), sharper)
    np.testing.assert_allclose(found, expected, atol=2e-5)


@pytest.mark.parametrize(
    "kernel",
    [kernels.BILINEAR, kernels.CATMULL_ROM, kernels.MITCHELL, kernels.LANCZOS2, kernels.LANCZOS3, kernels.BSPLINE],
)
def test_weights_sum_to_one_and_samples_stay(kernel: kernels.Kernel) -> None:
    fractions = np.concatenate([[0.0, 2.0**-40, 0.5, 1 - 2.0**-40], np.random.default_rng(0).random(100)])
    weights = kernel.weights(fractions)
    np.testing.assert_allclose(weights.sum(axis=0), 1, atol=1e-15)
    if kernel.interpolates:
        np.testing.assert_array_equal(weights[:, 0], (kernel.offsets() == 0).astype(float))


def test_a_gaussian_is_what_the_average_of_one_is() -> None:
    """A wide Gaussian blob, shrunk: its variance in the result is the sum of its own and the ellipse's."""
    y, x = np.mgrid[0:96, 0:96] + 0.5
    deviation, shrink = 9.0, 4.0
    blob = np.exp(-((x - 48) ** 2 + (y - 48) ** 2) / (2 * deviation**2))[..., None]
    map_ = Projective.of([[shrink, 0, 0], [0, shrink, 0], [0, 0, 1]])
    found = resample(Source(blob, Border.CONSTANT, 0.0), map_, 24, 24, truth_sampler)[..., 0]
    variance = deviation**2 + shrink**2 / 4
    at = (np.arange(24) + 0.5) * shrink - 48
    expected = deviation**2 / variance * np.exp(-(at[:, None] ** 2 + at**2) / (2 * variance))
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_ellipses_are_those_of_the_singular_value_decomposition() -> None:
    rng = np.random.default_rng(5)
    for jacobian in rng.normal(size=(50, 2, 2)) * 10 ** rng.uniform(-2, 4, (50, 1, 2)):
        (xu, xv), (yu, yv) = jacobian
        flat = [np.array([each]) for each in (0.0, 0.0, xu, yu, xv, yv)]
        found = Ellipses.of(Places(*flat))
        u, sizes, _ = np.linalg.svd(jacobian)
        shape = u @ np.diag(np.maximum(sizes, 1) ** 2) @ u.T
        xx, xy, yy = (float(each[0]) for each in found.inverse())
        np.testing.assert_allclose([[xx, xy], [xy, yy]], np.linalg.inv(shape), rtol=1e-6, atol=1e-15)
        np.testing.assert_allclose([found.xx[0], found.yy[0]], np.diag(shape), rtol=1e-12)


class Numeric(Map):
    """A projective map that does not tell its derivative."""

    def __init__(self, of: Projective) -> None:
        self.at = of.at  # type: ignore[method-assign]


def test_footprints_from_side_to_side_are_nearly_the_derivative() -> None:
    of = Projective.of([[0.9, 0.1, 3], [-0.2, 1.2, 1], [1e-3, 2e-3, 1]])
    u, v = np.arange(20) + 0.5, np.arange(30) + 0.5
    for found, expected in zip(Numeric(of).places(u, v), of.places(u, v), strict=True):
        np.testing.assert_allclose(found, expected, atol=2e-5)


@pytest.mark.parametrize("method", ["bilinear", "bicubic", "mitchell"])
def test_places_are_exact_at_sixteen_thousand_pixels(method: str) -> None:
    """A ramp of slope 1 shows where a pixel looked. Steps of 1/32 px, or float32 coordinates, would be seen."""
    ramp = (np.arange(16384, dtype=np.float64) - 16000).astype(np.float32)[None, :, None].repeat(2, axis=0)
    wanted = 16000 + np.array([0.1, 1 / 3, 0.7071, 0.9999])
    device = default_device()
    assert device is not None
    for at in wanted:
        p = affine.validate({"matrix": [[1, 0, at], [0, 1, 0]], "inverse": True, "width": 1, "border": "clamp"})
        inputs = {"image": as_image(ramp)}
        found = affine.methods[method].implementation.opencl(device, inputs, p, 0.0)
        assert abs(found[0, 0, 0] - (at - 16000)) < 1e-4


def held(ellipses: Ellipses, samples: float, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Samples and lines of the levels that `ewa` takes ellipses from, by their areas and heights."""
    reach = reach_of(samples)
    level = level_of(ellipses, samples, most_of(samples), count)
    each = [ellipses.take(level == one).at_level(int(one)) for one in np.unique(level)]
    area = np.concatenate([np.pi * reach**2 * np.sqrt(some.major * some.minor) for some in each])
    return area, np.concatenate([2 * reach * np.sqrt(some.yy) + 1 for some in each])


@pytest.mark.parametrize("samples", [1.0, 2.0, 4.0, 8.0])
def test_an_ellipse_holds_no_more_than_a_fixed_number_of_samples(samples: float) -> None:
    rng = np.random.default_rng(8)
    turn, sizes = rng.uniform(0, 2 * np.pi, 10_000), 10 ** rng.uniform(-1, 6, (2, 10_000))
    c, s, (long, short) = np.cos(turn), np.sin(turn), sizes
    nowhere = np.zeros_like(turn)
    area, _ = held(Ellipses.of(Places(nowhere, nowhere, c * long, s * long, -s * short, c * short)), samples)
    assert area.max() <= 448 * samples**4
    assert area.max() > 350 * samples**4


def taps(matrix: list[list[float]], side: int) -> float:
    """What `ewa` of one sample does for an image of that side, in samples: 36 for each pixel, and lines count four."""
    few = max(side // 64, 1)  # columns are much alike; lines are not
    at = Projective.of(matrix).places(np.arange(0, side, few) + 0.5, np.arange(side) + 0.5)
    seen = np.isfinite(at.x)
    ellipses = Ellipses.of(at.take(seen))
    area, lines = held(ellipses.take((ellipses.blend() > 0) & ~ellipses.beyond(side, side)), 1)
    return few * float(36 * seen.sum() + (area + 4 * lines).sum())


@pytest.mark.parametrize("side", [16, 64, 256, 1024, 4096])
def test_a_vanishing_line_costs_no_more_than_a_few_benign_warps(side: int) -> None:
    horizon = [[1.0, 1.6 / side, 0], [0.05, 0.3, 0.375 * side], [0.48 / side, 1.76 / side, -1]]
    benign = [[1.25, 0.05, 0], [-0.05, 1.3, 0], [0.1 / side, 0.1 / side, 1]]
    assert taps(horizon, side) <= 2 * taps(benign, side)


VIEWS = {
    "horizon": [[1.0, 0.1, 0], [0.05, 0.3, 192], [0.03 / 32, 0.11 / 32, -1.003]],
    "above": [[1.25, 0.05, 0], [-0.05, 1.3, 0], [0.0002, 0.0002, 1]],
    "less": [[3.0, 0, 0], [0, 3, 0], [0, 0, 1]],
    "slanted": [[30.0, 2, 0], [0, 3, 0], [0, 0, 1]],
    "upright": [[1.2, 0, 0], [2, 9, 0], [0, 0, 1]],
}


@pytest.mark.parametrize("samples", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("name", VIEWS)
def test_what_ellipses_hold_is_foretold(name: str, samples: float) -> None:
    """Of each at a few places, against all that a device would take of 64 x 64."""
    side, view = 512, Projective.of(VIEWS[name])
    at = view.places((np.arange(64) + 0.5) * 8, (np.arange(64) + 0.5) * 8)
    ellipses = Ellipses.of(at.take(np.isfinite(at.x)))
    area, lines = held(ellipses.take((ellipses.blend() > 0) & ~ellipses.beyond(side, side)), samples)
    found = effort.steps(view, (side, side), (0, 0, side, side), samples)
    assert found == pytest.approx(float((area + effort.LINE * lines).sum()) / 64**2, rel=0.3)


@pytest.mark.parametrize("far", [1e-300, 1e160, 1e300])
def test_what_no_picture_holds_takes_no_steps(far: float) -> None:
    view = Projective.of([[far, 0, 0], [0, far, 0], [0, 0, 1]])
    assert effort.steps(view, (512, 512), (0, 0, 512, 512), 4.0) == 0


def test_truth_cuts_where_nothing_is_left() -> None:
    assert np.exp(-2 * REACH**2) < 2e-8


def test_whole_shifts_and_turns_have_whole_inverses() -> None:
    turn = np.array([[0.0, -1, 31], [1, 0, 7], [0, 0, 1]])
    np.testing.assert_array_equal(output_to_input(turn, inverse=False), [[0, 1, -7], [-1, 0, 31], [0, 0, 1]])


def test_a_checkerboard_to_the_horizon_tells_filters_apart() -> None:
    """RMS errors: nearest 0.3, bilinear 0.22, mip 0.083, 8 x 8 samples 0.02, ellipses 2.9e-3, 7.6e-7 and 5.9e-8."""
    row, column = np.mgrid[:32, :32] // 4
    board = ((row + column) % 2).astype(np.float32)[..., None]
    plane = {"matrix": [[1, 0.1, 0], [0.05, 0.3, 12], [0.02, 0.06, -1.003]], "inverse": True, "border": "wrap"}
    view = {**plane, "width": 64, "height": 48}
    true = homography.evaluate_truth({"image": as_image(board)}, homography.validate(view))
    ladder: tuple[tuple[float, dict[str, object]], ...] = (
        (0.35, {"method": "nearest"}),
        (0.25, {"method": "bilinear"}),
        (0.1, {"method": "mip"}),
        (0.03, {"method": "supersampled", "points": 8}),
        (4e-3, {"method": "ewa", "samples": 1}),
        (2e-6, {"method": "ewa", "samples": 2}),
        (1e-7, {"method": "ewa", "samples": 4}),
    )
    before = 0.5
    for most, asked in ladder:
        found = lichen.run("homography", board, **view, **asked).image.pixels
        error = float(np.sqrt(np.square(found - true).mean()))
        assert error < min(most, before), asked
        before = error


@pytest.mark.parametrize("channels", [1, 4])
@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_an_ellipse_beside_a_hole_does_not_see_it(channels: int, turn: float) -> None:
    """A device weighs eight neighbours at once, those outside of the ellipse by 0: NaN times 0 must not show."""
    pixels = np.random.default_rng(9).random((90, 110, channels), dtype=np.float32)
    pixels[31, 40] = np.nan
    pixels[60, 70] = np.inf
    c, s = 0.45 * np.cos(turn), 0.45 * np.sin(turn)
    given = {"matrix": [[c, -s, 20], [s, c, 5]], "width": 70, "height": 60, "method": "ewa", "border": "reflect"}
    ours, plain = (lichen.run("affine", pixels, device=each, **given).image.pixels for each in ("opencl", "numpy"))
    np.testing.assert_array_equal(np.isfinite(ours), np.isfinite(plain))
    assert 0 < (~np.isfinite(ours)).sum() < 130 * channels


@pytest.mark.parametrize("border", [Border.REFLECT, Border.REFLECT101])
@pytest.mark.parametrize("method", ["bilinear", "bicubic", "lanczos3"])
def test_places_far_from_a_mirrored_picture_show_what_numpy_finds(border: Border, method: str) -> None:
    """A device looks them up inside the picture, and steps from sample to sample the other way."""
    pixels = np.random.default_rng(6).random((13, 1, 4), dtype=np.float32).repeat(17, axis=1)
    pixels += np.random.default_rng(7).random((1, 17, 4), dtype=np.float32)
    given = {
        "matrix": [[0.9, 0.2, -70], [-0.3, 1.1, 45]],
        "width": 70,
        "height": 40,
        "method": method,
        "border": border,
    }
    ours, plain = (lichen.run("affine", pixels, device=on, **given).image.pixels for on in ("opencl", "numpy"))
    np.testing.assert_allclose(ours, plain, atol=3e-6, rtol=0)


def turned(pixels: np.ndarray, left: int, method: str, border: Border, device: str, past: float) -> np.ndarray:
    """A turn, its result begun `left` columns before the first. Places are whole 2048ths of a pixel and `past` more, so
    that doubles hold them exactly wherever the result begins."""
    across, down = (897 / 1024, 510 / 1024), (-510 / 1024, 897 / 1024)
    rows = [[*row, start - row[0] * left + past] for row, start in zip((across, down), (-20, 30), strict=True)]
    given = {"matrix": rows, "inverse": True, "width": 260, "height": 90, "border": border, "value": 0.3}
    return lichen.run("affine", pixels, method=method, device=device, **given).image.pixels


@pytest.mark.parametrize("border", list(Border))
@pytest.mark.parametrize("channels", [1, 4])
@pytest.mark.parametrize("method", ["nearest", "bilinear", "bicubic", "lanczos3"])
def test_a_pixel_is_the_same_whatever_lies_beside_it(border: Border, channels: int, method: str) -> None:
    """Where no pixel of a segment needs care they are found another way than beside one that does."""
    pixels = np.random.default_rng(9).random((90, 200, channels), dtype=np.float32)
    whole, moved = (turned(pixels, left, method, border, "opencl", 2**-13) for left in (0, 37))
    np.testing.assert_array_equal(moved[:, 37:], whole[:, :-37])
    np.testing.assert_allclose(whole, turned(pixels, 0, method, border, "numpy", 2**-13), atol=2e-6, rtol=0)


@pytest.mark.parametrize("border", list(Border))
@pytest.mark.parametrize("channels", [1, 4])
def test_samples_of_no_weight_are_not_used(border: Border, channels: int) -> None:
    """Beside holes, at places on rows and columns of samples and beyond the last of them."""
    pixels = np.random.default_rng(9).random((90, 200, channels), dtype=np.float32)
    pixels[:, [1, 60, 198]], pixels[[1, 50, 88]] = np.nan, np.inf
    ours, plain = (turned(pixels, 0, "bilinear", border, on, 2**-11) for on in ("opencl", "numpy"))
    np.testing.assert_allclose(ours, plain, atol=2e-6, rtol=0)
    assert 0.02 < (~np.isfinite(ours)).mean() < 0.98


@pytest.mark.parametrize("border", list(Border))
@pytest.mark.parametrize("size", [(31, 40), (9, 8), (3, 10)])
def test_ellipses_of_all_sizes_weigh_what_they_hold(border: Border, size: tuple[int, int]) -> None:
    """Tiny ones by powers, those across a border eight at a time, cut at any radius: as NumPy does, one by one."""
    pixels = np.random.default_rng(3).random((*size, 4), dtype=np.float32)
    for shrunk, samples in ((0.95, 1), (0.9, 4), (0.5, 2), (0.2, 4)):
        given = {"matrix": [[shrunk, 0.05, 1], [-0.1, shrunk, -2], [1e-3, 1e-3, 1]], "width": 30, "height": 24}
        asked = {**given, "method": "ewa", "samples": samples, "border": border, "value": 0.3}
        ours, plain = (lichen.run("homography", pixels, device=on, **asked).image.pixels for on in ("opencl", "numpy"))
        np.testing.assert_allclose(ours, plain, atol=2e-6, rtol=0)
