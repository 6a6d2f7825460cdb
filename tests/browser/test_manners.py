"""How the page behaves: everybody can read and reach it, nothing moves by itself, nobody else is asked for anything."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

from .conftest import Service, Visit

Visits = Callable[..., Visit]
PLACES = {
    "#/try/gaussian": ".plot-point.in-use",
    "#/pipelines": ".graph-node",
    "#/scenes": ".graph-node",
    "#/cases": ".case img",
    "#/api": ".path",
    "#/status": ".tile",
}
"""Views by their addresses, each with what shows that it is there."""


@pytest.mark.parametrize(("width", "theme"), [(1280, "dark"), (390, "light")])
def test_every_view_is_for_everybody(visit: Visits, service: Service, width: int, theme: str) -> None:
    window = visit(width, 800, color_scheme=theme)
    for place, sign in PLACES.items():
        page = window.open(place)
        page.locator(sign).first.wait_for()
        overflow = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        assert overflow <= 0, f"{place} is wider than the window by {overflow} px"
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        serious = [each for each in found if each["impact"] in ("serious", "critical")]
        assert [
            (each["id"], each["nodes"][0]["html"], each["nodes"][0].get("failureSummary")) for each in serious
        ] == []
        if place == "#/cases":
            case = page.locator(".case").first
            expect(case.locator(".why")).to_have_text([re.compile("^Naive code: .+"), re.compile("^Lichen, by .+: .+")])
            case.get_by_text("Parameters and test").click()
            expect(case).to_contain_text("test_hard_cases_hold[")
    expect(page.locator(".requests .timeline").first).to_be_visible()  # what this tab has asked, in the status
    assert window.said == []
    assert {each.split("/")[2] for each in window.asked if each.startswith("http")} == {service.url.split("/")[2]}
    assert {each.split(":")[0] for each in window.asked} <= {"http", "blob", "data"}


def test_nothing_moves_while_the_page_comes_to_be(visit: Visits) -> None:
    window = visit()
    window.page.add_init_script("""
        window.moved = 0;
        const unasked = (each) => each.hadRecentInput ? 0 : each.value;
        const note = (list) => list.getEntries().forEach((each) => { window.moved += unasked(each); });
        new PerformanceObserver(note).observe({ type: "layout-shift", buffered: true });
    """)
    page = window.open()
    window.settled()
    assert page.evaluate("window.moved") < 0.1  # what the web's own measure calls good


def test_a_picture_is_made_with_the_keyboard_alone(visit: Visits) -> None:
    window = visit()
    page = window.open()
    window.settled()
    page.keyboard.press("Tab")
    expect(page.locator(":focus")).to_have_text("Skip to the content")
    for _ in range(30):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.type") == "search":
            break
    page.keyboard.type("line integral")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", name="lic", exact=True)).to_be_visible()
    window.settled()
    for _ in range(80):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.getAttribute('aria-label')") == "length, slider":
            break
    before = page.url
    page.keyboard.press("ArrowRight")
    page.wait_for_function("before => location.href !== before", arg=before)
    moving = [each for each in window.asked if "/operations/lic?" in each and "length=28" not in each]
    assert "method=" in moving[0]  # a cheap picture while the slider moves, and then the one that is asked for
    assert "method=" not in moving[1]
    for _ in range(80):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.classList.contains('plot-point')"):
            break
    label = page.evaluate("document.activeElement.getAttribute('aria-label')")
    assert "In use." in label
    page.keyboard.press("ArrowRight")
    chosen = page.evaluate("document.activeElement.dataset.method")
    page.keyboard.press("Enter")
    page.wait_for_function("method => location.hash.includes(`method=${method}`)", arg=chosen)
    window.settled()
    assert window.said == []


def test_pipelines_show_what_was_left_out(visit: Visits) -> None:
    window = visit()
    page = window.open("#/pipelines")
    page.locator(".graph-node").first.wait_for()
    page.get_by_role("button", name="Undone again").click()
    expect(page.locator(".graph-node.gone")).to_have_count(3)
    assert "; changes " in (page.locator(".graph-node.gone title").first.text_content() or "")
    page.get_by_role("button", name="Compare with everything run").click()
    expect(page.locator(".proof")).to_contain_text(re.compile(r"differ by (nothing|[\d.e-]+); each promises"))
    page.get_by_label("run everything").check()
    expect(page.locator(".graph-node.gone")).to_have_count(0)
    expect(page.locator(".flame-part")).not_to_have_count(0)  # the kernels' time, node by node
    page.locator("#pipeline").fill("gaussian:sigma=-1")
    page.get_by_role("button", name="Run", exact=True).click()
    expect(page.locator(".problem")).to_contain_text("/nodes/gaussian/parameters/sigma")


def test_what_a_scene_does_not_need_leaves_its_plan(visit: Visits) -> None:
    window = visit()
    page = window.open("#/scenes")
    page.locator(".dial").first.wait_for()
    scene = {
        "camera": {"width": 48, "height": 36},
        "objects": [{"shape": "sphere", "centre": [0, 0, -5], "radius": 1}],
        "lights": [{"kind": "point", "position": [3, 5, 2], "intensity": 30}],
        "fog": {"density": 0.03},
        "lens": {"focus": 5, "blur": 3},
    }
    page.locator("#pipeline").fill(json.dumps(scene))
    page.locator("#pipeline").blur()
    density = page.get_by_label("fog density", exact=True)
    expect(density).to_have_value("0.03")
    nodes = page.locator(".graph-node:not(.gone)")
    expect(nodes.filter(has_text="fog")).not_to_have_count(0)
    density.fill("0")
    density.press("Enter")
    expect(nodes.filter(has_text="fog")).to_have_count(0)
    expect(page.locator(".pipeline-plan table").first).to_contain_text("fog")
    expect(page.locator("#pipeline")).to_have_value(re.compile('"density": 0\\b'))
    aperture = page.get_by_label("lens aperture", exact=True)
    expect(nodes.filter(has_text="lens")).not_to_have_count(0)
    aperture.fill("0")
    aperture.press("Enter")
    expect(nodes.filter(has_text="lens")).to_have_count(0)
    page.get_by_label("show lights per tile").check()
    expect(page.locator(".mapped")).to_contain_text("Of 1 light, a tile of 32 px looks at")
    assert window.said == []


def test_a_key_is_asked_for_and_kept_in_the_tab(visit: Visits) -> None:
    """The service needs none; a refusal is put in its place."""
    window = visit()
    refusal = '{"type":"/problems/unauthorized","title":"The request is not authorised","status":401}'

    def guard(route) -> None:  # type: ignore[no-untyped-def]
        if route.request.headers.get("authorization") == "Bearer lichen_secret":
            route.continue_()
        else:
            route.fulfill(status=401, content_type="application/problem+json", body=refusal)

    window.page.route("**/v1/**", guard)
    page = window.open()
    page.get_by_role("textbox", name="Key").fill("lichen_secret")
    page.get_by_role("button", name="Use it").click()
    window.settled()
    assert page.evaluate("localStorage.length") == 0
