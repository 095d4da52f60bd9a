"""GeoTIFF files written by rasterio: cell centres, bands, no-data, scale, reference system, and what is refused."""

import jax.numpy as jnp
import numpy as np
import pytest

from maipp.errors import InputError
from maipp.fields.raster import Raster, load_raster
from maipp.geo import WGS84, Crs

rasterio = pytest.importorskip("rasterio")
VALUES = np.arange(12, dtype=np.float32).reshape(3, 4) ** 1.5


def write(
    path, *bands, crs: str | None = "EPSG:32632", transform=None, descriptions=(), scales=None, offsets=None, **profile
):
    from rasterio.transform import from_origin

    transform = from_origin(500000, 5200030, 20, 10) if transform is None else transform
    profile = {"driver": "GTiff", "height": 3, "width": 4, "dtype": bands[0].dtype, **profile}
    with rasterio.open(path, "w", count=len(bands), crs=crs, transform=transform, **profile) as file:
        for number, band in enumerate(bands, start=1):
            file.write(band, number)
        for number, name in enumerate(descriptions, start=1):
            file.set_band_description(number, name)
        if scales:
            file.scales, file.offsets = scales, offsets
    return path


def test_north_up_with_cell_centres_and_reference_system(tmp_path):
    data = load_raster(write(tmp_path / "f.tif", VALUES, descriptions=["depth"]))
    np.testing.assert_array_equal(data.values, VALUES[::-1])
    np.testing.assert_array_equal(data.x, [500010, 500030, 500050, 500070])
    np.testing.assert_array_equal(data.y, [5200005, 5200015, 5200025])
    assert data.crs == Crs("EPSG:32632", metres=1.0) and data.missing is None
    assert (data.x_name, data.y_name, data.value_name) == ("x", "y", "depth")
    # The same values at the same places as rasterio itself samples them.
    with rasterio.open(tmp_path / "f.tif") as file:
        spots = [(500030.0, 5200015.0), (500070.0, 5200025.0)]
        theirs = [float(value[0]) for value in file.sample(spots)]
    field = Raster.from_data(data)
    ours = field.reference.to_user_values(field(jnp.asarray(field.reference.to_domain(np.array(spots)), jnp.float32)))
    np.testing.assert_allclose(ours, theirs, rtol=1e-5)


def test_degrees_and_own_reference_systems(tmp_path):
    from rasterio.transform import from_origin

    data = load_raster(write(tmp_path / "f.tiff", VALUES, crs="EPSG:4326", transform=from_origin(9, 48, 0.1, 0.1)))
    assert data.crs == WGS84 and (data.x_name, data.y_name) == ("longitude", "latitude")
    own = "+proj=aeqd +lat_0=47 +lon_0=9 +datum=WGS84 +units=m"
    data = load_raster(write(tmp_path / "g.tif", VALUES, crs=own))
    assert data.crs.metres == 1 and data.crs.name is not None
    assert rasterio.crs.CRS.from_wkt(data.crs.name).to_epsg() is None and "Azimuthal" in data.crs.name


@pytest.mark.parametrize(("value", "index"), [("depth", 1), ("2", 1), ("salt", 0), ("1", 0)])
def test_bands_by_name_and_number(value, index, tmp_path):
    path = write(tmp_path / "f.tif", VALUES, VALUES * 2, VALUES * 3, descriptions=["salt", "depth", "heat"])
    np.testing.assert_array_equal(load_raster(path, value=value).values[::-1], VALUES * (index + 1))


def test_no_data_is_refused_or_filled(tmp_path):
    holes = VALUES.astype(np.int16)
    holes[0, 0] = holes[2, 3] = -99
    path = write(tmp_path / "f.tif", holes, nodata=-99)
    with pytest.raises(InputError, match="row 0, column 0.*2 such in all; fill the gaps"):
        load_raster(path)
    data = load_raster(path, gaps="nearest")
    assert data.missing is not None and data.missing.sum() == 2
    assert data.missing[2, 0] and data.missing[0, 3]  # rows run north now
    assert data.values.min() >= 0
    np.testing.assert_array_equal(data.known(np.array([[500010.0, 5200025.0], [500030.0, 5200025.0]])), [False, True])


def test_scale_and_offset_are_applied(tmp_path):
    path = write(tmp_path / "f.tif", VALUES.astype(np.int16), scales=(0.5,), offsets=(10.0,))
    np.testing.assert_allclose(load_raster(path).values[::-1], VALUES.astype(np.int16) * 0.5 + 10)


def test_a_picture_without_coordinates_takes_an_extent(tmp_path):
    from rasterio.transform import Affine

    path = write(tmp_path / "f.tif", VALUES, crs=None, transform=Affine.identity())
    np.testing.assert_array_equal(load_raster(path).x, np.arange(4))
    data = load_raster(path, extent=(0.0, 30.0, 20.0, 0.0))
    np.testing.assert_array_equal(data.values, VALUES[::-1])
    np.testing.assert_array_equal(data.y, [0, 10, 20])


def rotated(path):
    from rasterio.transform import Affine

    write(path, VALUES, transform=Affine.rotation(20) * Affine.scale(10, -10))


BAD = {
    "rotated": (rotated, {}, "rotated.*gdalwarp"),
    "text": (lambda path: path.write_text("no picture"), {}, "not a GeoTIFF, or damaged"),
    "empty": (lambda path: path.write_bytes(b""), {}, "the file is empty"),
    "cut short": (lambda path: path.write_bytes(write(path, VALUES).read_bytes()[:60]), {}, "damaged|cannot be read"),
    "two bands": (lambda path: write(path, VALUES, VALUES), {}, r"more than one band \(1, 2\).*value=NAME"),
    "no such band": (lambda path: write(path, VALUES, VALUES), {"value": "3"}, "no band named '3'; there is: 1, 2"),
    "extent": (lambda path: write(path, VALUES), {"extent": (0.0, 1.0, 0.0, 1.0)}, "its own coordinates"),
    "complex": (lambda path: write(path, VALUES.astype(np.complex64)), {}, "complex64, not real numbers"),
    "all no data": (lambda path: write(path, VALUES * 0 - 1, nodata=-1), {"gaps": "nearest"}, "not one cell"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files_give_one_line(case, tmp_path):
    make, options, problem = BAD[case]
    make(tmp_path / "f.tif")
    with pytest.raises(InputError, match=problem) as caught:
        load_raster(tmp_path / "f.tif", **options)
    assert str(caught.value).startswith(str(tmp_path)) and "\n" not in str(caught.value)


def test_without_rasterio_the_extra_is_named(tmp_path, monkeypatch):
    path = write(tmp_path / "f.tif", VALUES)
    monkeypatch.setitem(__import__("sys").modules, "rasterio", None)
    with pytest.raises(InputError, match=r"pip install 'maipp\[geo\]'"):
        load_raster(path)


@pytest.mark.parametrize(
    ("crs", "place"),
    [
        ("EPSG:3857", (13.3, 53.4)),
        ("EPSG:25833", (13.3, 53.4)),
        ("EPSG:4314", (13.3, 53.4)),
        ("EPSG:4326", (13.3, 53.4)),
        ("EPSG:2263", (-73.97, 40.77)),
    ],
)
def test_a_domain_is_as_large_as_the_ground_is(tmp_path, crs, place):
    from rasterio.transform import from_bounds

    pyproj = pytest.importorskip("pyproj")
    there = pyproj.Transformer.from_crs(4326, crs, always_xy=True)
    step = np.array([0.02, 0.01])  # degrees: some kilometres
    (west, south), (east, north) = (there.transform(*(np.array(place) + sign * step)) for sign in (-1, 1))
    read = load_raster(
        write(tmp_path / "f.tif", VALUES, crs=crs, transform=from_bounds(west, south, east, north, 4, 3))
    )
    field = Raster.from_data(read)
    geod = pyproj.Geod(ellps="WGS84")
    middle = (read.x[0] + read.x[-1]) / 2, (read.y[0] + read.y[-1]) / 2
    across, along = (
        geod.inv(*there.transform(*a, direction="INVERSE"), *there.transform(*b, direction="INVERSE"))[2]
        for a, b in (
            ((read.x[0], middle[1]), (read.x[-1], middle[1])),
            ((middle[0], read.y[0]), (middle[0], read.y[-1])),
        )
    )
    metres = field.reference.metres_per_unit
    assert metres is not None and field.reference.geographic == (crs in ("EPSG:4314", "EPSG:4326"))
    assert np.array(field.domain) * metres == pytest.approx([across, along], rel=0.005)


def test_what_the_file_says_can_be_overridden(tmp_path):
    path = write(tmp_path / "f.tif", VALUES, crs="EPSG:3857")
    assert load_raster(path, crs=Crs("EPSG:25833", metres=1.0)).crs.name == "EPSG:25833"
