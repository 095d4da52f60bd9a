"""Fields on an evenly spaced grid of the user's coordinates, which is what a heat map can draw."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator, RegularGridInterpolator

from maipp.typing import Float
from maipp.viz.report_survey import SurveyReport

# More points than this along a side are drawn coarser: nobody sees them on a map, but the file would grow tenfold.
MOST_PER_SIDE = 64
# A projection bends and turns the grid. By less than this part of a cell it is drawn as if it did not.
_STRAIGHT = 0.1


@dataclass(frozen=True, eq=False)
class MapGrid:
    """The evenly spaced columns and rows of a map, and how values on the evaluation grid get there."""

    x: Float[np.ndarray, " c"]  # of the columns, user's coordinates
    y: Float[np.ndarray, " r"]  # of the rows
    side: int  # points per side of the evaluation grid
    bent: Float[np.ndarray, "q 2"] | None  # where the evaluation grid is, if not on straight columns and rows

    def pictures(self, values: Float[np.ndarray, "k q"]) -> Float[np.ndarray, "k r c"]:
        """Rows of values on the evaluation grid as pictures, rows ascending in y.

        Beyond a grid that is turned the nearest value goes on, so that colours reach its border.
        """
        values = np.asarray(values, np.float64)
        if self.bent is not None:
            # Linear between the places where values are known; the triangles are found once for all pictures.
            at = np.stack(np.meshgrid(self.x, self.y), axis=-1)
            there = LinearNDInterpolator(self.bent, values.T, rescale=True)(at)
            beyond = np.isnan(there[..., 0])
            there[beyond] = NearestNDInterpolator(self.bent, values.T, rescale=True)(at[beyond])
            return np.moveaxis(there, -1, 0)
        pictures = np.swapaxes(values.reshape(-1, self.side, self.side), 1, 2)
        if len(self.x) == self.side:
            return pictures
        whole = np.linspace(0.0, 1.0, self.side)
        share = np.linspace(0.0, 1.0, len(self.x))
        at = np.stack(np.meshgrid(share, share, indexing="ij"), axis=-1)
        return np.moveaxis(RegularGridInterpolator((whole, whole), np.moveaxis(pictures, 0, -1))(at), -1, 0)


def map_grid(report: SurveyReport) -> MapGrid:
    """The grid on which the report's maps are drawn.

    The evaluation grid itself where it lies on straight, evenly spaced lines in the user's coordinates; else lines of
    its own across all of it.
    """
    scenario = report.episode.scenario
    side = scenario.grid
    x, y = (np.linspace(0.0, length, side) for length in scenario.extent)
    where = report.geo.to_user(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))  # (side, side, 2)
    low, high = where.min(axis=(0, 1)), where.max(axis=(0, 1))
    lines = [np.linspace(low[axis], high[axis], side) for axis in (0, 1)]
    straight = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    is_straight = (np.abs(where - straight) <= _STRAIGHT * (high - low) / (side - 1)).all()
    # Between places that lie askew finer lines show more.
    drawn = min(side if is_straight else 2 * side, MOST_PER_SIDE)
    x, y = (np.linspace(low[axis], high[axis], drawn) for axis in (0, 1))
    return MapGrid(x, y, side, None if is_straight else where.reshape(-1, 2))
