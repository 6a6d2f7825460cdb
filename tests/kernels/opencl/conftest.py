"""The device the tests of this folder run on; without one they are skipped, saying why."""

from __future__ import annotations

import pytest

from lichen.opencl.device import Device, default_device, status


@pytest.fixture(scope="session")
def device() -> Device:
    found = default_device()
    if found is None:
        pytest.skip(f"no OpenCL device: {status().reason}")
    return found
