"""Borders against `numpy.pad`, sampling against float64 interpolation of a padded image, hashes against their twin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lichen import hashing
from lichen.memory import aligned_empty
from lichen.opencl.device import Device
from lichen.operation import Border

SOURCE = str(Path(__file__).with_name("sampling_trial.cl"))
PAD = {"reflect": "symmetric", "reflect101": "reflect", "clamp": "edge", "wrap": "wrap"}
BORDERS = list(Border)


def padded(image: np.ndarray, border: Border, by: int) -> np.ndarray:
    widths = [(by, by), (by, by)] + [(0, 0)] * (image.ndim - 2)
    if border is Border.CONSTANT:
        return np.pad(image, widths, constant_values=5.0)
    return np.pad(image, widths, mode=PAD[border.value])  # type: ignore[call-overload,no-any-return]


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("n", [1, 2, 3, 7])
def test_borders_continue_as_they_are_drawn(device: Device, border: Border, n: int) -> None:
    at = np.arange(-5 * n - 3, 6 * n + 4, dtype=np.int32)
    out = aligned_empty(at.shape, np.int32)
    with device.session() as session:
        defines = {"BORDER": BORDERS.index(border)}
        arguments = (at, np.int32(n), session.write(out), np.int32(at.size))
        session.launch(SOURCE, "indices", (at.size,), *arguments, defines=defines)
    if border is Border.CONSTANT:
        expected = np.where((at >= 0) & (at < n), at, -1)
    else:
        expected = np.pad(np.arange(n), (-at[0], at[-1] - n + 1), mode=PAD[border.value])  # type: ignore[call-overload]
    assert np.array_equal(out, expected)


def sample(device: Device, method: str, border: Border, image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Rows of: four channels; the third of four alone; the image read as pairs (2); the image read as one (1)."""
    out = aligned_empty((x.size, 8))
    with device.session() as session:
        size = (np.int32(image.shape[1]), np.int32(image.shape[0]))
        arguments = (image, *size, x.astype(np.float32), y.astype(np.float32), session.write(out), np.int32(x.size))
        defines = {"BORDER": BORDERS.index(border)}
        session.launch(SOURCE, f"sample_{method}_trial", (x.size,), *arguments, defines=defines)
    return out


def reference(method: str, border: Border, image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The tensor-product interpolant of the padded image, in float64; `image` has shape (height, width, channels)."""
    margin = 40
    wide = padded(image.astype(np.float64), border, margin)
    if method == "nearest":
        return np.asarray(wide[np.floor(y).astype(int) + margin, np.floor(x).astype(int) + margin])
    left, top = np.floor(x - 0.5).astype(int), np.floor(y - 0.5).astype(int)

    def weights(t: np.ndarray) -> list[np.ndarray]:
        if method == "bilinear":
            return [1 - t, t]
        near = [1.5 * d**3 - 2.5 * d**2 + 1 for d in (t, 1 - t)]  # Keys 1981 with a = -1/2
        far = [-0.5 * d**3 + 2.5 * d**2 - 4 * d + 2 for d in (1 + t, 2 - t)]
        return [far[0], near[0], near[1], far[1]]

    across, down = weights(x - 0.5 - left), weights(y - 0.5 - top)
    first = 0 if method == "bilinear" else -1
    value = np.zeros((x.size, image.shape[2]))
    for j, v in enumerate(down):
        for i, w in enumerate(across):
            value += (v * w)[:, np.newaxis] * wide[top + first + j + margin, left + first + i + margin]
    return value


@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize(("method", "error"), [("nearest", 0.0), ("bilinear", 4e-6), ("bicubic", 8e-6)])
def test_sampling_interpolates_the_continued_image(device: Device, method: str, error: float, border: Border) -> None:
    random = np.random.default_rng(1)
    image = aligned_empty((6, 9, 4))
    image[...] = random.random(image.shape)
    x = random.uniform(-20, 29, 3000).astype(np.float32).astype(np.float64)
    y = random.uniform(-20, 26, 3000).astype(np.float32).astype(np.float64)
    found = sample(device, method, border, image, x, y)
    for columns, channels in ((slice(0, 4), 4), (slice(5, 7), 2), (slice(7, 8), 1)):
        layout = image.reshape(6, -1, channels)
        assert np.abs(found[:, columns] - reference(method, border, layout, x, y)).max() <= error
    assert np.array_equal(found[:, 4], found[:, 2])


@pytest.mark.parametrize("method", ["nearest", "bilinear", "bicubic"])
def test_coordinates_without_a_place_give_nan(device: Device, method: str) -> None:
    image = aligned_empty((6, 9, 4))
    image[...] = 1
    lost = np.array([np.nan, np.inf, -np.inf, 3.0, 3.0])
    for border in BORDERS:
        found = sample(device, method, border, image, lost, np.array([3.0, 3.0, 3.0, np.nan, np.inf]))
        assert np.isnan(found).all()
        far = np.array([1e6, -1e9, 3e38, -3e38, 2.0**31, -(2.0**31)])
        found = sample(device, method, border, image, far, far[::-1].copy())
        assert np.array_equal(found, np.full_like(found, 5 if border is Border.CONSTANT else 1))


@pytest.mark.parametrize("method", ["nearest", "bilinear", "bicubic"])
def test_pixel_centres_give_their_pixel_beside_any_neighbour(device: Device, method: str) -> None:
    image = aligned_empty((6, 9, 4))
    image[...] = np.random.default_rng(2).random(image.shape)
    image[1::2] = np.nan
    image[:, 1::2] = np.inf
    y, x = (axis.ravel() + 0.5 for axis in np.mgrid[0:6:2, 0:9:2])
    found = sample(device, method, Border.CLAMP, image, x, y)
    assert np.array_equal(found[:, :4], image[::2, ::2].reshape(-1, 4))


def test_hashes_equal_their_numpy_twin(device: Device) -> None:
    words = np.random.default_rng(3).integers(0, 1 << 32, (3, 160), dtype=np.uint32)
    words[:, 0], words[:, 1] = 0, 0xFFFFFFFF
    x, y, z = hashing.pcg3d(*words)
    x, y = hashing.pcg2d(x, y)
    z = hashing.pcg(z)
    for kernel, items in (("hashes", 10), ("hashes_one", 160)):
        held = [aligned_empty((160,), np.uint32) for _ in range(3)]
        unit = aligned_empty((160,))
        for array, row in zip(held, words, strict=True):
            array[:] = row
        with device.session() as session:
            arguments = [*(session.readwrite(array) for array in held), session.write(unit)]
            session.launch(SOURCE, kernel, (items,), *arguments, defines={"BORDER": 0})
        for array, expected in zip(held, (x, y, z), strict=True):
            assert np.array_equal(array, expected)
        assert np.array_equal(unit, hashing.unit(z))


def test_hashes_are_the_published_ones() -> None:
    """One value of each worked out with Python's own integers, and enough of them to be spread evenly."""
    mask = 0xFFFFFFFF
    state = (123 * 747796405 + 2891336453) & mask
    word = (((state >> ((state >> 28) + 4)) ^ state) * 277803737) & mask
    assert hashing.pcg(123)[0] == (word >> 22) ^ word
    grid = np.arange(1 << 16, dtype=np.uint32)
    for words in (
        hashing.pcg(grid),
        *hashing.pcg2d(grid % 256, grid // 256),
        *hashing.pcg3d(grid % 256, grid // 256, 7),
    ):
        value = hashing.unit(words)
        assert value.min() >= 0
        assert value.max() < 1
        counts = np.histogram(value, 64, (0, 1))[0]
        assert ((counts - 1024.0) ** 2 / 1024).sum() < 110  # chi-squared, 63 degrees of freedom: p = 2e-4
    assert np.array_equal(hashing.pcg(-1), hashing.pcg(0xFFFFFFFF))
