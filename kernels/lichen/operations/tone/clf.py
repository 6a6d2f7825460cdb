"""The Academy / ASC Common LUT Format, read safely into a chain of steps.

A document is a ProcessList of nodes that colour passes in order. Read are Matrix, LUT1D, LUT3D, Range, Exponent, Log
and ASC_CDL, in all their styles; descriptions are passed over. Bit depths scale what integers mean: everything is
brought to 1 at the largest code. With halfDomain a LUT1D has an entry for every half-precision number and is linear
between them; those of infinities and NaN are not used: what is infinite is held to the largest half, and NaN stays.
With rawHalfs entries are the bits of such numbers. Before version 3 a table may have an IndexMap, which says at which
numbers its entries lie; version 3 has dropped it.

XML is read by expat with its handlers alone: a document type, and with it every entity, is refused before anything of
it is expanded, as is text longer than a table could be. What is wrong is named with its node and line.

Sources: AMPAS S-2014-006 and Common LUT Format Implementation Guide, version 3, 2021; ASC CDL 1.2, 2008.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from xml.parsers import expat

import numpy as np

from lichen.memory import Array
from lichen.operations.tone.chain import HALVES, Chain, Curves, HalfTable, Matrix, Step, Table1, Table3
from lichen.operations.tone.clf_styles import PLAIN, asc_cdl, exponent, indexed, logarithm, ranged
from lichen.operations.tone.cube import LARGEST, LONGEST

DEPTHS = {"8i": 255.0, "10i": 1023.0, "12i": 4095.0, "16i": 65535.0, "16f": 1.0, "32f": 1.0}
MOST_NODES = 32
LONGEST_TABLE = 1 << 16
"""Entries of a LUT1D."""
NUMBER = 1e9
"""The largest number taken."""
PASSED = ("Description", "InputDescriptor", "OutputDescriptor", "Info")


@dataclass
class Element:
    """An element with its attributes, text, children and the line it starts on."""

    name: str
    attributes: Mapping[str, str]
    line: int
    text: list[str] = field(default_factory=list)
    children: list[Element] = field(default_factory=list)

    def child(self, name: str) -> Element | None:
        return next((each for each in self.children if each.name == name), None)


def _tree(text: str) -> Element:
    """The document's elements. Raises `ValueError`."""
    if len(text) > LONGEST:
        raise ValueError(f"the text has {len(text)} characters, more than {LONGEST}")
    parser = expat.ParserCreate()
    root = Element("", {}, 0)
    open_: list[Element] = [root]

    def start(name: str, attributes: dict[str, str]) -> None:
        if len(open_) > 6:
            raise ValueError(f"line {parser.CurrentLineNumber}: elements are nested too deep")
        made = Element(name.rsplit(":", 1)[-1], attributes, parser.CurrentLineNumber)
        open_[-1].children.append(made)
        open_.append(made)

    def refuse(*_: object) -> None:
        raise ValueError(f"line {parser.CurrentLineNumber}: a document type, which a CLF has no use for")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda name: open_.pop()
    parser.CharacterDataHandler = lambda data: open_[-1].text.append(data)
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as wrong:
        raise ValueError(f"is no XML: {wrong}") from None
    return root.children[0]


@dataclass(frozen=True)
class Node:
    """A process node and its place, with the readers that name it when something is wrong."""

    element: Element
    number: int
    version: float = 3.0
    """of the format"""

    def wrong(self, what: str) -> ValueError:
        return ValueError(f"node {self.number} ({self.element.name}, line {self.element.line}): {what}")

    def attribute(self, name: str, otherwise: str) -> str:
        return self.element.attributes.get(name, otherwise)

    def scale(self, which: str) -> float:
        depth = self.attribute(which, "")
        if depth not in DEPTHS:
            raise self.wrong(f"{which} is {depth!r}; it must be one of {', '.join(DEPTHS)}")
        return DEPTHS[depth]

    def numbers(self, text: str, count: int, what: str, *, finite: bool = True) -> list[float]:
        words = text.split()
        try:
            made = [float(word) for word in words]
        except ValueError:
            raise self.wrong(f"{what} holds what is no number") from None
        if len(made) != count:
            raise self.wrong(f"{what} holds {len(made)} numbers and must hold {count}")
        if finite and not all(math.isfinite(each) and abs(each) <= NUMBER for each in made):
            raise self.wrong(f"{what} holds a number that is not finite or beyond {NUMBER:g}")
        return made

    def number_of(self, values: Mapping[str, str], name: str, otherwise: float | None = None) -> float:
        if name not in values:
            if otherwise is None:
                raise self.wrong(f"needs {name}")
            return otherwise
        return self.numbers(values[name], 1, name)[0]

    def text_of(self, name: str) -> str | None:
        child = self.element.child(name)
        return "".join(child.text) if child else None

    def array(self, sizes: Callable[[list[int]], int], *, finite: bool = True) -> tuple[list[int], Array]:
        """The Array's dimensions and numbers; `sizes` checks the former and returns how many numbers there are."""
        child = self.element.child("Array")
        if child is None:
            raise self.wrong("has no Array")
        dimensions = [int(each) for each in child.attributes.get("dim", "").split() if each.isdecimal()]
        count = sizes(dimensions)
        if not count:
            raise self.wrong(f"Array has dim {child.attributes.get('dim', '')!r}, which does not fit")
        return dimensions, np.array(self.numbers("".join(child.text), count, "Array", finite=finite))


def _matrix(node: Node) -> list[Step]:
    def sizes(dim: list[int]) -> int:
        return dim[0] * dim[1] if dim[:2] in ([3, 3], [3, 4]) and dim[2:] in ([], [3]) else 0

    dimensions, numbers = node.array(sizes)
    given, made = node.scale("inBitDepth"), node.scale("outBitDepth")
    rows = numbers.reshape(3, dimensions[1]) / made
    added = rows[:, 3] if dimensions[1] == 4 else np.zeros(3)
    factors = tuple(tuple(map(float, row)) for row in rows[:, :3] * given)
    return [Matrix(factors, tuple(map(float, added)))]


def _placed(node: Node, size: int) -> list[Step]:
    """What IndexMaps do, one for all channels or one for each: from a number to its place, 1 at the last entry."""
    maps = [each for each in node.element.children if each.name == "IndexMap"]
    if not maps:
        return []
    if node.version >= 3:
        raise node.wrong("version 3 of the format has no IndexMap")
    curves = []
    for each in maps:
        pairs = [pair.split("@") for pair in "".join(each.text).split()]
        if len(pairs) < 2 or any(len(pair) != 2 for pair in pairs):
            raise node.wrong("IndexMap must hold two pairs or more, as 64@0 940@1023")
        flat = node.numbers(" ".join(itertools.chain.from_iterable(pairs)), 2 * len(pairs), "IndexMap")
        places = [
            (x / node.scale("inBitDepth"), place / (size - 1)) for x, place in zip(flat[::2], flat[1::2], strict=True)
        ]
        if not all(0 <= place <= 1 for _, place in places):
            raise node.wrong(f"IndexMap names a place outside of 0 to {size - 1}")
        try:
            curves.append(indexed(places))
        except ValueError as wrong:
            raise node.wrong(str(wrong)) from None
    if len(curves) not in (1, 3):
        raise node.wrong("has 1 IndexMap for all channels or 3")
    first, second, third = curves * 3 if len(curves) == 1 else curves
    return [Curves((first, second, third))]


def _lut1d(node: Node) -> list[Step]:
    if node.attribute("interpolation", "linear") not in ("linear", "default"):
        raise node.wrong("interpolation must be linear")
    half = node.attribute("halfDomain", "false") == "true"

    def sizes(dim: list[int]) -> int:
        fits = len(dim) == 2 and 2 <= dim[0] <= LONGEST_TABLE and dim[1] in (1, 3)
        return dim[0] * dim[1] if fits and (dim[0] == LONGEST_TABLE or not half) else 0

    raw = node.attribute("rawHalfs", "false") == "true"
    dimensions, numbers = node.array(sizes, finite=not half)
    if raw:
        if not ((numbers >= 0) & (numbers < LONGEST_TABLE) & (numbers == np.floor(numbers))).all():
            raise node.wrong("rawHalfs are whole numbers from 0 to 65535")
        numbers = numbers.astype(np.uint16).view(np.float16).astype(np.float64)
    table = np.broadcast_to(numbers.reshape(dimensions) / node.scale("outBitDepth"), (dimensions[0], 3)).T
    node.scale("inBitDepth")
    used = table.reshape(3, 2, -1)[..., :HALVES] if half else table
    if not np.isfinite(used).all():
        raise node.wrong("Array holds a number that is not finite")
    if not half:
        return [*_placed(node, dimensions[0]), Table1(np.ascontiguousarray(used))]
    if node.element.child("IndexMap") is not None:
        raise node.wrong("halfDomain says where entries lie: it has no IndexMap")
    return [HalfTable(np.ascontiguousarray(used))]


def _lut3d(node: Node) -> list[Step]:
    if node.attribute("rawHalfs", "false") == "true" or node.attribute("halfDomain", "false") == "true":
        raise node.wrong("halfDomain and rawHalfs belong to a LUT1D")
    interpolation = node.attribute("interpolation", "trilinear")
    if interpolation not in ("trilinear", "linear", "default", "tetrahedral"):
        raise node.wrong(f"interpolation is {interpolation!r}; it must be trilinear or tetrahedral")

    def sizes(dim: list[int]) -> int:
        fits = len(dim) == 4 and 2 <= dim[0] <= LARGEST and dim[:3] == [dim[0]] * 3 and dim[3] == 3
        return 3 * dim[0] ** 3 if fits else 0

    dimensions, numbers = node.array(sizes)
    node.scale("inBitDepth")
    by_red = numbers.reshape(dimensions) / node.scale("outBitDepth")  # blue is fastest in a CLF
    table = Table3(np.ascontiguousarray(by_red.transpose(2, 1, 0, 3)), tetrahedral=interpolation == "tetrahedral")
    return [*_placed(node, dimensions[0]), table]


def _range(node: Node) -> list[Step]:
    given, made = node.scale("inBitDepth"), node.scale("outBitDepth")
    ends = []
    for name, scale in (("minInValue", given), ("maxInValue", given), ("minOutValue", made), ("maxOutValue", made)):
        text = node.text_of(name)
        ends.append(None if text is None else node.numbers(text, 1, name)[0] / scale)
    style = node.attribute("style", "clamp").lower()
    if style not in ("clamp", "noclamp"):
        raise node.wrong(f"style is {style!r}; it must be clamp or noClamp")
    try:
        return [Curves((ranged(*ends, clamp=style == "clamp"),) * 3)]
    except ValueError as wrong:
        raise node.wrong(str(wrong)) from None


def _by_channel(
    node: Node, parameters: str, make: Callable[[Mapping[str, str]], object], otherwise: object
) -> list[Step]:
    """One set of parameters for all channels, or one for each of those named and `otherwise` for the rest."""
    made: list[object | None] = [None, None, None]
    for each in node.element.children:
        if each.name != parameters:
            continue
        channel = each.attributes.get("channel")
        if channel not in (None, "R", "G", "B"):
            raise node.wrong(f"channel is {channel!r}; it must be R, G or B")
        for at in range(3) if channel is None else ["RGB".index(channel)]:
            made[at] = make(each.attributes)
    if not any(made):
        raise node.wrong(f"has no {parameters}")
    return [Curves(tuple(each or otherwise for each in made))]  # type: ignore[arg-type]


def _exponent(node: Node) -> list[Step]:
    style = node.attribute("style", "")

    def make(values: Mapping[str, str]) -> object:
        power, offset = node.number_of(values, "exponent"), node.number_of(values, "offset", 0.0)
        return exponent(style, power, offset)

    try:
        # A channel left out has an exponent of 1, and with a basic style loses what is negative, as in OpenColorIO.
        otherwise = exponent(style, 1.0, 0.0) if style.startswith("basic") else PLAIN
        return _by_channel(node, "ExponentParams", make, otherwise)
    except ValueError as wrong:
        raise (wrong if str(wrong).startswith("node") else node.wrong(str(wrong))) from None


def _log(node: Node) -> list[Step]:
    style = node.attribute("style", "")

    def make(values: Mapping[str, str]) -> object:
        numbers = {name: node.number_of(values, name) for name in values if name != "channel"}
        return logarithm(style, numbers)

    try:
        if node.element.child("LogParams") is None:
            return [Curves((logarithm(style, {}),) * 3)]
        return _by_channel(node, "LogParams", make, PLAIN)
    except ValueError as wrong:
        raise (wrong if str(wrong).startswith("node") else node.wrong(str(wrong))) from None


def _asc_cdl(node: Node) -> list[Step]:
    numbers: dict[str, list[float]] = {"Slope": [1.0] * 3, "Offset": [0.0] * 3, "Power": [1.0] * 3, "Saturation": [1.0]}
    for group in ("SOPNode", "SatNode"):
        for each in (node.element.child(group) or Element("", {}, 0)).children:
            if each.name in numbers:
                numbers[each.name] = node.numbers("".join(each.text), len(numbers[each.name]), each.name)
    try:
        return asc_cdl(node.attribute("style", "Fwd"), *numbers.values())
    except ValueError as wrong:
        raise node.wrong(str(wrong)) from None


READERS: Mapping[str, Callable[[Node], list[Step]]] = {
    "Matrix": _matrix, "LUT1D": _lut1d, "LUT3D": _lut3d, "Range": _range, "Exponent": _exponent, "Log": _log,
    "ASC_CDL": _asc_cdl,
}  # fmt: skip


def _version(root: Element) -> float:
    """The number that a document's version begins with."""
    text = root.attributes.get("compCLFversion", "3")
    digits = ".".join(text.split(".")[:2])
    try:
        return float(digits)
    except ValueError:
        raise ValueError(f"line {root.line}: compCLFversion is {text[:20]!r}") from None


@lru_cache(maxsize=8)
def parse(text: str) -> Chain:
    """The chain in a CLF document. Raises `ValueError` with the node and line that are wrong."""
    root = _tree(text)
    if root.name != "ProcessList":
        raise ValueError(f"line {root.line}: the document is a {root.name}; it must be a ProcessList")
    nodes = [each for each in root.children if each.name not in PASSED]
    if not nodes or len(nodes) > MOST_NODES:
        raise ValueError(f"holds {len(nodes)} nodes; it must hold 1 to {MOST_NODES}")
    steps: list[Step] = []
    version = _version(root)
    for number, element in enumerate(nodes, 1):
        node = Node(element, number, version)
        if element.name not in READERS:
            raise node.wrong(f"is not read; nodes that are: {', '.join(READERS)}")
        steps += [] if node.attribute("bypass", "false") == "true" else READERS[element.name](node)
    return Chain(tuple(steps))
