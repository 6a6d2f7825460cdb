"""Warps and lookups beside OpenCV, OpenImageIO, SciPy and libvips, where it is installed.

Pictures are waves of 16 to 64 px, which every kernel can follow, so that errors are those of coordinates and weights:
of white noise no two interpolations make the same.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import OpenImageIO as oiio
from comparing import Call, Images, Peer, Row, Values, image, noise
from libraries import Late
from scipy import ndimage

import lichen
from lichen.image import Image
from lichen.memory import aligned_empty

TITLE = "Warps and lookups"
HALF = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
TURN = 30.0


def waves(channels: int) -> Callable[[int], dict[str, Image]]:
    """Sums of smooth waves."""

    def made(side: int) -> dict[str, Image]:
        rng = np.random.default_rng(4)
        y, x = np.mgrid[:side, :side].astype(np.float32)
        pixels = np.full((side, side, channels), 0.5, np.float32)
        for channel in range(channels):
            for _ in range(3):
                wave, angle, phase = rng.uniform(16, 64), rng.uniform(0, np.pi), rng.uniform(0, 6)
                along = (x * np.cos(angle) + y * np.sin(angle)) * (2 * np.pi / wave) + phase
                pixels[..., channel] += np.sin(along, dtype=np.float32) / 6
        return {"image": image(pixels)}

    return made


def perspective(side: int) -> np.ndarray:
    """The same view whatever the size."""
    matrix = np.array([[1.02, 0.08, -60.0], [-0.05, 0.98, 40.0], [2e-5, 3e-5, 1.0]])
    scale = np.diag([side / 2048, side / 2048, 1.0])
    return scale @ matrix @ np.linalg.inv(scale)


def turned(side: int) -> np.ndarray:
    """About the middle, counterclockwise as it is seen."""
    a, c = np.radians(TURN), side / 2
    matrix = np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
    return np.vstack([np.hstack([matrix, np.array([[c], [c]]) - matrix @ [[c], [c]]]), [[0, 0, 1]]])


def centred(matrix: np.ndarray) -> np.ndarray:
    """The same map where the centres of pixels are whole numbers."""
    return np.linalg.inv(HALF) @ matrix @ HALF


def by_opencv(name: str, matrix: Callable[[int], np.ndarray], flag: int) -> Peer:
    def prepare(inputs: Images, values: Values) -> Call:
        pixels = inputs["image"].pixels
        side = pixels.shape[0]
        given, made = centred(matrix(side)), aligned_empty(pixels.shape)
        work, given = (cv2.warpPerspective, given) if name == "warpPerspective" else (cv2.warpAffine, given[:2])
        return lambda: work(pixels, given, (side, side), dst=made, flags=flag, borderMode=cv2.BORDER_REPLICATE)

    return Peer(f"OpenCV {name}", prepare)


def oiio_warp(inputs: Images, values: Values) -> Call:
    """With a filter of its own. It is only ever given a benign map: with a vanishing line in the image it does not
    end."""
    pixels = inputs["image"].pixels
    buffer, matrix = oiio.ImageBuf(pixels), [float(each) for each in perspective(pixels.shape[0]).T.reshape(-1)]
    return lambda: Late(oiio.ImageBufAlgo.warp(buffer, matrix, "lanczos3", 0.0))


def warp(name: str, method: str, flag: int, **further: float) -> Row:
    """Homographies and rotations by one method."""
    if name == "homography":
        peers: tuple[Peer, ...] = (by_opencv("warpPerspective", perspective, flag),)
        values: Any = lambda side: {"matrix": perspective(side).tolist(), "border": "clamp"}  # noqa: E731
    else:
        peers, values = (by_opencv("warpAffine", turned, flag),), {"angle": TURN, "border": "clamp"}
    return Row(f"{name}, {method}, RGBA", name, values, peers, waves(4), {"method": method, **further}, error_side=128)


def horizon(side: int) -> np.ndarray:
    """Output to input: a plane that ends in the middle, a little aslant and between pixels, whatever the size."""
    matrix = np.array([[1, 0.1, 0], [0.05, 0.3, 6], [0.03, 0.11, -1.003]])
    scale = np.diag([side / 16, side / 16, 1])
    return scale @ matrix @ np.linalg.inv(scale)


def to_the_horizon(border: str, method: str, side: int = 512, **further: float) -> Row:
    """Beside the same filter and border where nothing is far."""
    asked = {"method": method, **further}

    def benign(inputs: Images, values: Values) -> Call:
        pixels = inputs["image"]
        view = {"matrix": perspective(pixels.height).tolist(), "border": border, **asked}
        return lambda: lichen.run("homography", pixels, **view).image.pixels

    said = ", ".join([method, *(f"{name} {each:g}" for name, each in further.items()), border])
    return Row(
        f"homography to the horizon, {said}, {side} px", "homography",
        lambda side: {"matrix": horizon(side).tolist(), "inverse": True, "border": border},
        (Peer("the same, a benign view", benign, same=False, yardstick=True),), waves(4), asked, side=side,
        error_side=64,
    )  # fmt: skip


def swirl(side: int) -> dict[str, Image]:
    """A map of places: the picture, stirred."""
    y, x = np.mgrid[:side, :side] + 0.5
    dx, dy = x / side - 0.5, y / side - 0.5
    a = 1.5 * np.exp(-8 * (dx * dx + dy * dy))
    places = np.stack([np.cos(a) * dx - np.sin(a) * dy, np.sin(a) * dx + np.cos(a) * dy], axis=-1) + 0.5
    return waves(4)(side) | {"map": Image(image((places * side).astype(np.float32)).pixels)}


def remapped(inputs: Images, values: Values) -> Call:
    pixels, places = inputs["image"].pixels, inputs["map"].pixels - np.float32(0.5)
    across, down = (np.ascontiguousarray(places[..., axis]) for axis in (0, 1))
    made = aligned_empty(pixels.shape)
    return lambda: cv2.remap(pixels, across, down, cv2.INTER_LINEAR, dst=made, borderMode=cv2.BORDER_REPLICATE)


def by_texture(side: int) -> dict[str, Image]:
    """The same map as a picture of coordinates in [0, 1], and what it is looked up in."""
    given = swirl(side)
    return {"image": Image(image(given["map"].pixels / np.float32(side)).pixels), "texture": given["image"]}


def looked_up(inputs: Images, values: Values) -> Call:
    side = inputs["texture"].pixels.shape[0]
    return remapped({"image": inputs["texture"], "map": Image(inputs["image"].pixels * np.float32(side))}, values)


def round_about(inputs: Images, values: Values) -> Call:
    pixels = inputs["image"].pixels
    side = pixels.shape[0]
    centre, reach = ((side - 1) / 2, (side - 1) / 2), side / 2
    return lambda: cv2.warpPolar(pixels, (side, side), centre, reach, cv2.INTER_LINEAR)


def straightened(inputs: Images, values: Values) -> Call:
    pixels = inputs["image"].pixels
    side = pixels.shape[0]
    focal, centre = side / np.sqrt(2), (side - 1) / 2
    lens = np.array([[focal, 0, centre], [0, focal, centre], [0, 0, 1]])
    return lambda: cv2.undistort(pixels, lens, np.array([-0.1, 0, 0, 0]))


def resized(flag: int) -> Any:
    def prepare(inputs: Images, values: Values) -> Call:
        pixels, goal = inputs["image"].pixels, (values["width"], values["width"])
        made = aligned_empty((*goal, pixels.shape[2]))
        return lambda: cv2.resize(pixels, goal, dst=made, interpolation=flag)

    return prepare


def by_libvips(inputs: Images, values: Values) -> Call:
    vips = importlib.import_module("pyvips")
    whole = vips.Image.new_from_array(inputs["image"].pixels)
    return lambda: whole.resize(values["width"] / whole.width, kernel="lanczos3").numpy()


def resize(method: str, *peers: Peer) -> Row:
    return Row(
        f"resize, a quarter, {method}, RGBA", "resize", lambda side: {"width": side // 4}, peers, noise(4),
        {"method": method}, side=4096, error_side=256,
    )  # fmt: skip


def halved(inputs: Images, values: Values) -> Call:
    pixels = inputs["image"].pixels
    made = aligned_empty((pixels.shape[0] // 2, pixels.shape[1] // 2, pixels.shape[2]))
    return lambda: cv2.pyrDown(pixels, dst=made)


def coloured(inputs: Images, values: Values) -> Call:
    """OpenCV's tables take 8 bits: it rounds to the nearest of 256."""
    grey = inputs["image"].pixels
    return lambda: cv2.applyColorMap(cv2.convertScaleAbs(grey, alpha=255), cv2.COLORMAP_VIRIDIS)


def by_scipy(inputs: Images, values: Values) -> Call:
    pixels, made = inputs["image"].pixels, aligned_empty(inputs["image"].pixels.shape)
    return lambda: ndimage.rotate(pixels, TURN, reshape=False, order=3, mode="nearest", output=made)


ROWS = (
    warp("homography", "bilinear", cv2.INTER_LINEAR),
    warp("homography", "bicubic", cv2.INTER_CUBIC),
    warp("homography", "lanczos3", cv2.INTER_LANCZOS4),
    Row("homography, ewa, RGBA", "homography", lambda side: {"matrix": perspective(side).tolist()}, (
        Peer("OpenImageIO warp, lanczos3", oiio_warp, same=False),), waves(4), {"method": "ewa"}, error_side=128),
    *(to_the_horizon(border, "ewa", samples=1) for border in ("clamp", "wrap", "reflect")),
    *(to_the_horizon("wrap", "ewa", side, samples=1) for side in (64, 4096)),
    to_the_horizon("wrap", "ewa", samples=4),
    to_the_horizon("reflect", "bicubic"),
    warp("rotate", "bilinear", cv2.INTER_LINEAR),
    warp("rotate", "bicubic", cv2.INTER_CUBIC),
    Row("rotate, bicubic against splines, 512 px", "rotate", {"angle": TURN, "border": "clamp"}, (
        Peer("SciPy rotate, order 3", by_scipy, alone=True),), waves(4), {"method": "bicubic"}, 512, 128),
    Row("remap, bilinear, RGBA", "remap", {"border": "clamp"}, (Peer("OpenCV remap", remapped),), swirl,
        {"method": "bilinear"}, error_side=128),
    Row("pixel_texture, linear, RGBA", "pixel_texture", {}, (Peer("OpenCV remap", looked_up),), by_texture,
        error_side=128),
    Row("polar, bilinear, RGBA", "polar", lambda side: {"outer": side / 2, "direction": "forward"}, (
        Peer("OpenCV warpPolar", round_about, same=False),), waves(4), {"method": "bilinear"}, error_side=128),
    Row("lens_distort, undistort, bilinear, RGBA", "lens_distort", {"k": [-0.1]}, (
        Peer("OpenCV undistort", straightened),), waves(4), {"method": "bilinear"}, error_side=128),
    resize("box", Peer("OpenCV INTER_AREA", resized(cv2.INTER_AREA), same=False)),
    resize("lanczos3", Peer("OpenCV INTER_LANCZOS4, aliasing", resized(cv2.INTER_LANCZOS4), same=False),
           Peer("libvips lanczos3", by_libvips)),
    Row("pyramid, one level, RGBA", "pyramid", {}, (Peer("OpenCV pyrDown", halved, same=False),), noise(4)),
    Row("colour_map, viridis", "colour_map", {"low": 0, "high": 1}, (
        Peer("OpenCV applyColorMap, 8 bits", coloured, same=False),), noise(1)),
)  # fmt: skip
