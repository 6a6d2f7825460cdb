"""Lamps against closed forms: discs, rectangles, cones, slides; and what `lighting` makes of lists of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import ndimage

import lichen
from lichen.errors import InvalidRequest
from lichen.memory import Array

WHITE = {"diffuse": [1, 1, 1], "highlight": [0, 0, 0]}


def plane(*places: tuple[float, float, float]) -> dict[str, Array]:
    """A row of surfaces at these places that face +z."""
    position = np.array(places, np.float32)[None]
    return {"position": position, "normal": np.broadcast_to(np.float32([0, 0, 1]), position.shape).copy()}


def truth(images: dict[str, Array], *lights: dict[str, Any], **values: Any) -> Array:
    """Radiance of white diffuse surfaces, one row."""
    return np.asarray(lichen.evaluate_truth("lighting", **images, lights=list(lights), **{**WHITE, **values})[0])


def test_the_inverse_square_far_from_a_lamp() -> None:
    found = truth(
        plane((0, 0, -1), (0, 0, -10), (3, 0, -4)),
        {"kind": "point", "radius": 1e-6, "colour": [1, 0.5, 0], "intensity": 2},
    )
    expected = np.outer([1, 0.01, 0.8 / 25], [2, 1, 0])
    assert np.allclose(found, expected, rtol=1e-9)


def test_a_lamp_is_a_ball_of_plummers_density() -> None:
    """What a transparent ball sends out of a sphere is what its gas within the sphere makes (Gauss)."""
    radius, distances = 0.7, np.array([0.05, 0.3, 1.0, 4.0])
    found = truth(plane(*((0.0, 0.0, -r) for r in distances)), {"kind": "point", "radius": radius})[:, 0]
    inner = np.linspace(0, 1, 20001)
    for r, seen in zip(distances, found, strict=True):
        at = inner * r
        density = 3 / radius**3 * (1 + (at / radius) ** 2) ** -2.5
        assert seen == pytest.approx(np.trapezoid(density * at**2, at) / r**2, rel=1e-6)


def test_falloff_is_the_callers_polynomial() -> None:
    found = truth(plane((0, 0, -2)), {"kind": "point", "radius": 1e-6, "falloff": [0.5, 0.25, 0.125]})
    assert np.allclose(found, 1 / (0.5 + 0.5 + 0.5), rtol=1e-9)


def test_a_spot_ends_smoothly() -> None:
    angles = np.radians([0, 9.9, 15, 20.1, 90])
    places = [(np.tan(a) * 3, 0.0, -3.0) if a < 1.5 else (3.0, 0.0, 0.0) for a in angles]
    lamp = {"kind": "spot", "inner": 10, "outer": 20, "falloff": [1, 0, 0], "radius": 1e-6}
    found = truth(plane(*places), lamp)[:, 0]
    middle = (np.cos(np.radians(15)) - np.cos(np.radians(20))) / (np.cos(np.radians(10)) - np.cos(np.radians(20)))
    expected = [1, np.cos(angles[1]), np.cos(angles[2]) * middle**2 * (3 - 2 * middle), 0, 0]
    assert np.allclose(found, expected, atol=1e-6)


def test_an_area_lights_as_the_form_factor_says() -> None:
    """A rectangle over a parallel patch below its corner, by the closed form (Howell, A catalog of radiation heat
    transfer configuration factors, C-11), four times for the patch below its middle."""
    width, height, away = 1.6, 0.8, 1.1
    a, b = width / 2 / away, height / 2 / away
    factor = (
        a / np.sqrt(1 + a * a) * np.arctan(b / np.sqrt(1 + a * a))
        + b / np.sqrt(1 + b * b) * np.arctan(a / np.sqrt(1 + b * b))
    ) / (2 * np.pi)
    # Radiance L of the lamp gives the white surface the radiance 4 L x factor; intensity is L x area / pi.
    lamp = {
        "kind": "area", "size": [width, height], "intensity": width * height / np.pi, "samples": 512,
        "direction": [0, 0, -1],
    }  # fmt: skip
    found = truth(plane((0, 0, -away)), lamp)[0, 0]
    assert found == pytest.approx(4 * factor, rel=5e-3)
    behind = truth(plane((0, 0, -away)), {**lamp, "direction": [0, 0, 1]})
    assert np.array_equal(behind, np.zeros_like(behind))


def test_more_samples_come_nearer_to_the_area() -> None:
    images = plane((0.3, 0.2, -0.4), (-0.6, 0.1, -0.7))
    lamp = {"kind": "area", "size": [1.5, 1.0]}
    best = truth(images, {**lamp, "samples": 1024}, highlight=[1, 1, 1])
    apart = [np.abs(truth(images, {**lamp, "samples": n}, highlight=[1, 1, 1]) - best).max() for n in (1, 16, 256)]
    assert apart[0] > apart[1] > apart[2]


def test_a_share_of_the_discs_is_the_area_with_fewer() -> None:
    images = plane((0.3, 0.2, -0.4), (-0.6, 0.1, -0.7))
    lamp = {"kind": "area", "size": [1.5, 1.0], "samples": 64}
    few = lichen.run("lighting", **images, lights=[lamp], method="sparse", share=0.25, device="numpy")
    exact = lichen.evaluate_truth("lighting", **images, lights=[{**lamp, "samples": 16}])
    assert np.allclose(few.image.pixels, exact, rtol=1e-5)
    whole = lichen.evaluate_truth("lighting", **images, lights=[lamp])
    assert np.abs(few.image.pixels - whole).max() <= few.error.value


def test_a_projector_shows_its_slide() -> None:
    """A slide thrown on a wall at distance 2 is seen there at the size that the angle says, the right way up."""
    rng = np.random.default_rng(1)
    slide = rng.random((4, 6, 3)).astype(np.float32)
    half = 2 * np.tan(np.radians(25))
    across, down = (np.arange(6) + 0.5) / 6 - 0.5, (np.arange(4) + 0.5) / 4 - 0.5
    y, x = np.meshgrid(-2 * half * down, 2 * half * 1.5 * across, indexing="ij")
    images = {
        "position": np.stack([x, y, np.full_like(x, -2)], axis=-1).astype(np.float32),
        "normal": np.broadcast_to(np.float32([0, 0, 1]), (4, 6, 3)).copy(),
        "slide": slide,
    }
    lamp = {"kind": "projector", "fov": 50, "aspect": 1.5, "falloff": [1, 0, 0], "radius": 1e-6}
    found = lichen.evaluate_truth("lighting", **images, lights=[lamp], **WHITE)
    cosine = 2 / np.sqrt(x * x + y * y + 4)
    assert np.allclose(found, slide * cosine[..., None], atol=2e-6)


SLAB: dict[str, Any] = {
    "kind": "slab", "position": [0.2, 0.1, 0.3], "direction": [0.2, -0.1, -1], "size": [0.8, 0.5], "cells": [3, 2],
    "fov": 60, "aspect": 1.25, "intensity": 2, "colour": [1, 0.5, 0.25],
}  # fmt: skip


@pytest.mark.parametrize("distance", [None, 1.5])
def test_a_slab_sums_micro_lights(distance: float | None) -> None:
    """Against the sum over the cells of a light field of four dimensions, written out (equation 7.4)."""
    rng = np.random.default_rng(4)
    field = rng.random((2, 3, 5, 4)).astype(np.float32)  # v, u, t, s
    sheet = field.transpose(0, 2, 1, 3).reshape(10, 12, 1)
    places = rng.uniform([-1, -1, -2], [1, 1, -0.5], (40, 3))
    images = {**plane(*map(tuple, places)), "slab": sheet}
    found = truth(images, {**SLAB, "distance": distance})
    places = images["position"][0].astype(float)
    ahead = np.array(SLAB["direction"]) / np.linalg.norm(SLAB["direction"])
    right = np.cross(ahead, [0, 1, 0])
    right /= np.linalg.norm(right)
    up, tangent = np.cross(right, ahead), np.tan(np.radians(30))
    width, height = SLAB["size"]
    square = width * height / (6 * np.pi)
    framed = np.pad(field, ((0, 0), (0, 0), (1, 1), (1, 1)))
    expected = np.zeros(len(places))
    for v in range(2):
        for u in range(3):
            x, y = ((u + 0.5) / 3 - 0.5) * width, (0.5 - (v + 0.5) / 2) * height
            way = places - (np.array(SLAB["position"]) + x * right + y * up)
            depth = way @ ahead
            moved = (0, 0) if distance is None else (x / distance, y / distance)
            s = 0.5 + (way @ right / depth + moved[0]) / (2 * tangent * 1.25)
            t = 0.5 - (way @ up / depth + moved[1]) / (2 * tangent)
            seen = ndimage.map_coordinates(
                framed[v, u].astype(float), [t * 5 + 0.5, s * 4 + 0.5], order=1, mode="grid-constant"
            )
            far = np.linalg.norm(way, axis=1)
            facing, leaving = np.maximum(-way[:, 2] / far, 0), np.maximum(depth / far, 0)
            shares = far / np.sqrt(far**2 + square) / (far**2 + square)
            expected += seen * shares * facing * leaving / 6 * (depth > 0)
    assert np.count_nonzero(expected) > 20
    assert np.allclose(found, np.outer(expected * 2, SLAB["colour"]), rtol=1e-6, atol=1e-9)


def test_an_even_slab_is_an_area() -> None:
    images = plane((0.3, 0.2, -0.9), (-0.2, 0.1, -0.7))
    alike = {"size": [0.8, 0.4], "intensity": 3}
    slab = {"kind": "slab", "cells": [6, 3], "fov": 160, **alike}
    found = truth({**images, "slab": np.ones((6, 12, 1), np.float32)}, slab)
    assert np.allclose(found, truth(images, {"kind": "area", "samples": 18, **alike}), rtol=1e-9)
    few = lichen.run("lighting", **images, lights=[slab], **WHITE, method="sparse", share=1 / 9, device="numpy")
    assert np.allclose(few.image.pixels[0], truth(images, {**slab, "lit": [2, 1]}), rtol=1e-5)
    assert np.abs(few.image.pixels[0] - found).max() <= few.error.value


def test_lamps_add_up_and_are_seen_as_far_as_visibility_says() -> None:
    images = plane((0, 0, -3), (1, 1, -2))
    lamps = [{"kind": "directional", "direction": [-1, 0, -1]}, {"kind": "point", "position": [1, 0, 0]}]
    shares = np.float32([[[0.25, 0.5], [1, 0]]])
    alone = [truth(images, lamp, highlight=[1, 1, 1]) for lamp in lamps]
    together = truth({**images, "visibility": shares}, *lamps, highlight=[1, 1, 1])
    assert np.allclose(together, sum(alone[i] * shares[0, :, i : i + 1] for i in range(2)), rtol=1e-9)


def test_images_of_colour_multiply_the_parameters() -> None:
    """Diffuse light and highlights are linear in their colours, which are grey or have three channels."""
    rng = np.random.default_rng(2)
    normal = rng.normal(size=(3, 4, 3)).astype(np.float32) + np.float32([0, 0, 2])
    grey, colour = (rng.random((3, 4, channels), np.float32) for channels in (1, 3))

    def found(**given: Any) -> Array:
        return np.asarray(
            lichen.evaluate_truth("lighting", normal=normal, lights=[{"direction": [0, -1, -2]}], **given)
        )

    matt, shiny = found(**WHITE), found(diffuse=[0, 0, 0])
    mixed = found(albedo=colour, specular=grey, diffuse=[0.5, 0.25, 1], highlight=[1, 2, 3])
    assert np.allclose(mixed, matt * colour * [0.5, 0.25, 1] + shiny * grey * [1, 2, 3], rtol=1e-6)


def test_flaws_are_named_before_anything_is_computed() -> None:
    normal = np.zeros((2, 3, 3), np.float32)
    lamps = [{"kind": "point"}, {"kind": "spot"}]
    with pytest.raises(InvalidRequest) as caught:
        lichen.run(
            "lighting", normal=normal, lights=lamps, view=[0, 0, 0],
            visibility=np.ones((2, 3, 3), np.float32), roughness=np.ones((3, 3, 1), np.float32),
        )  # fmt: skip
    pointers = {flaw.pointer for flaw in caught.value.flaws}
    assert pointers >= {
        "/parameters/lights/0/kind", "/parameters/lights/1/kind", "/parameters/view", "/inputs/visibility",
        "/inputs/roughness",
    }  # fmt: skip
    bad = [
        {"kind": "lantern"}, {"direction": [0, 0, 0]}, {"kind": "spot", "inner": 40, "outer": 40},
        {"falloff": [0, 0, 0]}, {"kind": "area", "direction": [0, 1, 0]}, {"brightness": 1},
    ]  # fmt: skip
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("lighting", normal=normal, lights=bad)
    named = {flaw.pointer.removeprefix("/parameters/lights/").split("/")[0] for flaw in caught.value.flaws}
    assert named >= {"0", "1", "2", "3", "4", "5"}
    for exponent in (0, 1e6):
        with pytest.raises(InvalidRequest, match="/parameters/exponent"):
            lichen.run("lighting", normal=normal, model="phong", exponent=exponent)


@pytest.mark.parametrize(
    "values",
    [
        {"distribution": "ggx"},
        {"distribution": "beckmann", "facet_roughness": 0.25},
        {"distribution": "gaussian", "facet_roughness": 0.7, "index": 3},
        {"model": "cosine_lobe", "exponent": 80},
        {"model": "blinn_phong", "exponent": 7.5},
        {"model": "phong", "facet_roughness": 0.5},
    ],
    ids=lambda values: "-".join(map(str, values.values())),
)
def test_larger_tables_come_nearer_and_keep_what_they_state(values: dict[str, Any]) -> None:
    """Linear between entries: four times as many, a sixteenth of the error."""
    rng = np.random.default_rng(3)
    normal = (rng.normal(size=(40, 40, 3)) * [0.6, 0.6, 0.1] + [0, 0, 1]).astype(np.float32)
    arguments: dict[str, Any] = {"lights": [{"direction": [0.2, -0.4, -1]}], "diffuse": [0, 0, 0], **values}
    exact = lichen.evaluate_truth("lighting", normal=normal, **arguments)
    apart = []
    for size in (16, 64, 256):
        run = lichen.run("lighting", normal=normal, method="tables", size=size, device="numpy", **arguments)
        apart.append(float(np.abs(run.image.pixels - exact).max()))
        assert apart[-1] <= run.error.value
    assert apart[0] > 4 * apart[1] > 16 * apart[2]
