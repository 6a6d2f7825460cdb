"""What can go wrong, as types.

Every error Lichen raises on purpose is a `LichenError`. It carries a stable `code`, one sentence, every flaw found
(not only the first), and, where a limit was crossed, the limit and the actual value. The service turns them into
problem documents; nothing here knows about HTTP.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from pydantic import ValidationError


@dataclass(frozen=True, slots=True)
class Flaw:
    """One bad field: a JSON pointer to it, and what is wrong with it."""

    pointer: str
    detail: str


class LichenError(Exception):
    """Base of all errors raised on purpose."""

    code: ClassVar[str] = "error"
    title: ClassVar[str] = "Something went wrong"

    def __init__(
        self,
        detail: str,
        flaws: Sequence[Flaw] = (),
        *,
        limit: float | None = None,
        actual: float | None = None,
    ) -> None:
        super().__init__(detail)
        self.detail = detail
        self.flaws = tuple(flaws)
        self.limit = limit
        self.actual = actual

    def __str__(self) -> str:
        return "; ".join([self.detail, *(f"{flaw.pointer}: {flaw.detail}" for flaw in self.flaws)])


class InvalidRequest(LichenError):
    """Well formed, but a parameter, an input or their combination is not acceptable."""

    code = "invalid-request"
    title = "The request is well formed but not valid"


class UnknownOperation(LichenError):
    code = "unknown-operation"
    title = "There is no such operation"


class UnknownTexture(LichenError):
    code = "unknown-texture"
    title = "There is no such texture"


class UnreadableImage(LichenError):
    """The bytes are not a whole image of the format they claim."""

    code = "unreadable-image"
    title = "The image cannot be decoded"


class UnsupportedFormat(LichenError):
    code = "unsupported-format"
    title = "The image format is not supported"


class TooLarge(LichenError):
    """Pixels, channels or bytes beyond a stated limit; raised before memory is taken for them."""

    code = "too-large"
    title = "A limit on size was crossed"


class NonfiniteInput(LichenError):
    """NaN or infinity in an input while the request asked for `nonfinite=reject`."""

    code = "nonfinite-input"
    title = "The input holds NaN or infinite values"


class Unattainable(LichenError):
    """No method meets the asked error or time; the detail names the best that can be had."""

    code = "unattainable"
    title = "No method meets the asked error or time"


class DeviceFailure(LichenError):
    """A device cannot be used, or a kernel failed to build or to run; the detail names the kernel and its log."""

    code = "device-failure"
    title = "The compute device failed"


def nearest(name: str, known: Iterable[str]) -> str:
    """The end of an error sentence that names what the caller may have meant.

    >>> nearest("gausian", ["gaussian", "lic"])
    'did you mean gaussian?'
    >>> nearest("x", ["gaussian", "lic"])
    'known: gaussian, lic'
    """
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    if close:
        return f"did you mean {' or '.join(close)}?"
    return f"known: {', '.join(names)}" if names else "none is known"


def parameter_flaws(invalid: ValidationError, owner: str, known: Iterable[str]) -> list[Flaw]:
    """Every flaw that pydantic found in the parameters of `owner`, which knows the names `known`."""
    return [
        Flaw(
            "/parameters/" + "/".join(str(part) for part in problem["loc"]),
            f"is not a parameter of {owner}; {nearest(str(problem['loc'][0]), known)}"
            if problem["type"] == "extra_forbidden"
            else _sentence(problem["msg"], problem.get("input"), problem["type"]),
        )
        for problem in invalid.errors(include_url=False, include_context=False)
    ]


def _sentence(message: str, value: Any, kind: str) -> str:
    if kind == "missing":
        return "is required"
    shown = repr(value)
    return f"{message[:1].lower()}{message[1:]} (got {shown if len(shown) <= 60 else shown[:57] + '...'})"
