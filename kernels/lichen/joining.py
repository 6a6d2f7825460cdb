"""Two neighbouring operations as one: what an operation says of itself so that the planner can find that out.

An operation that may be joined declares a `Link`: what it is, as far as its neighbours are concerned. A link that
stands before another says whether one operation does what both do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol


@dataclass(frozen=True, slots=True)
class Joined:
    """One operation, by its name, in place of two. `same` says that its definition differs from theirs by the rounding
    of doubles alone; what is not the same is another picture, and nothing that a plan may do unasked."""

    operation: str
    parameters: Mapping[str, Any]
    same: bool
    reason: str


class Link(Protocol):
    """What an operation is for its neighbours."""

    def then(self, following: Link) -> Joined | str | None:
        """One operation for this and then `following`; or why there is none; None where nobody would look for one."""
