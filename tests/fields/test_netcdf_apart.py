"""NetCDF 4 read in a process of its own: what damaged files, dead processes and other environments come to."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.fields import netcdf_apart, netcdf_grid
from maipp.fields.raster import load_raster

xarray = pytest.importorskip("xarray")
h5py = pytest.importorskip("h5py")
pytest.importorskip("h5netcdf")

DATA = Path(__file__).parents[1] / "data"
GRID, ENDLESS = DATA / "field_cases" / "time2.nc", DATA / "endless.nc"


def test_it_is_what_reading_it_here_gives():
    apart, here = (read(GRID, None, {"time": 1}) for read in (netcdf_apart.read_apart, netcdf_grid.read_grid))
    assert {**vars(apart), "values": 0, "x": 0, "y": 0} == {**vars(here), "values": 0, "x": 0, "y": 0}
    for name in ("values", "x", "y"):
        one, other = getattr(apart, name), getattr(here, name)
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)


def test_a_reference_system_and_an_odd_name_come_across(tmp_path):
    mapping = {"grid_mapping_name": "lambert_conformal_conic", "standard_parallel": np.array([49.0, 44.0])}
    mapping |= {"longitude_of_central_meridian": 3.0, "latitude_of_projection_origin": 46.5}
    data = xarray.Dataset(
        {"chl": (("y", "x"), np.arange(12.0).reshape(3, 4), {"grid_mapping": "crs"}), "crs": ((), 0, mapping)},
        coords={"x": np.arange(4.0), "y": np.arange(3.0)},
    )
    path = tmp_path / "été\udce9\n.nc"
    data.to_netcdf(tmp_path / "f.nc", engine="h5netcdf")
    (tmp_path / "f.nc").rename(path)
    crs = load_raster(path).crs
    assert "Lambert" in str(crs.name) and "49" in str(crs.name) and "44" in str(crs.name)


def test_doubts_of_the_reader_come_across(tmp_path):
    data = xarray.Dataset({"chl": (("lat", "lon"), np.arange(12.0).reshape(3, 4), {"grid_mapping": "gone"})})
    data.to_netcdf(tmp_path / "f.nc", engine="h5netcdf")
    with pytest.warns(UserWarning, match="gone"):
        load_raster(tmp_path / "f.nc")


def test_a_file_that_keeps_hdf5_busy_without_end_is_refused(monkeypatch):
    monkeypatch.setattr(netcdf_apart, "SECONDS", 2.0)
    with pytest.raises(InputError, match=r"endless.nc: damaged, HDF5 was not done with it after 2 s; get it anew"):
        load_raster(ENDLESS)


def test_its_process_ends_by_itself_where_nobody_waits():
    asked = {"path": str(ENDLESS), "value": None, "at": {}, "seconds": 1 - netcdf_apart.LATER, "sys_path": sys.path}
    program, request = [sys.executable, "-c", netcdf_apart.PROGRAM], json.dumps(asked).encode()
    done = subprocess.run(program, input=request, capture_output=True)
    assert done.returncode == 1 and not done.stdout


@pytest.mark.parametrize(
    ("end", "told"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", r"broke off reading it \(Segmentation fault\)"),
        ("sys.exit(3)", r"broke off reading it \(exit code 3 of .*python"),
    ],
)
def test_a_process_that_dies_is_told(end, told, monkeypatch):
    monkeypatch.setattr(netcdf_apart, "PROGRAM", f"import os, signal, sys\n{end}")
    with pytest.raises(InputError, match=told) as caught:
        load_raster(GRID, at={"time": 0})
    assert str(caught.value).startswith(str(GRID))


def test_no_interpreter_is_told(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/no/python")
    with pytest.raises(InputError, match="/no/python does not start to read it"):
        load_raster(GRID, at={"time": 0})


def test_a_small_file_of_more_values_than_memory_is_refused(tmp_path):
    with h5py.File(tmp_path / "f.nc", "w") as file:
        axes = [file.create_dataset(name, (2**33,), "f8", chunks=(1000,)) for name in ("lat", "lon")]
        values = file.create_dataset("chl", (2**33, 2**33), "f8", chunks=(10, 10))
        for dimension, axis in zip(values.dims, axes, strict=True):
            axis.make_scale()
            dimension.attach_scale(axis)
    with pytest.raises(InputError, match="Unable to allocate 64.0 GiB"):
        load_raster(tmp_path / "f.nc")


def test_hdf5_by_the_name_of_a_geotiff_is_none(tmp_path):
    pytest.importorskip("rasterio")
    (tmp_path / "f.tif").write_bytes(ENDLESS.read_bytes())
    with pytest.raises(InputError, match="f.tif: not a GeoTIFF"):
        load_raster(tmp_path / "f.tif")


def test_the_process_imports_no_jax():
    program = (
        "import sys, maipp.fields.netcdf_apart; print([m for m in ('jax', 'scipy', 'xarray') if m in sys.modules])"
    )
    asked = [sys.executable, "-c", f"import sys; sys.path[:] = {sys.path}; {program}"]
    assert subprocess.run(asked, capture_output=True, text=True, check=True).stdout == "[]\n"


def test_packages_are_those_of_this_process(tmp_path, monkeypatch):
    (tmp_path / "xarray.py").write_text("raise ImportError")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"NetCDF needs xarray.*pip install 'maipp\[geo\]'"):
        load_raster(GRID, at={"time": 0})
