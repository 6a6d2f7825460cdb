"""Ocio: a conversion, look or view of an OpenColorIO configuration that the caller brings.

Truth: what OpenColorIO's CPU processor makes of the picture in float32 with lossless optimisation only. `config` is one
of OpenColorIO's own by name (ocio://default, ocio://cg-config-latest, ocio://studio-config-latest, ...), the text of a
configuration, or an archive (.ocioz) of one with its files of tables, in base64. Colour goes from the space or role
`source` to `target`, by way of `looks` where they are given; or to a `view` of a `display`. `inverse` goes the other
way.

A text is data, never a reason to read the disk: configurations that name files of tables are refused, since a server
has none of the caller's but those in an archive (operation table3d takes their text), environment variables keep the
values that the text itself gives, and anchors of YAML, which can expand without end, are refused.

OpenColorIO turns NaN into a colour in places; here a pixel with NaN in any colour is NaN. Channels after the third
pass.
How far results reach and how errors carry is not known of a configuration, and stated so: any range, any factor.
There is no trade of accuracy for time here. OpenColorIO's approximate mathematics, its own default, has no stated
error; nor would a table of three dimensions made of a configuration, whose curves may bend, clip and jump anywhere
between the table's nodes. Who can judge such a table by its own pictures makes it with OpenColorIO and gives it to
table3d.

Source: OpenColorIO 2, Academy Software Foundation, opencolorio.readthedocs.io.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import PyOpenColorIO as pyocio
from pydantic import Field, field_validator

from lichen.errors import Flaw, nearest
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned_empty
from lichen.operation import (
    POINTWISE,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.colour.archive import SIGNATURE, Archive, unpacked
from lichen.processors import each

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lichen.opencl.device import Device

LONGEST = 1 << 20
"""Characters of a configuration: the largest of the Academy's has 200 thousand."""
LONGEST_ARCHIVE = 16 << 20
"""Characters of an archive, in base64."""
ANCHOR = re.compile(r"(?:^|[\s\[{,])[&*][A-Za-z0-9_]", re.MULTILINE)
BUILT_IN = "ocio://"
FLOAT_MAX = float(np.finfo(np.float32).max)
BLOCK = 1 << 16
"""Pixels that OpenColorIO is given at once."""


def _inner(transform: Any) -> Iterator[Any]:
    """A transform and all inside it."""
    if transform is None:
        return
    yield transform
    if isinstance(transform, pyocio.GroupTransform):
        for each in transform:
            yield from _inner(each)


def _transforms(config: Any) -> Iterator[Any]:
    """Every transform of a configuration."""
    to, back = pyocio.COLORSPACE_DIR_TO_REFERENCE, pyocio.COLORSPACE_DIR_FROM_REFERENCE
    spaces = config.getColorSpaces(pyocio.SEARCH_REFERENCE_SPACE_ALL, pyocio.COLORSPACE_ALL)
    for space in spaces:
        yield from _inner(space.getTransform(to))
        yield from _inner(space.getTransform(back))
    for look in config.getLooks():
        yield from _inner(look.getTransform())
        yield from _inner(look.getInverseTransform())
    for view in config.getViewTransforms():
        yield from _inner(view.getTransform(pyocio.VIEWTRANSFORM_DIR_TO_REFERENCE))
        yield from _inner(view.getTransform(pyocio.VIEWTRANSFORM_DIR_FROM_REFERENCE))
    for named in config.getNamedTransforms():
        yield from _inner(named.getTransform(pyocio.TRANSFORM_DIR_FORWARD))
        yield from _inner(named.getTransform(pyocio.TRANSFORM_DIR_INVERSE))


@dataclass(frozen=True, eq=False)
class Known:
    """A configuration, the context of its variables, and the archive that its files lie in, if it came in one."""

    config: Any
    context: Any
    archive: Archive | None = None


def _context(config: Any, archive: Archive | None) -> Any:
    """The text's own variables and none of this process; files are looked for in the archive."""
    context = pyocio.Context()
    if archive is not None:
        context.setWorkingDir(str(archive.path))
        for path in config.getSearchPaths():
            context.addSearchPath(path)
    for name in config.getEnvironmentVarNames():
        context.setStringVar(name, config.getEnvironmentVarDefault(name))
    return context


@lru_cache(maxsize=8)
def known(text: str) -> Known:
    """The configuration. Raises `ValueError` where it is none or would read the disk."""
    if text.startswith(BUILT_IN):
        name = text.removeprefix(BUILT_IN)
        offered = [entry[0] for entry in pyocio.BuiltinConfigRegistry().getBuiltinConfigs()]
        offered += ["default", "cg-config-latest", "studio-config-latest"]
        if name not in offered:
            raise ValueError(f"there is no built-in configuration {name!r}; {nearest(name, offered)}")
        config = pyocio.Config.CreateFromBuiltinConfig(text)
        return Known(config, _context(config, None))
    archive = unpacked(text) if text.startswith(SIGNATURE) else None
    plain = archive.text if archive else text
    if len(plain) > LONGEST:
        raise ValueError(f"the configuration has {len(plain)} characters, more than {LONGEST}")
    if ANCHOR.search(plain):
        raise ValueError("anchors and aliases of YAML are not read")
    try:
        config = pyocio.Config.CreateFromStream(plain)
    except pyocio.Exception as wrong:
        raise ValueError(f"is no configuration: {' '.join(str(wrong).split())[:200]}") from None
    context = _context(config, archive)
    for transform in _transforms(config):
        if isinstance(transform, pyocio.FileTransform):
            _held(transform.getSrc(), context, archive)
    return Known(config, context, archive)


def _held(source: str, context: Any, archive: Archive | None) -> None:
    """Raises `ValueError` where a file of tables is none of the archive's."""
    if archive is None:
        raise ValueError(
            f"names the file {source[:60]!r}; files are not read: give an archive, or its text to the operation table3d"
        )
    try:
        found = archive.holds(context.resolveFileLocation(source))
    except (pyocio.Exception, pyocio.ExceptionMissingFile):
        found = False
    if not found:
        raise ValueError(f"names the file {source[:60]!r}, which the archive does not hold")


def read(text: str) -> Any:
    """The configuration itself."""
    return known(text).config


class Parameters(OperationParameters):
    config: str = Field("ocio://default", max_length=LONGEST_ARCHIVE)
    """a built-in configuration as ocio://name, the text of one, or an archive (.ocioz) in base64"""
    source: str = Field("scene_linear", max_length=200)
    """the colour space, or role, of the picture's numbers"""
    target: str | None = Field(None, max_length=200)
    """the colour space or role to convert to; or give display and view"""
    looks: str | None = Field(None, max_length=500)
    """looks on the way to target, as OpenColorIO writes them: a, +b, -c"""
    display: str | None = Field(None, max_length=200)
    """the display to show it on"""
    view: str | None = Field(None, max_length=200)
    """the view of that display"""
    inverse: bool = False
    """the other way round: from the target, or the display, to source"""

    @field_validator("config")
    @classmethod
    def _readable(cls, text: str) -> str:
        read(text)
        return text


def _transform(p: Parameters) -> Any:
    way = pyocio.TRANSFORM_DIR_INVERSE if p.inverse else pyocio.TRANSFORM_DIR_FORWARD
    if p.target is None:
        return pyocio.DisplayViewTransform(src=p.source, display=p.display or "", view=p.view or "", direction=way)
    if p.looks:
        return pyocio.LookTransform(src=p.source, dst=p.target, looks=p.looks, direction=way)
    return pyocio.ColorSpaceTransform(src=p.source, dst=p.target, direction=way)


@lru_cache(maxsize=16)
def _processor(p: Parameters) -> Any:
    """OpenColorIO's for the parameters."""
    it = known(p.config)
    processor = it.config.getProcessor(it.context, _transform(p), pyocio.TRANSFORM_DIR_FORWARD)
    plain = pyocio.BIT_DEPTH_F32
    return processor.getOptimizedCPUProcessor(plain, plain, pyocio.OPTIMIZATION_LOSSLESS)


def _missing(p: Parameters) -> list[Flaw]:
    """Names that the configuration does not have."""
    config, flaws = read(p.config), []
    spaces = [*config.getColorSpaceNames(), *config.getRoleNames()]
    for field, name in (("source", p.source), ("target", p.target)):
        if name is not None and config.getColorSpace(name) is None:
            flaws.append(Flaw(f"/parameters/{field}", f"there is no colour space {name!r}; {nearest(name, spaces)}"))
    for name in re.split(r"[,:|\s]+", p.looks or ""):
        looks = list(config.getLookNames())
        if name.strip("+-") and config.getLook(name.strip("+-")) is None:
            flaws.append(Flaw("/parameters/looks", f"there is no look {name!r}; {nearest(name, looks)}"))
    if p.display is not None and p.view is not None:
        displays = list(config.getDisplays())
        views = list(config.getViews(p.display))
        if p.display not in displays:
            flaws.append(
                Flaw("/parameters/display", f"there is no display {p.display!r}; {nearest(p.display, displays)}")
            )
        elif p.view not in views:
            flaws.append(Flaw("/parameters/view", f"{p.display!r} has no view {p.view!r}; {nearest(p.view, views)}"))
    return flaws


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image = facts["image"]
    flaws = []
    if image.channels - (image.alpha is not Alpha.NONE) < 3:
        flaws.append(Flaw("/inputs/image", "must have 3 colour channels"))
    shown = p.display is not None or p.view is not None
    if (p.target is None) == (not shown):
        flaws.append(Flaw("/parameters/target", "either a target, or a display and a view: one of them is needed"))
    elif shown and (p.display is None or p.view is None):
        absent = "display" if p.display is None else "view"
        flaws.append(Flaw(f"/parameters/{absent}", "a display and a view belong together"))
    if p.looks and p.target is None:
        flaws.append(Flaw("/parameters/looks", "belong to a target; a view brings its own"))
    flaws += _missing(p)
    if not flaws:
        try:
            _processor(p)
        except (pyocio.Exception, pyocio.ExceptionMissingFile) as wrong:
            flaws.append(Flaw("/parameters/config", f"OpenColorIO: {' '.join(str(wrong).split())[:200]}"))
    return flaws


def _result(p: Parameters, facts: InputFacts) -> Facts:
    """Nothing is known of what a configuration makes."""
    image = facts["image"]
    plain = Facts(image.height, image.width, image.channels, alpha=image.alpha)
    return dataclasses.replace(plain, extent=Extent(-FLOAT_MAX, FLOAT_MAX, image.samples))


def _known(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    got = pixels.reshape(-1, 3)
    fine = np.isnan(got[0]).all() and np.isfinite(got[1:]).all() and np.allclose(got[1], got[1, 0], atol=2e-4)
    return None if fine else f"NaN must stay, and grey be grey: got {got.tolist()}"


ACES = "ocio://cg-config-v1.0.0_aces-v1.3_ocio-v2.1"
"""A configuration that every OpenColorIO 2 brings: what ocio://default is changes with its version."""

ocio = Operation(
    name="ocio",
    family="colour",
    summary="Applies a conversion, look or view of an OpenColorIO configuration.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "the picture; channels after the third pass unchanged", channels=(3, None)),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    propagate=lambda p, facts, error: FLOAT_MAX if error else 0.0,
    wants_alpha=Alpha.STRAIGHT,
    check=_check,
    examples=(
        {"config": ACES, "source": "ACEScg", "target": "ACEScct"},
        {"config": ACES, "source": "ACEScg", "display": "sRGB - Display", "view": "ACES 1.0 - SDR Video"},
    ),
    hard_cases=(
        HardCase(
            name="NaN under a logarithm",
            why="OpenColorIO's curves compare and clamp, and NaN becomes a colour",
            inputs=lambda: {
                "image": np.array([[[np.nan, 0.5, 0.1], [0.18, 0.18, 0.18], [-1, 0, 1e4]]], np.float32),
            },
            parameters={"source": "ACEScg", "target": "ACEScct"},
            holds=_known,
        ),
    ),
)


def evaluate(inputs: Inputs, p: Parameters) -> Array:
    """Float32, by OpenColorIO, in runs of pixels."""
    image = inputs["image"]
    processor = _processor(p)
    out = aligned_empty(image.pixels.shape)
    flat, made = image.pixels.reshape(-1, image.channels), out.reshape(-1, image.channels)

    def run(start: int) -> None:
        block = flat[start : start + BLOCK]
        with np.errstate(over="ignore"):
            colours = np.array(block[:, :3], np.float32, order="C")  # a copy: OpenColorIO writes into it
        bad = np.logical_or.reduce([np.isnan(colours[:, c]) for c in range(3)])
        processor.apply(pyocio.PackedImageDesc(colours, len(colours), 1, 3))
        colours[bad] = np.nan
        made[start : start + BLOCK, :3] = colours
        made[start : start + BLOCK, 3:] = block[:, 3:]

    each(run, range(0, len(flat), BLOCK))
    return out


@ocio.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return evaluate(inputs, p).astype(np.float64)


@ocio.method(
    "exact",
    error=lambda p, knob, facts: Error(0.0, "bound"),
    work=lambda p, knob, facts: facts["image"].pixels,
    rates={"opencl": Rate(2e-4, 1.2e-7), "numpy": Rate(2e-4, 1.2e-7)},
)
class Exact:
    """OpenColorIO's CPU processor on the host, with lossless optimisation only: the definition itself."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return evaluate(inputs, parameters)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return evaluate(inputs, parameters)
