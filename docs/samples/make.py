"""Makes the sample files beside it: a photograph, and the field of directions along its edges.

The field is the edge tangent flow: at each pixel the eigenvector of the smoothed structure tensor along which the
picture changes least, times the tensor's coherence, (l1 - l2) / (l1 + l2), which is 1 on a straight edge and 0 where
no direction stands out. Components are (x, y), y down.

An eigenvector has no sign. Signs are chosen along a spanning tree of the pixels that prefers neighbours with strong and
parallel directions, so that a change of sign, which half-turn singularities make unavoidable, falls where the field is
weak; a slight blur then lets the field pass through zero there.

Source: Kang, Lee, Chui, "Coherent line drawing", NPAR 2007 (the flow); Weickert, "Coherence-enhancing diffusion
filtering", IJCV 31, 1999 (the tensor).

    python docs/samples/make.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import skimage.data
from scipy.ndimage import gaussian_filter, sobel
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from lichen import files
from lichen.image import Space, Storage, as_image
from lichen.memory import Array

TENSOR_SIGMA = 5.0
FIELD_SIGMA = 1.5
HERE = Path(__file__).parent


def tangents(grey: Array, sigma: float) -> Array:
    """Unit tangents times coherence, shape (rows, columns, 2), signs as they come."""
    across, down = sobel(grey, axis=1), sobel(grey, axis=0)
    xx, xy, yy = (gaussian_filter(product, sigma) for product in (across * across, across * down, down * down))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy) + np.pi / 2  # of the eigenvector with the smaller eigenvalue
    strength = np.hypot(xx - yy, 2 * xy)
    trace = xx + yy
    coherence = np.divide(strength, trace, out=np.zeros_like(trace), where=trace > 0)
    return np.asarray(np.stack([np.cos(angle), np.sin(angle)], axis=2) * coherence[:, :, np.newaxis])


def aligned_signs(field: Array) -> Array:
    """The field with each vector turned by 0 or 180 degrees so that neighbours agree, strong ones first."""
    rows, columns, _ = field.shape
    index = np.arange(rows * columns).reshape(rows, columns)
    pairs = [(index[:, :-1], index[:, 1:]), (index[:-1], index[1:])]
    start = np.concatenate([first.ravel() for first, _ in pairs])
    end = np.concatenate([second.ravel() for _, second in pairs])
    flat = field.reshape(-1, 2)
    product = np.sum(flat[start] * flat[end], axis=1)
    cost = 1.0 + 1e-6 - np.abs(product)  # never zero, which would mean no edge
    tree = minimum_spanning_tree(coo_array((cost, (start, end)), shape=(index.size, index.size)).tocsr())
    root = int(np.argmax(np.sum(flat * flat, axis=1)))
    order, parent = breadth_first_order(tree, root, directed=False)
    signs = np.ones(index.size)
    for node in order[1:]:
        above = parent[node]
        signs[node] = signs[above] if np.dot(flat[node], flat[above]) >= 0 else -signs[above]
    return field * signs.reshape(rows, columns, 1)


def main() -> None:
    photo: Array = skimage.data.astronaut()  # type: ignore[no-untyped-call, unused-ignore]
    picture = as_image(photo).replace(space=Space.SRGB)
    (HERE / "photo.jpg").write_bytes(files.encode(picture, "jpeg", quality=90).data)

    grey = photo @ np.array([0.2126, 0.7152, 0.0722]) / 255
    field = aligned_signs(tangents(grey, TENSOR_SIGMA))
    field = gaussian_filter(field, (FIELD_SIGMA, FIELD_SIGMA, 0))
    encoded = files.encode(as_image(field), "exr", storage=Storage.FLOAT16)
    (HERE / "field.exr").write_bytes(encoded.data)


if __name__ == "__main__":
    main()
