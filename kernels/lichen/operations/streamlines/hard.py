"""Fields and textures that break naive line integral convolution, and what must hold for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

Inputs = Mapping[str, Any]
Maker = Callable[[], Inputs]


def _noise(height: int, width: int, channels: int = 1) -> Array:
    return np.random.default_rng(7).random((height, width, channels), dtype=np.float32)


def _field(height: int, width: int, vector: Callable[[Array, Array], tuple[Any, Any]]) -> Array:
    """Vectors as a function of the pixel centres (x, y)."""
    y, x = np.mgrid[:height, :width] + 0.5
    u, v = np.broadcast_arrays(*vector(x, y), x)[:2]
    return np.stack([u, v], axis=-1).astype(np.float32)


def _with_noise(height: int, width: int, vector: Callable[[Array, Array], tuple[Any, Any]]) -> Maker:
    return lambda: {"field": _field(height, width, vector), "texture": _noise(height, width)}


def _texture(inputs: Inputs) -> Array:
    texture: Array = inputs["texture"]
    return texture.reshape(*texture.shape[:2], -1)


def _unchanged(inputs: Inputs, result: Array) -> str | None:
    return None if np.array_equal(_texture(inputs), result, equal_nan=True) else "the texture changed"


def _constant(inputs: Inputs, result: Array) -> str | None:
    return None if (result == _texture(inputs)[0, 0]).all() else "a constant texture changed"


def _a_mean(inputs: Inputs, result: Array) -> str | None:
    """Every output is a weighted mean of texture values."""
    texture = _texture(inputs)
    if not np.isfinite(result).all():
        return f"{np.count_nonzero(~np.isfinite(result))} values are not finite"
    slack = 1e-5
    low, high = float(result.min()), float(result.max())
    inside = texture.min() - slack <= low and high <= texture.max() + slack
    return None if inside else f"values in [{low}, {high}] are no means of the texture"


def _at(row: int, column: int) -> Callable[[Inputs, Array], str | None]:
    def holds(inputs: Inputs, result: Array) -> str | None:
        if (result[row, column] != _texture(inputs)[row, column]).any():
            return "the centre does not keep its own texture value"
        return _a_mean(inputs, result)

    return holds


def _rows_kept(inputs: Inputs, result: Array) -> str | None:
    """The field runs along rows, and the texture is constant along them."""
    worst = float(np.abs(result - _texture(inputs)).max())
    return None if worst <= 1e-6 else f"a texture constant along the lines changed by {worst}"


def _stays_near(row: int, column: int, far: int) -> Callable[[Inputs, Array], str | None]:
    """One texel is NaN; lines are at most `far` long, so it must reach its own pixel and none beyond `far` + 1."""

    def holds(inputs: Inputs, result: Array) -> str | None:
        if np.isfinite(result[row, column]).any():
            return "NaN became a colour"
        rows, columns = np.nonzero(~np.isfinite(result).all(axis=2))
        spread = int(max(np.abs(rows - row).max(), np.abs(columns - column).max()))
        return None if spread <= far + 1 else f"NaN spread over {spread} px"

    return holds


def _holed() -> Inputs:
    field = _field(24, 40, lambda x, y: (1.0, 0.0))
    field[10:13, 18:20] = np.nan
    field[5, 30, 0] = np.inf
    return {"field": field, "texture": _noise(24, 40)}


def _bad_texel() -> Inputs:
    texture = _noise(24, 40)
    texture[12, 20] = np.nan
    return {"field": _field(24, 40, lambda x, y: (12.3 - y, x - 20.1)), "texture": texture}


def _striped(vector: Callable[[Array, Array], tuple[Any, Any]]) -> Maker:
    stripes = np.repeat(np.linspace(0, 1, 24, dtype=np.float32)[:, None], 40, axis=1)[:, :, None]
    return lambda: {"field": _field(24, 40, vector), "texture": stripes}


def _sized(height: int, width: int, rows: int, columns: int) -> Maker:
    return lambda: {"field": _field(height, width, lambda x, y: (y - 3, 5 - x)), "texture": _noise(rows, columns, 3)}


def _half_masked() -> Inputs:
    mask = np.ones((24, 40, 1), np.float32)
    mask[:, 20:] = 0
    return {"field": _field(24, 40, lambda x, y: (1.0, 0.0)), "texture": _noise(24, 40), "mask": mask}


def _masked_kept(inputs: Inputs, result: Array) -> str | None:
    if not np.array_equal(result[:, 20:], _texture(inputs)[:, 20:]):
        return "a masked pixel changed"
    return "nothing changed" if np.array_equal(result[:, :18], _texture(inputs)[:, :18]) else _a_mean(inputs, result)


def _turned() -> Inputs:
    """Two slices that cancel in the middle."""
    return {"field": _field(20, 30, lambda x, y: (1.0, 0.5)), "later": _field(20, 30, lambda x, y: (-1.0, -0.5)),
            "texture": _noise(20, 30)}  # fmt: skip


def _same_all_round(inputs: Inputs, result: Array) -> str | None:
    """Lines along whole rows of a periodic image: each pixel of a row is the mean of the row."""
    means = _texture(inputs).mean(axis=1, keepdims=True)
    worst = float(np.abs(result - means).max())
    return None if worst <= 1e-4 else f"a pixel is {worst:.3g} off the mean of its row"


def _still_frames(inputs: Inputs, result: Array) -> str | None:
    texture = np.concatenate([_texture(inputs)] * 3)
    return None if np.array_equal(texture, result) else "a constant texture changed"


_STEPPING = ("nearest", "euler", "rk2", "rk4", "rk45", "fastlic")
"""Methods that keep whole rows apart: positions in codes do not."""
_LONG = {"length": 60.0}
_SHORT = {"length": 6.0}

HARD_CASES = (
    HardCase("zero field", "no line exists", _with_noise(9, 13, lambda x, y: (0, 0)), _SHORT, _unchanged),
    HardCase("field of NaN", "no line exists", _with_noise(9, 13, lambda x, y: (np.nan, 1)), _SHORT, _unchanged),
    HardCase(
        "length 0", "the integral is empty", _with_noise(9, 13, lambda x, y: (y, -x)), {"length": 0.0}, _unchanged
    ),
    HardCase(
        "constant field", "every line meets the border", _with_noise(20, 30, lambda x, y: (3, -4)), _LONG, _a_mean
    ),
    HardCase("holes in the field", "lines end at NaN and infinity", _holed, _SHORT, _a_mean),
    HardCase("NaN in the texture", "it reaches only the lines through it", _bad_texel, _SHORT, _stays_near(12, 20, 6)),
    HardCase(
        "vortex on a pixel",
        "its centre has no direction",
        _with_noise(25, 25, lambda x, y: (12.5 - y, x - 12.5)),
        _SHORT,
        _at(12, 12),
    ),
    HardCase(
        "vortex between pixels",
        "closed lines much shorter than the length",
        _with_noise(24, 24, lambda x, y: (12 - y, x - 12)),
        {"length": 80.0, "kernel": "hann"},
        _a_mean,
    ),
    HardCase(
        "saddle", "neighbouring lines part", _with_noise(24, 24, lambda x, y: (x - 12.2, 11.9 - y)), _LONG, _a_mean
    ),
    HardCase(
        "source", "lines begin inside", _with_noise(25, 25, lambda x, y: (x - 12.5, y - 12.5)), _LONG, _at(12, 12)
    ),
    HardCase("sink", "lines end inside", _with_noise(24, 24, lambda x, y: (12.1 - x, 11.7 - y)), _LONG, _a_mean),
    HardCase(
        "opposed neighbours",
        "the field cancels between pixels",
        _with_noise(24, 40, lambda x, y: (np.where(x < 20, 1, -1), 0)),
        _LONG,
        _a_mean,
    ),
    HardCase(
        "vectors of 1e30 and 1e-30",
        "squares overflow and vanish",
        _striped(lambda x, y: (np.where(x < 20, 1e30, 1e-30), 0)),
        _LONG,
        _rows_kept,
        _STEPPING,
    ),
    HardCase(
        "denormal vectors",
        "a reciprocal overflows",
        _striped(lambda x, y: (1e-40, 0)),
        _LONG,
        _rows_kept,
        _STEPPING,
    ),
    HardCase("mask", "what is masked has no line", _half_masked, _SHORT, _masked_kept),
    HardCase(
        "slices that cancel",
        "there is no field half way",
        _turned,
        {"length": 6.0, "time": 0.5},
        _unchanged,
    ),
    HardCase(
        "twice round a periodic image",
        "a line is longer than the image",
        _with_noise(6, 16, lambda x, y: (2, 0)),
        {"length": 16.0, "border": "wrap"},
        _same_all_round,
        ("rk2", "rk4"),
    ),
    HardCase(
        "odd length",
        "it is no whole number of steps",
        _with_noise(9, 13, lambda x, y: (y, 6 - x)),
        {"length": 7.31},
        _a_mean,
    ),
    HardCase(
        "frames over a constant",
        "every phase sums to one",
        lambda: {"field": _field(9, 12, lambda x, y: (y, 6 - x)), "texture": np.full((9, 12, 1), 0.7, np.float32)},
        {"length": 9.0, "kernel": "ripple", "frames": 3},
        _still_frames,
    ),
    HardCase(
        "vectors of 1e30 by time",
        "one step leaves the image",
        _with_noise(24, 40, lambda x, y: (1e30 * (x - 20), -1e30)),
        {"length": 6.0, "speed": "field"},
        _a_mean,
    ),
    HardCase(
        "constant texture",
        "weights must sum to one exactly",
        lambda: {
            "field": _field(24, 40, lambda x, y: (y - 12, 20 - x)),
            "texture": np.full((24, 40, 2), 0.3, np.float32),
        },
        {"length": 33.3, "kernel": "cosine"},
        _constant,
    ),
    HardCase("one pixel", "every line leaves at once", _sized(1, 1, 1, 1), _SHORT, _a_mean),
    HardCase("one row", "no second row to interpolate", _sized(1, 70, 1, 70), _SHORT, _a_mean),
    HardCase("one column", "no second column to interpolate", _sized(70, 1, 70, 1), _SHORT, _a_mean),
    HardCase("larger texture", "positions scale", _sized(9, 14, 37, 21), _SHORT, _a_mean),
    HardCase("smaller texture", "positions scale", _sized(37, 21, 1, 2), _SHORT, _a_mean),
)
