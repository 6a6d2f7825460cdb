"""Reports say of every setting what became of it, and drawings keep all of them."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest

import lichen
from lichen.accuracy.precision import PRECISIONS
from lichen.calibration.chart import Labels, spanning
from lichen.calibration.corpus import typical
from lichen.calibration.drawing import DENSITY, HUES, THEMES, Dot, Line, Text, dashes, to_png, to_svg
from lichen.calibration.examples import default_example
from lichen.calibration.gather import measured, predicted
from lichen.calibration.peers import PEERS, peers
from lichen.calibration.plot import plot
from lichen.calibration.report import Report, Setting
from lichen.calibration.words import milliseconds, round_errors, scientific, short
from lichen.files import decode

NAN = math.nan


def setting(
    method: str, knob: float | None, milliseconds: float, worst: float, typical: float | None = None
) -> Setting:
    return Setting(method, knob, milliseconds / 1e3, worst, worst / 10 if typical is None else typical, worst, worst)


def report(*settings: Setting) -> Report:
    return Report(
        "blur", {"sigma": 4}, 0, "opencl", 512, settings, {"fir": "tail"}, "Made up.", {"cpu": "none"}, "again"
    )


LADDER = (
    setting("fir", 1e-2, 1.0, 1e-2),
    setting("fir", 1e-4, 1.2, 1e-4),
    setting("fir", 1e-6, 1.44, 1e-6),
    setting("dct", 1e-4, 2.4, 2e-4),
    replace(setting("dct", 1e-6, NAN, NAN), failed="the border is wrap"),
    replace(setting("dct", 1e-7, NAN, NAN), failed="the border is wrap"),
    replace(setting("Other <gaussian>", None, 0.6, 5e-3), peer=True, stated=None),
    replace(setting("fir", 1e-6, 1.5, 1e-3), precision="fixed8"),
)


def test_every_setting_is_judged() -> None:
    found = {each.label: verdict for each, verdict in zip(LADDER, report(*LADDER).verdicts, strict=True)}
    assert [found[f"fir at {knob}"].standing for knob in ("1e-2", "1e-4", "1e-6")] == ["worthwhile"] * 3
    assert found["dct at 1e-4"].reason == "fir at 1e-4 is 2 times as fast and 2 times as accurate"
    assert found["dct at 1e-6"].reason == "the border is wrap"
    assert found["Other <gaussian>"].reason == "fir at 1e-4, the fastest of ours as accurate, takes 2.0 times the time"
    assert found["fir at 1e-6, fixed8"].standing == "variant"


def test_the_headline_is_the_price_of_a_digit() -> None:
    assert report(*LADDER).headline.startswith("One more digit costs 10 % more time on average; from 0.01 to 1e-6")
    assert [price.error for price in report(*LADDER).prices] == [1e-2, 1e-3, 1e-4, 1e-5, 1e-6]
    assert [round(price.seconds * 1e3, 2) for price in report(*LADDER).prices] == [1.0, 1.2, 1.2, 1.44, 1.44]


def test_peers_and_failures_are_never_on_the_front() -> None:
    assert {each.method for each in report(*LADDER).front} == {"fir"}


def test_where_the_worst_case_cannot_be_bought_down_the_typical_error_ranks() -> None:
    flat = [setting("euler", 1, 1.0, 0.9, 0.1), setting("rk4", 1, 3.0, 0.8, 0.01), setting("rk4", 2, 4.0, 1.0, 0.02)]
    made = report(*flat)
    assert made.ranking == "typical"
    assert made.remark.startswith("The worst case lies between 0.8 and 1 ")
    assert [each.method for each in made.front] == ["euler", "rk4"]
    rounding = [replace(each, worst=each.worst * 1e-7, typical=each.typical * 1e-7) for each in flat]
    assert report(*rounding).ranking == "worst"


def test_one_setting_needs_no_price() -> None:
    alone = report(setting("exact", None, 1.0, 1e-7))
    assert alone.headline == "Exact is the fastest and the most accurate: error 1e-7."
    assert alone.prices == []
    assert report(replace(setting("exact", None, NAN, NAN), failed="no")).headline == "No method could run."


@pytest.mark.parametrize("made", [LADDER, LADDER[:1], LADDER[4:5], (setting("exact", None, 1.0, 0.0),)])
def test_drawings_keep_every_setting(made: tuple[Setting, ...]) -> None:
    drawing = plot(report(*made))
    root = ElementTree.fromstring(to_svg(drawing))
    titles = " ".join(each.text or "" for each in root.iter("{http://www.w3.org/2000/svg}title"))
    for each in made:
        assert (each.failed or each.method) in titles
    for shape in drawing.shapes:
        if isinstance(shape, (Dot, Text)):
            assert 0 <= shape.x <= drawing.width, shape
            assert 0 <= shape.y <= drawing.height, shape


def test_texts_do_not_cover_each_other() -> None:
    boxes = [shape.box for shape in plot(report(*LADDER)).shapes if isinstance(shape, Text)]
    for i, a in enumerate(boxes):
        for b in boxes[i + 1 :]:
            assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1], (a, b)


@pytest.mark.parametrize("name", list(lichen.operations()))
def test_every_method_worth_taking_is_named(name: str) -> None:
    report = predicted(lichen.operations()[name])
    texts = {shape.text for shape in plot(report).shapes if isinstance(shape, Text)}
    assert texts >= {setting.method for setting in report.worthwhile}


def test_a_line_leads_to_a_name_that_is_not_beside_its_mark() -> None:
    """Of settings in one place all have names, and lines lead to those that lie further off."""
    crowd = [setting(f"method{i}", None, 1 + i / 1e4, 1e-3) for i in range(8)]
    others = setting("coarse", None, 0.1, 1), setting("alone", None, 10, 1e-6)
    drawing = plot(report(*crowd, *others))
    names = {shape.text: shape for shape in drawing.shapes if isinstance(shape, Text)}
    assert names.keys() >= {each.method for each in (*crowd, *others)}
    ends = [shape.points[1] for shape in drawing.shapes if isinstance(shape, Line) and shape.role in HUES]
    led = {
        name
        for name, text in names.items()
        for x, y in ends
        if text.box[0] <= x <= text.box[2] and text.box[1] <= y <= text.box[3]
    }
    assert 2 <= len(led) <= 6
    assert not led & {"coarse", "alone"}


def test_drawings_are_the_same_bytes_again_and_speak_ascii() -> None:
    first, second = (plot(report(*LADDER)) for _ in range(2))
    assert to_svg(first) == to_svg(second)
    assert to_png(first, "dark") == to_png(second, "dark")
    to_svg(first).decode("ascii")


def test_themes_name_every_role() -> None:
    assert set(THEMES["light"]) == set(THEMES["dark"])
    for theme, hues in THEMES.items():
        pixels = decode(to_png(plot(report(*LADDER)), theme)).pixels
        assert pixels.shape[1] == 960 * DENSITY
        shown = np.round(pixels[..., :3] * 255).astype(int) @ (1 << 16, 1 << 8, 1)
        for role in ("paper", "panel"):
            assert (shown == int(hues[role][1:7], 16)).any()


def test_dashes_have_the_asked_lengths() -> None:
    strokes = dashes([(0, 0), (10, 0)], (3, 1))
    assert [[x for x, _ in stroke] for stroke in strokes] == [[0, 3], [4, 7], [8, 10]]


def test_labels_stay_inside_and_apart() -> None:
    labels = Labels((0, 0, 200, 60), [(100, 30, 4)])
    placed = [labels.put(100, 30, f"label {number}", role="ink", size=11) for number in range(12)]
    assert placed[0]
    assert not placed[-1]
    assert len(labels.placed) == sum(placed)


def test_scales_have_the_least_length() -> None:
    assert spanning([3.0], 0, 1, least=1.0, margin=0.1).decades == pytest.approx(1.0)
    assert spanning([], 0, 1, least=1.0, margin=0.1).decades == pytest.approx(1.0)


def test_numbers_are_short() -> None:
    assert [scientific(each) for each in (0.0, 1.23e-4, 0.0123, 0.5, 12345.0, NAN)] == [
        *("0", "1.2e-4", "0.012", "0.5", "1.2e4", "nan")
    ]
    assert [short(each) for each in (1e-4, 0.01, 0.25, 2.0, 65536.0)] == ["1e-4", "1e-2", "0.25", "2", "65536"]
    assert round_errors(3e-3, 2e-5) == [1e-2, 1e-3, 1e-4]
    assert milliseconds(0.0123) == "12 ms"


# ------------------------------------------------------------------------------------------------- of real operations


@pytest.mark.parametrize("name", list(lichen.operations()))
def test_every_example_can_be_predicted(name: str) -> None:
    operation = lichen.operations()[name]
    for example in range(len(operation.examples)):
        made = predicted(operation, example, size=256)
        assert len(made.verdicts) == len(made.settings)
        assert all(verdict.reason for verdict in made.verdicts)
        to_svg(plot(made))
    assert 0 <= default_example(operation) < len(operation.examples)


def test_a_measured_report_holds_peers_and_precisions() -> None:
    operation = lichen.operations()["premultiply"]
    made = measured(operation, size=64, quick=True)
    assert {each.precision for each in made.settings} == set(PRECISIONS)
    assert any(each.peer for each in made.settings)
    assert all(each.seconds > 0 for each in made.settings if each.failed is None)
    by_precision = {each.precision: each.worst for each in made.settings if not each.peer}
    order = ("fixed8", "fixed12", "fixed16", "float32", "float64")
    assert [by_precision[each] for each in order] == sorted((by_precision[each] for each in order), reverse=True)


def test_what_cannot_run_stays_in_the_report() -> None:
    made = measured(lichen.operations()["gaussian"], 4, size=64, backend="numpy", quick=True)
    kept = {(each.method, each.knob): each for each in made.settings if not each.peer and each.precision == "float32"}
    assert set(kept) == {
        (method.name, knob)
        for method in lichen.operations()["gaussian"].methods.values()
        for knob in method.knob.values
    }
    assert "border" in str(kept["dct", 1e-6].failed)
    assert 0 < kept["fir", 1e-6].worst <= kept["fir", 1e-6].stated


def test_what_needs_no_picture_is_measured_too() -> None:
    made = measured(lichen.operations()["white_noise"], size=64, quick=True)
    assert {each.precision for each in made.settings if each.failed is None} == set(PRECISIONS)
    assert "1 channels" in made.source


@pytest.mark.parametrize("peer", PEERS, ids=[peer.name for peer in PEERS])
def test_peers_compute_the_same_thing(peer: object) -> None:
    """For every example they are listed for; rlic's lines are shorter where they run diagonally."""
    operation = lichen.operations()[peer.operation]  # type: ignore[attr-defined]
    ran = 0
    for example in operation.examples:
        parameters = operation.validate(example)
        if peer not in peers(operation, parameters):
            continue
        inputs = typical(operation, parameters, 40).inputs
        job = peer.job(inputs, parameters)  # type: ignore[attr-defined]
        job.run()
        wrong = job.pixels() - operation.evaluate_truth(inputs, parameters)
        assert np.sqrt(np.square(wrong).mean()) < (0.12 if operation.name == "lic" else 1e-3), example
        ran += 1
    assert ran
