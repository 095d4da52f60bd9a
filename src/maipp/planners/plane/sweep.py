"""Rows of a sweep, clipped to what no-go zones leave free."""

import equinox as eqx
import numpy as np
import shapely

from maipp.roadmap.zones import free_space, padded, rounded
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Float, Int

# Numbers of vertices are padded to a multiple of this, so that areas share one compiled planner.
_VERTICES = 64

# Pieces of rows shorter than this many clearances are left out.
_SHORTEST = 10


class Sweep(eqx.Module):
    """The pieces of all rows of all strips, and the orders in which agents sweep them."""

    points: Float[Array, "p 2"]  # both ends of every piece, domain units
    onward: Float[Array, "v p"]  # length of the shortest way from each corner of the zones to each of them
    order: Int[Array, "m 4 t"]  # agent, first corner (2 * from the top + from the right): which points, one by one
    valid: Bool[Array, "m 4 t"]  # False for padding


def clipped_sweep(
    scenario: Scenario, rows: int, margin: float, corners: int, points: int = 0, vertices: int = 0
) -> Sweep:
    """The sweep of a scenario with no-go zones: each agent's own strip, then those of the others.

    As many `corners` as the zones have with padding; padded to at least that many `points` and `vertices`.
    """
    free, agents = free_space(scenario.obstacles, scenario.extent), scenario.agents
    width, height = scenario.extent
    strip, gap = width / agents, height / rows
    ends: list[np.ndarray] = []
    # Row by row of each strip, on the way there and back: the pieces from left to right, as numbers of their left ends.
    pieces: list[list[list[int]]] = []
    lines = [row + 0.5 for row in range(rows)] + [rows - 1.0 - row for row in range(rows - 1)]
    for agent in range(agents):
        pieces.append([])
        for line in lines:
            whole = shapely.linestrings(
                [(strip * (agent + margin), line * gap), (strip * (agent + 1 - margin), line * gap)]
            )
            parts = [part for part in shapely.get_parts(free.outside & whole) if part.geom_type == "LineString"]
            parts = sorted(part.bounds for part in parts if part.length >= _SHORTEST * free.clearance)
            pieces[-1].append([len(ends) + 2 * i for i in range(len(parts))])
            ends += [np.array([x, y]) for left, bottom, right, top in parts for x, y in ((left, bottom), (right, top))]
    count = rounded(max(len(ends), points), _VERTICES)
    places = np.array(ends).reshape(-1, 2)

    orders = []
    for agent in range(agents):
        for from_top in (False, True):
            for from_right in (False, True):
                order: list[int] = []
                for other in range(agents):
                    order += _one_strip(pieces[(agent + other) % agents], rows, from_top, from_right)
                orders.append(np.array(order, np.int32))
    longest = rounded(max(vertices, *(len(order) for order in orders)), _VERTICES)
    shape = (agents, 4, longest)
    table = np.stack([np.pad(order, (0, longest - len(order)), constant_values=-1) for order in orders]).reshape(shape)
    return Sweep(
        points=padded(places, (count, 2), -max(scenario.extent)),
        onward=padded(free.corner_lengths_to(places), (corners, count), np.inf),
        order=padded(np.maximum(table, 0), shape, 0),
        valid=padded(table >= 0, shape, False),
    )


def _one_strip(rows_of: list[list[int]], rows: int, from_top: bool, from_right: bool) -> list[int]:
    """The piece ends of a strip in the order of its sweep, back between the rows included."""
    order: list[int] = []
    for row, pieces in enumerate(_rows_in_order(rows_of, rows, from_top)):
        leftwards = (row % 2 == 1) != from_right
        for left in pieces[::-1] if leftwards else pieces:
            order += [left + 1, left] if leftwards else [left, left + 1]
    return order


def _rows_in_order(rows_of: list[list[int]], rows: int, from_top: bool) -> list[list[int]]:
    there, back = rows_of[:rows], rows_of[rows:]
    return there[::-1] + back[::-1] if from_top else there + back
