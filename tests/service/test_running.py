"""Running an operation through the routes: pixels in, pixels out, and the account of how they were made."""

from __future__ import annotations

import gzip
import io
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from PIL import Image as pillow
from PIL import ImageSequence

from lichen import engine
from lichen.errors import DeviceFailure
from lichen.files import FORMATS, decode, encode, probe
from lichen.image import Alpha, Image, Space, Storage
from lichen_service.documents import content_digest

from .conftest import Caller, form, picture, pointers, problem_of, read_json

BLUR = "/v1/operations/gaussian"


def npy(pixels: np.ndarray[Any, Any]) -> bytes:
    return bytes(encode(Image(np.ascontiguousarray(pixels)), "npy").data)


# ---------------------------------------------------------------------------------------------------- the result


@pytest.mark.parametrize("method", ["POST", "QUERY"])
def test_a_result_is_what_the_library_makes(call: Caller, png: bytes, method: str) -> None:
    response = call(method, f"{BLUR}?sigma=2&method=fir&device=numpy", png)
    assert response.status == 200
    assert response.headers["Content-Type"] == "image/png"
    expected = engine.run("gaussian", decode(png), sigma=2.0, method="fir", device="numpy", storage="uint8")
    assert bytes(response.body) == bytes(encode(expected.image, "png").data)


def test_every_result_carries_its_account(call: Caller, png: bytes) -> None:
    headers = call("POST", f"{BLUR}?sigma=2&method=fir", png).headers
    assert re.fullmatch(r"fir; tail=\S+", headers["Lichen-Method"])
    assert headers["Lichen-Device"] in ("opencl", "numpy")
    value, kind, metric = headers["Lichen-Error"].split("; ")
    assert 0 < float(value) < 1e-2
    assert (kind, metric) == ("bound", "max") or (kind, metric) == ("estimate", "max")
    assert headers["Lichen-Nonfinite"] == "0"
    assert headers["Lichen-Space"] == "srgb; alpha=none; storage=uint8"
    assert headers["Lichen-Clipped"] == "0"
    assert headers["Vary"] == "Accept"
    assert re.fullmatch(r'"[0-9a-f]{32}"', headers["ETag"])
    stages = dict(entry.split(";dur=") for entry in headers["Server-Timing"].split(", "))
    assert {"queue", "decode", "plan", "kernel", "encode", "total"} <= set(stages)
    assert all(float(milliseconds) >= 0 for milliseconds in stages.values())


def test_the_digest_is_that_of_the_body(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=1", png)
    assert response.headers["Content-Digest"] == content_digest(response.body)


def test_dropped_work_is_named(call: Caller, png: bytes) -> None:
    headers = call("POST", f"{BLUR}?sigma=0", png).headers
    assert headers["Lichen-Method"] == "identity"
    assert headers["Lichen-Skipped"].startswith('identity;node="gaussian";reason="')
    assert "Lichen-Skipped" not in call("POST", f"{BLUR}?sigma=0&prune=false", png).headers


def test_the_log_line_knows_what_ran(call: Caller, png: bytes) -> None:
    log = call("POST", f"{BLUR}?sigma=2&method=fir&device=numpy", png).log
    assert (log["operation"], log["pixels"], log["device"]) == ("gaussian", 12 * 16, "numpy")


def test_numpy_serves_where_there_is_no_opencl(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=3&device=numpy", png)
    assert response.headers["Lichen-Device"] == "numpy"
    assert decode(response.body).pixels.shape == (12, 16, 3)


def test_nonfinite_values_are_counted_and_policed(call: Caller) -> None:
    pixels = np.full((9, 9, 1), 0.5, np.float32)
    pixels[4, 4] = np.nan
    kept = call("POST", f"{BLUR}?sigma=0.5&method=fir", npy(pixels))
    counted = int(kept.headers["Lichen-Nonfinite"])
    assert counted == np.count_nonzero(~np.isfinite(decode(kept.body).pixels)) >= 1
    problem = problem_of(call("POST", f"{BLUR}?sigma=1&nonfinite=reject", npy(pixels)), 422, "nonfinite-input")
    assert pointers(problem) == {"/inputs/image"}
    assert (problem["limit"], problem["actual"]) == (0, 1)
    repaired = call("POST", f"{BLUR}?sigma=1&nonfinite=repair", npy(pixels))
    assert repaired.headers["Lichen-Nonfinite"] == "0"


def test_samples_beyond_an_integer_are_counted(call: Caller) -> None:
    pixels = np.full((4, 5, 1), 2.0, np.float32)
    headers = call("POST", f"{BLUR}?sigma=1&format=png", npy(pixels)).headers
    assert headers["Lichen-Clipped"] == "20"


# ------------------------------------------------------------------------------------------------------- formats


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_every_format_comes_back_as_itself(call: Caller, name: str) -> None:
    image = (
        picture()
        if FORMATS[name].natural_space(Storage.UINT8) is not Space.LINEAR
        else picture().replace(space=Space.LINEAR, storage=Storage.FLOAT32)
    )
    response = call("POST", f"{BLUR}?sigma=1", bytes(encode(image, name).data))
    assert response.headers["Content-Type"] == FORMATS[name].media_type
    header = probe(response.body)
    assert (header.format, header.width, header.height, header.channels) == (name, 16, 12, 3)


def test_an_animation_is_one_request(call: Caller) -> None:
    y, x = np.mgrid[:10, :12].astype(np.float32)
    field = np.stack([4.5 - y, x - 5.5], axis=-1)
    query = "frames=24&length=4&kernel=ripple&method=euler&device=numpy"
    response = call("POST", f"/v1/operations/lic?{query}", npy(field), {"accept": "image/webp"})
    assert response.headers["Content-Type"] == "image/webp"
    with pillow.open(io.BytesIO(response.body)) as file:
        assert (getattr(file, "n_frames", 1), file.size) == (24, (12, 10))
        assert len({frame.tobytes() for frame in ImageSequence.Iterator(file)}) == 24


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        ("*/*", "image/png"),
        ("image/*", "image/png"),
        ("image/jpeg", "image/jpeg"),
        ("image/x-exr;q=0.9, image/webp;q=0.8", "image/x-exr"),
        ("application/x-npy, image/*;q=0.5", "application/x-npy"),
        ("image/png;q=0, image/tiff;q=0.1", "image/tiff"),
    ],
)
def test_accept_chooses_the_format(call: Caller, png: bytes, accept: str, media_type: str) -> None:
    response = call("POST", f"{BLUR}?sigma=1", png, {"accept": accept})
    assert response.headers["Content-Type"] == media_type


def test_format_overrides_accept(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=1&format=tiff&storage=uint16", png, {"accept": "image/png"})
    assert probe(response.body).format == "tiff"
    assert probe(response.body).storage is Storage.UINT16


def test_nothing_acceptable_is_a_406_that_lists_what_exists(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=1", png, {"accept": "text/html"})
    problem = problem_of(response, 406, "not-acceptable")
    assert "image/png" in problem["detail"]
    assert response.headers["Vary"] == "Accept"


def test_a_format_that_cannot_hold_the_result_says_why(call: Caller) -> None:
    field = npy(np.zeros((4, 5, 6), np.float32))
    problem = problem_of(call("POST", f"{BLUR}?sigma=1&format=png", field), 422, "invalid-request")
    assert pointers(problem) == {"/query/format"}
    assert "6 channels" in problem["errors"][0]["detail"]
    refused = problem_of(call("POST", f"{BLUR}?sigma=1", field, {"accept": "image/png"}), 406, "not-acceptable")
    assert "6 channels" in refused["detail"]
    assert "image/png" not in refused["detail"].partition(".")[0]


def test_a_storage_the_format_lacks_is_refused(call: Caller, png: bytes) -> None:
    problem = problem_of(call("POST", f"{BLUR}?sigma=1&format=jpeg&storage=float32", png), 422, "invalid-request")
    assert pointers(problem) == {"/query/storage"}
    free = call("POST", f"{BLUR}?sigma=1&storage=float32", png)
    assert probe(free.body).storage is Storage.FLOAT32


def test_the_result_is_in_the_light_natural_to_its_format(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=0&format=exr&storage=float32&device=numpy", png)
    stored = decode(png).pixels.astype(np.float64)
    linear = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    assert response.headers["Lichen-Space"].startswith("linear")
    np.testing.assert_allclose(decode(response.body).pixels, linear, atol=2e-6)
    kept = call("POST", f"{BLUR}?sigma=0&format=npy&storage=float32", png)
    np.testing.assert_array_equal(decode(kept.body).pixels, decode(png).pixels)


def test_coverage_is_what_the_format_holds(call: Caller) -> None:
    straight = bytes(encode(picture(channels=4), "png").data)
    same = call("POST", f"{BLUR}?sigma=1", straight)
    assert (probe(same.body).format, decode(same.body).alpha) == ("png", Alpha.STRAIGHT)
    assert decode(call("POST", f"{BLUR}?sigma=1&format=exr", straight).body).alpha is Alpha.ASSOCIATED
    refused = problem_of(call("POST", f"{BLUR}?sigma=1&format=exr&alpha=straight", straight), 422, "invalid-request")
    assert pointers(refused) == {"/query/alpha"}


# ---------------------------------------------------------------------------------------------------- entity tags


def test_a_result_is_not_computed_twice(call: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    first = call("POST", f"{BLUR}?sigma=2", png)
    tag = first.headers["ETag"]

    def refuse(*arguments: object, **options: object) -> None:
        raise AssertionError("the operation ran")

    monkeypatch.setattr("lichen.engine.Prepared.run", refuse)
    again = call("POST", f"{BLUR}?sigma=2.0", png, {"if-none-match": f'W/"x", {tag}'})
    assert (again.status, again.body, again.headers["ETag"]) == (304, b"", tag)


def test_who_insists_on_other_bytes_gets_none(call: Caller, png: bytes) -> None:
    tag = call("POST", f"{BLUR}?sigma=2", png).headers["ETag"]
    assert call("POST", f"{BLUR}?sigma=2", png, {"if-match": tag}).status == 200
    problem_of(call("POST", f"{BLUR}?sigma=3", png, {"if-match": tag}), 412, "precondition-failed")


def test_the_seed_is_named(call: Caller, png: bytes) -> None:
    noise = "/v1/operations/white_noise?width=8&height=8&format=npy"
    seed = call("GET", noise).headers["Lichen-Seed"]
    assert bytes(call("GET", f"{noise}&seed={seed}").body) == bytes(call("GET", noise).body)
    assert call("GET", f"{noise}&seed=7").headers["Lichen-Seed"] == "7"
    assert "Lichen-Seed" not in call("POST", f"{BLUR}?sigma=2", png).headers


def test_whatever_decides_the_bytes_changes_the_tag(call: Caller, png: bytes) -> None:
    other = bytes(encode(picture(13, 16), "png").data)
    requests = [
        (f"{BLUR}?sigma=2", png),
        (f"{BLUR}?sigma=2.1", png),
        (f"{BLUR}?sigma=2&border=wrap", png),
        (f"{BLUR}?sigma=2&method=fir&tail=0.001", png),
        (f"{BLUR}?sigma=2&method=fir&tail=0.0001", png),
        (f"{BLUR}?sigma=2&format=npy", png),
        (f"{BLUR}?sigma=2&format=npy&storage=float16", png),
        (f"{BLUR}?sigma=2", other),
    ]
    tags = [call("POST", target, body).headers["ETag"] for target, body in requests]
    assert len(set(tags)) == len(tags)
    assert call("POST", *requests[0]).headers["ETag"] == tags[0]


def test_the_same_request_gives_the_same_bytes(call: Caller, png: bytes) -> None:
    bodies = {bytes(call("POST", f"{BLUR}?sigma=2.5", png).body) for _ in range(3)}
    assert len(bodies) == 1


# ---------------------------------------------------------------------------------------------------------- plans


def test_a_plan_is_explained_without_computing(call: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lichen.engine.Prepared.run", None)
    response = call("POST", f"{BLUR}?sigma=2&explain=true", png)
    plan = read_json(response)
    assert response.status == 200
    assert response.headers["Cache-Control"] == "no-store"
    assert plan["format"] == "png"
    assert "gaussian" in [node["operation"] for node in plan["nodes"]]
    assert plan["error"]["kind"] in ("bound", "estimate")
    assert plan["digest"]


# -------------------------------------------------------------------------------------------------- what is refused


def test_every_flaw_is_named_at_once(call: Caller) -> None:
    target = f"{BLUR}?sigma=-1&border=mirror&sgima=2&method=firr&max_error=x&nonfinite=maybe&tail=7&tail=8&format=gif"
    problem = problem_of(call("POST", target, b""), 422, "invalid-request")
    assert pointers(problem) == {
        "/parameters/sigma",
        "/parameters/border",
        "/parameters/tail",
        "/query/sgima",
        "/query/method",
        "/query/max_error",
        "/query/nonfinite",
        "/query/format",
        "/inputs/image",
    }
    details = {each["detail"] for each in problem["errors"] if each["pointer"] == "/query/sgima"}
    assert "sigma" in details.pop()


def test_a_bad_image_is_named_beside_bad_parameters(call: Caller, png: bytes) -> None:
    problem = problem_of(call("POST", f"{BLUR}?sigma=-1", b"not an image"), 422, "invalid-request")
    assert pointers(problem) == {"/parameters/sigma", "/inputs/image"}


def test_a_parameter_may_be_given_once(call: Caller, png: bytes) -> None:
    problem = problem_of(call("POST", f"{BLUR}?sigma=1&sigma=1", png), 422, "invalid-request")
    assert problem["errors"] == [{"pointer": "/parameters/sigma", "detail": "is given more than once"}]


def test_what_cannot_be_met_says_what_can(call: Caller, png: bytes) -> None:
    problem = problem_of(call("POST", f"{BLUR}?sigma=2&max_error=1e-30", png), 422, "unattainable")
    assert problem["actual"] == 1e-30
    assert problem["limit"] > 0
    assert pointers(problem) == {"/query/max_error"}


def test_a_knob_of_another_method_is_refused(call: Caller, png: bytes, operations: Mapping[str, Any]) -> None:
    knobless = [name for name, each in operations["gaussian"].methods.items() if each.knob is None]
    other = [n for n, m in operations["gaussian"].methods.items() if m.knob and m.knob.name != "tail"]
    for method in (*knobless, *other):
        problem = problem_of(call("POST", f"{BLUR}?sigma=2&method={method}&tail=0.001", png), 422, "invalid-request")
        assert pointers(problem) <= {"/parameters/tail", "/query/method"}


@pytest.mark.parametrize("cut", [1, 8, 20, 40, 60, -20, -1])
def test_a_cut_image_is_unreadable(call: Caller, png: bytes, cut: int) -> None:
    problem = (
        problem_of(call("POST", f"{BLUR}?sigma=1", png[:cut]), 422, "unreadable-image")
        if cut > 8 or cut < 0
        else (read_json(call("POST", f"{BLUR}?sigma=1", png[:cut])))
    )
    assert pointers(problem) == {"/inputs/image"}


def test_an_image_over_the_limits_is_refused_by_its_header(call: Caller) -> None:
    header = bytearray(encode(picture(), "png").data)
    header[16:24] = (60000).to_bytes(4, "big") * 2
    response = call("POST", f"{BLUR}?sigma=1", bytes(header))
    assert response.status in (413, 422)  # 422 where the header's checksum is looked at first
    huge = (
        b"\x93NUMPY\x01\x00v\x00"
        + b"{'descr': '<f4', 'fortran_order': False, 'shape': (100000, 100000, 3), }".ljust(117)
        + b"\n"
    )
    problem = problem_of(call("POST", f"{BLUR}?sigma=1", huge), 413, "too-large")
    assert problem["actual"] > problem["limit"]
    assert all(pointer.startswith("/inputs/image/") for pointer in pointers(problem))


def test_a_body_over_the_limit_is_refused_unread(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=1", png, {"content-length": str(1 << 40)})
    problem = problem_of(response, 413, "too-large")
    assert (problem["limit"], problem["actual"]) == (call.settings.max_body, 1 << 40)
    assert call.admitted == [False]


@pytest.mark.parametrize(
    "media_type", ["", "application/octet-stream", "application/x-www-form-urlencoded", "image/png"]
)
def test_types_that_say_nothing_leave_it_to_the_bytes(call: Caller, png: bytes, media_type: str) -> None:
    assert call("POST", f"{BLUR}?sigma=1", png, {"content-type": media_type}).status == 200


def test_a_type_nobody_reads_is_refused_unread(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=1", png, {"content-type": "application/json"})
    problem_of(response, 415, "unsupported-format")
    assert "image/png" in response.headers["Accept"]
    assert call.admitted == [False]


def test_a_compressed_body_is_refused_unread(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=1", gzip.compress(png), {"content-encoding": "gzip"})
    problem_of(response, 415, "unsupported-encoding")
    assert response.headers["Accept-Encoding"] == "identity"
    assert call.admitted == [False]
    assert call("POST", f"{BLUR}?sigma=1", png, {"content-encoding": "identity"}).status == 200


def test_a_type_that_is_not_that_of_the_bytes_is_refused(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=1", png, {"content-type": "image/jpeg"})
    assert response.status in (415, 422)
    assert pointers(read_json(response)) == {"/inputs/image"}


def test_bytes_of_no_format_are_refused(call: Caller) -> None:
    response = call("POST", f"{BLUR}?sigma=1", b"GIF89a" + bytes(100))
    assert response.status in (415, 422)
    assert pointers(read_json(response)) == {"/inputs/image"}


def test_a_late_request_is_not_begun(call: Caller, png: bytes) -> None:
    response = call("POST", f"{BLUR}?sigma=1", png, seconds=-1.0)
    assert problem_of(response, 504, "deadline-exceeded")["retryable"] is True


def test_a_failing_device_is_a_503_without_its_log(call: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise DeviceFailure("the kernel rows did not build\n/home/someone/cache: error")

    monkeypatch.setattr("lichen.engine.Prepared.run", fail)
    response = call("POST", f"{BLUR}?sigma=2", png)
    problem = problem_of(response, 503, "device-failure")
    assert problem["retryable"] is True
    assert "Retry-After" in response.headers
    assert "someone" not in bytes(response.body).decode()


def test_a_defect_is_a_500_that_says_nothing(call: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object, **options: object) -> None:
        raise ZeroDivisionError("a secret of the inside")

    monkeypatch.setattr("lichen.engine.Prepared.run", fail)
    response = call("POST", f"{BLUR}?sigma=2", png)
    problem_of(response, 500, "internal-error")
    assert "secret" not in bytes(response.body).decode()


# ----------------------------------------------------------------------------------------------------------- forms


def test_a_form_of_one_image_is_that_image(call: Caller, png: bytes) -> None:
    body, headers = form({"image": (png, "image/png")})
    assert bytes(call("POST", f"{BLUR}?sigma=2", body, headers).body) == bytes(
        call("POST", f"{BLUR}?sigma=2", png).body
    )


def test_a_form_of_two_images_gives_each_to_its_input(call: Caller, operations: Mapping[str, Any]) -> None:
    names = [each.name for each in operations["lic"].inputs]
    y, x = np.mgrid[0:16, 0:16].astype(np.float32) - 7.4
    field, texture = np.stack([-y, x], axis=2), picture(16, 16)
    parts = {names[0]: npy(field), names[1]: (bytes(encode(texture, "png").data), "image/png")}
    target = "/v1/operations/lic?length=4&device=numpy&format=npy&storage=float32"
    response = call("POST", target, *form(parts))
    asked = {"length": 4, "device": "numpy", "storage": "float32"}
    expected = engine.run("lic", Image(field), **asked, **{names[1]: decode(parts[names[1]][0])})
    np.testing.assert_array_equal(decode(response.body).pixels, expected.image.pixels)
    # A part called `image` is the first input, whatever that is called.
    renamed = {"image": parts[names[0]], names[1]: parts[names[1]]}
    assert bytes(call("POST", target, *form(renamed)).body) == bytes(response.body)
    broken = {names[0]: b"no image", names[1]: parts[names[1]][0][:40]}
    problem = read_json(call("POST", target, *form(broken)))
    assert pointers(problem) == {f"/inputs/{names[0]}", f"/inputs/{names[1]}"}


def test_a_form_may_come_in_any_kind_of_buffer(call: Caller, png: bytes) -> None:
    body, headers = form({"image": png})
    for kind in (bytes, bytearray, memoryview):
        assert call("POST", f"{BLUR}?sigma=2", kind(body), headers).status == 200


def test_unknown_and_repeated_parts_are_named(call: Caller, png: bytes) -> None:
    body, headers = form({"imgae": png, "sigma": b"2"})
    problem = problem_of(call("POST", f"{BLUR}?sigma=2", body, headers), 422, "invalid-request")
    assert pointers(problem) == {"/inputs/imgae", "/inputs/sigma", "/inputs/image"}
    twice = body.replace(b'name="imgae"', b'name="image"').replace(b'name="sigma"', b'name="image"')
    problem = problem_of(call("POST", f"{BLUR}?sigma=2", twice, headers), 422, "invalid-request")
    assert {"pointer": "/inputs/image", "detail": "is given more than once"} in problem["errors"]


def test_a_part_of_a_type_nobody_reads_is_refused(call: Caller, png: bytes) -> None:
    body, headers = form({"image": (png, "text/html")})
    response = call("POST", f"{BLUR}?sigma=2", body, headers)
    assert pointers(problem_of(response, 415, "unsupported-format")) == {"/inputs/image"}


@pytest.mark.parametrize(
    ("spoil", "status"),
    [
        (lambda body: body[:-4], 400),
        (lambda body: b"", 400),
        (lambda body: b"preamble" * 20 + body, 400),
        (lambda body: body.replace(b"form-data", b"file"), 400),
        (lambda body: body.replace(b'; name="image"', b""), 400),
        (lambda body: body.replace(b"Content-Type", b"X: " + b"y" * 5000 + b"\r\nContent-Type"), 413),
    ],
)
def test_a_broken_form_is_refused(call: Caller, png: bytes, spoil: Any, status: int) -> None:
    body, headers = form({"image": png})
    response = call("POST", f"{BLUR}?sigma=2", spoil(body), headers)
    problem_of(response, status, "malformed-form" if status == 400 else "too-large")


@pytest.mark.parametrize("content_type", ["multipart/form-data", f"multipart/form-data; boundary={'b' * 71}"])
def test_a_form_needs_a_good_boundary(call: Caller, png: bytes, content_type: str) -> None:
    body, _ = form({"image": png})
    problem_of(call("POST", f"{BLUR}?sigma=2", body, {"content-type": content_type}), 400, "malformed-form")


def test_a_form_of_too_many_parts_is_refused(call: Caller, png: bytes) -> None:
    body, headers = form({f"image{n}": b"x" for n in range(call.settings.max_images + 1)})
    problem = problem_of(call("POST", f"{BLUR}?sigma=2", body, headers), 413, "too-large")
    assert problem["limit"] == call.settings.max_images


def test_findings_come_alone_as_json_or_as_a_table(call: Caller) -> None:
    y, x = np.mgrid[:24, :24] - 11.5
    field = npy(np.stack([-y, x], axis=-1).astype(np.float32))
    run = "/v1/operations/streamlines?spacing=6&length=20&device=numpy"
    found = read_json(call("POST", f"{run}&findings=json&format=png", field))
    answer = call("POST", f"{run}&findings=npy", field)
    assert answer.headers["Content-Type"] == "application/x-npy"
    table = np.load(io.BytesIO(bytes(answer.body)))
    assert table[:, 1:].tolist() == [point for line in found["lines"] for point in line["points"]]
    assert answer.headers["ETag"] != call("POST", run, field).headers["ETag"]
    for operation in ("lic", "compare"):
        path = f"/v1/operations/{operation}?findings=npy"
        assert "/query/findings" in pointers(problem_of(call("POST", path, field), 422, "invalid-request"))
    path = "/v1/pipelines?pipeline=streamlines&findings=npy"
    assert pointers(problem_of(call("POST", path, field), 422, "invalid-request")) == {"/query/findings"}
