"""The device's range of an array equals NumPy's, whatever it holds."""

from __future__ import annotations

import numpy as np
import pytest

from lichen.image import measure_extent
from lichen.memory import aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.extent import extent

COUNT = (1 << 21) + 12_345  # more than goes to NumPy, and no whole number of blocks or vectors


@pytest.mark.parametrize("case", ["plain", "holes", "last", "nothing finite", "denormal", "constant"])
def test_extent_is_numpys(device: Device, case: str) -> None:
    random = np.random.default_rng(1)
    values = aligned_empty((COUNT,))
    values[:] = random.normal(size=COUNT)
    if case == "holes":
        values[::7], values[3], values[4] = np.nan, np.inf, -np.inf
    elif case == "last":
        values[-1], values[-2], values[-3] = 1e30, -1e30, np.nan
    elif case == "nothing finite":
        values[:] = [np.nan]
        values[5] = -np.inf
    elif case == "denormal":
        values[:] = 0
        values[77] = -1e-45
    elif case == "constant":
        values[:] = -3
    found = extent(device, values)
    assert found == measure_extent(values)
    assert found == extent(device, values[::-1])  # not C-ordered forwards: NumPy's
    assert extent(device, values.astype(np.float64)) == found
