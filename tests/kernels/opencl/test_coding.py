"""Samples of files that go through the device are those that NumPy makes, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from lichen import coding, files
from lichen.errors import DeviceFailure
from lichen.files.samples import to_floats, to_storage
from lichen.image import Image, Space, Storage
from lichen.memory import Array, aligned
from lichen.opencl import samples as on_device
from lichen.opencl.device import Device

SHAPE = (3, 400_003)  # more than goes to NumPy, and no whole number of blocks or vectors
KINDS = [Storage.UINT8, Storage.UINT16]


def hard(levels: int) -> Array:
    """Values in and out of range, between two codes, and none at all."""
    random = np.random.default_rng(1)
    values = aligned(random.normal(0.5, 0.4, SHAPE).astype(np.float32))
    flat = values.reshape(-1)
    flat[15::31] = (random.integers(0, levels, len(flat[15::31])) + 0.5) / levels
    for at, value in enumerate((np.nan, np.inf, -np.inf, 3e38, -3e38, -0.0, -1e-9, 1.0, 1 + 1e-7)):
        flat[2 * at :: 997] = value
    return values


@pytest.mark.parametrize("storage", KINDS)
def test_storing_on_the_device_is_numpys(device: Device, storage: Storage) -> None:
    kind = np.dtype(storage.value)
    values = hard(np.iinfo(kind).max)
    found, expected = on_device.quantised(device, values, kind), to_storage(values, storage)
    np.testing.assert_array_equal(found[0], expected[0])
    assert found[1:] == expected[1:]
    assert min(found[1:]) > 0
    inside = aligned(np.clip(np.nan_to_num(values), 0, 1))
    np.testing.assert_array_equal(on_device.quantised(device, inside, kind)[0], to_storage(inside, storage)[0])


def test_halves_stored_on_the_device_are_numpys(device: Device) -> None:
    """Every half, what lies half way to the next one and beside that, numbers too large, and none."""
    every = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)
    finite = np.sort(every[np.isfinite(every)])
    between = (finite[1:] + finite[:-1]) / 2
    odd = np.float32([np.inf, -np.inf, np.nan, 65519.99, 65520, -65520, 1e30, -1e30, -1e-8, 2.0**-25, 3e-45, -0.0])
    near = np.concatenate([np.nextafter(between, np.float32(way)) for way in (-np.inf, np.inf)])
    values = aligned(np.resize(np.concatenate([every, between, near, odd]), SHAPE))
    found, expected = on_device.quantised(device, values, np.dtype(np.float16)), to_storage(values, Storage.FLOAT16)
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(np.signbit(found[0]), np.signbit(expected[0]))
    assert found[1:] == expected[1:]
    assert found[1] > 0


def test_floats_of_halves_from_the_device_are_numpys(device: Device) -> None:
    halves = np.resize(np.arange(1 << 16, dtype=np.uint16).view(np.float16), SHAPE)
    found, expected = on_device.widened(device, halves), to_floats(halves)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(np.signbit(found), np.signbit(expected))


@pytest.mark.parametrize("storage", KINDS)
def test_floats_from_the_device_are_numpys(device: Device, storage: Storage) -> None:
    codes = np.resize(np.arange(np.iinfo(storage.value).max + 1, dtype=storage.value), SHAPE)
    np.testing.assert_array_equal(on_device.widened(device, codes), to_floats(codes))


def test_files_are_the_same_by_either_way_and_where_the_device_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    image = Image(hard(255).reshape(3, -1, 1)[:, :390_000].reshape(-1, 650, 3), Space.SRGB, storage=Storage.UINT8)
    by_numpy = files.encode(image, "png")

    def refused(*given: object) -> None:
        raise DeviceFailure("the device is gone")

    for failing in (False, True):
        if failing:
            monkeypatch.setattr(on_device, "quantised", refused)
            monkeypatch.setattr(on_device, "widened", refused)
        made = coding.encode(image, "png")
        assert made == by_numpy
        back, expected = coding.decode(made.data), files.decode(made.data)
        np.testing.assert_array_equal(back.pixels, expected.pixels)
        assert back.extent == expected.extent
