"""Composite against the specification's formulas for straight colour, pixel by pixel, and against Pillow."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from PIL import Image as PillowImage
from PIL import ImageChops

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image, Space
from lichen.opencl.device import default_device
from lichen.operation import Facts
from lichen.operations.compositing.blending import Blend, Operator

BACKENDS = ("opencl", "numpy")
KINDS = {False: Alpha.NONE, True: Alpha.ASSOCIATED}
RNG = np.random.default_rng(5)
OPERATION = lichen.operations()["composite"]

# The specification's section 10, straight colour, scalars: Cb and Cs are backdrop and source.
SEPARABLE = {
    "normal": lambda cb, cs: cs,
    "multiply": lambda cb, cs: cb * cs,
    "screen": lambda cb, cs: cb + cs - cb * cs,
    "overlay": lambda cb, cs: SEPARABLE["hard_light"](cs, cb),
    "darken": min,
    "lighten": max,
    "color_dodge": lambda cb, cs: 0 if cb == 0 else 1 if cs == 1 else min(1, cb / (1 - cs)),
    "color_burn": lambda cb, cs: 1 if cb == 1 else 0 if cs == 0 else 1 - min(1, (1 - cb) / cs),
    "hard_light": lambda cb, cs: cb * 2 * cs if cs <= 0.5 else SEPARABLE["screen"](cb, 2 * cs - 1),
    "soft_light": lambda cb, cs: (
        cb - (1 - 2 * cs) * cb * (1 - cb)
        if cs <= 0.5
        else cb + (2 * cs - 1) * ((((16 * cb - 12) * cb + 4) * cb if cb <= 0.25 else math.sqrt(cb)) - cb)
    ),
    "difference": lambda cb, cs: abs(cb - cs),
    "exclusion": lambda cb, cs: cb + cs - 2 * cb * cs,
}


def lum(c):
    return 0.3 * c[0] + 0.59 * c[1] + 0.11 * c[2]


def clip_color(c):
    light, low, high = lum(c), min(c), max(c)
    if low < 0:
        c = [light + (each - light) * light / (light - low) for each in c]
    if high > 1:
        c = [light + (each - light) * (1 - light) / (high - light) for each in c]
    return c


def set_lum(c, light):
    return clip_color([each + light - lum(c) for each in c])


def sat(c):
    return max(c) - min(c)


def set_sat(c, s):
    """The specification's text: middle and largest scaled, the smallest 0."""
    order = sorted(range(3), key=lambda i: c[i])
    least, middle, most = order
    made = [0.0, 0.0, 0.0]
    if c[most] > c[least]:
        made[middle] = (c[middle] - c[least]) * s / (c[most] - c[least])
        made[most] = s
    return made


THREE = {
    "hue": lambda cb, cs: set_lum(set_sat(cs, sat(cb)), lum(cb)),
    "saturation": lambda cb, cs: set_lum(set_sat(cb, sat(cs)), lum(cb)),
    "color": lambda cb, cs: set_lum(cs, lum(cb)),
    "luminosity": lambda cb, cs: set_lum(cb, lum(cs)),
}
FACTORS = {
    "clear": lambda s, b: (0, 0),
    "copy": lambda s, b: (1, 0),
    "destination": lambda s, b: (0, 1),
    "over": lambda s, b: (1, 1 - s),
    "destination_over": lambda s, b: (1 - b, 1),
    "in": lambda s, b: (b, 0),
    "destination_in": lambda s, b: (0, s),
    "out": lambda s, b: (1 - b, 0),
    "destination_out": lambda s, b: (0, 1 - s),
    "atop": lambda s, b: (b, 1 - s),
    "destination_atop": lambda s, b: (1 - b, s),
    "xor": lambda s, b: (1 - b, 1 - s),
}


def specified(operator, mode, image, base):
    """co and ao of one pixel by the specification; both straight, four numbers."""
    cs, s, cb, b = list(image[:3]), image[3], list(base[:3]), base[3]
    mixed = THREE[mode](cb, cs) if mode in THREE else [SEPARABLE[mode](x, y) for x, y in zip(cb, cs, strict=True)]
    cs = [(1 - b) * own + b * made for own, made in zip(cs, mixed, strict=True)]
    from_image, from_base = FACTORS[operator](s, b)
    colour = [s * from_image * x + b * from_base * y for x, y in zip(cs, cb, strict=True)]
    return [*colour, s * from_image + b * from_base]


def straight(height: int, width: int) -> np.ndarray:
    """Colours and coverages with their ends among them."""
    made = RNG.random((height, width, 4))
    return np.where(RNG.random(made.shape) < 0.15, np.round(made), made)


def associated(pixels: np.ndarray) -> Image:
    made = np.concatenate([pixels[..., :3] * pixels[..., 3:], pixels[..., 3:]], axis=-1)
    return Image(made.astype(np.float32), Space.SRGB, Alpha.ASSOCIATED)


@pytest.mark.parametrize("backend", BACKENDS)
def test_is_what_the_specification_says(backend: str) -> None:
    """Every operator with every mode. Where no coverage is on one side, the specification has no colour there."""
    top, ground = straight(7, 9), straight(7, 9)
    image, base = associated(top), associated(ground)
    combinations = list(itertools.product(FACTORS, [*SEPARABLE, *THREE]))
    for operator, mode in combinations:
        result = lichen.run(
            "composite", image, base=base, operator=operator, blend=mode, light="stored", device=backend, prune=False
        )
        expected = np.array(
            [[specified(operator, mode, *p) for p in zip(*rows, strict=True)] for rows in zip(top, ground, strict=True)]
        )
        assert result.image.alpha is Alpha.ASSOCIATED
        assert np.abs(result.image.pixels - expected).max() < 2e-5, (operator, mode)


@pytest.mark.parametrize("mode", ["multiply", "screen", "darken", "lighten", "difference", "hard_light", "overlay"])
def test_agrees_with_pillow(mode: str) -> None:
    """Which works on bytes, and so within a code value."""
    codes = [RNG.integers(0, 256, (31, 17, 3), dtype=np.uint8) for _ in range(2)]
    ground, top = (PillowImage.fromarray(each) for each in codes)
    theirs = {"darken": "darker", "lighten": "lighter"}.get(mode, mode)
    expected = np.asarray(getattr(ImageChops, theirs)(ground, top)).astype(float)
    result = lichen.run("composite", codes[1], base=codes[0], blend=mode, light="stored")
    assert np.abs(result.image.pixels * 255 - expected).max() <= 2


def within(inputs: dict[str, Image], values: dict[str, object], backend: str) -> None:
    parameters = OPERATION.validate(values)
    facts = {name: Facts.of(image) for name, image in inputs.items()}
    assert not OPERATION.check(parameters, facts)
    method = OPERATION.methods["exact"]
    with np.errstate(all="ignore"):
        body = method.implementation
        if backend == "numpy":
            pixels = body.numpy(inputs, parameters, 0.0)
        else:
            pixels = body.opencl(default_device(), inputs, parameters, 0.0)
    truth = OPERATION.evaluate_truth(inputs, parameters)
    stated, predicted = method.error(parameters, 0.0, facts), OPERATION.result(parameters, facts)
    assert pixels.shape == (predicted.height, predicted.width, predicted.channels)
    assert np.abs(pixels - truth).max() <= stated.value
    assert predicted.extent.low <= truth.min()
    assert truth.max() <= predicted.extent.high


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("spread", [(0.0, 1.0), (-0.4, 1.5), (-30.0, 1e3)], ids=["usual", "lobes", "wild"])
def test_covered_pictures_keep_the_stated_error(backend: str, spread: tuple[float, float]) -> None:
    """Coverage on either side, both or none, masks, and every channel count; coverage and light beyond [0, 1]."""
    rng = np.random.default_rng(11)
    modes, operators = list(Blend), list(Operator)
    layouts = ((3, True, True), (3, False, True), (3, True, False), (5, True, True), (1, False, True))
    for number, mode in enumerate(modes * 2):
        colours, *covered = layouts[0 if not mode.separable else number % len(layouts)]
        pictures = [
            Image(rng.uniform(*spread, (5, 21, colours + own)).astype(np.float32), alpha=KINDS[own]) for own in covered
        ]
        inputs = dict(zip(("image", "base"), pictures, strict=True))
        if not mode.separable or number % len(layouts) == 3:
            inputs["mask"] = Image(rng.uniform(-0.2, 1.2, (5, 21, 1)).astype(np.float32))
        within(inputs, {"operator": operators[number % 13], "blend": mode, "opacity": 0.75}, backend)


def test_opaque_pictures_stay_without_coverage() -> None:
    picture = RNG.random((4, 5, 3)).astype(np.float32)
    for operator, covered in (("over", 3), ("atop", 3), ("plus", 3), ("in", 3), ("xor", 4), ("clear", 4)):
        assert (
            lichen.run(
                "composite", picture, base=picture, operator=operator, device="numpy", prune=False
            ).image.channels
            == covered
        )
    mask = np.zeros((4, 5, 1), np.float32)
    assert lichen.run("composite", picture, base=picture, mask=mask, operator="in").image.channels == 4


def test_identities_are_bit_for_bit() -> None:
    picture, base = (RNG.random((4, 5, 3)).astype(np.float32) for _ in range(2))
    base[2, 2] = np.nan
    for operator in ("over", "copy"):
        pruned = lichen.run("composite", picture, base=base, operator=operator)
        whole = lichen.run("composite", picture, base=base, operator=operator, prune=False)
        assert any(each.action == "dropped" for each in pruned.decisions)
        assert pruned.image.pixels.tobytes() == whole.image.pixels.tobytes()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_picture_may_hang_over_the_edge(backend: str) -> None:
    base, stamp = np.zeros((6, 8, 1), np.float32), np.ones((3, 3, 1), np.float32)
    for x, y in ((-1, -2), (6, 4), (2, 2), (50, 0), (-50, -50)):
        expected = np.zeros((6, 8, 1))
        expected[max(y, 0) : max(y + 3, 0), max(x, 0) : max(x + 3, 0)] = 1
        result = lichen.run("composite", stamp, base=base, x=x, y=y, device=backend)
        assert np.array_equal(result.image.pixels, expected)


def test_light_is_summed_unless_asked_otherwise() -> None:
    """Half black over white in an sRGB picture: half the light is 0.735, half the number 0.5."""
    black, white = (Image(np.full((1, 1, 3), value, np.float32), Space.SRGB) for value in (0, 1))
    linear = lichen.run("composite", black, base=white, opacity=0.5).image
    stored = lichen.run("composite", black, base=white, opacity=0.5, light="stored").image
    assert linear.space is stored.space is Space.SRGB
    assert np.allclose(linear.pixels, 0.735357, atol=1e-5)
    assert np.allclose(stored.pixels, 0.5, atol=1e-7)


def test_flaws_name_both() -> None:
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("composite", np.zeros((4, 4, 1)), base=np.zeros((4, 4, 2)), blend="hue", mask=np.zeros((3, 4, 1)))
    assert {flaw.pointer for flaw in refused.value.flaws} == {"/inputs/base", "/parameters/blend", "/inputs/mask"}
