"""Three-dimensional tables against colour-science and SciPy, and the reading of .cube text."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image
from lichen.operations.tone.cube import parse, written
from lichen.operations.tone.table3d import Parameters, table3d

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from colour.algebra import table_interpolation_tetrahedral

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(8)
NOISE = RNG.random((37, 41, 3), dtype=np.float32)
TABLE = RNG.random((9, 9, 9, 3))


def test_tetrahedral_truth_is_colour_sciences() -> None:
    got = table3d.evaluate_truth({"image": Image(NOISE)}, Parameters(cube=written(TABLE)))
    by_red = parse(written(TABLE)).table.transpose(2, 1, 0, 3)
    np.testing.assert_allclose(got, table_interpolation_tetrahedral(NOISE.astype(np.float64), by_red), atol=1e-12)


def test_trilinear_truth_is_scipys() -> None:
    parameters = Parameters(cube=written(TABLE), interpolation="trilinear")
    got = table3d.evaluate_truth({"image": Image(NOISE)}, parameters)
    places = NOISE.astype(np.float64).transpose(2, 0, 1)[::-1] * 8
    expected = [map_coordinates(parse(written(TABLE)).table[..., c], places, order=1) for c in range(3)]
    np.testing.assert_allclose(got, np.stack(expected, axis=-1), atol=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("interpolation", ["tetrahedral", "trilinear"])
@pytest.mark.parametrize("size", [2, 17, 33, 65])
def test_tables_of_all_sizes_keep_their_error(backend: str, interpolation: str, size: int) -> None:
    table = RNG.random((size * size, size, 3), dtype=np.float32)
    values = {"interpolation": interpolation, "domain_min": [-0.2, 0, 0.1], "domain_max": [0.9, 1, 1.3]}
    result = lichen.run("table3d", NOISE, table=table, device=backend, **values)
    truth = table3d.evaluate_truth({"image": Image(NOISE), "table": Image(table)}, Parameters(**values))
    assert np.abs(result.image.pixels - truth).max() <= result.error.value


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("interpolation", ["tetrahedral", "trilinear"])
def test_the_plain_table_changes_nothing(backend: str, interpolation: str) -> None:
    axis = np.linspace(0, 1, 33)
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    cube = written(np.stack([red, green, blue], axis=-1))
    pixels = np.concatenate([NOISE, NOISE[..., :1] * 2], axis=2)
    image = Image(pixels, alpha=Alpha.STRAIGHT)
    got = lichen.run("table3d", image, cube=cube, interpolation=interpolation, device=backend).image.pixels
    np.testing.assert_allclose(got[..., :3], NOISE, atol=3e-6)
    np.testing.assert_array_equal(got[..., 3], pixels[..., 3])


def test_cube_text_is_read() -> None:
    text = '# a comment\nTITLE "x"\nDOMAIN_MIN 0 0 -1\nDOMAIN_MAX 2 2 2\n' + written(TABLE[:2, :2, :2])
    cube = parse(text)
    assert (cube.low, cube.high) == ((0, 0, -1), (2, 2, 2))
    np.testing.assert_allclose(cube.table, TABLE[:2, :2, :2], atol=1e-8)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "0 colours"),
        ("LUT_3D_SIZE 100000\n", "2 to 65"),
        ("LUT_3D_SIZE nan\n", "finite"),
        ("LUT_1D_SIZE 4\n", "LUT_1D_SIZE 4 and LUT_3D_SIZE 0 need 4"),
        ("LUT_3D_SIZE 2\n" + "0 0 0\n" * 9, "more colours"),
        ("LUT_3D_SIZE 2\n" + "0 0 0\n" * 7, "7 colours"),
        ("LUT_3D_SIZE 2\n0 0 inf\n", "line 2"),
        ("LUT_3D_SIZE 2\n0 zero 0\n", "line 2"),
        ("0 0 0\n", "no size"),
    ],
)
def test_text_that_is_no_table_is_refused(text: str, says: str) -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("table3d", NOISE, cube=text)
    assert says in str(caught.value.flaws)


def test_a_table_is_needed_and_must_fit() -> None:
    bad = np.full((4, 2, 3), np.nan, np.float32)
    for values in ({}, {"table": NOISE}, {"table": bad}, {"table": bad * 0 + 1, "cube": written(TABLE)}):
        with pytest.raises(InvalidRequest):
            lichen.run("table3d", NOISE, **values)
