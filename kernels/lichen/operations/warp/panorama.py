"""Panorama: an image of all directions, from any chart of the sphere to any other, turned as wanted.

Truth: every pixel of the result is a direction of its chart `to`; turned by yaw (about the upright axis, to the right),
pitch (up) and roll (clockwise), in that order from the outside, it is looked up in the image, which is a chart `of` the
same sphere, and resampled as all warps are (see `lichen.operations.warp.reference`). The charts stand in
`lichen.operations.warp.charts`.

Footprints are taken in the chart that a pixel's middle lies in, so that no edge of a cube and no seam makes one an
image wide. Before it is sampled, every chart of the image gets a margin with what its neighbours show there, bilinear:
a quarter of its width for faces and discs. A lat-long image goes around, and on over its poles. Of a mirror ball, which
shows one direction all around its rim, samples that lie wholly inside the rim count, and those are repeated outwards;
what a fisheye does not see is background.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.operation import Border, Degrees, HardCase, InputFacts, Inputs
from lichen.operations.warp import cases
from lichen.operations.warp.charts import FACES, LAYOUT, NOTHING, SHAPE, Chart, Sphere, Vectors
from lichen.operations.warp.kernels import BILINEAR
from lichen.operations.warp.maps import Doubles, Map, Places, Recipe, folded_difference
from lichen.operations.warp.prediction import Size
from lichen.operations.warp.reference import Closed, Source, interpolate
from lichen.operations.warp.resampling import Warp, WarpParameters, declare


class Parameters(WarpParameters):
    source: Chart = Field(Chart.LATLONG, description="what the image is")
    target: Chart = Field(Chart.CUBE, description="what the result is")
    view: float = Field(180.0, ge=1, le=360, description="across a fisheye", json_schema_extra={"unit": "deg"})
    yaw: Degrees = Field(0.0, ge=-1e5, le=1e5, description="how far to the right to look")
    pitch: Degrees = Field(0.0, ge=-1e5, le=1e5, description="how far up")
    roll: Degrees = Field(0.0, ge=-1e5, le=1e5, description="how far to tilt clockwise")

    @property
    def turn(self) -> Doubles:
        """The matrix from directions of the result to directions of the image."""
        yaw, pitch, roll = (math.radians(each) for each in (self.yaw, self.pitch, self.roll))
        c, s = math.cos(roll), math.sin(roll)
        tilted = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        c, s = math.cos(pitch), math.sin(pitch)
        raised = np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])
        c, s = math.cos(yaw), math.sin(yaw)
        made: Doubles = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ raised @ tilted
        return made


def _cell(chart: Chart, size: Size) -> Size:
    """Width and height of one chart of an image."""
    across, down = LAYOUT[chart]
    return size[0] // across, size[1] // down


def _margin(chart: Chart, size: Size) -> int:
    """Samples put around each chart of an image."""
    return 0 if chart in (Chart.LATLONG, Chart.FISHEYE) else max(8, min(_cell(chart, size)) // 4)


def widened(source: Source, sphere: Sphere) -> Source:
    """The image with a margin around each of its charts."""
    height, width, channels = source.pixels.shape
    chart = sphere.chart
    margin = _margin(chart, (width, height))
    if margin == 0:
        border = Closed.SPHERE if chart is Chart.LATLONG else Border.CLAMP
        return Source(source.pixels, border, source.value)
    across, down = LAYOUT[chart]
    wide, tall = _cell(chart, (width, height))
    canvas = np.empty((down * (tall + 2 * margin), across * (wide + 2 * margin), channels), source.pixels.dtype)
    s = (2 * (np.arange(wide + 2 * margin) - margin + 0.5) / wide - 1)[np.newaxis, :]
    t = (2 * (np.arange(tall + 2 * margin) - margin + 0.5) / tall - 1)[:, np.newaxis]
    s, t = np.broadcast_arrays(s, t)
    for face in range(across * down):
        row, column = divmod(face, across)
        part = canvas[row * (tall + 2 * margin) :, column * (wide + 2 * margin) :][
            : tall + 2 * margin, : wide + 2 * margin
        ]
        own = source.pixels[row * tall : (row + 1) * tall, column * wide : (column + 1) * wide]
        part[margin : margin + tall, margin : margin + wide] = own
        outside = _outside(sphere, s, t, (wide, tall))
        if FACES.get(chart, ())[face : face + 1] == (NOTHING,):
            part[outside] = source.value  # nobody looks there
        else:
            part[outside] = _shown(source, sphere, s[outside], t[outside], face, (wide, tall))
    return Source(canvas, Border.CLAMP, source.value)


def _outside(sphere: Sphere, s: Doubles, t: Doubles, cell: Size) -> Doubles:
    """Which samples at (s, t) of a chart show something else: those beyond its edge, and of a mirror ball also those
    that the rim crosses, which in a photograph show what stands around the ball, too."""
    if sphere.chart is not Chart.MIRROR_BALL or min(cell) < 3:
        return ~sphere.holds(s, t)
    made: Doubles = np.hypot(np.abs(s) + 1 / cell[0], np.abs(t) + 1 / cell[1]) > 1
    return made


def _shown(source: Source, sphere: Sphere, s: Doubles, t: Doubles, face: int, cell: Size) -> Doubles:
    """What other charts show at places beyond the edge of one, no nearer than half a sample to their own edges; of a
    ball, what it shows a little inside its rim."""
    if sphere.chart is Chart.MIRROR_BALL:
        # three quarters of a sample inside, where one of the neighbours at least is not crossed by the rim
        inward = (1 - (1.5 if min(cell) >= 3 else 1) / min(cell)) / np.hypot(s, t)
        s, t, at = s * inward, t * inward, np.zeros_like(s)
    else:
        d = sphere.direction(s, t, np.full_like(s, face))
        at = sphere.face(d)
        s, t = sphere.place(d, at)
        if sphere.chart is Chart.PARABOLOID:
            inward = np.minimum(1, (1 - 1 / min(cell)) / np.maximum(np.hypot(s, t), 1e-300))
            s, t = s * inward, t * inward
    (wide, tall), (across, _) = cell, LAYOUT[sphere.chart]
    x, y = np.clip((s + 1) / 2 * wide, 0.5, wide - 0.5), np.clip((t + 1) / 2 * tall, 0.5, tall - 0.5)
    x, y = x + at % across * wide, y + at // across * tall
    # Of the neighbours, only those that belong to a chart count: what lies around a disc shows nothing.
    height, width, _ = source.pixels.shape
    own_s = 2 * ((np.arange(width) + 0.5) % wide) / wide - 1
    own_t = 2 * ((np.arange(height) + 0.5) % tall) / tall - 1
    own_s, own_t = np.broadcast_arrays(own_s[np.newaxis, :], own_t[:, np.newaxis])
    held = ~_outside(sphere, own_s, own_t, cell)[..., np.newaxis]
    shown = interpolate(Source(np.where(held, source.pixels, 0.0), Border.CLAMP, 0.0), x, y, BILINEAR)
    share = interpolate(Source(held.astype(np.float64), Border.CLAMP, 0.0), x, y, BILINEAR)
    return np.where(share > 0, shown / np.where(share > 0, share, 1.0), source.value)


class Turned(Map):
    """From the pixels of one image of the sphere to those of another, whose charts have margins."""

    def __init__(self, p: Parameters, source: Size, target: Size) -> None:
        self.source, self.target = Sphere(p.source, p.view), Sphere(p.target, p.view)
        self.turn, self.cell, self.margin = p.turn, _cell(p.source, source), _margin(p.source, source)
        self.tile = _cell(p.target, target)
        if p.source is Chart.LATLONG:
            self.periods = float(source[0]), math.inf

    def recipe(self) -> Recipe:
        charts, own, target = list(Chart), self.source, self.target
        start = charts.index(own.chart), charts.index(target.chart), LAYOUT[own.chart][0], *LAYOUT[target.chart]
        view = own.view / 720
        faces = [(*FACES.get(each.chart, ()), *[NOTHING] * 12)[:12] for each in (own, target)]
        cells = [faces[0].index(each) if each in faces[0] else 0 for each in range(NOTHING)]
        sizes = *self.cell, self.margin, *self.tile
        return Recipe("warp/panorama.cl", [*start, *sizes, view, *self.turn.ravel(), *faces[0], *faces[1], *cells])

    def directions(self, u: Doubles, v: Doubles, face: Doubles) -> Vectors:
        """In the image, of places of the result in a face of its chart."""
        (wide, tall), (across, _) = self.tile, LAYOUT[self.target.chart]
        s, t = 2 * (u - face % across * wide) / wide - 1, 2 * (v - face // across * tall) / tall - 1
        d = np.stack(np.broadcast_arrays(*self.target.direction(s, t, face)))
        x, y, z = np.einsum("ij,j...->i...", self.turn, d)
        return x, y, z

    def _faces(self, u: Doubles, v: Doubles) -> Doubles:
        across, down = LAYOUT[self.target.chart]
        column = np.clip(np.floor(u / self.tile[0]), 0, across - 1)
        face: Doubles = np.clip(np.floor(v / self.tile[1]), 0, down - 1) * across + column
        return face.astype(np.int64)

    def _seen(self, d: Vectors, face: Doubles) -> tuple[Doubles, Doubles]:
        s, t = self.source.place(d, face)
        (wide, tall), (across, _) = self.cell, LAYOUT[self.source.chart]
        x = (s + 1) / 2 * wide + self.margin + face % across * (wide + 2 * self.margin)
        y = (t + 1) / 2 * tall + self.margin + face // across * (tall + 2 * self.margin)
        return x, y

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        u, v = np.broadcast_arrays(u, v)
        d = self.directions(u, v, self._faces(u, v))
        x, y = self._seen(d, self.source.face(d))
        return self._shown(d, u, v, x), self._shown(d, u, v, y)

    def _shown(self, d: Vectors, u: Doubles, v: Doubles, values: Doubles) -> Doubles:
        """NaN where the result's chart holds no direction, or the image's does not see it."""
        face = self._faces(u, v)
        (wide, tall), (across, _) = self.tile, LAYOUT[self.target.chart]
        s, t = 2 * (u - face % across * wide) / wide - 1, 2 * (v - face // across * tall) / tall - 1
        held = self.target.holds(s, t, face)
        if self.source.chart is Chart.FISHEYE:
            held = held & self.source.holds(*self.source.place(d, self.source.face(d)))
        return np.where(held, values, np.nan)

    def places(self, u: Doubles, v: Doubles) -> Places:
        u, v = np.broadcast_arrays(u[np.newaxis, :], v[:, np.newaxis])
        faces = self._faces(u, v)
        middle = self.directions(u, v, faces)
        chart = self.source.face(middle)
        x, y = self.at(u, v)
        steps = []
        with np.errstate(invalid="ignore"):
            here = self._seen(middle, chart)
            for du, dv in ((0.5, 0.0), (0.0, 0.5)):
                before = self._seen(self.directions(u - du, v - dv, faces), chart)
                after = self._seen(self.directions(u + du, v + dv, faces), chart)
                for axis in (0, 1):
                    period = self.periods[axis]
                    whole = folded_difference(after[axis] - before[axis], period)
                    ends = (after[axis] - here[axis], here[axis] - before[axis])
                    first, second = (2 * folded_difference(each, period) for each in ends)
                    some = np.where(np.isnan(whole), np.where(np.isnan(first), second, first), whole)
                    steps.append(np.where(np.isnan(some), 0.0, some))
        return Places(x, y, *steps)


class Panoramic(Warp[Parameters]):
    """Sources get margins before they are sampled."""

    def source(self, inputs: Inputs, p: Parameters) -> Source:
        return widened(super().source(inputs, p), Sphere(p.source, p.view))

    def preparing(self, p: Parameters, facts: InputFacts) -> float:
        """NumPy finds what margins show, in microseconds a pixel."""
        image = facts["image"]
        return 20.0 * image.pixels if _margin(p.source, (image.width, image.height)) else 0.0


def _size(p: Parameters, facts: InputFacts) -> Size:
    """As asked for; else the proportions of the result's chart and about as many pixels around as the image has."""
    image, (across, down) = facts["image"], SHAPE[p.target]
    around = {Chart.CUBE: 4 / 3, Chart.CUBE_PAGES: 4.0}
    whole = image.width * around.get(p.source, 1.0)
    cell = {
        Chart.LATLONG: 1 / 2,
        Chart.CUBE: 1 / 4,
        Chart.CUBE_CROSS: 1 / 4,
        Chart.CUBE_PAGES: 1 / 4,
        Chart.PARABOLOID: 1 / 2,
        Chart.MIRROR_BALL: 1,
        Chart.FISHEYE: 1 / 2,
    }
    side = max(1, round(whole * cell[p.target]))
    if p.width and not p.height:
        return p.width, max(1, p.width * down // across)
    if p.height and not p.width:
        return p.height * across // down, p.height
    return p.width or side * across, p.height or side * down


def _map(p: Parameters, inputs: Inputs) -> Turned:
    image = inputs["image"]
    return Turned(p, (image.width, image.height), WARP.extent_of(inputs, p))


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, flaws = facts["image"], []
    across, down = LAYOUT[p.source]
    if image.width % across or image.height % down:
        flaws.append(Flaw("/inputs/image", f"must be {across} x {down} charts of whole pixels"))
    width, height = _size(p, facts)
    across, down = LAYOUT[p.target]
    if width % across:
        flaws.append(Flaw("/parameters/width", f"must be a multiple of {across}, the charts across"))
    if height % down:
        flaws.append(Flaw("/parameters/height", f"must be a multiple of {down}, the charts down"))
    if image.width // LAYOUT[p.source][0] < 1 or image.height // LAYOUT[p.source][1] < 1:
        flaws.append(Flaw("/inputs/image", "is too small for its charts"))
    return flaws


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    still = p.yaw == p.pitch == p.roll == 0 and p.source is p.target and p.source in (Chart.LATLONG, Chart.CUBE)
    same = _size(p, facts) == (image.width, image.height)
    return "the chart stays and nothing is turned" if still and same else None


WARP = Panoramic(_map, _size)

panorama = declare(
    WARP,
    name="panorama",
    summary="Converts images of all directions: lat-long, cubes, mirror ball, dual paraboloid, fisheye; any to any.",
    description=__doc__ or "",
    parameters=Parameters,
    check=_check,
    identity=_identity,
    examples=(
        {"source": "latlong", "target": "fisheye", "view": 200, "pitch": 40, "width": 40, "height": 40},
        {"source": "mirror_ball", "target": "paraboloid", "yaw": 25, "width": 48, "height": 24},
        {"source": "latlong", "target": "cube", "width": 48, "height": 32, "roll": 10},
        {"source": "fisheye", "target": "latlong", "view": 190, "value": 0.1, "width": 40, "height": 20},
    ),
    hard_cases=tuple(
        HardCase(
            name=f"{source} to {target}",
            why="poles, seams, edges and rims: a constant sky stays one on all of them",
            inputs=cases.constant_of(*SHAPE[source]),
            parameters={"source": source, "target": target, "view": 360, "pitch": 90, "yaw": 45},
            holds=cases.constant_on_chart(target),
        )
        for source, target in (
            (Chart.LATLONG, Chart.CUBE),
            (Chart.CUBE, Chart.LATLONG),
            (Chart.MIRROR_BALL, Chart.LATLONG),
            (Chart.PARABOLOID, Chart.MIRROR_BALL),
            (Chart.FISHEYE, Chart.PARABOLOID),
        )
    ),
)
