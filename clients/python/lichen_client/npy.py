"""Arrays as NPY bytes and back, without a copy on the way in.

NPY is the one format in which every sample survives: type, shape and bits. NumPy is imported on first use, because a
caller that sends and stores encoded files never needs it.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

MEDIA_TYPE = "application/x-npy"


def to_npy(value: npt.ArrayLike) -> bytes:
    """`value` as an NPY file in C order. Raises ValueError for arrays of Python objects."""
    import numpy as np

    array = np.asarray(value)
    file = io.BytesIO()
    np.save(file, np.ascontiguousarray(array).reshape(array.shape), allow_pickle=False)
    return file.getvalue()


def from_npy(body: bytearray) -> np.ndarray[Any, np.dtype[Any]]:
    """The array in an NPY file; it is writable and shares the memory of `body`. Raises ValueError."""
    import numpy as np

    # The header's length is a 16-bit number in version 1, and the service writes no other.
    head = io.BytesIO(memoryview(body)[: 1 << 17])
    version = np.lib.format.read_magic(head)
    if version != (1, 0):
        raise ValueError(f"NPY version {version} is not supported")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(head)
    if dtype.hasobject:
        raise ValueError("an array of Python objects is not read")
    count = int(np.prod(shape, dtype=np.int64))
    flat = np.frombuffer(body, dtype, count, offset=head.tell())
    return flat.reshape(shape, order="F" if fortran else "C")
