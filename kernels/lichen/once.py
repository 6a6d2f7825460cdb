"""What is found when it is first asked for, and kept: for predictions, which are asked for by the dozen.

`once` is `functools.cached_property` without the lock that it takes for all objects of a class before Python 3.12, and
`latest` a `functools.lru_cache` of one entry that compares no values. Threads that ask at once may find the same twice,
and keep either: both are for what follows from their arguments alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Generic, ParamSpec, TypeVar, overload

T = TypeVar("T")
P = ParamSpec("P")
NOTHING = object()


class once(Generic[T]):
    """Decorator of a method without arguments, whose result becomes an attribute of the object.

    >>> class Circle:
    ...     radius = 1.0
    ...     @once
    ...     def area(self) -> float:
    ...         return 3.14 * self.radius**2
    >>> Circle().area
    3.14
    """

    def __init__(self, find: Callable[[Any], T]) -> None:
        self._find, self._name, self.__doc__ = find, find.__name__, find.__doc__

    @overload
    def __get__(self, owner: None, kind: type) -> once[T]: ...
    @overload
    def __get__(self, owner: object, kind: type) -> T: ...
    def __get__(self, owner: object | None, kind: type) -> once[T] | T:
        if owner is None:
            return self
        found = owner.__dict__[self._name] = self._find(owner)
        return found


def latest(find: Callable[P, T]) -> Callable[P, T]:
    """Decorator of a function that follows from its one to three arguments alone: what it said last, if it is asked of
    the very same objects again. All methods of a request ask the same of its parameters and facts, one after the other.

    >>> @latest
    ... def total(numbers: list[float]) -> float:
    ...     print("adding")
    ...     return sum(numbers)
    >>> numbers = [1.0, 2.0]
    >>> total(numbers) + total(numbers)
    adding
    6.0
    """
    kept: list[Any] = [NOTHING, NOTHING, NOTHING, None]

    @wraps(find)
    def found(a: Any, b: Any = NOTHING, c: Any = NOTHING, /, **named: Any) -> T:
        first, second, third, said = kept
        if named or first is not a or second is not b or third is not c:
            said = find(*[each for each in (a, b, c) if each is not NOTHING], **named)
            if not named:
                kept[:] = a, b, c, said
        return said  # type: ignore[no-any-return]

    return found  # type: ignore[return-value]
