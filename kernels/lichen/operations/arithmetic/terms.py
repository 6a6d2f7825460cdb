"""An expression's text as a tree of terms. The text is parsed as Python's grammar has it and never run.

Theory. `ast.parse` builds a tree without evaluating anything. Only the nodes named here are taken, everything else is
an error that names it: there are no attributes but channels, no calls but of the functions in functions.py, no names
but the images, the places and pi. Length, size and depth are limited before anything is computed.

    numbers      1, 0.5, 1e-3, pi
    images       a, b, c, d: channel by channel; one of a single channel serves all channels
    channels     a.r a.g a.b a.a, or a[0], a[1], ...
    places       x, y (pixel centres lie at +0.5), width, height
    operators    + - * / **, comparisons (1 or 0, chained as in mathematics), and, or, not, `u if c else v`
    results      one expression, or several between brackets, (u, v, w), each a channel of one
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from lichen.operations.arithmetic.functions import FUNCTIONS

IMAGES = ("a", "b", "c", "d")
PLACES = ("x", "y", "width", "height")
NUMBERS = {"pi": 3.141592653589793}
CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
LONGEST, LARGEST, DEEPEST, WIDEST = 2000, 256, 32, 8
"""Characters, terms, terms within terms, and results."""
SQUARED = 8
"""Whole powers up to it are products."""
OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "add", ast.Sub: "subtract", ast.Mult: "multiply", ast.Div: "divide", ast.Pow: "pow",
    ast.Lt: "less", ast.LtE: "at_most", ast.Gt: "greater", ast.GtE: "at_least", ast.Eq: "equal", ast.NotEq: "unequal",
    ast.And: "and", ast.Or: "or",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Term:
    """A function of terms; or, without any, a `number`, an `image` (and the channel named, or None) or a `place`."""

    name: str
    terms: tuple[Term, ...] = ()
    number: float = 0.0
    image: str = ""
    channel: int | None = None

    def walk(self) -> Iterator[Term]:
        yield self
        for each in self.terms:
            yield from each.walk()


class Unreadable(ValueError):
    """What is wrong with an expression, in one sentence."""


@lru_cache(maxsize=64)
def parse(text: str) -> tuple[Term, ...]:
    """The results that a text describes. Raises `Unreadable`."""
    if len(text) > LONGEST:
        raise Unreadable(f"is longer than {LONGEST} characters")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        where = f" at character {error.offset}" if isinstance(error, SyntaxError) and error.offset else ""
        raise Unreadable(f"cannot be read{where}") from None
    parts = tree.elts if isinstance(tree, ast.Tuple) else [tree]
    if not 1 <= len(parts) <= WIDEST:
        raise Unreadable(f"has {len(parts)} results; 1 to {WIDEST} are taken")
    made = tuple(_term(part, 0) for part in parts)
    size = sum(1 for each in made for _ in each.walk())
    if size > LARGEST:
        raise Unreadable(f"has {size} terms; {LARGEST} are the most")
    return made


def _term(node: ast.AST, depth: int) -> Term:
    if depth > DEEPEST:
        raise Unreadable(f"is nested more than {DEEPEST} deep")

    def inner(each: ast.AST) -> Term:
        return _term(each, depth + 1)

    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool) and abs(value) <= 1e30:
            return Term("number", number=float(value))
        case ast.Name(id=name) if name in IMAGES:
            return Term("image", image=name)
        case ast.Name(id=name) if name in PLACES:
            return Term("place", image=name)
        case ast.Name(id=name) if name in NUMBERS:
            return Term("number", number=NUMBERS[name])
        case ast.Attribute(value=ast.Name(id=name), attr=channel) if name in IMAGES and channel in CHANNELS:
            return Term("image", image=name, channel=CHANNELS[channel])
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=int() as channel)) if (
            name in IMAGES and not isinstance(channel, bool) and 0 <= channel < 64
        ):
            return Term("image", image=name, channel=channel)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            made = inner(operand)
            return Term("number", number=-made.number) if made.name == "number" else Term("negate", (made,))
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return inner(operand)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return Term("not", (inner(operand),))
        case ast.BinOp(op=ast.Pow(), left=left, right=right):
            return _power(inner(left), inner(right))
        case ast.BinOp(op=operator, left=left, right=right) if type(operator) in OPERATORS:
            return Term(OPERATORS[type(operator)], (inner(left), inner(right)))
        case ast.BoolOp(op=operator, values=values):
            return _chain(OPERATORS[type(operator)], [inner(each) for each in values])
        case ast.Compare(left=left, ops=operators, comparators=rights) if all(type(o) in OPERATORS for o in operators):
            sides = [inner(each) for each in (left, *rights)]
            pairs = zip(operators, sides, sides[1:], strict=False)
            return _chain("and", [Term(OPERATORS[type(o)], (low, high)) for o, low, high in pairs])
        case ast.IfExp(test=test, body=body, orelse=other):
            return Term("select", (inner(test), inner(body), inner(other)))
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]):
            return _call(name, [inner(each) for each in given])
    raise Unreadable(_refusal(node))


def _refusal(node: ast.AST) -> str:
    known = ", ".join((*IMAGES, *PLACES, *NUMBERS))
    if isinstance(node, ast.Name):
        return f"has the unknown name {node.id[:40]!r}; known: {known}"
    if isinstance(node, ast.Attribute):
        return f"has no {node.attr[:40]!r}; images have the channels r, g, b, a and [0], [1], ..."
    return (
        f"may not hold {type(node).__name__}"
        if not isinstance(node, ast.Constant)
        else "holds a value that is no number"
    )


def _call(name: str, given: list[Term]) -> Term:
    callable_here = {each: made for each, made in FUNCTIONS.items() if made.called}
    if name not in callable_here:
        raise Unreadable(f"has no function {name[:40]!r}; known: {', '.join(sorted(callable_here))}")
    if len(given) != callable_here[name].arguments:
        raise Unreadable(f"gives {name} {len(given)} argument(s); it takes {callable_here[name].arguments}")
    return _power(*given) if name == "pow" else Term(name, tuple(given))


def _chain(name: str, terms: list[Term]) -> Term:
    made = terms[0]
    for each in terms[1:]:
        made = Term(name, (made, each))
    return made


def _power(base: Term, exponent: Term) -> Term:
    """Small whole powers as products, which take negative numbers too."""
    whole = exponent.number
    if exponent.name == "number" and whole == int(whole) and -SQUARED <= whole <= -1:
        return Term("divide", (Term("number", number=1.0), _power(base, Term("number", number=-whole))))
    if exponent.name != "number" or whole != int(whole) or not 1 <= whole <= SQUARED:
        return Term("pow", (base, exponent))
    half = _power(base, Term("number", number=float(whole // 2))) if whole > 1 else base
    if whole == 1:
        return base
    square = Term("multiply", (half, half))
    return Term("multiply", (square, base)) if whole % 2 else square
