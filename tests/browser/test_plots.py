"""What a browser makes of plots: it draws with the reader's own font, which is wider than that of the painted ones."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import Browser

from lichen.calibration.drawing import Drawing, Text, to_svg
from lichen.calibration.gather import predicted
from lichen.calibration.plot import plot
from lichen.catalogue import operations
from lichen.operation import Operation

BOXES = """() => [...document.querySelectorAll("svg text")].map(text => {
  const box = text.getBBox();
  return [text.textContent, box.x, box.y, box.x + box.width, box.y + box.height];
})"""
TOUCH = 1.0, 4.0
"""px by which boxes of texts may lie over each other: there is air in them above and below the letters."""

Box = tuple[str, float, float, float, float]


@pytest.fixture(scope="session")
def texts(browser: Browser) -> Any:
    """All texts of a drawing and where the browser put them: left, top, right and bottom."""
    page = browser.new_page()

    def found(drawing: Drawing) -> list[Box]:
        page.set_content(to_svg(drawing).decode())
        return [tuple(each) for each in page.evaluate(BOXES)]

    yield found
    page.close()


def beyond(drawing: Drawing, texts: list[Box]) -> list[str]:
    return [
        text
        for text, left, top, right, bottom in texts
        if left < 0 or top < 0 or right > drawing.width or bottom > drawing.height
    ]


def covered(texts: list[Box]) -> list[tuple[str, str]]:
    pairs = [(one, other) for number, one in enumerate(texts) for other in texts[:number]]
    return [
        (one[0], other[0])
        for one, other in pairs
        if all(min(one[i + 3], other[i + 3]) - max(one[i + 1], other[i + 1]) > TOUCH[i] for i in (0, 1))
    ]


@pytest.mark.parametrize("operation", operations().values(), ids=list(operations()))
def test_no_text_of_a_plot_is_cut_off_or_covered(operation: Operation[Any], texts: Any) -> None:
    drawing = plot(predicted(operation))
    found = texts(drawing)
    assert len(found) == sum(isinstance(shape, Text) for shape in drawing.shapes)
    assert not beyond(drawing, found)
    assert not covered(found)


def test_what_is_cut_off_or_covered_is_found(texts: Any) -> None:
    far, near, over = Text(180, 20, "far to the right"), Text(5, 20, "left"), Text(12, 22, "over")
    drawing = Drawing(200, 40, "", "", (far, near, over))
    assert beyond(drawing, texts(drawing)) == ["far to the right"]
    assert covered(texts(drawing)) == [("over", "left")]
