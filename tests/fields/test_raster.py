import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from matplotlib.cbook import get_sample_data
from scipy.interpolate import RegularGridInterpolator

from maipp.errors import InputError
from maipp.fields.raster import Raster, RasterData, load_raster, read_field
from maipp.geo import METRES, PLANE, WGS84, Crs, GeoReference

# Uneven spacing in both axes, and no symmetry that would hide a swap of rows and columns.
X = np.array([100.0, 110.0, 125.0, 150.0, 200.0])
Y = np.array([-3.0, 0.0, 20.0, 47.0])
VALUES = np.arange(20.0).reshape(4, 5) ** 1.5 - 7.0


def test_matplotlib_topobathy_loads_with_its_own_coordinates():
    source = get_sample_data("topobathy.npz", asfileobj=False)
    with np.load(source) as file:
        topo, longitude, latitude = file["topo"], file["longitude"], file["latitude"]
    data = load_raster(source)
    np.testing.assert_array_equal(data.values, topo)
    assert (data.value_name, data.x_name, data.y_name) == ("topo", "longitude", "latitude")
    # Latitude is not evenly spaced in this file: every sample must still come back at its own place.
    assert np.ptp(np.diff(latitude)) > 1e-4
    raster = Raster.from_data(dataclasses.replace(data, crs=WGS84))
    points = np.stack(np.meshgrid(longitude, latitude), axis=-1).reshape(-1, 2)
    read = raster(jnp.asarray(raster.reference.to_domain(points)))
    np.testing.assert_array_equal(read, raster.values.ravel())
    np.testing.assert_allclose(raster.reference.to_user_values(read), topo.ravel(), atol=1e-3)
    geod = pytest.importorskip("pyproj").Geod(ellps="WGS84")
    middle = [float(axis[0] + axis[-1]) / 2 for axis in (longitude, latitude)]
    # Short lengths at the middle, by an algorithm of others.
    east = geod.inv(middle[0] - 0.01, middle[1], middle[0] + 0.01, middle[1])[2] / 0.02 * np.ptp(longitude)
    north = geod.inv(middle[0], middle[1] - 0.01, middle[0], middle[1] + 0.01)[2] / 0.02 * np.ptp(latitude)
    assert raster.domain == pytest.approx((east / max(east, north), north / max(east, north)), rel=1e-5)
    assert raster.reference.metres_per_unit == pytest.approx(max(east, north), rel=1e-5)
    assert raster.reference.geographic


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"low": 3.0, "high": 3.0}, "low=3 and high=3"),
        ({"low": 100.0}, "low must be below high.*use invert"),
        ({"high": float("nan")}, "high=nan"),
        ({"low": -1.5e308, "high": 1.5e308}, "span no finite range"),
        ({"low": 0.0, "high": 1e-320}, "overflow"),
    ],
)
def test_unusable_limits_are_refused(options, problem):
    data = RasterData(VALUES, X, Y * 10, source="survey.npz")
    with pytest.raises(InputError, match=problem) as caught:
        Raster.from_data(data, **options)
    assert str(caught.value).startswith("survey.npz: ")


def test_grid_lines_that_single_precision_merges_are_refused():
    x = np.array([0.0, 1.0, np.nextafter(1.0, 2), 2.0, 3.0]) + 2.0**20
    x[2] = np.nextafter(x[1], np.inf)
    with jax.enable_x64(False), pytest.raises(InputError, match="too close for float32"):
        Raster.from_data(RasterData(VALUES, x, Y))


gaps = st.floats(0.05, 1.0)
unit_points = hnp.arrays(np.float32, (40, 2), elements=st.floats(-0.25, 1.25, width=32))


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(np.float64, 4, elements=gaps),
    hnp.arrays(np.float64, 3, elements=gaps),
    hnp.arrays(np.float64, (4, 5), elements=st.floats(-100.0, 100.0), unique=True),
    unit_points,
)
def test_bilinear_matches_scipy_and_clamps_at_the_border(x_gaps, y_gaps, values, points):
    x = np.concatenate([[-7.0], -7.0 + np.cumsum(x_gaps)])
    y = np.concatenate([[3.0], 3.0 + np.cumsum(y_gaps)])
    assume(np.ptp(values) > 1e-6)
    raster = Raster.from_data(RasterData(values, x, y))
    axes = (np.asarray(raster.y, np.float64), np.asarray(raster.x, np.float64))
    reference = RegularGridInterpolator(axes, np.asarray(raster.values, np.float64))
    inside = np.clip(points, 0.0, np.asarray(raster.domain))
    inside = np.minimum(inside, [axes[1][-1], axes[0][-1]])
    np.testing.assert_allclose(raster(jnp.asarray(points)), reference(inside[:, ::-1]), atol=2e-5)


def test_exact_at_the_samples_and_between_them():
    raster = Raster.from_data(RasterData(VALUES, X, Y))
    points = jnp.stack(jnp.meshgrid(raster.x, raster.y), axis=-1).reshape(-1, 2)
    np.testing.assert_array_equal(raster(points), raster.values.ravel())
    assert (raster.values.min(), raster.values.max()) == (0.0, 1.0)
    middle = (points[0] + points[6]) / 2  # centre of the first cell
    np.testing.assert_allclose(raster(middle[None])[0], raster.values[:2, :2].mean(), rtol=1e-5)


def test_jit_vmap_and_grad_work_and_agree():
    raster = Raster.from_data(RasterData(VALUES, X, Y))
    points = jnp.asarray(np.random.default_rng(1).uniform(0, 1, (6, 4, 2)), raster.x.dtype)
    batched = jax.jit(lambda field, p: jax.vmap(field)(p))(raster, points)
    np.testing.assert_allclose(batched.ravel(), raster(points.reshape(-1, 2)), atol=1e-6)
    fields = jax.tree.map(lambda a, b: jnp.stack([a, b]), raster, raster)
    both = jax.vmap(lambda field, p: field(p))(fields, points[:2])
    np.testing.assert_allclose(both, batched[:2], atol=1e-6)
    slope = jax.grad(lambda p: raster(p[None])[0])(jnp.array([0.02, 0.01]))
    upper = 0.01 / raster.y[1]
    cell = raster.values[:2, :2]
    assert slope[0] == pytest.approx(
        float(((cell[0, 1] - cell[0, 0]) * (1 - upper) + (cell[1, 1] - cell[1, 0]) * upper) / raster.x[1]),
        rel=1e-4,
    )


def test_the_longest_side_becomes_one():
    data = RasterData(VALUES, X, Y)
    raster = Raster.from_data(data)
    assert raster.domain == (1.0, 0.5)
    np.testing.assert_allclose(raster.x, [0, 0.1, 0.25, 0.5, 1.0], rtol=1e-6)
    assert Raster.from_data(RasterData(VALUES.T, Y, X)).domain == (0.5, 1.0)


def test_limits_and_inversion_set_which_value_is_interesting():
    data = RasterData(VALUES, X, Y)
    limited = Raster.from_data(data, low=-7.0, high=13.0)
    np.testing.assert_allclose(limited.values, (VALUES + 7) / 20, rtol=1e-6)
    inverted = Raster.from_data(data, invert=True)
    np.testing.assert_allclose(inverted.values, 1 - Raster.from_data(data).values, atol=1e-6)
    assert inverted.values[0, 0] == 1.0
    np.testing.assert_allclose(inverted.reference.to_user_std(np.array([0.5])), [0.5 * np.ptp(VALUES)])


def mappings():
    coordinate = st.floats(-1e6, 1e6)
    side = st.floats(1.0, 1e6)
    domain = st.floats(0.01, 100.0)
    limits = st.tuples(st.floats(-1e4, 1e4), st.floats(0.1, 1e4), st.booleans()).map(
        lambda t: (t[0], t[0] + t[1]) if t[2] else (t[0] + t[1], t[0])
    )
    return st.builds(
        lambda origin, size, domain, limits: GeoReference(origin, size, domain, *limits),
        st.tuples(coordinate, coordinate),
        st.tuples(side, side),
        st.tuples(domain, domain),
        limits,
    )


def test_degrees_are_known_and_not_guessed():
    # Review A7: metres in the proportions that degrees would have, and degrees on both sides of the equator.
    y = np.linspace(-0.7, 0.7, 15)
    x = np.linspace(0.0, 2.0, 15) * np.cos(np.radians(y[-1] + y[0]) / 2)
    values = np.arange(225.0).reshape(15, 15)
    metric = Raster.from_data(RasterData(values, x, y, crs=METRES)).reference
    assert not metric.geographic and metric.metres_per_unit == pytest.approx(2.0)
    plain = Raster.from_data(RasterData(values, x, y)).reference
    assert not plain.geographic and plain.metres_per_unit is None
    degrees = Raster.from_data(RasterData(values, x, y, crs=WGS84)).reference
    assert degrees.geographic and degrees.metres_per_unit == pytest.approx(2 * 111_319.49, rel=1e-6)


def test_what_is_no_degrees_is_told():
    with pytest.raises(InputError, match=r"^survey.npz: .* said to be degrees, .* y is -30..470"):
        Raster.from_data(RasterData(VALUES, X, Y * 10, "survey.npz", crs=WGS84))


def test_feet_are_feet():
    feet = Raster.from_data(RasterData(VALUES, X, Y, crs=Crs(metres=0.3048))).reference
    assert feet.domain == pytest.approx((1.0, 0.5)) and feet.metres_per_unit == pytest.approx(30.48)
    assert feet.length_scale == pytest.approx(100.0)


def test_one_function_reads_a_field(tmp_path):
    np.savez(tmp_path / "f.npz", depth=VALUES, salt=VALUES * 2, x=X / 100, y=Y)
    read = read_field(tmp_path / "f.npz", value="salt", low=0.0, high=50.0, invert=True, crs="WGS84")
    there = read.reference
    assert (there.value_at_zero, there.value_at_one, there.value_name) == (50.0, 0.0, "salt")
    assert there.crs == WGS84 and there.metres_per_unit == pytest.approx(50 * 110_700, rel=1e-2)
    assert read_field(tmp_path / "f.npz", value="salt", crs="none").reference.crs == PLANE


@given(mappings(), hnp.arrays(np.float64, (7, 2), elements=st.floats(0.0, 1.0)))
def test_mapping_round_trips(mapping, fractions):
    points = fractions * mapping.domain
    file_points = mapping.to_user(points)
    # In fractions of the domain: with an origin of 1e6 and a side of 1, doubles resolve 1e-10 of the side.
    returned = mapping.to_domain(file_points) / mapping.domain
    np.testing.assert_allclose(returned, fractions, rtol=0, atol=1e-9)
    np.testing.assert_allclose(mapping.to_user(mapping.to_domain(file_points)), file_points, rtol=1e-9, atol=1e-9)
    values = fractions[:, 0]
    file_values = mapping.to_user_values(values)
    np.testing.assert_allclose(mapping.to_domain_values(file_values), values, atol=1e-9)
    np.testing.assert_allclose(
        mapping.to_user_values(mapping.to_domain_values(file_values)), file_values, rtol=1e-9, atol=1e-9
    )
    # A standard deviation maps as the difference of two values does, and is never negative.
    np.testing.assert_allclose(
        mapping.to_user_std(values), np.abs(file_values - mapping.to_user_values(0.0)), rtol=1e-9, atol=1e-9
    )


def test_mapping_takes_the_files_own_corners_to_the_domains():
    raster = Raster.from_data(load_like_a_survey())
    corners = np.array([[100.0, -3.0], [200.0, 47.0]])
    np.testing.assert_array_equal(raster.reference.to_domain(corners), [[0, 0], [1, 0.5]])
    np.testing.assert_array_equal(raster.reference.to_user(np.array([[0, 0], [1, 0.5]])), corners)
    assert raster.reference.to_user_values(np.array([0.0, 1.0])).tolist() == [VALUES.min(), VALUES.max()]
    assert (raster.reference.x_name, raster.reference.y_name, raster.reference.value_name) == ("lon", "lat", "salt")
    assert hash(raster.reference) == hash(Raster.from_data(load_like_a_survey()).reference)


def load_like_a_survey():
    return RasterData(VALUES, X, Y, "survey.csv", "lon", "lat", "salt")
