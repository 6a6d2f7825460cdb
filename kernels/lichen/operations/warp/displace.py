"""Displace: every pixel looks a little way off, by a map or by a pattern.

Truth: the pixel at (u, v) shows the source at (u, v) + d(u, v), resampled as all warps are (see
`lichen.operations.warp.reference`). What d is, `pattern` says; r is measured from `centre`, a share of the image's size
(the middle by default), and lengths are in pixels.

* map: d = (m - bias) x `amplitude`, of the first two channels m of the input `map`, which has the image's size.
* ripple: away from the centre, d = `amplitude` sin(2 pi (r / `length` - `phase`)) in the direction of r, fading out as
  exp(-r / `reach`) where a reach is given.
* swirl: a turn about the centre by `angle` degrees, all of it at the centre, none from `reach` on: angle (1 - r /
  reach)^2, to the left as it is seen.
* taper: rows narrow or widen about the centre, from not at all at the upper edge to 1 + `amplitude` times at the lower.
* haze: hot air, turbulence. Both components are `amplitude` times gradient noise of a cell of `length` px, that rises
  with `phase` and is different for every `seed`; the integral over all is 0. With `octaves` it is a sum of noises, each
  of `lacunarity` times the frequency and `gain` times the amplitude of the one before (fBm), in a lattice of its own;
  the shares sum to 1, so that nothing moves further than by one octave.

Source: McReynolds and Blythe, Advanced Graphics Programming Using OpenGL, 2005, sections 12.2.4 and 14.1; Perlin,
Improving noise, SIGGRAPH 2002, for the noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.hashing import pcg3d
from lichen.operation import Degrees, HardCase, Input, InputFacts, Inputs
from lichen.operations.warp import cases
from lichen.operations.warp.grids import Coordinate, Sampled
from lichen.operations.warp.maps import Doubles, Map, Recipe
from lichen.operations.warp.prediction import Size
from lichen.operations.warp.resampling import Warp, WarpParameters, declare, own_size


class Pattern(StrEnum):
    """By what pixels are displaced."""

    MAP = "map"
    RIPPLE = "ripple"
    SWIRL = "swirl"
    TAPER = "taper"
    HAZE = "haze"


class Parameters(WarpParameters):
    pattern: Pattern = Field(Pattern.MAP, description="a map, or one of the patterns")
    amplitude: float = Field(1.0, ge=-1e5, le=1e5, description="how far: px, or the factor of a map or of a taper")
    bias: float = Field(0.0, ge=-1e6, le=1e6, description="the map's value that means no displacement, such as 0.5")
    length: float = Field(32.0, gt=1e-3, le=1e6, description="of a wave, or of a cell of haze, px")
    phase: float = Field(0.0, ge=-1e6, le=1e6, description="of a ripple, or the height of the haze, in whole periods")
    angle: Degrees = Field(90.0, ge=-1e5, le=1e5, description="of a swirl at its centre")
    reach: float | None = Field(
        None,
        ge=1e-3,
        le=1e6,
        description="where a swirl ends (half the smaller side if left out), or a ripple fades, px",
    )
    centre: tuple[float, float] = Field((0.5, 0.5), description="shares of width and height")
    seed: int = Field(0, ge=0, le=2**32 - 1, description="of the haze")
    octaves: int = Field(1, ge=1, le=12, description="of the haze: noises of ever smaller cells that are added")
    lacunarity: float = Field(2.0, ge=1, le=8, description="from one octave's frequency to the next one's")
    gain: float = Field(0.5, ge=0, le=1, description="from one octave's amplitude to the next one's")


@dataclass(frozen=True)
class Octave:
    """One noise of a haze: frequency over that of the first, shift of its lattice, share, and the seeds of x and y."""

    frequency: float
    shift: tuple[float, float]
    share: float
    seeds: tuple[int, int]

    @property
    def numbers(self) -> tuple[float, ...]:
        return self.frequency, *self.shift, self.share, *self.seeds


def octaves(p: Parameters) -> tuple[Octave, ...]:
    """The first is not shifted; the others are, so that they do not share the zeros of their lattices."""
    total = math.fsum(p.gain**k for k in range(p.octaves))
    made = []
    for k in range(p.octaves):
        own, right, down = (int(each[0]) for each in pcg3d(p.seed, k, 0x5BD1E995)) if k else (p.seed, 0, 0)
        shift = right / 2**32, down / 2**32
        made.append(Octave(p.lacunarity**k, shift, p.gain**k / total, (own, own ^ 0x9E3779B9)))
    return tuple(made)


def _quintic(t: Doubles) -> Doubles:
    made: Doubles = t * t * t * (t * (t * 6 - 15) + 10)
    return made


def gradient_noise(x: Doubles, y: Doubles, seed: int) -> Doubles:
    """Gradient noise of unit cells, in [-1, 1]: 0 at whole numbers, its gradients there unit vectors by hash."""
    cell_x, cell_y = np.floor(x), np.floor(y)
    fx, fy = x - cell_x, y - cell_y
    column, row = cell_x.astype(np.int64), cell_y.astype(np.int64)
    corner = {}
    for j in (0, 1):
        for i in (0, 1):
            hashed = pcg3d((column + i) & 0xFFFFFFFF, (row + j) & 0xFFFFFFFF, seed)[0]
            turn = hashed.astype(np.float64) * (2 * math.pi / 2**32)
            corner[i, j] = np.cos(turn) * (fx - i) + np.sin(turn) * (fy - j)
    across, down = _quintic(fx), _quintic(fy)
    upper = corner[0, 0] + across * (corner[1, 0] - corner[0, 0])
    lower = corner[0, 1] + across * (corner[1, 1] - corner[0, 1])
    made: Doubles = math.sqrt(2) * (upper + down * (lower - upper))
    return made


class Displaced(Map):
    """A pattern about a centre in an image of (width, height)."""

    def __init__(self, p: Parameters, size: Size) -> None:
        self.p, self.size = p, size

    def recipe(self) -> Recipe:
        p, (width, height) = self.p, self.size
        reach = p.reach or (min(width, height) / 2 if p.pattern is Pattern.SWIRL else math.inf)
        start = list(Pattern).index(p.pattern), p.centre[0] * width, p.centre[1] * height
        haze = [number for octave in octaves(p) for number in octave.numbers]
        numbers = p.amplitude, p.length, p.phase, p.angle / 360, reach, height, p.octaves
        return Recipe("warp/displace.cl", [*start, *numbers, *haze])

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        p, (width, height) = self.p, self.size
        cx, cy = p.centre[0] * width, p.centre[1] * height
        dx, dy = u - cx, v - cy
        match p.pattern:
            case Pattern.RIPPLE:
                r = np.hypot(dx, dy)
                turns = r / p.length - p.phase
                wave = p.amplitude * np.sin(2 * math.pi * (turns - np.rint(turns)))
                if p.reach is not None:
                    wave = wave * np.exp(-r / p.reach)
                along = [np.divide(d, r, out=np.zeros(r.shape), where=r > 0) for d in np.broadcast_arrays(dx, dy)]
                return u + wave * along[0], v + wave * along[1]
            case Pattern.SWIRL:
                reach = p.reach or min(width, height) / 2
                share = np.maximum(1 - np.hypot(dx, dy) / reach, 0)
                turn = math.radians(p.angle) * share * share
                c, s = np.cos(turn), np.sin(turn)
                return cx + c * dx - s * dy, cy + s * dx + c * dy
            case Pattern.TAPER:
                wide = 1 + p.amplitude * (v / height)
                ahead = np.where(wide > 0, wide, np.nan)
                return cx + dx / ahead, v + 0 * u
            case _:
                x, y = np.broadcast_arrays(u / p.length, v / p.length + p.phase)
                moved = [np.zeros_like(x), np.zeros_like(x)]
                for each in octaves(p):
                    a, b = x * each.frequency + each.shift[0], y * each.frequency + each.shift[1]
                    for sum_, seed in zip(moved, each.seeds, strict=True):
                        sum_ += each.share * gradient_noise(a, b, seed)
                return u + p.amplitude * moved[0], v + p.amplitude * moved[1]


def _map(p: Parameters, inputs: Inputs) -> Map:
    image = inputs["image"]
    if p.pattern is not Pattern.MAP:
        return Displaced(p, (image.width, image.height))
    both = Coordinate(p.amplitude, bias=p.bias, own=1.0)
    return Sampled(inputs["map"].pixels, both, both)


def _size(p: Parameters, facts: InputFacts) -> Size:
    return (
        (facts["map"].width, facts["map"].height) if p.pattern is Pattern.MAP and "map" in facts else own_size(p, facts)
    )


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image = facts["image"]
    if p.pattern is not Pattern.MAP:
        return [Flaw("/inputs/map", f"is not read by {p.pattern}")] if "map" in facts else []
    if "map" not in facts:
        return [Flaw("/inputs/map", "is required; name a pattern to do without")]
    given = facts["map"]
    flaws = []
    if (given.width, given.height) != (image.width, image.height):
        flaws.append(Flaw("/inputs/map", f"is {given.width}x{given.height}, and image {image.width}x{image.height}"))
    if (p.width or image.width, p.height or image.height) != (image.width, image.height):
        flaws.append(Flaw("/parameters/width", "the result of a map has the image's size"))
    return flaws


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    if _size(p, facts) != (image.width, image.height):
        return None
    if p.pattern is Pattern.SWIRL:
        return "the angle is 0" if p.angle == 0 else None
    nothing = p.amplitude == 0 and not (p.pattern is Pattern.MAP and facts["map"].extent.nonfinite)
    return "the amplitude is 0" if nothing else None


displace = declare(
    Warp[Parameters](_map, _size),
    name="displace",
    summary="Displaces every pixel by a map, or by a ripple, swirl, taper, or a haze of one octave or more.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "what is displaced"),
        Input("map", "x and y of every pixel's displacement", (2, 4), required=False, picture=False),
    ),
    check=_check,
    identity=_identity,
    examples=(
        {"pattern": "ripple", "amplitude": 2.5, "length": 11, "phase": 0.2, "reach": 30, "border": "reflect"},
        {"pattern": "swirl", "angle": 140},
        {"pattern": "taper", "amplitude": -0.7, "border": "clamp"},
        {"pattern": "haze", "amplitude": 3, "length": 9, "seed": 5, "border": "reflect101"},
    ),
    hard_cases=(
        HardCase(
            name="centre of a ripple",
            why="the direction of nothing: 0 / 0",
            inputs=lambda: {"image": np.full((15, 15, 2), 0.7, np.float32)},
            parameters={"pattern": "ripple", "amplitude": 3, "length": 4, "border": "clamp"},
            holds=cases.stays_constant,
        ),
        HardCase(
            name="taper to a point",
            why="rows of no width, and rows behind it",
            inputs=cases.constant,
            parameters={"pattern": "taper", "amplitude": -2},
            holds=cases.constant_or_background,
        ),
    ),
)
