"""What the Python client offers beside sending and receiving: methods, local work, jobs, stored images, notebooks."""

from __future__ import annotations

import asyncio
import inspect
import io
import json
import re
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from PIL import Image as Pillow

import lichen
from lichen.catalogue import operations
from lichen.files import encode
from lichen.image import Image, Space, Storage
from lichen_client import (
    Asset,
    AsyncClient,
    Client,
    ConnectionFailed,
    Dismissed,
    NotFound,
    Pipeline,
    Results,
    Retries,
    Scene,
    TimedOut,
    Unprocessable,
)
from lichen_client.preview import png_of

NPY = ("Content-Type", "application/x-npy")


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


@pytest.fixture
def image() -> np.ndarray:
    return np.random.default_rng(11).random((21, 34, 3), np.float32)


# --------------------------------------------------------------------------------------------------------- the methods


def test_the_methods_are_those_of_the_catalogue(root: Path) -> None:
    made = runpy.run_path(str(root / "clients/python/make.py"))["text"]()
    assert (root / "clients/python/lichen_client/operations.py").read_text() == made, "run `make client`"


@pytest.mark.parametrize("kind", [Client, AsyncClient])
def test_every_operation_is_a_method_with_its_parameters(kind: type) -> None:
    for name, operation in operations().items():
        method = getattr(kind, name)
        given = inspect.signature(method).parameters
        wanted = {*operation.parameters.model_fields, *operation.knobs, *(each.name for each in operation.inputs[1:])}
        assert wanted <= given.keys(), name
        assert method.__doc__.startswith(operation.summary.strip()[:20])


def test_a_method_sends_what_it_was_given_and_nothing_else(server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], body=npy(np.zeros((1, 1))))]
    with Client(server.url) as client:
        client.gaussian(b"x", sigma=5, max_error=1e-4)
        client.lic(b"x", texture=b"y", length=3.0)
    first, second = server.received
    query = parse_qs(urlsplit(first.target).query)
    assert query == {"sigma": ["5"], "max_error": ["0.0001"], "format": ["npy"]}
    assert b'name="texture"' in second.body


# -------------------------------------------------------------------------------------------------------- this process


@pytest.fixture(scope="module")
def local() -> Iterator[Client]:
    with Client(local=True) as client:
        yield client


def test_the_engine_here_answers_as_the_library_does(local: Client, image: np.ndarray) -> None:
    result = local.gaussian(image, sigma=2.5, method="fir", device="numpy")
    expected = lichen.run("gaussian", image, sigma=2.5, method="fir", device="numpy")
    np.testing.assert_array_equal(result.array, expected.image.pixels)
    assert result.report.method == expected.method
    assert result.explain()["nodes"][0]["operation"] == "gaussian"
    with pytest.raises(Unprocessable) as raised:
        local.gaussian(image, sigma=-1)
    assert [flaw.pointer for flaw in raised.value.errors] == ["/parameters/sigma"]
    with pytest.raises(NotFound, match="gaussian"):
        local.run("gausian", image)


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float16", "float32", "float64"])
def test_an_array_comes_back_in_the_type_it_was_sent_in(local: Client, kind: str) -> None:
    image = (np.arange(60).reshape(4, 5, 3) * (np.iinfo(kind).max // 60 if kind[0] == "u" else 1 / 60)).astype(kind)
    made = local.saturation(image, amount=1.0, device="numpy").array
    assert made.dtype == image.dtype
    np.testing.assert_array_equal(made, image)


def test_findings_and_maps_come_beside_pixels(local: Client, image: np.ndarray) -> None:
    assert local.find("statistics", image)["channels"]
    result = local.statistics(image)
    assert result.findings["channels"]
    verified = local.gaussian(image, sigma=2, verify=True, device="numpy")
    assert verified.report.measured is not None
    assert verified.map is not None
    assert verified.map.array.shape[:2] == image.shape[:2]


def test_pipelines_and_stored_images_work_here_too(local: Client, image: np.ndarray) -> None:
    kept = local.store(encode(Image(image, Space.SRGB, storage=Storage.UINT8), "png").data)
    assert (kept.width, kept.height, kept.channels) == (34, 21, 3)
    p = Pipeline()
    p.output("soft", p.add("gaussian", p.input(), sigma=2), format="png")
    p.output("hard", p.add("levels", p.input(), gamma=2.0))
    results = local.run_pipeline(p, kept)
    assert (results["soft"].media_type, results["hard"].array.shape) == ("image/png", (21, 34, 3))
    html = results._repr_html_()
    assert html.count("<img") == 2
    assert (results["soft"]._repr_png_() or b"").startswith(b"\x89PNG")
    assert (p._repr_html_() or "").count("<rect ") == 5, "a picture read, two operations, two outputs"
    p.add("median", p.input())  # which comes too late for the plan
    plan = results.explain()
    assert {each["operation"] for each in plan["nodes"]} == {"gaussian", "levels", "transfer"}
    assert {name: each["format"] for name, each in plan["outputs"].items()} == {"soft": "png", "hard": "npy"}
    assert results["hard"].explain()["outputs"] == plan["outputs"]
    again = local.lic(np.ones((21, 34, 2), np.float32), texture=kept, length=2.0)
    assert again.array.shape[:2] == (21, 34)


SCENE = {
    "camera": {"eye": [0, 1.5, 4], "target": [0, 0.6, 0], "width": 24, "height": 18},
    "objects": [{"shape": "plane"}, {"shape": "sphere", "centre": [0, 0.8, 0], "radius": 0.8}],
    "lights": [{"kind": "point", "position": [3, 5, 2], "intensity": 30}],
}


def test_a_scene_is_rendered_and_explained(local: Client) -> None:
    picture = local.render(SCENE, device="numpy", format="png")
    assert Pillow.open(io.BytesIO(picture.content)).size == (24, 18)
    assert picture.explain()["nodes"] == local.explain_scene(SCENE, device="numpy", format="png")["nodes"]
    with pytest.raises(Unprocessable, match="mist"):
        local.render({**SCENE, "mist": 1})


def test_a_scene_is_built_with_the_pictures_it_reads(local: Client) -> None:
    sky = np.full((4, 8, 3), 0.5, np.float32)
    scene = Scene(width=24, height=16, eye=(0, 1.5, 4), target=(0, 0.5, 0)).camera(fov=40)
    scene.add("plane").add("sphere", centre=np.array([0, 0.7, 0]), radius=0.7, albedo=None)
    scene.light("point", position=(3, 5, 2), intensity=30, shadow={"size": 32}).light("directional", intensity=0.2)
    scene.environment(sky, reflectance=0.2).fog(density=0.02).ambient(0.1, 0.1, 0.1).background(0.2, 0.3, 0.4)
    scene.surface("lambert").output("picture")
    said = {
        "camera": {"width": 24, "height": 16, "eye": [0, 1.5, 4], "target": [0, 0.5, 0], "fov": 40},
        "objects": [{"shape": "plane"}, {"shape": "sphere", "centre": [0, 0.7, 0], "radius": 0.7}],
        "lights": [
            {"kind": "point", "position": [3, 5, 2], "intensity": 30, "shadow": {"size": 32}},
            {"kind": "directional", "intensity": 0.2},
        ],
        "environment": {"image": "environment", "reflectance": 0.2},
        "fog": {"density": 0.02},
        "ambient": [0.1, 0.1, 0.1],
        "background": [0.2, 0.3, 0.4],
        "surface": {"model": "lambert"},
        "output": "picture",
    }
    assert json.loads(json.dumps(scene.to_json())) == said
    made = local.render(scene, device="numpy")
    np.testing.assert_array_equal(made.array, local.render(said, images={"environment": sky}, device="numpy").array)
    assert "fog" in {each["name"] for each in local.explain_scene(scene)["nodes"]}
    assert "light 1" in str(scene)
    assert "environment" in scene._repr_html_()
    lit = Scene().buffers(depth=np.ones((4, 4, 1), np.float32), normal="sent").light(shadow={"map": sky[..., :1]})
    assert lit.document["buffers"] == {"depth": "depth", "normal": "sent"}
    assert set(lit.images) == {"depth", "shadow0"}
    with pytest.raises(TypeError, match="depth is a picture"):
        Scene().buffers(depth=3)


def drawn(png: bytes | None) -> dict[tuple[int, int], str]:
    """The boxes of a drawing by column and row: which have frames and letters in them, and what their colours mean."""
    fills = {(232, 241, 228): "input", (255, 255, 255): "node", (230, 238, 248): "output"}
    pixels = np.asarray(Pillow.open(io.BytesIO(png or b"")).convert("RGB"))
    found = {}
    for row, top in enumerate(range(20, pixels.shape[0] - 80, 128)):
        for column, left in enumerate(range(20, pixels.shape[1] - 300, 380)):
            box = pixels[top : top + 80, left : left + 300]
            if box[30:50, :2].max() < 160 and box[10:40, 10:-10].min() < 60:
                found[column, row] = fills[tuple(int(each) for each in box[70, 290])]
    return found


def test_a_notebook_draws_pipelines_and_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    p = Pipeline()
    photo, noise = p.input("photo"), p.add("perlin_noise", width=8, height=8)
    p.output("mixed", p.add("mix", photo, base=noise), format="png")
    p.output("same", photo)
    lines = {(0, 0): "input", (1, 0): "node", (2, 0): "node", (3, 0): "output", (1, 1): "output"}
    assert drawn(p._repr_png_()) == lines
    assert (p.to_svg().count("<rect "), p.to_svg().count("<path ")) == (5, 4), "the noise reads nothing"
    scene = Scene(width=8).add("sphere", centre=(0, 1, 0)).light("point", shadow=True).ambient(0.1, 0.1, 0.1)
    scene.environment(np.zeros((4, 8, 3), np.float32)).output("light")
    parts = {(1, row): "node" for row in range(5)}  # camera, object, light, ambient, environment
    assert drawn(scene._repr_png_()) == {(0, 0): "input", **parts, (2, 0): "output"}
    assert drawn(Scene()._repr_png_()) == {(2, 0): "output"}
    monkeypatch.setitem(sys.modules, "PIL", None)
    assert (p._repr_png_(), scene._repr_png_(), Pipeline()._repr_png_()) == (None, None, None)


def test_no_line_of_a_drawing_runs_under_a_box() -> None:
    """A picture that is read again further right passes below the boxes between, in one line for each that reads it."""
    p = Pipeline()
    photo = p.input("photo")
    value = p.add("gaussian", photo, sigma=2)
    for gamma in (1, 2, 3):
        value = p.add("levels", value, gamma=gamma)
    p.output("mixed", p.add("mix", photo, base=value))
    p.output("kept", p.add("mix", value, base=photo))
    svg, wide, high = p.to_svg(), 150, 40
    corners = [(float(x), float(y)) for x, y in re.findall(r'<rect class="\w+" x="(\d+)" y="(\d+)"', svg)]
    lines = [[float(each) for each in re.findall(r"[\d.]+", path)] for path in re.findall(r'<path d="([^"]+)"', svg)]
    assert (len(corners), len(lines)) == (9, 10), "four in the chain, two for each mix, two outputs"
    for line in lines:
        points = list(zip(line[::2], line[1::2], strict=True))
        assert (points[0][0] - wide, points[0][1] - high / 2) in corners, "begins at the right of a box"
        assert (points[-1][0], points[-1][1] - high / 2) in corners, "ends at the left of one"
        for a, b, c, d in zip(points[:-1:3], points[1::3], points[2::3], points[3::3], strict=True):
            for t in np.linspace(0.01, 0.99, 50):
                weights = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3
                x, y = np.dot(weights, [a, b, c, d])
                assert not any(left < x < left + wide and top < y < top + high for left, top in corners), (x, y)


def test_the_asynchronous_client_works_here_too(image: np.ndarray) -> None:
    async def once() -> np.ndarray:
        async with AsyncClient(local=True) as client:
            result = await client.gaussian(image, sigma=1, device="numpy")
            assert (await result.explain())["nodes"]
            return result.array

    np.testing.assert_array_equal(
        asyncio.run(once()), lichen.run("gaussian", image, sigma=1, device="numpy").image.pixels
    )


# ---------------------------------------------------------------------------------------------------------- the images


@pytest.mark.parametrize("mode", ["1", "L", "LA", "RGB", "RGBA", "P", "I;16"])
def test_pictures_of_pillow_lose_nothing(mode: str, server: Any, answer: Any) -> None:
    server.script = [answer(headers=[("Content-Type", "image/png")], echo=True)]
    picture = Pillow.effect_noise((9, 7), 80).convert(mode if mode != "I;16" else "I").convert(mode)
    with Client(server.url) as client:
        back = Pillow.open(io.BytesIO(client.run("gaussian", picture, format="png").content))
    assert back.size == picture.size
    np.testing.assert_array_equal(np.asarray(back.convert("RGBA")), np.asarray(picture.convert("RGBA")))


def test_a_stored_image_is_named_by_its_input(server: Any, answer: Any) -> None:
    server.script = [answer(headers=[NPY], body=npy(np.zeros((1, 1))))]
    kept = Asset("sha256:" + "0" * 64)
    with Client(server.url) as client:
        client.lic(kept, texture=b"x")
        client.run("lic", b"x", texture=kept)
    first, second = server.received
    assert parse_qs(urlsplit(first.target).query)["field"] == [kept.id]
    assert parse_qs(urlsplit(second.target).query)["texture"] == [kept.id]
    assert b'name="texture"' in first.body


@pytest.mark.parametrize(("channels", "mode"), [(1, "L"), (2, "LA"), (3, "RGB"), (4, "RGBA"), (7, "RGB")])
def test_a_notebook_shows_arrays(channels: int, mode: str) -> None:
    array = np.linspace(-0.5, 1.5, 6 * 5 * channels, dtype=np.float32).reshape(6, 5, channels)
    array[0, 0] = np.nan
    shown = Pillow.open(io.BytesIO(png_of(array)))
    assert shown.mode == mode
    expected = np.rint(
        np.clip(np.nan_to_num(array.astype(float), nan=0), 0, 1)[..., : min(channels, 4 if channels < 5 else 3)] * 255
    )
    np.testing.assert_array_equal(np.asarray(shown).reshape(expected.shape), expected)


def test_a_large_or_linear_array_is_shown_small_and_encoded() -> None:
    large = np.full((3000, 10), 255, np.uint8)
    assert Pillow.open(io.BytesIO(png_of(large))).size == (4, 1000)
    grey = np.asarray(Pillow.open(io.BytesIO(png_of(np.full((1, 1, 1), 0.5, np.float32), linear=True))))
    assert grey[0, 0] == 188  # sRGB of one half, IEC 61966-2-1


# ------------------------------------------------------------------------------------------------- options and answers


def test_other_options_share_the_connections(server: Any, answer: Any) -> None:
    server.script = [answer(503), answer(body=b"{}")]
    with Client(server.url, retries=Retries(first=0.001)) as client:
        hasty = client.with_options(retries=0, timeout=3, headers={"X-Request-ID": "mine"})
        assert (hasty.timeout, client.timeout) == (3, 65.0)
        with pytest.raises(Exception, match="503"):
            hasty.version()
        hasty.close()
        client.version()
        assert client.with_raw_response.get("v1", "version").status == 200
        with pytest.raises(ValueError, match="timeout"):
            client.with_options(timeout=-1)
    assert server.received[0].headers["x-request-id"] == "mine"
    assert 1 <= int(server.received[0].headers["request-timeout"]) <= 3000
    assert "x-request-id" not in server.received[1].headers
    assert server.connections == 1


def test_a_raw_answer_is_what_came_refusals_too(server: Any, answer: Any) -> None:
    server.script = [answer(422, [("X-A", "b")], b"no")]

    async def awaited() -> Any:
        async with AsyncClient(server.url, key="secret") as client:
            raw = client.with_raw_response
            return [
                await each
                for each in (
                    raw.gaussian(b"x", sigma=1),
                    raw.run_pipeline("levels", b"x"),
                    raw.render({"a": 1}),
                    raw.get("v1", "limits"),
                )
            ]

    with Client(server.url, key="secret") as client:
        raw = client.with_raw_response
        replies = [raw.run("gaussian", b"x", sigma=1), raw.run_pipeline("levels", b"x"), raw.render({"a": 1})]
        replies.append(raw.get("v1", "limits"))
    for reply in (*replies, *asyncio.run(awaited())):
        assert (reply.status, reply.headers["x-a"], bytes(reply.body)) == (422, "b", b"no")
    targets = [each.target for each in server.received]
    assert targets[:4] == targets[4:]
    assert {each.headers["authorization"] for each in server.received} == {"Bearer secret"}


def test_a_streamed_answer_is_read_piece_by_piece(server: Any, answer: Any, tmp_path: Path) -> None:
    """What may pass is tried again before anything is handed out, a refusal is raised, and half a body is none."""
    body = bytes(range(256)) * 1000
    whole = [answer(503, [("Retry-After", "0")], b"busy"), answer(200, [("X-A", "b")], body)]
    server.script = [*whole, answer(422, body=b"no"), answer(200, body=body, cut=70_000)] * 2

    async def awaited() -> None:
        async with AsyncClient(server.url) as client:
            asked = client.with_streaming_response
            async with asked.gaussian(b"x", sigma=1) as stream:
                assert (stream.status, stream.headers["x-a"]) == (200, "b")
                assert b"".join([piece async for piece in stream]) == body
            with pytest.raises(Unprocessable):
                async with asked.gaussian(b"x", sigma=1):
                    pass
            async with asked.gaussian(b"x", sigma=1) as stream:
                with pytest.raises(ConnectionFailed):
                    await stream.save(tmp_path / "there")

    with Client(server.url) as client:
        asked = client.with_streaming_response
        with asked.gaussian(b"x", sigma=1) as stream:
            assert (stream.status, stream.headers["x-a"]) == (200, "b")
            stream.save(tmp_path / "here")
        assert (tmp_path / "here").read_bytes() == body
        with pytest.raises(Unprocessable), asked.gaussian(b"x", sigma=1):
            pass
        with asked.gaussian(b"x", sigma=1) as stream, pytest.raises(ConnectionFailed):
            stream.save(tmp_path / "there")
    asyncio.run(awaited())
    assert [each.name for each in tmp_path.iterdir()] == ["here"]


def test_the_engine_here_streams_too(local: Client, image: np.ndarray) -> None:
    with local.with_streaming_response.gaussian(image, sigma=1, format="npy") as stream:
        assert b"".join(stream) == bytes(local.gaussian(image, sigma=1, format="npy").content)


# ------------------------------------------------------------------------------------------------------------ the jobs


def state(status: str, progress: int = 0) -> bytes:
    return json.dumps({"id": "j1", "status": status, "progress": progress, "stage": "run"}).encode()


def test_a_job_is_asked_for_once_and_told_of_as_it_goes(
    server: Any, answer: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    array = np.ones((2, 3, 1), np.float32)
    server.script = [
        answer(503),
        answer(202, body=state("accepted")),
        answer(body=state("running", 40)),
        answer(body=state("successful", 100)),
        answer(headers=[NPY], body=npy(array)),
    ]
    seen: list[tuple[float, str]] = []
    with Client(server.url, retries=Retries(first=0.001)) as client:
        job = client.submit("gaussian", b"x", sigma=1)
        result = job.result(progress=lambda percent, stage: seen.append((percent, stage)))
    assert not isinstance(result, Results)
    np.testing.assert_array_equal(result.array, array)
    assert seen == [(40.0, "run"), (100.0, "run")]
    first, second, *rest = server.received
    assert first.headers["idempotency-key"] == second.headers["idempotency-key"]
    assert (first.method, first.headers["prefer"]) == ("POST", "respond-async")
    assert [each.target for each in rest] == ["/v1/jobs/j1", "/v1/jobs/j1", "/v1/jobs/j1/result"]


def test_a_job_that_was_given_up_or_takes_long_is_an_error(
    server: Any, answer: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    server.script = [answer(body=state("running", 50)), answer(body=state("dismissed", 50)), answer(204)]
    with Client(server.url) as client:
        job = client.job("j1")
        with pytest.raises(TimedOut, match="has not ended"):
            job.wait(0.01)
        with pytest.raises(Dismissed):
            job.result(progress=True)
        job.dismiss()
    assert "50 %" in capsys.readouterr().err
    assert server.received[-1].method == "DELETE"


@pytest.mark.parametrize("kind", ["operation", "pipeline", "scene"])
def test_results_of_jobs_explain_themselves(kind: str, server: Any, answer: Any) -> None:
    """As the call would that was asked for, even where what was submitted has changed since."""
    plan = {"nodes": [], "decisions": []}
    ended = [answer(body=state("successful", 100)), answer(headers=[NPY], body=npy(np.zeros((1, 1))))]
    server.script = [answer(202, body=state("accepted")), *ended, answer(body=json.dumps(plan).encode()), *ended]
    built = Pipeline()
    built.add("gaussian", built.input(), sigma=2)
    scene = Scene(width=8).ambient(0.1, 0.1, 0.1)
    with Client(server.url) as client:
        if kind == "operation":
            job = client.submit("gaussian", b"x", sigma=1, max_error=1e-3)
        elif kind == "pipeline":
            job = client.submit_pipeline(built, b"x", max_error=1e-3)
            built.add("levels", built.input(), gamma=2)
        else:
            job = client.submit_scene(scene, max_error=1e-3)
            scene.ambient(0.5, 0.5, 0.5)
        assert job.result().explain() == plan
        asked, told = server.received[0], server.received[3]
        assert urlsplit(told.target).path == urlsplit(asked.target).path
        assert parse_qs(urlsplit(told.target).query) == {**parse_qs(urlsplit(asked.target).query), "explain": ["true"]}
        sent, again = (re.sub(rb"[0-9a-f]{32}", b"boundary", each.body) for each in (asked, told))
        assert again == sent
        with pytest.raises(ValueError, match="does not know where it came from"):
            client.job("j1").result().explain()


def test_jobs_can_be_awaited(server: Any, answer: Any) -> None:
    mixed = b"--b\r\nContent-Type: application/x-npy\r\nLichen-Output: %s\r\n\r\n%s\r\n"
    body = b"".join(mixed % (name, npy(np.zeros((1, 1)))) for name in (b"one", b"two")) + b"--b--\r\n"
    server.script = [
        answer(202, body=state("accepted")),
        answer(body=state("successful", 100)),
        answer(headers=[("Content-Type", 'multipart/mixed; boundary="b"')], body=body),
    ]

    async def once() -> Any:
        async with AsyncClient(server.url) as client:
            return await (await client.submit_pipeline("levels|levels", b"x")).result(5)

    results = asyncio.run(once())
    assert isinstance(results, Results)
    assert list(results) == ["one", "two"]
