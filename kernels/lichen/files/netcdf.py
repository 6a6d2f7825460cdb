"""NetCDF, classic and 4: two components of a field, or one variable, as a picture of data. Read with netCDF4.

By the CF conventions components are the pair of variables whose standard names differ in `eastward` and `northward` (or
`x` and `y`) alone; else those of usual names (`lichen.files.selection`). Their two axes of places are those that are
marked or named as longitude and latitude (or projected x and y), else the last two. Rows lie so that y grows upwards
and columns so that x grows to the right, whichever way the file has them; an axis without coordinates counts as
growing. Packed values are unpacked; fill values, missing values and values outside the valid range are NaN.

Source: NetCDF Climate and Forecast (CF) Metadata Conventions, version 1.11, sections 2.5, 3.3, 4 and 8.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lichen.errors import LichenError, UnreadableImage, UnsupportedFormat
from lichen.files import selection
from lichen.files.format import Header, data_format
from lichen.files.selection import FIRST, Selection
from lichen.image import Space, Storage
from lichen.memory import Array

SIGNATURES = (b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF\r\n\x1a\n")
_SIDES = (("eastward", "northward"), ("x_", "y_"))
_X = frozenset(("lon", "longitude", "x", "nx", "xc", "xlon", "west_east", "i"))
_Y = frozenset(("lat", "latitude", "y", "ny", "yc", "ylat", "south_north", "j"))
_ALIASES: Mapping[str, frozenset[str]] = {
    "time": frozenset(("time", "t", "valid_time", "step", "date")),
    "level": frozenset(
        ("level", "lev", "plev", "pressure", "pressure_level", "isobaricinhpa", "height", "depth", "altitude", "z")
    ),
}
_AXES = {"T": "time", "Z": "level"}


def read_header(data: memoryview, select: str = "") -> Header:
    chosen = selection.parse(select)
    try:
        import netCDF4
    except ImportError:
        raise UnsupportedFormat("NetCDF is read with netCDF4: pip install 'lichen[fields]'.") from None
    try:
        with netCDF4.Dataset("memory.nc", memory=bytes(data)) as file:
            samples = _samples(file, chosen)
    except LichenError:
        raise
    except (OSError, RuntimeError, ValueError, AttributeError, IndexError, TypeError) as error:
        raise UnreadableImage(f"The NetCDF file is damaged or incomplete: {str(error)[:120]}.") from None
    rows, columns, channels = samples.shape
    return Header("netcdf", columns, rows, channels, Storage.FLOAT32, Space.DATA, details=samples)


def _samples(file: Any, chosen: Selection) -> Array:
    fields = {name: each for name, each in file.variables.items() if each.ndim >= 2 and each.dtype.kind in "iuf"}
    if not fields:
        raise UnreadableImage("The NetCDF file has no variable of numbers over two dimensions.")
    picked = [fields[name] for name in chosen.components(list(fields), _conventional(fields))]
    names = [name for each in picked for name in each.dimensions]
    chosen.known([*dict.fromkeys([*names, *(key for name in names if (key := _alias(file, name)))])])
    return selection.picture([_plane(file, each, chosen) for each in picked])


def _conventional(fields: Mapping[str, Any]) -> tuple[str, str] | None:
    """The pair of standard names, the first in the file."""
    said = {str(getattr(each, "standard_name", "")): name for name, each in reversed(list(fields.items()))}
    for right, up in _SIDES:
        for name, variable in reversed(list(said.items())):
            other = name.replace(right, up, 1)
            if name != other and other in said:
                return variable, said[other]
    return None


def _plane(file: Any, variable: Any, chosen: Selection) -> Array:
    """Values (rows, columns) of the selection, in doubles, the first row the lowest."""
    names = variable.dimensions
    down, across = _sides(file, names)
    cut: list[Any] = []
    for position, (name, size) in enumerate(zip(names, variable.shape, strict=True)):
        if position in (down, across):
            cut.append(slice(None))
        else:
            place = chosen.places.get(name) or chosen.places.get(_alias(file, name) or "", FIRST)
            cut.append(place.among(name, size, _coordinates(file, name)))
    values = np.ma.filled(np.ma.asarray(variable[tuple(cut)]).astype(np.float64), np.nan)
    if across < down:
        values = values.T
    if _falls(file, variable, names[down], 0):
        values = values[::-1]
    return values[:, ::-1] if _falls(file, variable, names[across], 1) else values


def _sides(file: Any, names: tuple[str, ...]) -> tuple[int, int]:
    """Which dimensions run along y and x."""
    kinds = [_kind(file, name) for name in names]
    if kinds.count("x") == kinds.count("y") == 1:
        return kinds.index("y"), kinds.index("x")
    return len(names) - 2, len(names) - 1


def _kind(file: Any, name: str) -> str:
    """x, y, or nothing that is known."""
    variable = file.variables.get(name)
    said = [str(getattr(variable, key, "")).lower() for key in ("axis", "standard_name", "units")]
    if said[0] in ("x", "y"):
        return said[0]
    if said[1] in ("longitude", "projection_x_coordinate", "grid_longitude") or said[2].startswith("degrees_e"):
        return "x"
    if said[1] in ("latitude", "projection_y_coordinate", "grid_latitude") or said[2].startswith("degrees_n"):
        return "y"
    lower = name.lower()
    return "x" if lower in _X else "y" if lower in _Y else ""


def _alias(file: Any, name: str) -> str | None:
    """`time` or `level`, where a dimension is one."""
    variable = file.variables.get(name)
    marked = _AXES.get(str(getattr(variable, "axis", "")).upper())
    return marked or next((key for key, known in _ALIASES.items() if name.lower() in known), None)


def _coordinates(file: Any, name: str) -> Array | None:
    variable = file.variables.get(name)
    if variable is None or variable.dimensions != (name,) or variable.dtype.kind not in "iuf":
        return None
    return np.ma.filled(np.ma.asarray(variable[:]).astype(np.float64), np.nan)


def _falls(file: Any, variable: Any, name: str, axis: int) -> bool:
    """Whether coordinates fall along a dimension; those of two dimensions (`coordinates`), along most of it."""
    along = _coordinates(file, name)
    if along is None:
        words = ("lat", "lon")[axis]
        for each in str(getattr(variable, "coordinates", "")).split():
            found = file.variables.get(each)
            if found is not None and words in each.lower() and found.ndim >= 2:
                values = np.ma.filled(np.ma.asarray(found[(0,) * (found.ndim - 2)]).astype(np.float64), np.nan)
                steps = np.diff(values, axis=axis)
                return bool(np.count_nonzero(steps < 0) > np.count_nonzero(steps > 0))
        return False
    return bool(along.size > 1 and along[-1] < along[0])


netcdf = data_format(
    name="netcdf",
    media_types=("application/x-netcdf", "application/netcdf"),
    extensions=(".nc", ".nc4", ".cdf"),
    recognises=lambda head: head.startswith(SIGNATURES),
    read_header=read_header,
    modules=("netCDF4",),
)
