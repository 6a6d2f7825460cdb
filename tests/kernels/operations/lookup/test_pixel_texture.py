"""Pixel textures against scipy's interpolation, OpenCV's remapping and the pixel path step by step."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Image, Space

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(4)
MODES = {"clamp": "nearest", "wrap": "grid-wrap", "reflect": "grid-mirror", "reflect101": "mirror"}


def stacked(texture: np.ndarray) -> np.ndarray:
    """A texture (..., rows, columns, channels) as its image."""
    return texture.reshape(-1, *texture.shape[-2:])


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("border", list(MODES))
@pytest.mark.parametrize("dimensions", [1, 2, 3, 4])
def test_agrees_with_scipy(dimensions: int, border: str, backend: str) -> None:
    """Linear and nearest in every number of dimensions, coordinates on both sides beyond the ends."""
    shape = (2, 3, 4, 5)[4 - dimensions :]
    texture = RNG.random((*shape, 3)).astype(np.float32)
    places = RNG.uniform(-1.5, 2.5, (9, 14, dimensions)).astype(np.float32)
    image = stacked(texture if dimensions > 1 else texture[None])
    values = {"dimensions": dimensions, "border": border, "device": backend}
    if dimensions > 2:
        values["depth"] = shape[-3]
    if dimensions > 3:
        values["fourth"] = shape[0]
    index = [places[..., k].astype(np.float64) * shape[-1 - k] - 0.5 for k in range(dimensions)][::-1]
    for name, order in (("linear", 1), ("nearest", 0)):
        found = lichen.run("pixel_texture", places, texture=image, filter=name, method="exact", **values).image.pixels
        at = index if order else [np.floor(each + 0.5) for each in index]
        expected = np.stack(
            [map_coordinates(texture[..., c], at, order=order, mode=MODES[border]) for c in range(3)], -1
        )
        assert np.abs(found - expected).max() < 1e-6, name


@pytest.mark.parametrize("backend", BACKENDS)
def test_cubic_agrees_with_opencv(backend: str) -> None:
    """Whose cubic has another parameter, so against Catmull and Rom's weights applied to a remap of each tap."""
    texture = RNG.random((12, 15, 1)).astype(np.float32)
    places = RNG.uniform(2, 9, (8, 9, 2)).astype(np.float32)
    found = lichen.run("pixel_texture", places, texture=texture, filter="cubic", units="texel", device=backend).image
    x, y = places[..., 0].astype(np.float64) - 0.5, places[..., 1].astype(np.float64) - 0.5
    total = np.zeros((8, 9))

    def kernel(t: np.ndarray) -> np.ndarray:
        t = np.abs(t)
        return np.where(t < 1, 1.5 * t**3 - 2.5 * t**2 + 1, np.where(t < 2, -0.5 * t**3 + 2.5 * t**2 - 4 * t + 2, 0))

    for j in range(-1, 3):
        for i in range(-1, 3):
            at_x, at_y = np.floor(x) + i, np.floor(y) + j
            texel = cv2.remap(texture, at_x.astype(np.float32), at_y.astype(np.float32), cv2.INTER_NEAREST)
            total += kernel(x - at_x) * kernel(y - at_y) * texel
    assert np.abs(found.pixels[..., 0] - total).max() < 2e-6


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_whole_pixel_path_is_one_request(backend: str) -> None:
    """Scale and bias, tables, matrix, tables, projective lookup: each step by NumPy, as the paper orders them."""
    image = RNG.random((10, 11, 4)).astype(np.float32)
    texture = RNG.random((9, 7, 2)).astype(np.float32)
    before = [[0, 0.1, 0.5, 1], [1, 0.6, 0.3, 0], [0.2, 0.3, 0.5, 0.9], [0, 1, 0, 1]]
    after = [[0, 0.8, 1], [0.1, 0.2, 1], [0.6, 0.8, 1.2]]
    matrix = [[0.4, 0.2, 0.1, 0, 0.1], [0, 0.5, 0.3, 0.1, 0], [0.2, 0.1, 0, 0.4, 0.3]]
    found = lichen.run(
        "pixel_texture", image, texture=texture, scale=[1.2, 1, 0.9, 1], bias=[-0.1, 0, 0.05, 0], before=before,
        matrix=matrix, after=after, projective=True, border="wrap", device=backend,
    ).image.pixels  # fmt: skip
    c = image.astype(np.float64) * [1.2, 1, 0.9, 1] + [-0.1, 0, 0.05, 0]
    c = np.stack([np.interp(c[..., k], np.linspace(0, 1, 4), before[k]) for k in range(4)], -1)
    c = np.concatenate([c, np.ones((10, 11, 1))], -1) @ np.array(matrix).T
    c = np.stack([np.interp(c[..., k], np.linspace(0, 1, 3), after[k]) for k in range(3)], -1)
    s, t = (c[..., k] / c[..., 2] for k in (0, 1))
    expected = [map_coordinates(texture[..., k], [t * 9 - 0.5, s * 7 - 0.5], order=1, mode="grid-wrap") for k in (0, 1)]
    assert np.abs(found - np.stack(expected, -1)).max() < 1e-6


def test_the_texture_says_what_the_result_is() -> None:
    texture = Image(RNG.random((4, 4, 3)).astype(np.float32), Space.SRGB)
    result = lichen.run("pixel_texture", RNG.random((5, 6, 2)), texture=texture)
    assert result.image.space is Space.SRGB
    assert result.image.pixels.shape == (5, 6, 3)


def test_doubles_keep_every_pixel_on_its_texel() -> None:
    """Coordinates just beside an edge between texels: float32 meets the neighbour, doubles do not."""
    texture = np.arange(3000, dtype=np.float32).reshape(1, 3000, 1)
    places = ((np.arange(1, 2999) + 0.001) / 3000 - 0.5).astype(np.float32).reshape(1, -1, 1)
    values = {"dimensions": 1, "filter": "nearest", "scale": 0.9999, "bias": 0.5}
    truth = lichen.evaluate_truth("pixel_texture", places, texture=texture, **values)
    results = {
        method: [
            lichen.run("pixel_texture", places, texture=texture, method=method, device=backend, **values).image.pixels
            for backend in BACKENDS
        ]
        for method in ("exact", "single")
    }
    assert all(np.array_equal(each, truth) for each in results["exact"])
    assert any((each != truth).any() for each in results["single"])


@pytest.mark.parametrize("border", [*MODES, "constant"])
@pytest.mark.parametrize(("dimensions", "filter"), [(2, "nearest"), (2, "linear"), (2, "cubic"), (3, "linear")])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_a_pixel_is_the_same_whatever_lies_beside_it(border: str, dimensions: int, filter: str, channels: int) -> None:
    """Where no pixel of a segment needs care they are found another way than beside one that does. Some look beyond the
    texture, some at the middles of texels, the first and last among them, and some at holes."""
    texture = RNG.random((4 * 24, 32, channels)).astype(np.float32)
    texture[:, 1], texture[5::24] = np.nan, np.inf
    places = RNG.uniform(4 / 24, 20 / 24, (12, 600, dimensions)).astype(np.float32)
    places[:, 256::3] = RNG.uniform(-0.4, 1.4, (12, 115, dimensions))
    places[:, 400:, 0] = np.rint(places[:, 400:, 0] * 32 - 0.5) / 32 + 0.5 / 32
    places[6:] = places[6:, :, :1]
    given = {"texture": texture, "dimensions": dimensions, "filter": filter, "border": border, "background": 0.3}
    given |= {"depth": 4} if dimensions > 2 else {}
    whole, part, plain = (
        lichen.run("pixel_texture", some, method="exact", device=on, **given).image.pixels
        for some, on in ((places, "opencl"), (places[:, 37:], "opencl"), (places, "numpy"))
    )
    np.testing.assert_array_equal(part, whole[:, 37:])
    np.testing.assert_allclose(whole, plain, atol=2e-6, rtol=0)
    assert 0.02 < (~np.isfinite(whole)).mean() < 0.98


def test_flaws_are_named() -> None:
    image, texture = np.zeros((3, 3, 2)), np.zeros((3, 3, 1))
    for values, pointer in (
        ({"dimensions": 3, "depth": 4}, "/inputs/texture"),
        ({"dimensions": 4, "projective": True}, "/parameters/projective"),
        ({"matrix": [[1, 0]]}, "/parameters/matrix"),
        ({"dimensions": 3, "border": ["clamp", "wrap"]}, "/parameters/border"),
        ({"before": [[0, 1], [0, 0.5, 1]]}, "/parameters/before"),
    ):
        with pytest.raises(InvalidRequest) as refused:
            lichen.run("pixel_texture", image, texture=texture, **values)
        assert refused.value.flaws[0].pointer.startswith(pointer)
