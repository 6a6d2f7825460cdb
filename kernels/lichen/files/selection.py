"""What is read of a data file that holds more than one picture.

Text of `key=value` parts between commas, as in `u=u10,v=v10,time=3,level=@850`:

* `u` and `v` name the variables of the components to the right and upwards; `u` alone makes one channel of it. Without
  either, what the format's conventions call components of a vector is taken.
* Any other key is a dimension, by its name or as `time` or `level`: an index, from 0, or from the end where negative;
  or, behind an @, a coordinate, of which the nearest is taken. A dimension that is not mentioned is read at its first
  place.
* A part may begin with the name of an input and a dot, `later.time=4`, and then holds for that input alone.

How both formats lie in a picture: y runs upwards in data and down in pictures, so rows are turned where they must be
until the top is up, and v changes its sign. What is missing is NaN. Samples are kept as float32.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lichen.errors import Flaw, InvalidRequest, UnreadableImage, nearest
from lichen.memory import Array

_PART = re.compile(r"(?P<key>[^=,@]+)=(?P<at>@?)(?P<value>[^=,@]+)")
PAIRS = (
    ("u", "v"),
    ("u10", "v10"),
    ("uwnd", "vwnd"),
    ("ugrd", "vgrd"),
    ("uo", "vo"),
    ("uas", "vas"),
    ("ua", "va"),
    ("water_u", "water_v"),
    ("vx", "vy"),
)
"""Names by which components go, in the order in which they are looked for; capitals and small letters are alike."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where along a dimension: an index, or the nearest to a coordinate."""

    index: int | None
    coordinate: float = 0.0

    def among(self, name: str, size: int, coordinates: Array | None) -> int:
        """The index of `size` places. Raises `InvalidRequest` where there is none."""
        if self.index is not None:
            if not -size <= self.index < size:
                raise _unfit(f"{name} has {size} places, from 0 to {size - 1}, and none {self.index}")
            return self.index % size
        if coordinates is None or coordinates.shape != (size,) or not np.isfinite(coordinates).all():
            raise _unfit(f"{name} has no coordinates to find @{self.coordinate:g} among; give an index")
        return int(np.argmin(np.abs(coordinates - self.coordinate)))


FIRST = Place(0)


@dataclass(frozen=True, slots=True)
class Selection:
    u: str | None
    v: str | None
    places: Mapping[str, Place]

    def known(self, dimensions: Sequence[str]) -> None:
        """Raises `InvalidRequest` for a dimension that the data have not."""
        wrong = [each for each in self.places if each not in dimensions]
        if wrong:
            raise _unfit(*(f"{each} is no dimension to choose along; {nearest(each, dimensions)}" for each in wrong))

    def components(self, names: Sequence[str], conventional: tuple[str, str] | None = None) -> tuple[str, ...]:
        """The variables to read, of those with these names: as asked, by the convention, or by their names."""
        if self.u is None and self.v is not None:
            raise _unfit("v needs u beside it; u alone makes one channel")
        if self.u is not None:
            asked = (self.u,) if self.v is None else (self.u, self.v)
            wrong = [each for each in asked if each not in names]
            if wrong:
                raise _unfit(*(f"{each} is no variable; {nearest(each, names)}" for each in wrong))
            return asked
        if conventional is not None:
            return conventional
        lower = {each.lower(): each for each in reversed(names)}
        pair = next((pair for pair in PAIRS if pair[0] in lower and pair[1] in lower), None)
        if pair is None:
            raise _unfit(f"nothing here is called like the components of a vector; name u and v of {', '.join(names)}")
        return lower[pair[0]], lower[pair[1]]


def parse(text: str) -> Selection:
    """The selection for one input. Raises `InvalidRequest`.

    >>> parse("u=u10,v=v10,time=3,level=@850")
    Selection(u='u10', v='v10', places={'time': Place(index=3, coordinate=0.0), 'level': Place(index=None, \
coordinate=850.0)})
    """
    names: dict[str, str] = {}
    places: dict[str, Place] = {}
    for key, at, value in _parts(text):
        if key in names or key in places:
            raise _unfit(f"{key} is given more than once")
        if key in ("u", "v") and not at:
            names[key] = value
        else:
            places[key] = _place(key, at, value)
    return Selection(names.get("u"), names.get("v"), places)


def check(text: str) -> str:
    """The text, whose parts may be for inputs of any name. Raises `InvalidRequest`."""
    for key, at, value in _parts(text):
        if key.rpartition(".")[2] not in ("u", "v"):
            _place(key, at, value)
    return text


def for_input(text: str, name: str, names: Sequence[str]) -> str:
    """The part of a selection that holds for the input `name` of `names`.

    >>> for_input("time=3,later.level=1,mask.u=land", "later", ["field", "later", "mask"])
    'time=3,level=1'
    """
    kept: dict[str, str] = {}
    own: dict[str, str] = {}
    for key, at, value in _parts(text):
        before, dot, after = key.partition(".")
        if not dot or before not in names:
            kept[key] = f"{at}{value}"
        elif before == name:
            own[after] = f"{at}{value}"
    return ",".join(f"{key}={value}" for key, value in (kept | own).items())


def _parts(text: str) -> Iterator[tuple[str, str, str]]:
    for part in text.split(",") if text else ():
        match = _PART.fullmatch(part.strip())
        if match is None:
            raise _unfit(f"{part[:60]!r} is not of the form key=value")
        yield match["key"].strip(), match["at"], match["value"].strip()


def _place(key: str, at: str, value: str) -> Place:
    try:
        place = Place(None, float(value)) if at else Place(int(value))
    except ValueError:
        raise _unfit(f"{key}={at}{value} is neither an index nor @ and a coordinate") from None
    if not np.isfinite(place.coordinate):
        raise _unfit(f"{key}={at}{value} is not finite")
    return place


def picture(planes: Sequence[Array]) -> Array:
    """Channels of components (rows, columns) whose first row is the lowest: float32, the first row on top, y down; what
    float32 cannot hold is NaN. Raises `UnreadableImage` where they are of different sizes."""
    if len({plane.shape for plane in planes}) > 1:
        sizes = " and ".join("x".join(map(str, plane.shape[::-1])) for plane in planes)
        raise UnreadableImage(f"The components are of {sizes} places: they do not lie in the same ones.")
    with np.errstate(over="ignore"):
        made = np.stack(planes, axis=-1)[::-1].astype(np.float32)
    made[~np.isfinite(made)] = np.nan
    if made.shape[2] == 2:
        made[:, :, 1] *= -1
    return made


def _unfit(*reasons: str) -> InvalidRequest:
    return InvalidRequest("The selection does not fit the file.", [Flaw("/query/select", each) for each in reasons])
