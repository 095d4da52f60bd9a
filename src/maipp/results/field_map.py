"""The map of a survey: mean, standard deviation and high interest in the cells of a grid, north up."""

from dataclasses import dataclass
from functools import cached_property

import jax.numpy as jnp
import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from maipp.engine.score import interest_of
from maipp.foresight import Foresight, ForesightName, make_foresight
from maipp.geo import Crs, transform, unwrap
from maipp.results.taken import Taken
from maipp.roadmap import Obstacles
from maipp.surveys.area import as_region
from maipp.typing import Bool, Float

CELLS, FEWEST_CELLS, MOST_CELLS = 200, 10, 2000  # along the longer side
_TOGETHER = 1024  # cells that are asked together; one number, so that one shape is compiled for
_PIECES = 100  # of a border, which is straight in its own system and not in the domain


@dataclass(frozen=True, eq=False)
class FieldMap:
    """Values of cells, rows from north to south; NaN in cells whose middle is not in the area."""

    crs: Crs  # of the coordinates; longitudes may go on beyond 180
    west: float  # border of the first column
    north: float  # border of the first row
    cell: tuple[float, float]  # width and height
    mean: Float[np.ndarray, "r c"]  # the caller's unit
    std: Float[np.ndarray, "r c"]
    # 2 where the mean reaches the threshold, 1 where it only cannot be ruled out that the value does, 0 elsewhere; None
    # without a threshold.
    interest: Float[np.ndarray, "r c"] | None
    # What a foresight expects of the true field, the caller's unit; None: none was asked.
    foreseen_mean: Float[np.ndarray, "r c"] | None = None
    foreseen_std: Float[np.ndarray, "r c"] | None = None

    @cached_property
    def inside(self) -> Bool[np.ndarray, "r c"]:
        """The cells of the area."""
        return np.isfinite(self.mean)

    def share(self, least: int) -> float | None:
        """Share of the area whose interest is at least this; None without a threshold."""
        return None if self.interest is None else float((self.interest[self.inside] >= least).mean())


def field_map(taken: Taken, cells: int = CELLS, foresight: ForesightName | None = None) -> FieldMap:
    """The map, with `cells` along the longer side, square on the ground; that of a foresight too, if one is named."""
    user = _border(taken)
    border = _moved(taken, shapely.get_coordinates(user))
    (west, south), (east, north) = border.min(axis=0), border.max(axis=0)
    # Length of a unit of y over that of one of x: degrees of longitude shrink.
    aspect = taken.frame.for_pictures.aspect if taken.crs == taken.frame.crs else 1.0
    height = max(north - south, (east - west) / aspect) / cells
    cell = height * aspect, height
    columns, rows = (max(round(span / size), 1) for span, size in zip((east - west, north - south), cell, strict=True))
    cell = (east - west) / columns, (north - south) / rows
    x = west + cell[0] * (np.arange(columns) + 0.5)
    y = north - cell[1] * (np.arange(rows) + 0.5)
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    back = taken.crs.located and taken.crs != taken.frame.crs
    points = taken.frame.to_domain(transform(middles, taken.crs, taken.frame.crs) if back else middles)
    inside = _inside(taken, user, points)
    mean, std = _asked(taken, points[inside])
    scenario, foreseen = taken.episode.scenario, {}
    bound = np.asarray(interest_of(scenario).bound(jnp.asarray(mean), jnp.asarray(std**2)))
    interest = 1.0 * (bound >= scenario.threshold) + (mean >= scenario.threshold)

    def spread(values: np.ndarray) -> Float[np.ndarray, "r c"]:
        whole = np.full(len(points), np.nan)
        whole[inside] = values
        return whole.reshape(rows, columns)

    if foresight is not None:
        law = _asked(taken, points[inside], make_foresight(foresight, scenario))
        foreseen["foreseen_mean"] = spread(taken.frame.to_user_values(law[0]))
        foreseen["foreseen_std"] = spread(taken.frame.to_user_std(law[1]))
    return FieldMap(
        crs=taken.crs,
        west=float(west),
        north=float(north),
        cell=(float(cell[0]), float(cell[1])),
        mean=spread(taken.frame.to_user_values(mean)),
        std=spread(taken.frame.to_user_std(std)),
        interest=spread(interest) if taken.threshold_given else None,
        **foreseen,
    )


def _border(taken: Taken) -> BaseGeometry:
    """The border of the area, of a scenario that of the domain, the caller's coordinates; of many short pieces."""
    if taken.area is None:
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * taken.frame.domain
        pieces = shapely.segmentize(Polygon(corners), max(taken.frame.domain) / _PIECES)
        return shapely.transform(pieces, taken.frame.to_user)
    return _pieces(taken, taken.area)


def _pieces(taken: Taken, ring: np.ndarray) -> BaseGeometry:
    points = np.asarray(ring, np.float64)
    if taken.frame.geographic:
        points = unwrap(points, float(points[0, 0]))
    return shapely.segmentize(Polygon(points), float(np.ptp(points, axis=0).max()) / _PIECES)


def _moved(taken: Taken, points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
    """The caller's coordinates in the map's system."""
    if taken.crs.located and taken.crs != taken.frame.crs:
        points = transform(points, taken.frame.crs, taken.crs)
    return unwrap(points, float(points[0, 0])) if taken.crs.geographic else points


def _inside(taken: Taken, border: BaseGeometry, points: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
    """Which domain positions lie in the area and in no zone."""
    if taken.area is None:
        width, height = taken.frame.domain
        free = (points >= -1e-9).all(axis=1) & (points[:, 0] <= width + 1e-9) & (points[:, 1] <= height + 1e-9)
        zones = taken.episode.scenario.obstacles
        return free & Obstacles(zones).free(points) if zones else free
    zones = [shapely.transform(_pieces(taken, ring), taken.frame.to_domain) for ring in taken.no_go]
    area = as_region([shapely.transform(border, taken.frame.to_domain)])
    return shapely.contains_xy(shapely.difference(area, as_region(zones)), points[:, 0], points[:, 1])


def _asked(
    taken: Taken, points: Float[np.ndarray, "p 2"], foresight: Foresight | None = None
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Mean and standard deviation at domain positions, asked in parts of one size."""
    means, stds = [np.zeros(0)], [np.zeros(0)]
    for first in range(0, len(points), _TOGETHER):
        part = points[first : first + _TOGETHER]
        mean, std = taken.belief(part[np.minimum(np.arange(_TOGETHER), len(part) - 1)], foresight)
        means.append(np.asarray(mean, np.float64)[: len(part)])
        stds.append(np.asarray(std, np.float64)[: len(part)])
    return np.concatenate(means), np.concatenate(stds)
