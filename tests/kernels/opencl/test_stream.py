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


@pytest.mark.parametrize("samples", [FROM - 1, FROM, FROM + 13])
@pytest.mark.parametrize("shift", [0, 3, 16])
def test_every_sample_is_written_and_no_other(device: Device, samples: int, shift: int) -> None:
    given, made = aligned_empty((samples,)), aligned_empty((samples + 32,))
    given[:] = np.arange(samples)
    made[:] = -1
    with device.session() as session:
        items = -(-samples // 16)
        arguments = (given, session.readwrite(made), np.int32(shift), np.uint64(samples))
        session.launch(SOURCE, "twice", (items,), *arguments)
    assert np.array_equal(made[shift : shift + samples], 2 * given)
    assert (made[:shift] == -1).all() and (made[shift + samples :] == -1).all()
