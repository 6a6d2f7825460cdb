"""Fields that others wrote: NetCDF by netCDF4 and VTK image data by vtk, read as pictures with their tops up."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import netCDF4
import numpy as np
import pytest

from lichen.errors import InvalidRequest, TooLarge, UnreadableImage, UnsupportedFormat
from lichen.files import Limits, decode, encode, probe, recognise
from lichen.image import Space, as_image
from lichen.memory import Array

LATITUDES, LONGITUDES = np.linspace(60, 40, 5), np.arange(7.0)
EAST = np.arange(2 * 2 * 5 * 7, dtype=np.float64).reshape(2, 2, 5, 7) / 4
NORTH = -1 - EAST
SIZES = {"time": 2, "level": 2, "latitude": 5, "longitude": 7}
Build = Callable[[Any], None]


def written(build: Build, format: str = "NETCDF4", sizes: Mapping[str, int] = SIZES) -> bytes:
    file = netCDF4.Dataset("made.nc", "w", format=format, memory=1 << 14)
    for name, size in sizes.items():
        file.createDimension(name, size)
    build(file)
    return bytes(file.close())


def axes(file: Any, latitudes: Array = LATITUDES, longitudes: Array = LONGITUDES) -> None:
    for name, values, units in (
        ("latitude", latitudes, "degrees_north"),
        ("longitude", longitudes, "degrees_east"),
        ("level", np.array([500.0, 850.0]), "hPa"),
    ):
        made = file.createVariable(name, "f8", (name,))
        made.units, made[:] = units, values


def wind(file: Any, names: tuple[str, str] = ("u", "v"), standard: bool = False) -> None:
    for name, values, way in zip(names, (EAST, NORTH), ("eastward", "northward"), strict=True):
        made = file.createVariable(name, "f4", tuple(SIZES))
        made[:] = values
        if standard:
            made.standard_name = f"{way}_wind"


def plain(file: Any) -> None:
    axes(file)
    wind(file)


def picture(east: Array, north: Array) -> Array:
    """Of planes whose first row is on top."""
    return np.stack([east, -north], axis=-1).astype(np.float32)


@pytest.mark.parametrize("format", ["NETCDF4", "NETCDF4_CLASSIC", "NETCDF3_CLASSIC", "NETCDF3_64BIT_DATA"])
def test_netcdf_of_every_kind_is_read(format: str) -> None:
    data = written(plain, format)
    image = decode(data)
    assert (recognise(data).name, image.space) == ("netcdf", Space.DATA)
    np.testing.assert_array_equal(image.pixels, picture(EAST[0, 0], NORTH[0, 0]))
    header = probe(data, select="time=1")
    assert (header.width, header.height, header.channels) == (7, 5, 2)


@pytest.mark.parametrize(
    ("select", "at"),
    [("time=1", (1, 0)), ("time=-1,level=1", (1, 1)), ("level=@840", (0, 1)), ("level=@0,time=1", (1, 0))],
)
def test_places_are_chosen_by_index_and_by_coordinate(select: str, at: tuple[int, int]) -> None:
    np.testing.assert_array_equal(decode(written(plain), select=select).pixels, picture(EAST[at], NORTH[at]))


def test_the_top_of_a_picture_is_up_whichever_way_the_file_has_it() -> None:
    falling = decode(written(plain)).pixels
    rising = decode(written(lambda file: (axes(file, LATITUDES[::-1]), wind(file)))).pixels
    mirrored = decode(written(lambda file: (axes(file, longitudes=LONGITUDES[::-1]), wind(file)))).pixels
    bare = decode(written(wind)).pixels  # an axis without coordinates grows
    np.testing.assert_array_equal(rising, falling[::-1])
    np.testing.assert_array_equal(mirrored, falling[:, ::-1])
    np.testing.assert_array_equal(bare, falling[::-1])


def test_axes_are_found_where_they_are() -> None:
    def build(file: Any) -> None:
        axes(file)
        for name, values in (("u", EAST), ("v", NORTH)):
            file.createVariable(name, "f8", ("longitude", "time", "latitude"))[:] = values[:, 0].transpose(2, 0, 1)

    np.testing.assert_array_equal(decode(written(build), select="time=1").pixels, picture(EAST[1, 0], NORTH[1, 0]))


def test_axes_of_two_dimensions_say_which_way_is_up() -> None:
    sizes = {"south_north": 5, "west_east": 7}

    def build(file: Any) -> None:
        file.createVariable("XLAT", "f4", tuple(sizes))[:] = LATITUDES[:, None] + 0.1 * LONGITUDES
        for name, values in (("U10", EAST), ("V10", NORTH)):
            made = file.createVariable(name, "f4", tuple(sizes))
            made[:], made.coordinates = values[0, 0], "XLONG XLAT"

    np.testing.assert_array_equal(decode(written(build, sizes=sizes)).pixels, picture(EAST[0, 0], NORTH[0, 0]))


def test_components_go_by_standard_names_before_usual_ones_and_by_what_is_asked() -> None:
    def build(file: Any) -> None:
        axes(file)
        wind(file, ("first", "second"), standard=True)
        for name in ("u", "v"):
            file.createVariable(name, "f4", tuple(SIZES))[:] = 0

    data = written(build)
    np.testing.assert_array_equal(decode(data).pixels, picture(EAST[0, 0], NORTH[0, 0]))
    assert not decode(data, select="u=u,v=v").pixels.any()
    one = decode(data, select="u=second,time=1")
    np.testing.assert_array_equal(one.pixels, NORTH[1, 0, :, :, None].astype(np.float32))


def test_what_is_packed_is_unpacked_and_what_is_missing_is_nan() -> None:
    def build(file: Any) -> None:
        axes(file)
        for name, values in (("u", EAST), ("v", NORTH)):
            made = file.createVariable(name, "i2", tuple(SIZES), fill_value=-999)
            made.scale_factor, made.add_offset = 0.25, 1.0
            made[:] = np.ma.masked_where(np.abs(values - 3.0) < 0.1, values)

    pixels = decode(written(build)).pixels
    expected = picture(EAST[0, 0], NORTH[0, 0])
    expected[1, 5, 0] = np.nan
    np.testing.assert_array_equal(pixels, expected)


@pytest.mark.parametrize(
    ("select", "told"),
    [
        ("time=2", "has 2 places"),
        ("month=1", "no dimension"),
        ("u=wind,v=v", "no variable; known: u, v"),
        ("v=v", "needs u"),
        ("time=@3", "no coordinates"),
        ("time", "not of the form"),
        ("time=soon", "neither an index"),
        ("time=0,time=1", "more than once"),
        ("level=@nan", "not finite"),
    ],
)
def test_a_selection_that_does_not_fit_is_told(select: str, told: str) -> None:
    with pytest.raises(InvalidRequest, match=told) as caught:
        decode(written(plain), select=select)
    assert [flaw.pointer for flaw in caught.value.flaws] == ["/query/select"]


def test_components_that_nobody_would_guess_must_be_named() -> None:
    with pytest.raises(InvalidRequest, match="name u and v of first, second"):
        decode(written(lambda file: wind(file, ("first", "second"))))


def test_components_that_lie_in_different_places_are_refused() -> None:
    def build(file: Any) -> None:
        file.createVariable("u", "f4", ("latitude", "longitude"))[:] = 1
        file.createVariable("v", "f4", ("level", "longitude"))[:] = 1

    with pytest.raises(UnreadableImage, match="7x5 and 7x2"):
        decode(written(build))


def test_damaged_files_are_unreadable_and_large_ones_too_large() -> None:
    data = written(plain)
    for end in (20, 300, 2000):
        with pytest.raises(UnreadableImage):
            decode(data[:end])
    with pytest.raises(UnreadableImage, match="no variable"):
        decode(written(lambda file: None))
    with pytest.raises(TooLarge):
        decode(data, limits=Limits(side=6))


def test_data_are_not_written() -> None:
    with pytest.raises(UnsupportedFormat):
        encode(as_image(np.zeros((2, 2, 2))), "netcdf")


def test_without_its_library_a_format_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    data = written(plain)
    monkeypatch.setitem(__import__("sys").modules, "netCDF4", None)
    monkeypatch.setitem(__import__("sys").modules, "vtkmodules.vtkIOXML", None)
    for each in (data, b'<VTKFile type="ImageData">'):
        with pytest.raises(UnsupportedFormat, match=r"lichen\[fields\]"):
            decode(each)


# ----------------------------------------------------------------------------------------------------------------- vtk


def grid(arrays: Mapping[str, Array], sizes: tuple[int, int, int], *, cells: bool = False, active: str = "") -> bytes:
    """Image data as vtk writes them, with these arrays (n, components)."""
    pytest.importorskip("vtkmodules", reason="vtk is large: most tests run without")
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

    image = vtkImageData()
    image.SetDimensions(*sizes)
    held = image.GetCellData() if cells else image.GetPointData()
    for name, values in arrays.items():
        made = numpy_to_vtk(np.ascontiguousarray(values), deep=1)
        made.SetName(name)
        held.AddArray(made)
    if active:
        held.SetActiveVectors(active)
    writer = vtkXMLImageDataWriter()
    writer.SetInputData(image)
    writer.SetDataModeToAscii()
    writer.WriteToOutputStringOn()
    writer.Write()
    return str(writer.GetOutputString()).encode()


def vectors(count: int) -> Array:
    return np.arange(3.0 * count).reshape(count, 3)


def test_vtk_vectors_lie_with_y_upwards() -> None:
    pixels = decode(grid({"other": vectors(35)[:, :1], "flow": vectors(35)}, (7, 5, 1))).pixels
    upwards = vectors(35).reshape(5, 7, 3)[::-1]
    np.testing.assert_array_equal(pixels, picture(upwards[..., 0], upwards[..., 1]))


def test_vtk_grids_are_seen_along_the_axis_they_are_flat_along() -> None:
    pixels = decode(grid({"flow": vectors(35)}, (7, 1, 5))).pixels
    upwards = vectors(35).reshape(5, 7, 3)[::-1]
    np.testing.assert_array_equal(pixels, picture(upwards[..., 0], upwards[..., 2]))


def test_vtk_planes_arrays_and_cells_are_chosen() -> None:
    solid = {"flow": vectors(24), "best": -vectors(24), "u": vectors(24)[:, 0], "v": vectors(24)[:, 1]}
    data = grid(solid, (4, 3, 2), active="best")
    upwards = vectors(24).reshape(2, 3, 4, 3)[1, ::-1]
    np.testing.assert_array_equal(decode(data, select="z=1").pixels, picture(-upwards[..., 0], -upwards[..., 1]))
    for select in ("u=flow,z=1", "u=u,v=v,z=1"):
        np.testing.assert_array_equal(decode(data, select=select).pixels, picture(upwards[..., 0], upwards[..., 1]))
    assert decode(grid({"flow": vectors(6)}, (4, 3, 1), cells=True)).pixels.shape == (2, 3, 2)


def test_vtk_points_that_are_hidden_are_nan() -> None:
    ghosts = np.zeros(35, np.uint8)
    ghosts[3], ghosts[4] = 2, 1  # hidden; there twice
    pixels = decode(grid({"flow": vectors(35), "vtkGhostType": ghosts}, (7, 5, 1))).pixels
    assert np.isnan(pixels[-1, 3]).all()
    assert np.isnan(pixels).sum() == 2


def test_damaged_vtk_is_unreadable() -> None:
    data = grid({"flow": vectors(35)}, (7, 5, 1))
    for end in (60, 200, len(data) // 2):
        with pytest.raises(UnreadableImage):
            decode(data[:end])
    with pytest.raises(UnreadableImage):
        decode(b'<?xml version="1.0"?><svg/>')
