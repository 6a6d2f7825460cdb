"""Configurations of OpenColorIO: what they compute, and that none of them reaches the disk or this process."""

from __future__ import annotations

import base64
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image

RNG = np.random.default_rng(5)
PIXELS = RNG.uniform(0, 2, (13, 29, 3)).astype(np.float32)
CONFIG = """ocio_profile_version: 2
environment: {LICHEN_SECRET: plain}
roles: {scene_linear: lin, default: lin}
file_rules:
  - !<Rule> {name: Default, colorspace: default}
displays:
  screen:
    - !<View> {name: film, colorspace: out, looks: warm}
active_displays: []
active_views: []
looks:
  - !<Look> {name: warm, process_space: lin, transform: !<CDLTransform> {slope: [1.2, 1, 0.8]}}
colorspaces:
  - !<ColorSpace> {name: lin}
  - !<ColorSpace>
    name: out
    from_scene_reference: !<GroupTransform>
      children:
        - !<MatrixTransform> {matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1]}
        - !<ExponentTransform> {value: [0.5, 0.5, 0.5, 1]}
"""


def run(pixels: np.ndarray = PIXELS, **values: object) -> np.ndarray:
    return lichen.run("ocio", pixels, **values).image.pixels


def test_a_conversion_look_and_view_of_a_text() -> None:
    plain = np.sqrt(0.5 * PIXELS)
    np.testing.assert_allclose(run(config=CONFIG, target="out"), plain, rtol=3e-6)
    warm = np.sqrt(0.5 * PIXELS * np.float32([1.2, 1, 0.8]))
    np.testing.assert_allclose(run(config=CONFIG, target="out", looks="warm"), warm, rtol=3e-6)
    np.testing.assert_allclose(run(config=CONFIG, display="screen", view="film"), warm, rtol=3e-6)
    back = run(run(config=CONFIG, target="out"), config=CONFIG, target="out", inverse=True)
    np.testing.assert_allclose(back, PIXELS, rtol=1e-5, atol=1e-6)


def test_acescct_of_the_built_in_configuration_is_that_of_transfer() -> None:
    ours = lichen.run("transfer", PIXELS, curve="acescct", direction="encode").image.pixels
    np.testing.assert_allclose(run(source="ACEScg", target="ACEScct"), ours, atol=2e-6)


def test_coverage_passes_and_nan_stays() -> None:
    pixels = np.concatenate([PIXELS, PIXELS[..., :1]], axis=2)
    pixels[3, 4, 1] = np.nan
    made = run(Image(pixels, alpha=Alpha.STRAIGHT), source="ACEScg", target="ACEScct")
    assert made[..., 3].tobytes() == pixels[..., 3].tobytes()
    assert np.argwhere(np.isnan(made)).tolist() == [[3, 4, 0], [3, 4, 1], [3, 4, 2]]


def refused(**values: object) -> dict[str, str]:
    with pytest.raises(InvalidRequest) as caught:
        run(**values)
    return {flaw.pointer: flaw.detail for flaw in caught.value.flaws}


@pytest.mark.parametrize("place", ["colour space", "group", "look"])
def test_files_are_refused_wherever_they_are_named(place: str, tmp_path: Path) -> None:
    path = tmp_path / "table.spi1d"
    path.write_text("Version 1\nFrom 0 1\nLength 2\nComponents 1\n{\n0\n1\n}\n")
    transform = f"!<FileTransform> {{src: {path}}}"
    text = {
        "colour space": CONFIG + f"  - !<ColorSpace> {{name: bad, to_scene_reference: {transform}}}\n",
        "group": CONFIG.replace("!<ExponentTransform> {value: [0.5, 0.5, 0.5, 1]}", transform),
        "look": CONFIG.replace("!<CDLTransform> {slope: [1.2, 1, 0.8]}", transform),
    }[place]
    assert "files are not read" in refused(config=text, target="out")["/parameters/config"]


def test_variables_of_this_process_are_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LICHEN_SECRET", "swordfish")
    text = CONFIG.replace("{name: film, colorspace: out, looks: warm}", "{name: film, colorspace: $LICHEN_SECRET}")
    for config in (text, text.replace("environment: {LICHEN_SECRET: plain}\n", "")):
        assert "swordfish" not in str(refused(config=config, display="screen", view="film"))


def test_what_is_no_configuration_is_refused() -> None:
    assert "no configuration" in refused(config="hello", target="out")["/parameters/config"]
    assert "anchors" in refused(config="a: &a [1]\nb: [*a, *a]\n", target="out")["/parameters/config"]
    assert "no built-in" in refused(config="ocio://defualt", target="out")["/parameters/config"]


ARCHIVED = CONFIG.replace("environment: {LICHEN_SECRET: plain}", "environment: {SHOT: one}\nsearch_path: luts").replace(
    "!<CDLTransform> {slope: [1.2, 1, 0.8]}", "!<FileTransform> {src: $SHOT.cube}"
)


def archive(config: str | None = ARCHIVED, **files: str) -> str:
    """The base64 of a zip; a file's name may say folders by two underscores."""
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as made:
        for name, text in {"config.ocio": config, **files}.items():
            if text is not None:
                made.writestr(zipfile.ZipInfo(name.replace("__", "/")), text, zipfile.ZIP_DEFLATED)
    return base64.b64encode(held.getvalue()).decode()


@pytest.mark.parametrize("factor", [0.5, 0.25])
def test_an_archive_brings_its_tables(factor: float) -> None:
    """Two archives name a file alike and mean each its own."""
    table = f"LUT_1D_SIZE 2\nDOMAIN_MAX 2 2 2\n0 0 0\n{2 * factor} {2 * factor} {2 * factor}\n"
    text = archive(**{"luts__one.cube": table})
    warm = np.sqrt(0.5 * PIXELS * factor)
    np.testing.assert_allclose(run(config=text, target="out", looks="warm"), warm, rtol=3e-6)
    np.testing.assert_allclose(run(config=text, display="screen", view="film"), warm, rtol=3e-6)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (archive(**{"luts__two.cube": ""}), "which the archive does not hold"),
        (archive(ARCHIVED.replace("$SHOT.cube", "/etc/passwd")), "which the archive does not hold"),
        (archive(ARCHIVED.replace("search_path: luts", "search_path: /etc").replace("$SHOT.cube", "passwd")),
         "which the archive does not hold"),
        (archive(ARCHIVED.replace("$SHOT.cube", "../../etc/passwd")), "which the archive does not hold"),
        (archive(**{"..__one.cube": ""}), "outside of it"),
        (archive(**{"one.clf": "<ProcessList><Reference path='/etc/passwd'/></ProcessList>"}), "further file"),
        (archive(None, **{"luts__one.cube": ""}), "no config.ocio"),
        (archive()[:-20], "no archive"),
        (archive("a: &a [1]\nb: [*a, *a]\n"), "anchors"),
        (archive(zeros="0" * (65 << 20)), "more than 64 MiB"),
    ],
    ids=lambda value: value[:30],
)  # fmt: skip
def test_an_archive_is_read_safely(text: str, says: str) -> None:
    assert says in refused(config=text, target="out")["/parameters/config"]


def test_names_and_combinations_are_checked_all_at_once() -> None:
    assert set(refused(source="ACESgc", target="sRGB")) == {"/parameters/source", "/parameters/target"}
    assert set(refused(config=CONFIG)) == {"/parameters/target"}
    assert set(refused(config=CONFIG, target="out", display="screen", view="film")) == {"/parameters/target"}
    assert set(refused(config=CONFIG, display="screen")) == {"/parameters/view"}
    assert set(refused(config=CONFIG, display="screen", view="flim")) == {"/parameters/view"}
    assert set(refused(config=CONFIG, target="out", looks="wram")) == {"/parameters/looks"}


@pytest.mark.parametrize("example", lichen.operations()["ocio"].examples)
def test_examples_are_taken(example: dict[str, str]) -> None:
    assert np.isfinite(run(**example)).all()
