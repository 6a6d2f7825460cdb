"""Colour transform files against OpenColorIO, node by node, and the refusal of what is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import PyOpenColorIO as ocio
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image
from lichen.operations.tone.clf import parse
from lichen.operations.tone.cube import written

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(12)
PIXELS = np.concatenate([RNG.uniform(-0.4, 1.6, (40, 53, 3)), RNG.uniform(0, 1, (40, 53, 3))]).astype(np.float32)
FLOATS = 'inBitDepth="32f" outBitDepth="32f"'


def document(*nodes: str, version: str = "3") -> str:
    head = f'<?xml version="1.0"?>\n<ProcessList id="t" compCLFversion="{version}">\n'
    return head + "\n".join(nodes) + "\n</ProcessList>"


def array(numbers: np.ndarray, dim: str) -> str:
    return f'<Array dim="{dim}">\n' + "\n".join(f"{x:.9g}" for x in numbers.reshape(-1)) + "</Array>"


CUBE = RNG.random((5, 5, 5, 3))
LINE = np.sort(RNG.random((17, 3)), axis=0)
NODES = {
    "matrix": f"<Matrix {FLOATS}>{array(RNG.normal(size=(3, 3)), '3 3')}</Matrix>",
    "matrix with offsets, 10 to 8 bits": '<Matrix inBitDepth="10i" outBitDepth="8i"><Array dim="3 4">'
    "0.2 0.05 0 4 0 0.25 0 -2 0.01 0 0.3 0</Array></Matrix>",
    "range": f"<Range {FLOATS}><minInValue>0.1</minInValue><maxInValue>0.9</maxInValue><minOutValue>0</minOutValue>"
    "<maxOutValue>1.2</maxOutValue></Range>",
    "range below": f"<Range {FLOATS}><minInValue>0</minInValue><minOutValue>0</minOutValue></Range>",
    "range without clamp": f'<Range {FLOATS} style="noClamp"><minInValue>0.1</minInValue><maxInValue>0.9</maxInValue>'
    "<minOutValue>0</minOutValue><maxOutValue>1.2</maxOutValue></Range>",
    "lut1d": f"<LUT1D {FLOATS}>{array(LINE, '17 3')}</LUT1D>",
    "lut1d of one column, 10 bits": '<LUT1D inBitDepth="32f" outBitDepth="10i"><Array dim="3 1">'
    "0 600 1023</Array></LUT1D>",
    "lut3d": f'<LUT3D {FLOATS} interpolation="trilinear">{array(CUBE, "5 5 5 3")}</LUT3D>',
    "lut3d, tetrahedral": f'<LUT3D {FLOATS} interpolation="tetrahedral">{array(CUBE, "5 5 5 3")}</LUT3D>',
    "log10": f'<Log {FLOATS} style="log10"/>',
    "antilog2": f'<Log {FLOATS} style="antiLog2"/>',
    "log of a camera": f'<Log {FLOATS} style="cameraLinToLog"><LogParams base="10" linSideSlope="5.555556" '
    'linSideOffset="0.052272" logSideSlope="0.247190" logSideOffset="0.385537" linSideBreak="0.010591"/></Log>',
    "log of a camera, back": f'<Log {FLOATS} style="cameraLogToLin"><LogParams base="10" linSideSlope="5.555556" '
    'linSideOffset="0.052272" logSideSlope="0.247190" logSideOffset="0.385537" linSideBreak="0.010591"/></Log>',
    "linear to log": f'<Log {FLOATS} style="linToLog"><LogParams base="10" linSideSlope="1.1" linSideOffset="0.6" '
    'logSideSlope="0.3" logSideOffset="0.1"/></Log>',
}
for each in ("basicFwd", "basicRev", "basicMirrorFwd", "basicMirrorRev", "basicPassThruFwd", "basicPassThruRev"):
    NODES[each] = (
        f'<Exponent {FLOATS} style="{each}"><ExponentParams channel="R" exponent="2.2"/>'
        '<ExponentParams channel="B" exponent="1.5"/></Exponent>'
    )
for each in ("monCurveFwd", "monCurveRev", "monCurveMirrorFwd", "monCurveMirrorRev"):
    NODES[each] = f'<Exponent {FLOATS} style="{each}"><ExponentParams exponent="2.4" offset="0.055"/></Exponent>'
for each in ("Fwd", "Rev", "FwdNoClamp", "RevNoClamp"):
    NODES[f"cdl {each}"] = (
        f'<ASC_CDL {FLOATS} style="{each}"><SOPNode><Slope>1.2 0.9 1</Slope><Offset>0.05 -0.02 0</Offset>'
        "<Power>0.8 1.3 1</Power></SOPNode><SatNode><Saturation>0.7</Saturation></SatNode></ASC_CDL>"
    )
CHAIN = document(*(NODES[name] for name in ("monCurveMirrorFwd", "matrix", "cdl Fwd", "lut1d", "lut3d, tetrahedral")))


def by_ocio(text: str, pixels: np.ndarray, folder: Path) -> np.ndarray:
    path = folder / "transform.clf"
    path.write_text(text)
    config = ocio.Config.CreateRaw()
    processor = config.getProcessor(ocio.FileTransform(str(path), interpolation=ocio.INTERP_DEFAULT))
    made = np.ascontiguousarray(pixels[..., :3]).copy()
    plain = processor.getOptimizedCPUProcessor(ocio.BIT_DEPTH_F32, ocio.BIT_DEPTH_F32, ocio.OPTIMIZATION_NONE)
    plain.apply(ocio.PackedImageDesc(made, made.shape[1], made.shape[0], 3))
    return made


@pytest.mark.parametrize("name", NODES)
def test_truth_is_opencolorios(name: str, tmp_path: Path) -> None:
    """To float32, in which OpenColorIO computes: relative, and against what a steep start makes of a rounding."""
    text = document(NODES[name])
    found = lichen.evaluate_truth("table3d", PIXELS, clf=text)
    np.testing.assert_allclose(by_ocio(text, PIXELS, tmp_path), found, rtol=5e-6, atol=5e-6)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", [*NODES, "all"])
def test_nodes_keep_the_error_they_state(name: str, backend: str) -> None:
    text = CHAIN if name == "all" else document(NODES[name])
    result = lichen.run("table3d", PIXELS, clf=text, device=backend)
    truth = lichen.evaluate_truth("table3d", PIXELS, clf=text)
    assert np.abs(result.image.pixels - truth).max() <= result.error.value
    assert result.error.value < 3e-3 * max(1.0, np.abs(truth).max())


@pytest.mark.parametrize("backend", BACKENDS)
def test_coverage_passes_and_what_is_not_a_number_stays(backend: str) -> None:
    pixels = np.concatenate([PIXELS[:3], PIXELS[:3, :, :1]], axis=2)
    pixels[1, 5, 0] = np.nan
    made = lichen.run("table3d", Image(pixels, alpha=Alpha.STRAIGHT), clf=CHAIN, device=backend).image.pixels
    assert made[..., 3].tobytes() == pixels[..., 3].tobytes()
    assert np.isnan(made[1, 5, :3]).all()
    assert np.isfinite(np.delete(made.reshape(-1, 4), pixels.shape[1] + 5, axis=0)).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_shaper_comes_before_the_table(backend: str) -> None:
    shaper = np.stack([np.linspace(0, 1, 9) ** 0.5] * 3, axis=1)
    rows = [f"LUT_1D_SIZE 9\nLUT_1D_INPUT_RANGE 0 4\n{written(CUBE)}".replace("LUT_3D_SIZE 5\n", "LUT_3D_SIZE 5\n@")]
    text = rows[0].replace("@", "".join(f"{r:.9g} {g:.9g} {b:.9g}\n" for r, g, b in shaper))
    two = lichen.run("table3d", PIXELS, cube=text, device=backend).image.pixels
    first = np.interp(np.clip(PIXELS, 0, 4) / 4, np.linspace(0, 1, 9), shaper[:, 0])
    alone = lichen.evaluate_truth("table3d", first.astype(np.float32), cube=written(CUBE))
    np.testing.assert_allclose(two, alone, atol=1e-5)
    line = "LUT_1D_SIZE 3\n0 0 0\n0.25 0.5 0.75\n1 1 1\n"
    made = lichen.run("table3d", np.full((1, 1, 3), 0.5, np.float32), cube=line, device=backend).image.pixels
    np.testing.assert_allclose(made[0, 0], [0.25, 0.5, 0.75], atol=1e-6)


HALVES = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float64)
INDEXED = (
    '<LUT1D inBitDepth="10i" outBitDepth="32f"><IndexMap dim="2">64@0 940@2</IndexMap>'
    '<Array dim="3 1">0 0.25 1.5</Array></LUT1D>'
)


def by_halves() -> np.ndarray:
    """Three curves over all halves, bent at 0; NaN and infinities have entries of their own, which nothing reads."""
    with np.errstate(all="ignore"):
        return np.stack([np.cbrt(HALVES), np.tanh(3 * HALVES) + 0.1, 1e-3 * HALVES - 0.3 * (HALVES < 0)], axis=-1)


def test_a_table_of_halves_is_opencolorios(tmp_path: Path) -> None:
    """Between halves, among those below 2^-14, at both ends and beyond them; and the signs that meet at 0."""
    ours = document(f'<LUT1D {FLOATS} halfDomain="true">{array(by_halves(), "65536 3")}</LUT1D>')
    theirs = document(f'<LUT1D {FLOATS} halfDomain="true">{array(np.nan_to_num(by_halves()), "65536 3")}</LUT1D>')
    sizes = 10 ** RNG.uniform(-8, 4.8, (60, 41, 3)) * RNG.choice([-1, 1], (60, 41, 3))
    sizes[0, :9] = np.float32([0, 5e-8, 6.1e-5, 6.10352e-5, 65504, 65519, 7e4, 1e30, 1]).reshape(-1, 1)
    pixels = sizes.astype(np.float32)
    truth = lichen.evaluate_truth("table3d", pixels, clf=ours)
    np.testing.assert_allclose(by_ocio(theirs, pixels, tmp_path), truth, rtol=2e-6, atol=2e-6)
    for backend in BACKENDS:
        result = lichen.run("table3d", pixels, clf=ours, device=backend)
        assert np.abs(result.image.pixels - truth).max() <= result.error.value < 1e-4


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_table_of_halves_keeps_nan_and_holds_infinity(backend: str) -> None:
    text = document(f'<LUT1D {FLOATS} halfDomain="true">{array(by_halves(), "65536 3")}</LUT1D>')
    pixels = np.array([np.nan, np.inf, -np.inf, 0, -0.0, -1e-9], np.float32).reshape(-1, 1, 1).repeat(3, 2)
    made = lichen.run("table3d", pixels, clf=text, device=backend).image.pixels[:, 0, 0]
    expected = [np.nan, np.cbrt(65504), -np.cbrt(65504), 0, 0, -np.cbrt(2.0**-24) * 1e-9 * 2**24]
    np.testing.assert_allclose(made, expected, rtol=1e-6)


def test_halves_after_a_matrix_keep_the_error_they_state() -> None:
    """What the table is asked for is off by roundings there, and next to 0 the cube root makes much of them."""
    table = f'<LUT1D {FLOATS} halfDomain="true">{array(by_halves(), "65536 3")}</LUT1D>'
    text = document(NODES["matrix"], table)
    truth = lichen.evaluate_truth("table3d", PIXELS, clf=text)
    for backend in BACKENDS:
        result = lichen.run("table3d", PIXELS, clf=text, device=backend)
        assert np.abs(result.image.pixels - truth).max() <= result.error.value < 0.4


def test_entries_written_as_halves_are_opencolorios(tmp_path: Path) -> None:
    values = np.sort(RNG.uniform(-2, 2, (9, 1)).astype(np.float16), axis=0)
    coded = array(values.view(np.uint16).astype(np.float64), "9 1")
    text = document(f'<LUT1D inBitDepth="32f" outBitDepth="16f" rawHalfs="true">{coded}</LUT1D>')
    truth = lichen.evaluate_truth("table3d", PIXELS, clf=text)
    np.testing.assert_allclose(by_ocio(text, PIXELS, tmp_path), truth, atol=2e-6)
    np.testing.assert_allclose(truth[..., 0], np.interp(PIXELS[..., 0], np.linspace(0, 1, 9), values[:, 0]), atol=1e-6)


def test_an_index_map_says_where_entries_lie(tmp_path: Path) -> None:
    """Of two pairs as OpenColorIO reads it; of more as the format's second version says, a polygon."""
    text = document(INDEXED, version="2.0")
    truth = lichen.evaluate_truth("table3d", PIXELS, clf=text)
    np.testing.assert_allclose(by_ocio(text, PIXELS, tmp_path), truth, atol=2e-6)
    bent = INDEXED.replace("64@0 940@2", "64@0 200@1 940@2").replace('dim="2"', 'dim="3"')
    cube = f"<LUT3D {FLOATS}>{'<IndexMap>0@0 0.2@3 2@4</IndexMap>'}{array(CUBE, '5 5 5 3')}</LUT3D>"
    plain = f"<LUT3D {FLOATS}>{array(CUBE, '5 5 5 3')}</LUT3D>"
    for backend in BACKENDS:
        made = lichen.run("table3d", PIXELS, clf=document(bent, version="2"), device=backend).image.pixels
        place = np.interp(PIXELS * 1023, [64, 200, 940], [0, 1, 2])
        np.testing.assert_allclose(made, np.interp(place, [0, 1, 2], [0, 0.25, 1.5]), atol=3e-6)
        made = lichen.run("table3d", PIXELS, clf=document(cube, version="1.2.3"), device=backend).image.pixels
        moved = np.interp(PIXELS, [0, 0.2, 2], [0, 0.75, 1]).astype(np.float32)
        np.testing.assert_allclose(made, lichen.evaluate_truth("table3d", moved, clf=document(plain)), atol=1e-5)


BOMB = '<!DOCTYPE a [<!ENTITY b "bbbbbbbbbb"><!ENTITY c "&b;&b;&b;">]><ProcessList>&c;</ProcessList>'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no XML"),
        ("<a>", "no XML"),
        (BOMB, "document type"),
        ('<!DOCTYPE a SYSTEM "file:///etc/passwd"><ProcessList/>', "document type"),
        ("<ProcessList/>", "0 nodes"),
        ("<Look/>", "must be a ProcessList"),
        ("<a><a><a><a><a><a><a><a/></a></a></a></a></a></a></a>", "nested"),
        (document("<Gain/>"), "node 1 (Gain, line 3)"),
        (document(NODES["matrix"], f"<LUT1D {FLOATS} halfDomain='true'/>"), "node 2 (LUT1D, line 13): has no Array"),
        (document(f"<LUT1D {FLOATS} halfDomain='true'><Array dim='2 1'>0 1</Array></LUT1D>"), "does not fit"),
        (document(f"<LUT1D {FLOATS} rawHalfs='true'><Array dim='2 1'>0 0.5</Array></LUT1D>"), "whole numbers"),
        (document(f"<LUT1D {FLOATS} rawHalfs='true'><Array dim='2 1'>0 31744</Array></LUT1D>"), "not finite"),
        (document(INDEXED.replace("@", " ", 1), version="2.0"), "two pairs or more"),
        (document(INDEXED.replace("@2", "@3"), version="2.0"), "outside of 0 to 2"),
        (document(INDEXED.replace("940", "9"), version="2.0"), "must ascend"),
        (document(INDEXED), "version 3 of the format has no IndexMap"),
        (document(INDEXED, version="new"), "compCLFversion is 'new'"),
        (document(f"<Matrix {FLOATS}><Array dim='3 3'>1 2 3</Array></Matrix>"), "holds 3 numbers and must hold 9"),
        (document(f"<Matrix {FLOATS}><Array dim='3 3'>1 2 3 4 5 6 7 8 nan</Array></Matrix>"), "not finite"),
        (document("<Matrix inBitDepth='9i'><Array dim='3 3'>1 0 0 0 1 0 0 0 1</Array></Matrix>"), "inBitDepth is '9i'"),
        (document(f"<LUT3D {FLOATS}><Array dim='900 900 900 3'>0</Array></LUT3D>"), "does not fit"),
        (document(f"<Exponent {FLOATS} style='wave'><ExponentParams exponent='2'/></Exponent>"), "style is 'wave'"),
        (document(f"<Exponent {FLOATS} style='basicFwd'/>"), "has no ExponentParams"),
        (document(f"<Range {FLOATS}><minInValue>0</minInValue></Range>"), "OutValue"),
    ],
)
def test_what_is_no_colour_transform_is_refused_with_its_place(text: str, says: str) -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("table3d", PIXELS, clf=text)
    assert [flaw.pointer for flaw in caught.value.flaws] == ["/parameters/clf"]
    assert says in caught.value.flaws[0].detail


def test_a_bypassed_node_does_nothing() -> None:
    skipped = NODES["matrix"].replace("<Matrix", "<Matrix bypass='true'")
    assert len(parse(document(skipped, NODES["range"])).steps) == 1


def test_two_tables_are_one_too_many() -> None:
    for values in ({"clf": CHAIN, "cube": written(CUBE)}, {"clf": CHAIN, "domain_min": [0, 0, 0]}):
        with pytest.raises(InvalidRequest):
            lichen.run("table3d", PIXELS, **values)
