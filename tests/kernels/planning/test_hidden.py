"""What an opaque picture hides is not computed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lichen.engine import Prepared, prepare_pipeline
from lichen.execution import exact
from lichen.image import Alpha, Image, Space
from lichen.opencl.device import default_device
from lichen.planning import hidden
from lichen.planning.hidden import thin_part

RNG = np.random.default_rng(8)


def picture(*opaque: slice, alpha: Alpha = Alpha.ASSOCIATED, space: Space = Space.SRGB) -> Image:
    pixels = RNG.random((70, 50, 4), dtype=np.float32)
    pixels[..., :3] *= pixels[..., 3:]
    for rows in opaque:
        pixels[rows, :, 3] = 1
    return Image(pixels, space, alpha)


BELOW = picture()


def planned(top: Image, parameters: dict[str, Any], *, prune: bool = True, **form: Any) -> Prepared:
    below = {"image": "input.below"}
    nodes = {
        "soft": {"operation": "gaussian", "parameters": {"sigma": 1}, "inputs": below},
        "a": {"operation": "composite", "parameters": parameters, "inputs": {"image": "input.top", "base": "soft"}},
    }
    said = {"nodes": nodes, "outputs": {"x": {"node": "a", **form}}}
    return prepare_pipeline(said, images={"top": top, "below": BELOW}, device="numpy", prune=prune)


@pytest.mark.parametrize("alpha", [Alpha.ASSOCIATED, Alpha.STRAIGHT])
def test_below_an_opaque_part_nothing_is_computed(alpha: Alpha) -> None:
    """The same picture, by definition and by the methods; the blur below is made for the rows that show it."""
    top = picture(slice(0, 40), alpha=alpha)
    top.pixels[5, 6, 0] = np.nan
    part, whole = planned(top, {}), planned(top, {}, prune=False)
    assert part.plan.graph.facts()["a"].height == 30
    assert part.plan.graph.facts()["soft"].height == 30 + 10  # and what the blur reaches
    told = {each.pass_: each for each in part.plan.decisions if each.pass_ in ("hidden", "region")}
    assert told["hidden"].node == "a"
    assert told["hidden"].action == "computed on 50x30 from (0, 40)"
    assert told["region"].node == "soft"
    truths = [exact(each.plan.graph, each.order.images) for each in (part, whole)]
    np.testing.assert_allclose(truths[0], truths[1], rtol=0, atol=1e-12)
    pixels = [each.run()["x"].image.pixels for each in (part, whole)]
    np.testing.assert_allclose(pixels[0], pixels[1], rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("opaque", "parameters", "form"),
    [
        ((), {}, {}),
        ((slice(0, 5),), {}, {}),
        ((slice(20, 50),), {}, {}),
        ((slice(0, 40),), {"opacity": 0.5}, {}),
        ((slice(0, 40),), {"blend": "multiply"}, {}),
        ((slice(0, 40),), {"operator": "atop"}, {}),
        ((slice(0, 40),), {"y": 3}, {}),
        ((slice(0, 40),), {}, {"crop": [1, 2, 3, 4]}),
    ],
)
def test_where_something_shows_through_all_is_computed(
    opaque: tuple[slice, ...], parameters: dict[str, Any], form: dict[str, Any]
) -> None:
    plan = planned(picture(*opaque), parameters, **form).plan
    assert not any(each.pass_ == "hidden" for each in plan.decisions)


def test_the_thin_part_is_found_from_all_sides() -> None:
    image = picture(slice(0, 70))
    assert thin_part(image) is None
    image.pixels[33, 20, 3] = 0.5
    assert thin_part(image) == (20, 33, 1, 1)
    image.pixels[60, 31, 3] = np.nan
    assert thin_part(image) == (20, 33, 12, 28)
    assert thin_part(picture()) == (0, 0, 50, 70)
    assert thin_part(image.replace(alpha=Alpha.NONE)) is None


@pytest.mark.parametrize("part", [(0, 0, 50, 30), (7, 20, 11, 13), (0, 40, 50, 30), (49, 69, 1, 1)])
@pytest.mark.parametrize("tiled", [1, 16])
def test_a_patch_is_the_same_on_a_device(part: tuple[int, int, int, int], tiled: int) -> None:
    """Large results are written past the caches, in whole lines of them."""
    left, top, width, height = (tiled * each for each in part)
    below = BELOW.replace(pixels=np.tile(BELOW.pixels, (tiled, tiled, 1)))
    inner = Image(RNG.random((height, width, 4), dtype=np.float32), Space.SRGB, Alpha.ASSOCIATED)
    expected = below.pixels.copy()
    expected[top : top + height, left : left + width] = inner.pixels
    device, parameters = default_device(), hidden.Parameters(left=left, top=top)
    assert device is not None
    inputs = {"image": below, "part": inner}
    np.testing.assert_array_equal(hidden.Exact.opencl(device, inputs, parameters, 0.0), expected)
    np.testing.assert_array_equal(hidden.Exact.numpy(inputs, parameters, 0.0), expected)
