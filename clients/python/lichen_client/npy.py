"""Arrays as NPY bytes and back, without a copy of an array that lies in C order.

NPY is the one format in which every sample survives: type, shape and bits. NumPy is imported on first use, because a
caller that sends and stores encoded files never needs it.
"""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

MEDIA_TYPE = "application/x-npy"


def npy_pieces(value: npt.ArrayLike) -> tuple[bytes, memoryview]:
    """`value` as an NPY file in C order: its head, and its samples. Raises ValueError for arrays of Python objects."""
    import numpy as np

    array = np.asarray(value)
    if array.dtype.hasobject:
        raise ValueError("an array of Python objects is not sent")
    array = np.ascontiguousarray(array).reshape(array.shape)  # the reshape gives a scalar its shape back
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(array))
    return file.getvalue(), array.reshape(-1).view(np.uint8).data


def from_npy(body: bytearray) -> np.ndarray[Any, np.dtype[Any]]:
    """The array in an NPY file; it is writable and shares the memory of `body`. Raises ValueError."""
    import numpy as np

    usual = _USUAL.match(body)
    if usual is not None:
        shape, fortran, dtype = tuple(map(int, usual[3].split(b","))), False, np.dtype(usual[2].decode())
        offset = 10 + int.from_bytes(usual[1], "little")
    else:
        # The header's length is a 16-bit number in version 1, and the service writes no other.
        head = io.BytesIO(memoryview(body)[: 1 << 17])
        version = np.lib.format.read_magic(head)
        if version != (1, 0):
            raise ValueError(f"NPY version {version} is not supported")
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(head)
        if dtype.hasobject:
            raise ValueError("an array of Python objects is not read")
        offset = head.tell()
    count = int(np.prod(shape, dtype=np.int64))
    flat = np.frombuffer(body, dtype, count, offset=offset)
    return flat.reshape(shape, order="F" if fortran else "C")


_USUAL = re.compile(
    rb"\x93NUMPY\x01\x00(..)\{'descr': '([<|][biuf][1248])', 'fortran_order': False, 'shape': "
    rb"\(([0-9]+(?:, ?[0-9]+)+)\), \} *\n",
    re.DOTALL,
)
"""The head of an array of two or more dimensions as NumPy writes it, read without compiling Python."""
