"""Large results are written past the caches, and hold the same numbers wherever they begin and end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lichen.memory import aligned_empty
from lichen.opencl.device import Device

SOURCE = str(Path(__file__).with_name("stream_trial.cl"))
FROM = 1 << 21
"""`STREAM_FROM` of stream.clh."""


@pytest.mark.parametrize(("kernel", "samples"), [("twice", FROM - 1), ("twice", FROM + 13), ("twice_by_four", FROM)])
@pytest.mark.parametrize("shift", [0, 3, 16])
def test_every_sample_is_written_and_no_other(device: Device, kernel: str, samples: int, shift: int) -> None:
    given, made = aligned_empty((samples,)), aligned_empty((samples + 32,))
    given[:] = np.arange(samples)
    made[:] = -1
    with device.session() as session:
        items = -(-samples // (16 if kernel == "twice" else 4))
        arguments = (given, session.readwrite(made), np.int32(shift), np.uint64(samples))
        session.launch(SOURCE, kernel, (items,), *arguments)
    assert np.array_equal(made[shift : shift + samples], 2 * given)
    assert (made[:shift] == -1).all()
    assert (made[shift + samples :] == -1).all()
