"""Chains made band after band: the same picture with less of it in memory at once."""

from __future__ import annotations

import numpy as np
import pytest

import lichen
from lichen.engine import prepare_pipeline
from lichen.image import Image, Space
from lichen.planning import bands
from lichen.planning.graph import Banded

PICTURE = Image(np.random.default_rng(7).random((250, 40, 3), dtype=np.float32), Space.LINEAR)
CHAIN = (
    "levels:black=0.01|saturation:amount=1.2|box:width=3,height=3|levels:black=0.02|gaussian:sigma=0.6|levels:white=2"
)


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bands of a few rows for pictures of a few."""
    monkeypatch.setattr(bands, "WORTHWHILE", 1 << 10)
    monkeypatch.setattr(bands, "BAND", 1 << 12)
    monkeypatch.setattr(bands, "FEWEST", 2)


@pytest.mark.parametrize("device", ["opencl", "numpy"])
def test_bands_are_what_the_whole_is(device: str) -> None:
    """Within what both state; a NaN reaches as far as it did. Bands leave a rest at the end."""
    image = Image(PICTURE.pixels.copy(), Space.LINEAR)
    image.pixels[101, 7, 1] = np.nan
    banded, whole = (prepare_pipeline(CHAIN, image, device=device, max_error=1e-4, prune=p) for p in (True, False))
    (chain,) = banded.plan.graph.banded
    assert len(chain.steps) > 2
    assert PICTURE.height % chain.rows
    made, expected = banded.run()["result"], whole.run()["result"]
    both = made.error.value + expected.error.value
    np.testing.assert_allclose(made.image.pixels, expected.image.pixels, rtol=0, atol=both)
    assert banded.plan.peak_bytes < 2.7 * image.pixels.nbytes < whole.plan.peak_bytes
    (told,) = [each for each in banded.plan.decisions if each.pass_ == "tile"]
    assert told.node == chain.steps[-1]
    assert banded.plan.to_json()["bands"] == [{"nodes": list(chain.steps), "rows": chain.rows}]


def test_bands_reach_as_far_as_the_heads_of_fused_chains() -> None:
    kernel = [[0.1, 0.2, 0.1], [0.0, 0.3, 0.0], [0.1, 0.1, 0.1]]
    text = f"convolve:kernel={kernel}|levels:black=0.01|saturation|convolve:kernel={kernel}|levels:white=2"
    banded, whole = (
        prepare_pipeline(text, PICTURE, device="opencl", max_error=1e-4, prune=prune) for prune in (True, False)
    )
    assert [len(chain) for chain in banded.plan.graph.fused] == [2, 2]
    (chain,) = banded.plan.graph.banded
    assert chain.reaches == (1, 0, 1)
    made, expected = (each.run()["result"].image.pixels for each in (banded, whole))
    np.testing.assert_array_equal(made, expected)


def test_steps_make_what_the_next_reads() -> None:
    banded = Banded(("a", "b", "c"), 10, (0, 2, 3))
    assert bands.spans(banded, 0, 25) == [(0, 15), (0, 15), (0, 13), (0, 10)]
    assert bands.spans(banded, 20, 25) == [(15, 25), (15, 25), (17, 25), (20, 25)]


def test_what_needs_more_than_rows_nearby_is_made_whole() -> None:
    def chains(text: str) -> list[tuple[str, ...]]:
        plan = lichen.explain_pipeline(text, PICTURE.replace(space=Space.DATA), device="numpy")
        return [each.steps for each in plan.graph.banded]

    small = "box:width=3,height=3"
    assert chains(f"{small}|levels:black=0.1|equalise|{small}|{small}") == [("box", "levels"), ("box2", "box3")]
    assert chains("box:border=wrap|affine:matrix=[[1,0,9],[0,1,0]]|levels:black=0.1") == []
    assert chains("box:width=3,height=3|box:width=3,height=249") == []
    assert chains("box") == []
