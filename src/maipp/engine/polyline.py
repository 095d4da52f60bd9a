"""Polylines: legs that agents travel, paths that they may travel, in compiled code and on the host (Shapely)."""

import jax.numpy as jnp
import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.ops import substring

from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Extent, Float, Real


def along(polyline: Float[Array, "v 2"], distance: Float[Array, "..."]) -> Float[Array, "... 2"]:
    """Points at given distances along a polyline, clamped to its ends (domain units)."""
    steps = jnp.sqrt(jnp.sum((polyline[1:] - polyline[:-1]) ** 2, axis=-1))
    position = jnp.broadcast_to(polyline[0], (*jnp.shape(distance), 2))
    done = jnp.zeros((), polyline.dtype)
    for i in range(polyline.shape[0] - 1):
        share = jnp.clip((distance - done) / jnp.maximum(steps[i], 1e-12), 0.0, 1.0)[..., None]
        # The end of an edge is that vertex exactly: a sum of edges may round to a point outside the domain.
        position = jnp.where(share < 1.0, position + share * (polyline[i + 1] - polyline[i]), polyline[i + 1])
        done = done + steps[i]
    return position


def distances(polyline: Float[Array, "v 2"]) -> Float[Array, " v"]:
    """Of each vertex from the first, along a polyline (domain units)."""
    steps = jnp.sqrt(jnp.sum((polyline[1:] - polyline[:-1]) ** 2, axis=-1))
    return jnp.concatenate([jnp.zeros(1, polyline.dtype), jnp.cumsum(steps)])


def cut_leg(
    extent: Extent, position: Float[Array, "2"], waypoints: Float[Array, "w 2"], remaining: Float[Array, ""]
) -> tuple[Float[Array, "v 2"], Float[Array, " w"]]:
    """The leg from `position` through the waypoints, within the domain and cut where `remaining` (domain units) ends.

    Also the distance from the position to each waypoint of the leg, the last of which is its length.
    """
    planned = jnp.concatenate([position[None], jnp.clip(waypoints, 0.0, jnp.asarray(extent, position.dtype))])
    reach = jnp.minimum(distances(planned)[1:], remaining)
    return jnp.concatenate([position[None], along(planned, reach)]), reach


def along_paths(
    start: Float[Array, "2"], waypoints: Float[Array, "*c w 2"], offsets: Float[Array, " h"]
) -> tuple[Float[Array, "*c h 2"], Float[Array, "*c"]]:
    """Points at the given distances along each path from `start`, clamped to its end, and the paths' lengths."""
    origin = jnp.broadcast_to(start, (*waypoints.shape[:-2], 1, 2))
    vertices = jnp.concatenate([origin, waypoints], axis=-2)
    edges = vertices[..., 1:, :] - vertices[..., :-1, :]
    squared = jnp.sum(edges * edges, axis=-1)
    # sqrt has an infinite slope at zero: an edge of length zero (a repeated waypoint) passes no gradient.
    lengths = jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)), 0.0)
    points = jnp.broadcast_to(origin, (*waypoints.shape[:-2], offsets.shape[0], 2))
    done = jnp.zeros(lengths.shape[:-1], lengths.dtype)
    for i in range(lengths.shape[-1]):
        share = jnp.clip((offsets - done[..., None]) / jnp.maximum(lengths[..., i, None], 1e-12), 0.0, 1.0)
        points = points + share[..., None] * edges[..., i, None, :]
        done = done + lengths[..., i]
    return points, done


def first_part(start: Float[Array, "2"], path: Float[Array, "w 2"], length: Real) -> Float[Array, "w 2"]:
    """The path's waypoints, cut where it is `length` long (domain units)."""
    whole = jnp.concatenate([start[None], path])
    return along(whole, jnp.minimum(distances(whole)[1:], length))


def moves_on(polyline: Float[np.ndarray, "v 2"]) -> Bool[np.ndarray, " v"]:
    """Vertices of a polyline on the host that are elsewhere than the one before."""
    return np.append(True, np.hypot(*np.diff(polyline, axis=0).T) > DISTANCE_TOLERANCE)


def without_repeats(polyline: Float[np.ndarray, "v 2"]) -> Float[np.ndarray, "w 2"]:
    """The polyline on the host without vertices that are where the one before is."""
    return polyline[moves_on(polyline)]


def place_at(polyline: Float[np.ndarray, "v 2"], distance: float) -> Float[np.ndarray, "2"]:
    """The point at a distance along a polyline on the host; its end where it is shorter."""
    if len(polyline) == 1:
        return polyline[0]
    return shapely.get_coordinates(shapely.line_interpolate_point(LineString(polyline), distance))[0]


def shortened(polyline: Float[np.ndarray, "v 2"], length: float) -> Float[np.ndarray, "w 2"]:
    """The polyline on the host as far as it is not longer than `length` (> 0)."""
    line = LineString(polyline)
    return polyline if line.length <= length else shapely.get_coordinates(substring(line, 0.0, length))


def followed(
    polyline: Float[np.ndarray, "v 2"], position: Float[np.ndarray, "2"], about: float, accuracy: float = 0.05
) -> float:
    """Length of the way along a polyline on the host to its point nearest to a position, and on to the position.

    Where it comes by more than once, within `accuracy` of its length, it is the time whose way is nearest to `about`.
    """
    offsets = np.diff(polyline, axis=0)
    steps = np.hypot(*offsets.T)
    marks = np.concatenate([[0.0], np.cumsum(steps)])
    if marks[-1] == 0.0:
        return float(np.hypot(*(position - polyline[0])))
    offsets, begins, marks = offsets[steps > 0], polyline[:-1][steps > 0], marks[:-1][steps > 0]
    steps = steps[steps > 0]
    shares = np.clip(((position - begins) * offsets).sum(axis=1) / steps**2, 0.0, 1.0)
    gaps = np.hypot(*(begins + shares[:, None] * offsets - position).T)
    ways = marks + shares * steps
    near = gaps <= gaps.min() + accuracy * float(steps.sum())
    # Where it comes by once only, the nearest point itself.
    apart = np.abs(ways - ways[np.argmin(gaps)]) > 2 * accuracy * float(steps.sum())
    able = np.flatnonzero((near & apart) | (gaps == gaps.min()))
    best = able[np.argmin(np.abs(ways[able] - about))]
    return float(ways[best] + gaps[best])
