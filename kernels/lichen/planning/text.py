"""Pipelines as text, for URLs and the shell.

    transfer:direction=decode|gaussian:sigma=5|transfer:direction=encode

Grammar:

    pipeline = step *( "|" step )
    step     = [ label "=" ] operation [ ":" setting *( "," setting ) ]
    setting  = name "=" value
    value    = JSON array, object or string, or text in which "\\" stands before each "|", "," and "\\" of its own

* A step reads the one before it as its first input, the first one `input.image`; a step whose operation reads nothing
  begins anew. A setting named after an input says what that reads instead: a label, or `input.NAME`.
* A label names a step for those; without one it is the operation's name, with 2, 3, ... behind it from the second on.
* Settings are parameters, knobs, inputs, `method` and `max_error`. Vectors and matrices are JSON, as everywhere; inside
  JSON neither "|" nor "," ends anything. A JSON string is the text in it.
* Blanks around names and values do not count. What comes out is the last step, or with `crop` behind it the part that
  its settings `left`, `top`, `width` and `height` say; amid a pipeline `arrange` cuts.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from lichen.catalogue import known
from lichen.errors import Flaw, InvalidRequest, nearest

MOST = 1000
"""nodes of a pipeline"""
CROP = "crop"
SIDES = ("left", "top", "width", "height")
_DECODER = json.JSONDecoder()


def read(said: str) -> dict[str, Any]:
    """The mapping that the text stands for. Raises `InvalidRequest` with every flaw of form."""
    flaws: list[Flaw] = []
    nodes: dict[str, Any] = {}
    before = "input.image"
    name, part = "input.image", None
    steps = list(_split(said, "|"))
    if len(steps) > MOST + 1:  # one of them may be a crop
        raise InvalidRequest("The pipeline is too long.", [Flaw("/pipeline", f"has {len(steps)} steps, of {MOST}")])
    for number, step in enumerate(steps, start=1):
        head, _, rest = step.partition(":")
        label, equals, wanted = (part.strip() for part in head.partition("="))
        if not equals:
            label, wanted = "", label
        if wanted == CROP and not equals:
            part = _rectangle(rest, flaws)
            if number < len(steps):
                flaws.append(Flaw("/pipeline", f"step {number}: a crop comes last; elsewhere arrange cuts"))
            continue
        if not wanted:
            flaws.append(Flaw("/pipeline", f"step {number} names no operation"))
            continue
        name = label or _free(wanted, nodes)
        if name in nodes:
            flaws.append(Flaw(f"/nodes/{name}", f"step {number} is called as one before it"))
        nodes[name] = _node(name, wanted, rest, before, flaws)
        before = name
    if flaws:
        raise InvalidRequest(f"The pipeline has {len(flaws)} flaw(s).", flaws)
    return {"nodes": nodes, "outputs": {"result": {"node": name} if part is None else {"node": name, "crop": part}}}


def _rectangle(rest: str, flaws: list[Flaw]) -> list[Any]:
    """What the settings of a crop say, as an output does; 0 where left or top is left out."""
    given: dict[str, Any] = {"left": "0", "top": "0"}
    for setting in _split(rest, ",") if rest.strip() else ():
        key, _, value = (part.strip() for part in setting.partition("="))
        if key not in SIDES:
            flaws.append(Flaw(f"/outputs/result/crop/{key}", f"is not known here; {nearest(key, SIDES)}"))
        given[key] = value
    flaws += [Flaw(f"/outputs/result/crop/{side}", "is required") for side in SIDES if side not in given]
    sides = [given.get(side, "1") for side in SIDES]
    return [int(side) if side.isdecimal() else side for side in sides]


def _free(wanted: str, nodes: Mapping[str, Any]) -> str:
    return next(name for n in range(1, len(nodes) + 2) if (name := wanted if n == 1 else f"{wanted}{n}") not in nodes)


def _node(name: str, wanted: str, rest: str, before: str, flaws: list[Flaw]) -> dict[str, Any]:
    declared = known(wanted)
    names = [each.name for each in declared.inputs] if declared else []
    knobs = declared.knobs if declared else {}
    node: dict[str, Any] = {"operation": wanted, "parameters": {}, "inputs": {}, "knobs": {}}
    if names:
        node["inputs"][names[0]] = before
    given = set()
    for setting in _split(rest, ",") if rest.strip() else ():
        key, equals, value = (part.strip() for part in setting.partition("="))
        where = f"/nodes/{name}"
        if not equals or not key:
            flaws.append(Flaw(where, f"{setting.strip()!r} is not of the form name=value"))
        elif key in given:
            flaws.append(Flaw(f"{where}/parameters/{key}", "is given more than once"))
        elif key in ("method", "max_error"):
            node[key] = _value(value)
        else:
            part = "inputs" if key in names else "knobs" if key in knobs else "parameters"
            node[part][key] = _value(value)
        given.add(key)
    return node


def _value(text: str) -> Any:
    """JSON where the text is an array, an object or a string of it, else the text without its escapes."""
    if text[:1] in ("[", "{", '"'):
        try:
            return json.loads(text)
        except ValueError:
            pass
    return "".join(_unescaped(text))


def _unescaped(text: str) -> Iterator[str]:
    characters = iter(text)
    for each in characters:
        yield next(characters, each) if each == "\\" else each


def _split(text: str, separator: str) -> Iterator[str]:
    """The parts between separators that stand neither in JSON nor behind a backslash."""
    start = at = 0
    while at < len(text):
        if text[at] == "\\":
            at += 2
        elif text[at] == separator:
            yield text[start:at]
            at += 1
            start = at
        elif text[at] in '[{"' and text[start:at].rstrip()[-1:] in ("=", ""):
            at = _after_json(text, at)
        else:
            at += 1
    yield text[start:]


def _after_json(text: str, at: int) -> int:
    """Where the JSON value that begins at `at` ends; behind its first character where it is none."""
    try:
        return _DECODER.raw_decode(text, at)[1]
    except (ValueError, RecursionError):
        return at + 1
