"""Maps lie right whatever leads from the domain to the user's coordinates."""

import dataclasses
from collections.abc import Callable

import numpy as np

from maipp.geo import GeoReference
from maipp.viz.report_grid import MOST_PER_SIDE, map_grid
from maipp.viz.report_survey import SurveyReport


class Other(GeoReference):
    """Any way from the domain to the user's coordinates, as a projection may be."""

    way: Callable[[np.ndarray], np.ndarray]

    @classmethod
    def by(cls, way):
        found = cls((0.0, 0.0), (1.0, 0.5), (1.0, 0.5))
        object.__setattr__(found, "way", way)
        return found

    def to_user(self, points):
        return self.way(np.asarray(points, np.float64).reshape(-1, 2)).reshape(np.shape(points))


def plane(points):
    return 2.0 * points[..., 0] - 3.0 * points[..., 1] + 0.5


def grid_points(side, extent=(1.0, 0.5)):
    x, y = (np.linspace(0, length, side) for length in extent)
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


def test_an_affine_map_changes_no_value(episode, mapping):
    grid = map_grid(SurveyReport(dataclasses.replace(episode, reference=mapping)))
    np.testing.assert_allclose(grid.x, np.linspace(10, 12, 9))
    np.testing.assert_allclose(grid.y, np.linspace(60, 60.5, 9))
    values = np.arange(81.0)
    np.testing.assert_array_equal(grid.pictures(values[None])[0], values.reshape(9, 9).T)


def test_a_turned_projection_is_drawn_where_it_is(episode):
    angle = 0.3
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    grid = map_grid(SurveyReport(episode, reference=Other.by(lambda points: 1000 * points @ turn)))
    (picture,) = grid.pictures(plane(grid_points(9))[None])
    where = np.stack(np.meshgrid(grid.x, grid.y), axis=-1) @ turn.T / 1000
    inside = ((where > 1e-6) & (where < np.array([1.0, 0.5]) - 1e-6)).all(axis=-1)
    assert 0.3 < inside.mean() < 0.9
    np.testing.assert_allclose(picture[inside], plane(where)[inside], atol=1e-9)
    assert np.isfinite(picture).all() and plane(grid_points(9)).min() <= picture.min()


def test_the_outline_of_a_turned_domain_is_its_border(episode):
    report = SurveyReport(episode, reference=Other.by(lambda points: 1000 * points[:, ::-1]))
    outline = report.outline / 1000
    np.testing.assert_allclose([*outline.min(axis=0), *outline.max(axis=0)], [0, 0, 0.5, 1.0], atol=1e-12)
    on_border = np.isclose(outline, 0).any(axis=1) | np.isclose(outline, [0.5, 1.0]).any(axis=1)
    assert on_border.all() and len(outline) >= 4


def test_a_hardly_bent_projection_keeps_the_values(episode):
    grid = map_grid(
        SurveyReport(episode, reference=Other.by(lambda p: 1000 * (p + [[0.004, 0.002]] * p[:, ::-1] ** 2)))
    )
    assert grid.bent is None


def test_a_fine_grid_is_thinned(episode):
    scenario = episode.scenario.replace(grid=101)
    grid = map_grid(SurveyReport(dataclasses.replace(episode, scenario=scenario)))
    (picture,) = grid.pictures(plane(grid_points(101))[None])
    assert picture.shape == (MOST_PER_SIDE, MOST_PER_SIDE)
    where = np.stack(np.meshgrid(grid.x, grid.y), axis=-1)
    np.testing.assert_allclose(picture, plane(where), atol=1e-12)
