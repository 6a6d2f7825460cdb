"""What `make soak` judges by: it finds leaks of each kind among numbers as noisy as real ones, and nothing else."""

from __future__ import annotations

import os

import numpy as np
import pytest

from .soak import LEAK, Samples


def sampled(rise: float = 0.0, threads: int = 0, files: int = 0) -> Samples:
    """Two hundred samples, one in 50 requests: memory rises by so many MB a thousand, others by so many in all."""
    chance = np.random.default_rng(5)
    samples = Samples()
    for at in range(200):
        samples.requests.append(50 * at)
        samples.megabytes.append(300 + rise * 0.05 * at + chance.normal(0, 3))
        samples.threads.append(20 + int(chance.integers(0, 4)) + threads * at // 200)
        samples.files.append(40 + int(chance.integers(0, 4)) + files * at // 200)
    return samples


def test_what_is_steady_passes() -> None:
    assert sampled().flaws() == []
    assert sampled(rise=0.5).flaws() == []


@pytest.mark.parametrize(
    ("rise", "threads", "files", "said"),
    [(LEAK / 1000, 0, 0, "memory rises"), (0, 40, 0, "threads rise"), (0, 0, 40, "files rise")],
)
def test_every_leak_is_found(rise: float, threads: int, files: int, said: str) -> None:
    (flaw,) = sampled(rise, threads, files).flaws()
    assert flaw.startswith(said)


def test_a_process_is_sampled_as_it_is() -> None:
    samples = Samples()
    samples.take(os.getpid(), 1)
    before = samples.files[0]
    with open(os.devnull), open(os.devnull):
        samples.take(os.getpid(), 2)
    assert samples.files[1] == before + 2
    assert samples.megabytes[0] > 10
    assert samples.threads[0] >= 1
