"""One warp in place of two: matrices multiplied, so that the image is filtered once.

Two adjacent projective warps are one when nothing is lost between them: the second looks at no place outside the image
that the first makes, since beyond it lies a border where the source has more to show; and neither looks behind a plane
at infinity, where the product of two negative w would be positive again. Both conditions are linear, so they hold over
the result when they hold at its corners.

`link` says what an operation is, as far as this is concerned; `compose` joins two. Pure functions: the planner decides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lichen.operation import Facts, InputFacts, OperationParameters
from lichen.operations.warp import affine, homography, rotate
from lichen.operations.warp.maps import Doubles, Projective
from lichen.operations.warp.prediction import Size

SLACK = 1e-9
"""px; what rounding may put beyond an edge."""


@dataclass(frozen=True)
class Link:
    """A projective warp and the size (width, height) of its result."""

    map: Projective
    size: Size

    def corners(self) -> Doubles:
        """Of the result, homogeneous, in columns."""
        width, height = self.size
        return np.array([[0, width, width, 0], [0, 0, height, height], [1, 1, 1, 1.0]])


def link(parameters: OperationParameters, facts: InputFacts) -> Link | None:
    """What an operation with these parameters is, or None where it is no projective warp."""
    match parameters:
        case affine.Parameters():
            return Link(affine.map_of(parameters), affine.WARP.size(parameters, facts))
        case homography.Parameters():
            return Link(homography.map_of(parameters), homography.WARP.size(parameters, facts))
        case rotate.Parameters():
            image: Facts = facts["image"]
            size = rotate.WARP.size(parameters, facts)
            return Link(rotate.projective(parameters, (image.width, image.height), size), size)
        case _:
            return None


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
    return Link(Projective.of(both), second.size)
