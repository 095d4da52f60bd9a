"""Where agents end their survey, and the shortest ways there from anywhere, around no-go zones."""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from maipp.errors import InputError
from maipp.fields.mixture import host_grid
from maipp.roadmap.collision import is_collision_free
from maipp.roadmap.shortest_paths import TURNS, sight
from maipp.roadmap.zones import Borders, FreeSpace, Polygons, borders_of, everywhere, free_space, padded
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Int, Point

# Waypoints of a way home: turns, the place as far out of the zones as ways end, the place itself.
WAYPOINTS = TURNS + 1


class Ends(NamedTuple):
    """The places of each agent, of which any will do, and the ways there from the corners of the zones.

    One agent's have no axis m; those of a batch of missions have its axis in front.
    """

    bound: Bool[Array, "*b m"]  # whether the agent has any; else it may end anywhere
    places: Float[Array, "*b m k 2"]  # domain units; an agent with fewer has one of them again
    doors: Float[Array, "*b m k 2"]  # the same, those at the edge of a zone moved out of it
    steps: Float[Array, "*b m k"]  # from each door to its place, domain units
    onward: Float[Array, "*b m v"]  # length of the shortest way from each corner, domain units; inf: there is none
    turn: Int[Array, "*b m v"]  # the corner that it turns at next; -1 where it goes straight to a door
    door: Int[Array, "*b m v"]  # the door that it leads to
    lengths: Float[Array, "*b m g g"] | None  # of the shortest way from the grid's points (x, y); None without zones


class Home(eqx.Module):
    """Where the agents end, or one of them, and the no-go zones that are between."""

    ends: Ends
    borders: Borders | None


def lengths_home(home: Home, points: Float[Array, "p 2"]) -> Float[Array, " p"]:
    """Length of the shortest way from each point to one agent's home, domain units; inf where there is none."""
    straight, around, _, _ = _path_lengths(home, points)
    return jnp.minimum(jnp.min(straight, axis=-1), jnp.min(around, axis=-1, initial=jnp.inf))


def path_home(home: Home, here: Point) -> Float[Array, "w 2"]:
    """The first waypoints of the shortest way to one agent's home; its end again and again once it is reached.

    Where there is none it leads straight to the nearest place, whatever lies between.
    """
    ends, borders = home.ends, home.borders
    straight, around, lengths, there = (each[0] for each in _path_lengths(home, here[None]))
    door = jnp.argmin(jnp.where(jnp.isfinite(jnp.min(straight)), straight, lengths))
    if borders is None:
        return jnp.broadcast_to(ends.places[door], (WAYPOINTS, 2))
    corner = jnp.where(jnp.min(around) < jnp.min(straight), jnp.argmin(around), -1)
    door = jnp.where(corner < 0, door, ends.door[corner])
    points, arrived = [], jnp.asarray(False)
    for _ in range(TURNS):
        arrived = corner < 0
        last = jnp.where(there[door], ends.places[door], ends.doors[door])
        points.append(jnp.where(arrived, last, borders.corners[corner]))
        corner = jnp.where(arrived, -1, ends.turn[corner])
    return jnp.stack([*points, jnp.where(arrived, ends.places[door], points[-1])])


def _path_lengths(home: Home, points: Float[Array, "p 2"]) -> tuple[Array, Array, Array, Array]:
    """Lengths straight to each door and on (p, k), by way of each corner (p, v), inf where zones are between.

    The others are those straight to each door whatever is between (p, k), and whether a point is between a place and
    its door, as near as no zone is: then it need not go by the door (p, k).
    """
    ends, borders = home.ends, home.borders
    away = _distances(points, ends.places)
    there = away <= ends.steps + DISTANCE_TOLERANCE
    lengths = jnp.where(there, away, _distances(points, ends.doors) + ends.steps)
    if borders is None:
        return lengths, jnp.full((len(points), 0), jnp.inf, lengths.dtype), lengths, there
    straight = jnp.where(there | is_collision_free(borders, points[:, None], ends.doors), lengths, jnp.inf)
    around = jax.vmap(sight, (None, 0))(borders, points) + ends.onward
    return straight, around, lengths, there


def _distances(points: Float[Array, "p 2"], ends: Float[Array, "k 2"]) -> Float[Array, "p k"]:
    offset = ends - points[:, None]
    return jnp.sqrt(jnp.sum(offset * offset, axis=-1))


def home_of(
    places: Sequence[Sequence[tuple[float, float]]], obstacles: Polygons, extent: tuple[float, float], grid: int
) -> Home:
    """The way to each agent's places (domain units), on the host; at least one agent has one.

    `grid` are the points per side of the evaluation grid.

    Raises `InputError` for a place within a no-go zone; the message names `end[i]`, i the agent.
    """
    most = max(map(len, places))
    some = next(each[0] for each in places if each)
    own = np.array([[*each, *[each[0] if each else some] * (most - len(each))] for each in places], float)
    m, k, _ = own.shape  # (m, k, 2)
    doors, v, borders, lengths = own, 0, None, None
    rows = [(np.empty(0), np.empty(0, np.int32), np.empty(0, np.int32))] * m
    if obstacles:
        free = free_space(obstacles, extent)
        moved, reached = free.moved_out(own.reshape(-1, 2))
        if not reached.all():
            agent, place = divmod(int(np.argmin(reached)), k)
            x, y = own[agent, place]
            raise InputError(f"end[{agent}]: ({x:g}, {y:g}) lies within a no-go zone; give a place outside")
        doors, borders = moved.reshape(m, k, 2), borders_of(free, extent)
        v = len(borders.corners)
        lengths = np.stack([_lengths(free, ends, each, extent, grid) for ends, each in zip(doors, own, strict=True)])
        rows = [_onward(free, ends, np.hypot(*(ends - each).T)) for ends, each in zip(doors, own, strict=True)]
    onward, turn, door = (np.stack(each) for each in zip(*rows, strict=True))
    real = jnp.result_type(float)
    ends = Ends(
        bound=jnp.asarray([len(each) > 0 for each in places]),
        places=jnp.asarray(own, real),
        doors=jnp.asarray(doors, real),
        steps=jnp.asarray(np.linalg.norm(doors - own, axis=-1), real),
        onward=padded(onward, (m, v), np.inf),
        turn=padded(turn, (m, v), -1),
        door=padded(door, (m, v), 0),
        lengths=None if lengths is None else jnp.asarray(lengths, real),
    )
    return Home(ends, borders)


def _lengths(
    free: FreeSpace,
    doors: Float[np.ndarray, "k 2"],
    ends: Float[np.ndarray, "k 2"],
    extent: tuple[float, float],
    grid: int,
) -> Float[np.ndarray, "g g"]:
    """Length of the shortest way from each point of the evaluation grid to an end, by its door."""
    places, reached = free.moved_out(host_grid(grid, extent))
    ways = [free.lengths_to(places, door) + np.hypot(*(end - door)) for door, end in zip(doors, ends, strict=True)]
    shortest = np.where(reached, np.min(ways, axis=0), np.inf)
    return everywhere(shortest, places, ends[0]).reshape(grid, grid)


def _onward(
    free: FreeSpace, doors: Float[np.ndarray, "k 2"], steps: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, " v"], Int[np.ndarray, " v"], Int[np.ndarray, " v"]]:
    """From each corner: length of the shortest way to a door and on, the next corner (-1: none), which door."""
    last = free.straight(free.corners, doors) + steps
    count = len(free.corners)
    graph = np.full((count + 1, count + 1), np.inf)  # the last node stands for all doors
    graph[:count, :count] = free.legs
    graph[count, :count] = np.min(last, axis=1)
    row, column = np.nonzero(np.isfinite(graph))
    sparse = csr_array((graph[row, column], (row, column)), shape=graph.shape)
    onward, before = dijkstra(sparse, indices=count, return_predecessors=True)
    turn = np.where((before[:count] == count) | (before[:count] < 0), -1, before[:count]).astype(np.int32)
    door = np.argmin(last, axis=1).astype(np.int32)
    for corner in np.argsort(onward[:count]):  # those nearer to a door first
        if turn[corner] >= 0:
            door[corner] = door[turn[corner]]
    return onward[:count], turn, door
