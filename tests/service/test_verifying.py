"""Asking the service for the measured error, its map, and stores of less precision."""

from __future__ import annotations

import re
from email import message_from_bytes
from email.message import Message

import numpy as np
import pytest

from lichen import engine, verification
from lichen.accuracy import colour, metrics
from lichen.files import decode, encode
from lichen.image import Alpha, Image, Storage
from lichen_service import mixed
from lichen_service.documents import content_digest
from lichen_service.http.message import Response

from .conftest import Caller, problem_of, read_json

BLUR = "/v1/operations/gaussian"


@pytest.fixture(scope="module")
def array() -> bytes:
    pixels = np.random.default_rng(7).random((24, 31, 3), dtype=np.float32)
    return bytes(encode(Image(pixels), "npy").data)


def parts_of(response: Response) -> list[Message]:
    """The parts as a mail program takes them apart."""
    head = f"Content-Type: {response.headers['Content-Type']}\r\n\r\n".encode()
    message = message_from_bytes(head + bytes(response.body))
    assert message.is_multipart()
    assert not message.defects
    return [part for part in message.get_payload() if isinstance(part, Message)]


def payload(part: Message) -> bytes:
    data = part.get_payload(decode=True)
    assert isinstance(data, bytes)
    return data


def test_the_measured_error_comes_with_the_stated_one(call: Caller, array: bytes) -> None:
    target = f"{BLUR}?sigma=2&method=fir&tail=0.001&format=npy"
    plain, verified = call("POST", target, array), call("POST", f"{target}&verify=true", array)
    assert "Lichen-Measured" not in plain.headers
    assert bytes(plain.body) == bytes(verified.body)
    assert plain.headers["Lichen-Error"] == verified.headers["Lichen-Error"]
    found = re.fullmatch(
        r"(\S+); measured; max; sampled=1; p999=(\S+); rms=(\S+); mismatched=0", verified.headers["Lichen-Measured"]
    )
    assert found
    largest, p999, rms = map(float, found.groups())
    expected = engine.run("gaussian", decode(array), sigma=2, method="fir", tail=1e-3, verify=True).measured
    assert expected is not None
    assert expected.largest <= largest <= 1.01 * expected.largest
    assert rms < p999 <= largest <= float(verified.headers["Lichen-Error"].split(";")[0])
    assert "verify;dur=" in verified.headers["Server-Timing"]


def test_an_entity_tag_does_not_take_the_measurement_away(call: Caller, array: bytes) -> None:
    target = f"{BLUR}?sigma=2&format=npy"
    tag = call("POST", target, array).headers["ETag"]
    assert call("POST", target, array, {"if-none-match": tag}).status == 304
    verified = call("POST", f"{target}&verify=true", array, {"if-none-match": tag})
    assert verified.status == 200
    assert "Lichen-Measured" in verified.headers


def test_what_a_viewer_sees_of_the_error_is_told_of_pictures(call: Caller, png: bytes, array: bytes) -> None:
    """And how many codes it is, of integers: a kernel cut at half of its weight shows both."""
    target = f"{BLUR}?sigma=2&method=fir&tail=0.5&verify=true"
    told = dict(part.partition("=")[::2] for part in call("POST", target, png).headers["Lichen-Measured"].split("; "))
    truth = engine.evaluate_truth("gaussian", decode(png), sigma=2)
    made = engine.run("gaussian", decode(png), sigma=2, method="fir", tail=0.5).image
    assert int(told["codes"]) == metrics.steps(made.pixels, truth, Storage.UINT8).largest > 1
    assert float(told["ciede2000"]) == pytest.approx(colour.ciede2000(made, truth).largest, rel=0.01)
    numbers = call("POST", f"{target}&format=npy", array).headers["Lichen-Measured"]
    assert "codes" not in numbers


def test_what_cannot_be_measured_is_no_problem(call: Caller, array: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verification, "SECONDS", 0.0)
    response = call("POST", f"{BLUR}?sigma=2&verify=true", array, {"accept": "multipart/mixed"})
    assert response.status == 200
    assert re.fullmatch(r'none; reason="truth would take about .*"', response.headers["Lichen-Measured"])
    assert len(parts_of(response)) == 1


@pytest.mark.parametrize(
    "accept", ["multipart/mixed", "image/png, multipart/mixed", "multipart/mixed, image/png;q=0.5"]
)
def test_a_map_of_the_error_is_the_second_part(call: Caller, png: bytes, accept: str) -> None:
    target = f"{BLUR}?sigma=2&verify=true&method=fir&tail=0.01"
    response = call("POST", target, png, {"accept": accept})
    assert response.headers["Content-Digest"] == content_digest(response.body)
    image, errors = parts_of(response)
    assert payload(image) == bytes(call("POST", f"{target}&format=png", png).body)
    assert errors.get_content_type() == "image/png"
    scale = dict(part.split("=") for part in str(errors["Lichen-Map"]).split("; ")[1:])
    assert float(scale["high"]) == pytest.approx(1e4 * float(scale["low"]), rel=0.01)
    shown = decode(payload(errors))
    assert shown.pixels.shape == (12, 16, 4)
    assert shown.alpha is Alpha.STRAIGHT
    assert (shown.pixels[..., 3] == 1).all()
    truth = engine.evaluate_truth("gaussian", decode(png), sigma=2)
    made = engine.run("gaussian", decode(png), sigma=2, method="fir", tail=1e-2).image.pixels
    brightest = np.unravel_index(np.argmax(shown.pixels[..., :3].sum(axis=2)), (12, 16))
    apart = np.abs(made - truth).max(axis=2)
    assert apart[brightest] > 0.9 * apart.max()


def test_who_takes_numbers_gets_the_map_in_numbers(call: Caller, array: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=2&verify=true&format=npy", array, {"accept": "multipart/mixed"})
    _, errors = parts_of(response)
    measured = float(response.headers["Lichen-Measured"].split(";")[0])
    assert decode(payload(errors)).pixels.shape == (24, 31, 1)
    assert decode(payload(errors)).pixels.max() == pytest.approx(measured, rel=0.01)


@pytest.mark.parametrize("accept", ["*/*", "multipart/*", "image/png", "image/png, multipart/mixed;q=0.5"])
def test_who_does_not_ask_gets_no_parts(call: Caller, png: bytes, accept: str) -> None:
    response = call("POST", f"{BLUR}?sigma=2&verify=true", png, {"accept": accept})
    if accept == "multipart/*":
        problem_of(response, 406, "not-acceptable")
    else:
        assert response.headers["Content-Type"] == "image/png"
    without = call("POST", f"{BLUR}?sigma=2", png, {"accept": "multipart/mixed"})
    problem_of(without, 406, "not-acceptable")


def test_maps_show_what_was_not_looked_at_as_nothing() -> None:
    errors = np.float32([[0, 1e-3, np.nan]])
    encoded, scale = mixed.error_map(errors, "png")
    shown = decode(encoded.data).pixels
    assert shown[0, :, 3].tolist() == [1, 1, 0]
    assert shown[0, 0, :3].sum() < 0.5 < 2 < shown[0, 1, :3].sum()
    assert scale == "log10; low=1e-07; high=0.001; untaken=transparent"
    assert decode(mixed.error_map(np.zeros((2, 2), np.float32), "png")[0].data).pixels[..., 3].all()


def test_parts_survive_bodies_that_look_like_boundaries() -> None:
    bodies = [b"--x\r\n\r\n", b"\r\n--", bytes(range(256))]
    kind, body = mixed.join([({"Content-Type": "application/octet-stream"}, each) for each in bodies])
    assert [payload(part) for part in parts_of(Response(200, body, {"Content-Type": kind}))] == bodies


def test_precision_is_asked_for_and_told(call: Caller, array: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=2&precision=fixed8&format=npy&verify=true", array)
    assert response.headers["Lichen-Precision"] == "fixed8"
    pixels = decode(response.body).pixels
    np.testing.assert_allclose(pixels * 255, np.rint(pixels * 255), atol=1e-4)
    assert float(response.headers["Lichen-Error"].split(";")[0]) == pytest.approx(1 / 255, rel=0.02)
    assert 1e-3 < float(response.headers["Lichen-Measured"].split(";")[0]) < 1 / 255
    assert "Lichen-Precision" not in call("POST", f"{BLUR}?sigma=2", array).headers
    plan = read_json(call("POST", f"{BLUR}?sigma=2&precision=fixed8&explain=true", array))
    assert plan["precision"] == "fixed8"
    problem = problem_of(call("POST", f"{BLUR}?sigma=2&precision=fixed9", array), 422, "invalid-request")
    assert problem["errors"][0]["pointer"] == "/query/precision"
    doubles = call("POST", f"{BLUR}?sigma=2&precision=float64&format=npy&storage=float64", array)
    assert doubles.headers["Lichen-Method"] == "truth"
    truth = engine.evaluate_truth("gaussian", decode(array), sigma=2)
    assert np.abs(decode(doubles.body).pixels - truth).max() < 1e-12
