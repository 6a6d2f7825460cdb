"""VTK image data (.vti): the vectors of a regular grid, or one of its arrays, as a picture of data. Read with vtk.

Of the arrays at points, and where there are none of those of cells: the one that `u` names, both of `u` and `v`, the
active vectors, the first of two or three components, or the pair of scalars with usual names. A grid that is flat along
one axis is seen along it; of a solid one the plane `z` is taken, the first where nothing is said. VTK's y runs upwards.
Points that are blanked are NaN.

Source: The VTK User's Guide, 11th edition, VTK file formats: XML, ImageData.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lichen.errors import UnreadableImage, UnsupportedFormat
from lichen.files import selection
from lichen.files.format import Header, data_format
from lichen.files.selection import FIRST, Selection
from lichen.image import Space, Storage
from lichen.memory import Array

BEGINNINGS = (b"<VTKFile", b"<?xml")
_HIDDEN = {True: 2, False: 8 | 32}
"""Bits of vtkGhostType by which a point (True) or a cell is not there: hidden, or refined elsewhere. Duplicates are."""


def read_header(data: memoryview, select: str = "") -> Header:
    chosen = selection.parse(select)
    try:
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkObject
        from vtkmodules.vtkIOXML import vtkXMLImageDataReader
    except ImportError:
        raise UnsupportedFormat("VTK image data are read with vtk: pip install 'lichen[fields]'.") from None
    text = bytes(data)
    if b"<VTKFile" not in text[:4096] or b"ImageData" not in text[:4096]:
        raise UnreadableImage("The bytes are XML, but not of VTK image data.")
    vtkObject.GlobalWarningDisplayOff()  # it would write to the console; what is wrong is seen by what is missing
    reader: Any = vtkXMLImageDataReader()
    reader.ReadFromInputStringOn()
    reader.SetBinaryInputString(text, len(text))
    reader.Update()
    image = reader.GetOutput()
    if reader.GetErrorCode() or image.GetNumberOfPoints() == 0:
        raise UnreadableImage("The VTK image data are damaged or incomplete.")
    samples = _samples(image, chosen, vtk_to_numpy)
    rows, columns, channels = samples.shape
    return Header("vti", columns, rows, channels, Storage.FLOAT32, Space.DATA, details=samples)


def _samples(image: Any, chosen: Selection, values_of: Any) -> Array:
    sizes = [int(each) for each in image.GetDimensions()]
    held = image.GetPointData()
    points = held.GetNumberOfArrays() > 0
    if not points:
        held, sizes = image.GetCellData(), [max(each - 1, 1) for each in sizes]
    named = {}
    for number in range(held.GetNumberOfArrays()):
        array = held.GetArray(number)
        if array is not None and array.GetName() != "vtkGhostType":
            named[array.GetName()] = np.asarray(values_of(array), np.float64)
    named = {name: values.reshape(*sizes[::-1], -1) for name, values in named.items() if values.size}
    if not named:
        raise UnreadableImage("The VTK image data hold no array of numbers.")
    chosen.known(["z"])
    flat = next((axis for axis in (2, 1, 0) if sizes[axis] == 1), 2)
    shown = [axis for axis in range(3) if axis != flat]
    place = chosen.places.get("z", FIRST).among("z", sizes[flat], None)
    active = held.GetVectors()
    planes = _components(named, chosen, None if active is None else active.GetName(), shown)
    ghosts = held.GetArray("vtkGhostType")
    if ghosts is not None:
        gone = (np.asarray(values_of(ghosts)).reshape(sizes[::-1]) & _HIDDEN[points]) != 0
        planes = [np.where(gone, np.nan, plane) for plane in planes]
    return selection.picture([np.take(plane, place, axis=2 - flat) for plane in planes])


def _components(named: dict[str, Array], chosen: Selection, active: str | None, shown: list[int]) -> list[Array]:
    """Values (z, y, x) of each component."""
    vectors = [name for name, values in named.items() if values.shape[3] in (2, 3)]
    name = chosen.u if chosen.v is None else None
    if chosen.u is None and chosen.v is None:
        name = active if active in vectors else next(iter(vectors), None)
    if name in vectors:
        values = named[str(name)]
        return [values[..., axis] for axis in (shown if values.shape[3] == 3 else (0, 1))]
    scalars = [name for name, values in named.items() if values.shape[3] == 1]
    return [named[each][..., 0] for each in chosen.components(scalars)]


vti = data_format(
    name="vti",
    media_types=("application/x-vti", "application/vnd.vtk.imagedata+xml"),
    extensions=(".vti",),
    recognises=lambda head: head.startswith(BEGINNINGS),
    read_header=read_header,
    modules=("vtkmodules.util.numpy_support", "vtkmodules.vtkIOXML"),
)
