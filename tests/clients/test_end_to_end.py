"""The clients against the real service in a process of its own: one road from Python to a kernel and back."""

from __future__ import annotations

import asyncio
import io
import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import lichen
from lichen.catalogue import operations
from lichen.files import decode, encode
from lichen.image import Image, Space, Storage
from lichen_cli.main import main
from lichen_client import AsyncClient, Client, NotFound, Result, Retries, StatusError, Unprocessable

START = 60.0
"""Seconds the service may take to say where it listens; generous, since only a hang should fail here."""


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    """Address of a service that `lichen serve` started and that computes with NumPy; told to end, it ends with 0."""
    environment = {**os.environ, "LICHEN_DEVICE": "numpy"}
    arguments = [sys.executable, "-m", "lichen_cli", "serve", "--port", "0", "--workers", "1"]
    service = subprocess.Popen(
        arguments, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    said: list[str] = []
    listening = threading.Event()

    def listen() -> None:
        assert service.stdout is not None
        for line in service.stdout:
            said.append(line)
            if "listens on" in line:
                listening.set()
        listening.set()

    threading.Thread(target=listen, daemon=True).start()
    try:
        listening.wait(START)
        found = re.search(r"listens on (http://\S+)", "".join(said))
        assert found, "".join(said)
        yield found[1]
    finally:
        service.send_signal(signal.SIGTERM)
        try:
            assert service.wait(START) == 0
        except subprocess.TimeoutExpired:
            os.killpg(service.pid, signal.SIGKILL)
            service.wait()


@pytest.fixture(scope="module")
def client(url: str) -> Iterator[Client]:
    with Client(url, retries=Retries(count=8)) as made:
        yield made


@pytest.fixture(scope="module")
def image() -> np.ndarray:
    return np.random.default_rng(11).random((21, 34, 3), np.float32)


def test_the_service_gives_the_librarys_own_bytes(client: Client, image: np.ndarray) -> None:
    result = client.run("gaussian", image, sigma=2.5, method="fir")
    expected = lichen.run("gaussian", image, sigma=2.5, method="fir", device="numpy")
    np.testing.assert_array_equal(result.array, expected.image.pixels)
    assert result.array.dtype == np.float32
    with Client(local=True) as here:
        assert here.run("gaussian", image, sigma=2.5, method="fir", device="numpy").content == result.content
    report = result.report
    assert (report.method, report.device, report.nonfinite) == (expected.method, "numpy", 0)
    assert report.error is not None
    assert (report.error.kind, report.error.metric) == (expected.error.kind, "max")
    assert report.error.value == pytest.approx(expected.error.value, rel=0.01)
    assert report.error.value >= expected.error.value * (1 - 1e-6)
    assert {"decode", "kernel", "encode", "total"} <= report.timing.keys()
    assert report.etag
    assert report.request_id


def test_the_asynchronous_client_gets_the_same(url: str, client: Client, image: np.ndarray) -> None:
    async def once() -> np.ndarray:
        async with AsyncClient(url) as other:
            return (await other.run("gaussian", image, sigma=2.5)).array

    np.testing.assert_array_equal(asyncio.run(once()), client.run("gaussian", image, sigma=2.5).array)


def test_scenes_are_rendered_and_explained(url: str, client: Client) -> None:
    scene = {
        "camera": {"eye": [0, 1.5, 4], "target": [0, 0.5, 0], "width": 32, "height": 24},
        "objects": [{"shape": "plane"}, {"shape": "sphere", "centre": [0, 0.7, 0], "radius": 0.7}],
        "lights": [{"kind": "point", "position": [3, 5, 2], "intensity": 30, "shadow": {"size": 32}}],
        "environment": {"image": "sky", "reflectance": 0.2},
        "fog": {"density": 0},
    }
    sky = np.full((4, 8, 3), 0.5, np.float32)
    made = client.render(scene, images={"sky": sky})
    expected = lichen.render(scene, images={"sky": sky}, device="numpy").image.pixels
    np.testing.assert_allclose(made.array, expected, atol=1e-6)

    async def once() -> np.ndarray:
        async with AsyncClient(url) as other:
            later = await (await other.submit_scene(scene, images={"sky": sky})).result(60)
            assert await later.explain() == said
            return (await other.render(scene, images={"sky": sky})).array

    said = client.explain_scene(scene, images={"sky": sky})
    np.testing.assert_array_equal(asyncio.run(once()), made.array)
    later = client.submit_scene(scene, images={"sky": sky}).result(60)
    assert isinstance(later, Result)
    assert later.content == made.content
    assert later.explain() == said
    assert {"node": "fog", "reason": "its density is 0"}.items() <= {
        key: value for each in said["decisions"] if each["node"] == "fog" for key, value in each.items()
    }.items()
    with pytest.raises(Unprocessable):
        client.render({**scene, "camera": {"fov": 0}})


def test_a_pipeline_on_files_is_the_same_here_and_there(
    url: str, image: np.ndarray, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo = tmp_path / "photo.npy"
    np.save(photo, image)
    graph = {
        "nodes": {
            "soft": {"operation": "gaussian", "parameters": {"sigma": 2}, "method": "fir"},
            "sharp": {
                "operation": "mix",
                "parameters": {"amount": 1.5},
                "inputs": {"image": "input.image", "base": "soft"},
            },
        },
        "outputs": {"soft": {"node": "soft", "storage": "uint16"}, "sharp": {"node": "sharp", "format": "exr"}},
    }
    (tmp_path / "graph.json").write_text(json.dumps(graph))
    for place, more in (("here", ["--device", "numpy"]), ("there", ["--device", "numpy", "--url", url])):
        out = tmp_path / place
        out.mkdir()
        command = ["run", "--pipeline", "gaussian:sigma=2|levels:black=0.1", str(photo), str(out / "a.png"), *more]
        assert main(command) == 0
        assert "error at most" in capsys.readouterr().err
        named = ["--output", f"soft={out}/soft.png", "--output", f"sharp={out}/sharp.exr", "--json", *more]
        assert main(["run", "--pipeline", f"@{tmp_path}/graph.json", str(photo), *named]) == 0
        assert set(json.loads(capsys.readouterr().out)["outputs"]) == {"soft", "sharp"}
    for name in ("a.png", "soft.png", "sharp.exr"):
        assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()
    explain = ["run", "--pipeline", "gaussian:sigma=2", str(photo), "--explain", "--url", url]
    assert main(explain) == 0
    assert [each["name"] for each in json.loads(capsys.readouterr().out)["nodes"]] == ["gaussian"]
    assert main(["run", "--pipeline", "gaussian:sigma=2", str(photo), "b.png", "--max-ms", "-1", "--url", url]) == 2


def test_further_images_reach_their_inputs(client: Client) -> None:
    field = np.dstack([np.ones((16, 16)), np.zeros((16, 16))]).astype(np.float32)
    texture = np.random.default_rng(2).random((16, 16, 1), np.float32)
    result = client.run("lic", field, texture=texture, length=4, method="rk2")
    expected = lichen.run("lic", field, texture=texture, length=4, method="rk2", device="numpy")
    np.testing.assert_array_equal(result.array, expected.image.pixels)


def test_a_file_becomes_an_array_or_another_file(client: Client, image: np.ndarray, tmp_path: Path) -> None:
    photo = tmp_path / "photo.png"
    photo.write_bytes(encode(Image(image, Space.SRGB, storage=Storage.UINT8), "png").data)
    assert client.run("gaussian", photo, sigma=1).array.shape == image.shape
    client.run("gaussian", photo, sigma=1, format="png").save(tmp_path / "soft.png")
    soft = decode((tmp_path / "soft.png").read_bytes())
    assert (soft.pixels.shape, soft.storage) == (image.shape, Storage.UINT8)


def test_identity_returns_every_sample_bit_for_bit(client: Client) -> None:
    image = np.random.default_rng(4).normal(size=(5, 6, 7)).astype(np.float32)
    image[0, 0, :3] = [np.nan, np.inf, -0.0]
    result = client.run("gaussian", image, sigma=0)
    assert result.content == _npy(image)
    assert result.report.nonfinite == 2
    assert "identity" in result.report.skipped


def test_a_result_can_be_verified(client: Client, image: np.ndarray) -> None:
    report = client.run("gaussian", image, sigma=2, tail=1e-3, method="fir", verify=True).report
    assert report.error is not None
    assert report.measured is not None
    assert 0 < report.measured.rms < report.measured.largest <= report.error.value
    assert report.measured.sampled == 1
    assert client.run("gaussian", image, sigma=2).report.measured is None


def test_every_flaw_comes_back_at_once(client: Client, image: np.ndarray) -> None:
    with pytest.raises(Unprocessable) as raised:
        client.run("gaussian", image, sigma=-1, bordr="clamp", device="abacus")
    error = raised.value
    assert {"/parameters/sigma", "/query/bordr", "/query/device"} <= {flaw.pointer for flaw in error.errors}
    assert "border" in str(error)
    assert error.request_id


def test_unknown_names_come_back_with_the_nearest(client: Client, image: np.ndarray) -> None:
    with pytest.raises(NotFound, match="gaussian"):
        client.run("gausian", image)
    with pytest.raises(NotFound, match="gaussian"):
        client.operation("gausian")


@pytest.mark.parametrize("content", [b"not an image", b"\x89PNG\r\n\x1a\n", b"\x93NUMPY\x01\x00\xff\xff"])
def test_broken_uploads_are_refused_and_the_service_goes_on(client: Client, content: bytes) -> None:
    with pytest.raises(StatusError) as raised:
        client.run("gaussian", content, sigma=1)
    assert 400 <= raised.value.status < 500
    assert client.version()


def test_documents_and_plans(client: Client, image: np.ndarray) -> None:
    assert [each["name"] for each in client.operations()["operations"]] == list(operations())
    assert "sigma" in client.operation("gaussian")["parameters"]["properties"]
    assert client.version()["lichen"]
    plan = client.explain("gaussian", image, sigma=3)
    assert [node["operation"] for node in plan["nodes"]] == ["gaussian"]


def test_many_threads_share_one_client(client: Client) -> None:
    def once(number: int) -> bool:
        sent = np.full((8, 8, 1), number, np.float32)
        return bool(np.allclose(client.run("gaussian", sent, sigma=1 + number % 3).array, number, rtol=1e-5))

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(once, range(40)))


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()
