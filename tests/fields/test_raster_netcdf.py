"""NetCDF files written by xarray: axes by name and by attribute, dimensions to choose, gaps, what is refused."""

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.fields.raster import load_raster
from maipp.geo import WGS84, Crs

xarray = pytest.importorskip("xarray")
pytest.importorskip("h5netcdf")
pytest.importorskip("h5py")

LON, LAT = np.array([9.0, 9.5, 10.0, 10.5]), np.array([46.0, 46.5, 47.0])
VALUES = np.arange(12.0).reshape(3, 4) ** 1.5


def dataset(values=VALUES, dims=("lat", "lon"), **coordinates):
    return xarray.Dataset({"chl": (dims, values)}, coords={"lon": LON, "lat": LAT, **coordinates})


def write(path, data, engine="scipy", **options):
    data.to_netcdf(path, engine=engine, **options)
    return path


def assert_is_the_grid(data):
    np.testing.assert_array_equal(data.values, VALUES)
    np.testing.assert_array_equal(data.x, LON)
    np.testing.assert_array_equal(data.y, LAT)
    assert data.crs == WGS84 and data.value_name == "chl"


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_both_generations_of_the_format(engine, tmp_path):
    assert_is_the_grid(load_raster(write(tmp_path / "f.nc", dataset(), engine)))


def test_axes_in_any_order_and_direction(tmp_path):
    assert_is_the_grid(load_raster(write(tmp_path / "f.nc", dataset().transpose("lon", "lat").isel(lat=[2, 1, 0]))))


def test_axes_by_attributes_and_a_reference_system(tmp_path):
    data = xarray.Dataset(
        {"chl": (("j", "i"), VALUES, {"grid_mapping": "utm"}), "utm": ((), 0, {"spatial_ref": wkt(32632)})},
        coords={"i": ("i", LON * 1e5, {"standard_name": "projection_x_coordinate"}), "j": ("j", LAT, {"axis": "Y"})},
    )
    read = load_raster(write(tmp_path / "f.nc", data))
    np.testing.assert_array_equal(read.values, VALUES)
    assert read.crs == Crs("EPSG:32632", metres=1.0) and (read.x_name, read.y_name) == ("i", "j")


def test_kilometres_of_a_system_in_metres_are_led_over(tmp_path):
    units = {"units": "km"}
    coords = {"x": ("x", LON * 100, units), "y": ("y", LAT * 100, units)}
    data = xarray.Dataset(
        {"chl": (("y", "x"), VALUES, {"grid_mapping": "utm"}), "utm": ((), 0, {"crs_wkt": wkt(32632)})}, coords=coords
    )
    read = load_raster(write(tmp_path / "f.nc", data))
    np.testing.assert_allclose(read.x, LON * 1e5)
    assert read.crs == Crs("EPSG:32632", metres=1.0)
    plain = load_raster(write(tmp_path / "g.nc", data.drop_vars("utm")))
    assert plain.crs == Crs(metres=1000.0) and plain.x[0] == LON[0] * 100


def wkt(epsg):
    return pytest.importorskip("pyproj").CRS.from_epsg(epsg).to_wkt()


def test_single_times_are_dropped_and_others_chosen(tmp_path):
    one = dataset(VALUES[None, None], ("time", "depth", "lat", "lon"), time=[5.0], depth=[0.5])
    assert_is_the_grid(load_raster(write(tmp_path / "one.nc", one)))
    stack = np.stack([VALUES * 2, VALUES])[:, None]
    two = write(tmp_path / "two.nc", dataset(stack, ("time", "depth", "lat", "lon"), time=[5.0, 6.0]))
    assert_is_the_grid(load_raster(two, at={"time": 1}))
    assert_is_the_grid(load_raster(two, at={"time": -1, "depth": 0}))
    np.testing.assert_array_equal(load_raster(two, at={"time": 0}).values, VALUES * 2)


def test_times_that_do_not_decode_are_no_matter(tmp_path):
    odd = dataset(VALUES[None], ("time", "lat", "lon"), time=("time", [1.0], {"units": "moons since harvest"}))
    assert_is_the_grid(load_raster(write(tmp_path / "f.nc", odd)))


def test_packed_values_and_gaps(tmp_path):
    lake = VALUES.copy()
    lake[0, 0] = np.nan
    packing = {"chl": {"dtype": "i2", "scale_factor": 0.01, "_FillValue": -9999}}
    path = write(tmp_path / "f.nc", dataset(lake), encoding=packing)
    with pytest.raises(InputError, match="nan at row 0, column 0.*fill the gaps"):
        load_raster(path)
    data = load_raster(path, gaps="nearest")
    assert data.missing is not None and data.missing.sum() == 1 and data.missing[0, 0]
    np.testing.assert_allclose(data.values[~data.missing], VALUES[~data.missing], atol=0.0051)
    assert data.values[0, 0] in (data.values[0, 1], data.values[1, 0])


def test_variables_by_name(tmp_path):
    both = dataset().assign(salt=dataset().chl * 2)
    path = write(tmp_path / "f.nc", both)
    np.testing.assert_array_equal(load_raster(path, value="salt").values, VALUES * 2)
    with pytest.raises(InputError, match=r"more than one variable.*\(chl, salt\)"):
        load_raster(path)


def test_western_longitudes_become_negative(tmp_path):
    west = load_raster(write(tmp_path / "f.nc", dataset().assign_coords(lon=[350.0, 351.0, 352.0, 353.0])))
    np.testing.assert_array_equal(west.x, [-10, -9, -8, -7])
    np.testing.assert_array_equal(west.values, VALUES)
    around = load_raster(write(tmp_path / "g.nc", dataset().assign_coords(lon=[0.0, 90.0, 180.0, 270.0])))
    np.testing.assert_array_equal(around.x, [-90, 0, 90, 180])
    np.testing.assert_array_equal(around.values, VALUES[:, [3, 0, 1, 2]])
    across = load_raster(write(tmp_path / "h.nc", dataset().assign_coords(lon=[170.0, 175.0, 180.0, 185.0])))
    np.testing.assert_array_equal(across.x, [170, 175, 180, 185])


def test_a_grid_without_coordinates_takes_an_extent(tmp_path):
    path = write(tmp_path / "f.nc", xarray.Dataset({"chl": (("a", "b"), VALUES)}))
    np.testing.assert_array_equal(load_raster(path).x, np.arange(4))
    np.testing.assert_array_equal(load_raster(path, extent=(9.0, 10.5, 46.0, 47.0)).x, LON)


MESH = {"lon": (("j", "i"), np.tile(LON, (3, 1))), "lat": (("j", "i"), np.tile(LAT[:, None], (1, 4)))}
STACK = dataset(np.stack([VALUES, VALUES]), ("time", "lat", "lon"))
BAD = {
    "curvilinear": (xarray.Dataset({"chl": (("j", "i"), VALUES)}, coords=MESH), {}, "curvilinear"),
    "one axis": (
        xarray.Dataset({"chl": (("lat", "i"), VALUES)}, coords={"lat": LAT}),
        {},
        "not clear which are x and y",
    ),
    "a time to choose": (STACK, {}, r"3 dimensions \(time: 2, lat: 3, lon: 4\).*at \{time: 0\} \(0 to 1\)"),
    "no such time": (STACK, {"at": {"time": 2}}, "time=2 is not there; give 0 to 1"),
    "no such dimension": (STACK, {"at": {"depth": 0}}, "no dimension 'depth'; there is: time, lat, lon"),
    "no variable": (xarray.Dataset(coords={"lat": LAT}), {}, "no variable of two or more dimensions"),
    "extent": (dataset(), {"extent": (0.0, 1.0, 0.0, 1.0)}, "its own coordinates"),
    "no rows": (dataset().isel(lat=[]), {}, "at least 2 x 2 values, this one is 0 x 4"),
    "constant": (dataset(VALUES * 0), {}, "every value is 0"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_grids_give_one_line(case, tmp_path):
    data, options, problem = BAD[case]
    write(tmp_path / "f.nc", data, "h5netcdf" if case == "no rows" else "scipy")
    with pytest.raises(InputError, match=problem) as caught:
        load_raster(tmp_path / "f.nc", **options)
    assert str(caught.value).startswith(str(tmp_path)) and "\n" not in str(caught.value)


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_damaged_files_give_one_line(engine, tmp_path):
    path = write(tmp_path / "f.nc", dataset(), engine)
    content = path.read_bytes()
    for damaged in (b"no netcdf", content[: len(content) // 2], content[:20]):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="f.nc: .*") as caught:
            load_raster(path)
        assert "\n" not in str(caught.value)


def test_without_xarray_the_extra_is_named(tmp_path, monkeypatch):
    path = write(tmp_path / "f.nc", dataset())
    monkeypatch.setitem(__import__("sys").modules, "xarray", None)
    with pytest.raises(InputError, match=r"pip install 'maipp\[geo\]'"):
        load_raster(path)
