"""Trying operations on the page, as a visitor does: pictures, sliders, settings, mistakes, a service that goes away."""

from __future__ import annotations

import base64
import http.client
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, expect

import lichen
from lichen.files import decode, encode
from lichen.image import Image, Space, Storage

from .conftest import Service, Visit

Visits = Callable[..., Visit]
SIZE = (24, 32)


@pytest.fixture(scope="module")
def png() -> bytes:
    """A small picture of steps and noise, without symmetry."""
    pixels = np.random.default_rng(3).random((*SIZE, 3), np.float32)
    pixels[:, 20:] = np.round(pixels[:, 20:])
    return bytes(encode(Image(pixels, Space.SRGB, storage=Storage.UINT8), "png").data)


def drop(page: Page, data: bytes, name: str = "steps.png", *, pasted: bool = False) -> None:
    """Lets go of a file over the first field, as the operating system would, or pastes it into the page."""
    transfer = page.evaluate_handle(
        """([data, name]) => {
            const bytes = Uint8Array.from(atob(data), (each) => each.charCodeAt(0));
            const transfer = new DataTransfer();
            transfer.items.add(new File([bytes], name, { type: "image/png" }));
            return transfer;
        }""",
        [base64.b64encode(data).decode(), name],
    )
    if pasted:
        paste = "each => document.dispatchEvent(new ClipboardEvent('paste', { clipboardData: each }))"
        page.evaluate(paste, transfer)
    else:
        page.locator(".drop").first.dispatch_event("drop", {"dataTransfer": transfer})
    expect(page.locator(".drop option").first).to_have_text(name)


def shown(page: Page) -> Any:
    """The pixels of the stage at one screen pixel for each of the picture, (height, width, 3) in [0, 1]."""
    page.locator(".stage-canvas").focus()
    page.keyboard.press("0")
    rows, columns = SIZE
    code = """async ([width, height]) => {
        await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
        const canvas = document.querySelector(".stage-canvas");
        const k = Math.min(canvas.width / width, canvas.height / height);
        const left = (canvas.width - width * k) / 2, top = (canvas.height - height * k) / 2;
        const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
        copy.drawImage(canvas, 0, 0);
        const found = [];
        for (let y = 0; y < height; y += 1) for (let x = 0; x < width; x += 1)
            found.push(...copy.getImageData(left + (x + 0.5) * k, top + (y + 0.5) * k, 1, 1).data.slice(0, 3));
        return found;
    }"""
    return np.array(page.evaluate(code, [columns, rows])).reshape(rows, columns, 3)


def answered(service: Service, query: str, body: bytes) -> Any:
    """What the API gives for the same request, as 8-bit codes."""
    connection = http.client.HTTPConnection("127.0.0.1", service.port, timeout=60)
    connection.request("POST", f"/v1/operations/gaussian?{query}", body, {"Accept": "image/png"})
    response = connection.getresponse()
    assert response.status == 200
    data = response.read()
    connection.close()
    return np.rint(decode(data).pixels * 255).astype(int)


def slide(page: Page, parameter: str, share: float) -> None:
    """Drags the slider of a parameter with the mouse to this share of its way."""
    slider = page.locator(f'[data-parameter="{parameter}"] input[type=range]')
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    assert box is not None
    middle = box["y"] + box["height"] / 2
    start = box["x"] + 8 + float(slider.input_value()) / 1000 * (box["width"] - 16)
    page.mouse.move(start, middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 8 + share * (box["width"] - 16), middle, steps=6)
    page.mouse.up()


def test_a_dropped_picture_is_shown_as_the_api_computes_it(visit: Visits, service: Service, png: bytes) -> None:
    window = visit()
    page = window.open()
    window.settled()
    drop(page, png)
    expect(page.locator(".stage-canvas")).to_have_attribute(
        "aria-label", f"Result, {SIZE[1]} by {SIZE[0]} pixels. Arrow keys read pixels, plus and minus zoom."
    )
    window.settled()
    np.testing.assert_array_equal(shown(page), answered(service, "sigma=6", png))
    page.get_by_role("radio", name="input").check()
    np.testing.assert_array_equal(shown(page), np.rint(decode(png).pixels * 255))
    assert window.said == []


def test_a_dragged_slider_changes_the_picture_and_the_address(visit: Visits, service: Service, png: bytes) -> None:
    window = visit()
    page = window.open()
    window.settled()
    drop(page, png)
    before = shown(page)
    with page.expect_response(lambda each: "explain=true" in each.url and "sigma=6&" not in each.url):
        slide(page, "sigma", 0.12)
    sigma = page.locator('[data-parameter="sigma"] input[type=number]').input_value()
    assert 0 < float(sigma) < 2
    window.settled()
    assert page.url.endswith(f"#/try/gaussian?sigma={sigma}")
    after = shown(page)
    assert (after != before).any()
    np.testing.assert_array_equal(after, answered(service, f"sigma={sigma}", png))
    page.reload()
    window.settled()
    assert page.locator('[data-parameter="sigma"] input[type=number]').input_value() == sigma
    assert window.said == []


def test_a_chosen_point_is_the_setting_that_runs(visit: Visits) -> None:
    window = visit()
    page = window.open("#/try/gaussian?sigma=9")
    window.settled()
    used = page.locator(".account code")
    before = used.inner_text()
    expect(page.locator(".price-words")).to_contain_text("tenfold smaller")
    expect(page.locator(".price-scale")).to_contain_text("one step of an 8-bit picture is 0.00392")
    point = page.locator('.plot-point[data-method="dct"]').first
    knob = float(point.get_attribute("data-knob") or "nan")
    point.scroll_into_view_if_needed()
    point.click()
    expect(used).to_have_text(f"dct; tail={knob:g}")
    assert before != used.inner_text()
    expect(page.locator('.plot-point.in-use[data-method="dct"]')).to_have_count(1)
    assert f"method=dct&tail={knob:g}" in page.url.replace("e-7", "e-07").replace("e-6", "e-06").replace("e-5", "e-05")
    page.get_by_role("button", name="leave it to the service").click()
    expect(used).to_have_text(before)
    # The slider along the front asks for an error instead.
    window.settled()
    page.locator("#max-error").press("End")
    expect(page.locator(".plot-limit")).to_have_count(1)
    assert "max_error=" in page.url
    assert window.said == []


def test_the_error_is_measured_and_drawn_over_the_picture(visit: Visits, png: bytes) -> None:
    window = visit()
    page = window.open()
    window.settled()
    drop(page, png)
    window.settled()
    plain = shown(page)
    page.get_by_label("Measure the error on this picture").check()
    expect(page.locator(".colour-bar")).to_be_visible()
    largest, _, rms = (float(each) for each in page.locator(".measured dd").all_inner_texts())
    stated = float(page.locator(".account dd b").inner_text())
    assert 0 < rms < largest <= stated
    assert (shown(page) != plain).any()
    page.get_by_label("map over the picture").fill("0")
    np.testing.assert_array_equal(shown(page), plain)


def test_pixels_are_read_as_floats(visit: Visits, service: Service, png: bytes) -> None:
    window = visit()
    page = window.open()
    window.settled()
    drop(page, png, pasted=True)
    window.settled()
    page.locator(".stage-canvas").focus()
    page.keyboard.press("Shift+ArrowLeft")
    expect(page.locator(".readout .where")).to_have_text(f"x {SIZE[1] // 2 - 10}  y {SIZE[0] // 2}")
    expect(page.locator(".samples")).to_have_count(2)
    result, given = (
        [float(each) for each in samples.locator("b").all_inner_texts()] for samples in page.locator(".samples").all()
    )
    place = SIZE[0] // 2, SIZE[1] // 2 - 10
    np.testing.assert_allclose(given, decode(png).pixels[place], atol=6e-6)
    np.testing.assert_allclose(np.rint(np.array(result) * 255), answered(service, "sigma=6", png)[place], atol=0)
    page.locator(".drop select").select_option("noise:coloured")
    expect(page.locator(".drop option").first).to_have_text(re.compile(r"^White noise in colour, seed \d+$"))
    window.settled()
    assert window.said == []


def test_what_is_wrong_with_a_request_is_said_where_it_is(visit: Visits) -> None:
    window = visit()
    page = window.open()
    window.settled()
    field = page.locator('[data-parameter="sigma"] input[type=number]')
    field.fill("-3")
    field.press("Enter")
    alert = page.locator('[data-parameter="sigma"] .blame')
    expect(alert).to_be_visible()
    expect(alert).to_contain_text("greater than or equal to 0")
    expect(field).to_have_attribute("aria-invalid", "true")
    expect(page.locator(".trouble .problem")).to_be_visible()
    field.fill("2")
    field.press("Enter")
    expect(alert).to_be_hidden()
    expect(page.locator(".trouble .problem")).to_have_count(0)
    drop(page, b"no picture at all", "broken.png")
    expect(page.locator(".trouble .problem")).to_be_visible()


def test_operations_show_what_they_make(visit: Visits) -> None:
    """From nothing, as a table of findings, and as pages of an animation."""
    window = visit()
    page = window.open()
    page.get_by_label("Family").select_option("noise")
    expect(page.locator(".catalogue-list section")).to_have_count(1)
    page.get_by_label("Search operations").fill("worley")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", name="worley_noise", exact=True)).to_be_visible()
    expect(page.locator(".generator")).to_be_visible()
    window.settled()
    assert page.locator(".drop").count() == 0
    window.open("#/try/statistics")
    expect(page.get_by_role("rowheader", name="channels mean")).to_be_visible()
    window.open("#/try/lic?length=3&kernel=ripple&frames=9")
    expect(page.locator(".page-number")).to_have_text(re.compile(r"^[2-9] / 9$"))  # it plays by itself
    page.get_by_role("button", name="stop at this page").click()
    page.locator(".stage-canvas").focus()
    page.keyboard.press("Shift+ArrowLeft")
    leaves = page.get_by_label("page", exact=True)
    read = {}
    for key, number in (("Home", 1), ("End", 9)):
        leaves.press(key)
        expect(page.locator(".page-number")).to_have_text(f"{number} / 9")
        expect(page.locator(".samples").first).to_be_visible()
        read[number] = page.locator(".samples").first.inner_text()
    assert read[1] != read[9]
    expect(page.get_by_role("button", name="play the pages")).to_be_visible()
    assert window.said == []


def test_the_same_request_can_be_taken_elsewhere(visit: Visits, service: Service) -> None:
    window = visit()
    page = window.open("#/try/gaussian?sigma=2.5")
    window.settled()
    code = page.locator(".use pre")
    expect(code).to_contain_text(f"curl '{service.url}/v1/operations/gaussian?sigma=2.5&format=png'")
    page.get_by_role("radio", name="Python", exact=True).check()
    expect(code).to_contain_text('client.run("gaussian", "portrait.jpg", sigma=2.5)')
    page.get_by_role("radio", name="URL", exact=True).check()
    expect(code).to_contain_text("image=sha256%3A")
    response = page.request.get(code.inner_text())
    assert response.headers["content-type"] == "image/png"
    page.get_by_label("format of the file").select_option("exr")
    with page.expect_download() as download:
        page.get_by_role("button", name="Download").click()
    assert download.value.suggested_filename == "gaussian.exr"
    assert download.value.path().read_bytes()[:4] == b"\x76\x2f\x31\x01"


def test_a_service_that_goes_away_is_waited_for(visit: Visits, service: Service) -> None:
    window = visit()
    page = window.open()
    window.settled()
    service.kill()
    try:
        field = page.locator('[data-parameter="sigma"] input[type=number]')
        field.fill("11")
        field.press("Enter")
        expect(page.locator("#away")).to_be_visible()
    finally:
        service.start()
    expect(page.locator("#away")).to_be_hidden()
    expect(page.locator(".trouble .problem")).to_have_count(0)
    window.settled()
    assert "sigma=11" in page.url
    expect(page.locator(".use pre")).to_contain_text("sigma=11")


def test_a_curve_is_drawn_as_it_is_computed(visit: Visits) -> None:
    window = visit()
    page = window.open("#/try/curve")
    page.locator(".curve-line").first.wait_for()
    points = [[0.1, 0.2], [0.35, 0.3], [0.5, 0.9], [0.8, 0.6]]
    drawn = page.evaluate(
        """async ([points, ways]) => {
          const lib = new URL("lib/pchip.js", document.querySelector("script[type=module]").src);
          const { curved } = await import(lib);
          return ways.map((way) => curved(points, way));
        }""",
        [points, [{}, {"straight": True}, {"extend": True}]],
    )
    ways = [{}, {"interpolation": "linear"}, {"beyond": "extend"}]
    for line, way in zip(drawn, ways, strict=True):
        x, y = np.array(line).T
        told = {"points": points, "max_error": 1e-5, "device": "numpy", **way}
        expected = lichen.run("curve", x[None, :, None], **told).image.pixels.ravel()
        np.testing.assert_allclose(y, expected, atol=2e-5)
    assert window.said == []
