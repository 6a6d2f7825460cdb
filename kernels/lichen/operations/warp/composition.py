"""One warp in place of two: matrices multiplied, so that the image is filtered once.

Two adjacent projective warps are one when nothing is lost between them: the second looks at no place outside the image
that the first makes, since beyond it lies a border where the source has more to show; and neither looks behind a plane
at infinity, where the product of two negative w would be positive again. Both conditions are linear, so they hold over
the result when they hold at its corners.

The picture is another one, without the blur of the filter between: the planner joins warps where that is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lichen import joining
from lichen.joining import Joined
from lichen.operation import Border
from lichen.operations.warp.maps import Doubles, Projective
from lichen.operations.warp.prediction import Size

SLACK = 1e-9
"""px; what rounding may put beyond an edge."""


@dataclass(frozen=True)
class Link:
    """A projective warp, the size (width, height) of its result, and what lies beyond its source."""

    map: Projective
    size: Size
    border: Border = Border.CONSTANT
    value: float = 0.0

    def corners(self) -> Doubles:
        """Of the result, homogeneous, in columns."""
        width, height = self.size
        return np.array([[0, width, width, 0], [0, 0, height, height], [1, 1, 1, 1.0]])

    def then(self, following: joining.Link) -> Joined | str | None:
        """A homography, where `compose` finds one. Near its edge the second filters what lies beyond the first's
        result, by its own border; the one warp sees the source go on, or end by the first's."""
        if not isinstance(following, Link):
            return None
        both = compose(self, following)
        if isinstance(both, str):
            return both
        said = {
            "matrix": both.map.array.tolist(),
            "inverse": True,
            "width": both.size[0],
            "height": both.size[1],
            "border": self.border,
            "value": self.value,
        }
        return Joined("homography", said, same=False, reason="two warps are one, and the image is filtered once")


def compose(first: Link, second: Link) -> Link | str:
    """One warp for `first` and then `second`, or the reason why there is none."""
    seen = second.map.array @ second.corners()
    if seen[2].min() <= 0:
        return "the second looks behind its plane"
    x, y = seen[0] / seen[2], seen[1] / seen[2]
    width, height = first.size
    if min(x.min(), y.min()) < -SLACK or x.max() > width + SLACK or y.max() > height + SLACK:
        return "the second looks beyond what the first makes"
    both = first.map.array @ second.map.array
    if (both @ second.corners())[2].min() <= 0:
        return "the first looks behind its plane"
    return Link(Projective.of(both), second.size, first.border, first.value)
