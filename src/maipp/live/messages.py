"""Messages and memories outside of JAX: as bytes, exactly, and for people, in their own units."""

import base64
import binascii
from typing import Any

import jax
import numpy as np

from maipp.errors import InputError
from maipp.live.units import Units
from maipp.planners.announced.announcement import Announcement, TeamPlan
from maipp.team import Intent


def pack(tree: Any) -> str:
    """All arrays of a pytree as text, every bit of them; empty where there are none."""
    return base64.b64encode(b"".join(np.asarray(leaf).tobytes() for leaf in jax.tree.leaves(tree))).decode("ascii")


def unpack(text: str, like: Any) -> Any:
    """The pytree that `pack` made text of, with the structure of `like`; host arrays.

    Raises `InputError` for a text of another structure.
    """
    leaves, structure = jax.tree.flatten(like)
    arrays = [np.asarray(leaf) for leaf in leaves]
    try:
        content = base64.b64decode(text.encode("ascii"), validate=True)
    except (binascii.Error, UnicodeEncodeError):
        raise InputError("packed: not base64 text; send what the other process answered") from None
    if len(content) != sum(array.nbytes for array in arrays):
        raise InputError(
            f"packed: {len(content)} bytes; this planner's message has {sum(array.nbytes for array in arrays)}"
        )
    read, at = [], 0
    for array in arrays:
        read.append(np.frombuffer(content, array.dtype, array.size, at).reshape(array.shape).copy())
        at += array.nbytes
    return jax.tree.unflatten(structure, read)


def stacked(trees: list[Any]) -> Any:
    """The pytrees of all agents as one, with a leading axis."""
    return jax.tree.map(lambda *leaves: np.stack(leaves), *trees)


def describe(message: Any, units: Units) -> dict[str, Any] | None:
    """The message in the caller's coordinates and units, and `packed`; None where it announces nothing.

    An intent has `mean` and `covariance` (xx, xy, yy); announced measurements `points` and `times`, with the sender's
    `remaining` budget in joint form; a target is one of `points`. What other planners tell is in `arrays`, as it is.
    """
    told = _told(message, units)
    return None if told is None else told | {"packed": pack(message)}


def _told(message: Any, units: Units) -> dict[str, Any] | None:
    if isinstance(message, Intent):
        if not (np.isfinite(message.mean).all() and np.isfinite(message.covariance).all()):
            return None
        (mean,) = units.points_out(np.asarray(message.mean)[None])
        return {"mean": mean, "covariance": units.covariance_out(np.asarray(message.covariance))}
    if isinstance(message, Announcement):
        planned = np.isfinite(message.times) & np.isfinite(message.points).all(axis=-1)
        if not planned.any():
            return None
        times = [units.time_out(float(time)) for time in np.asarray(message.times)[planned]]
        return {"points": units.points_out(np.asarray(message.points)[planned]), "times": times}
    if isinstance(message, TeamPlan):
        legs = _told(message.legs, units)
        return None if legs is None else legs | {"remaining": units.length_out(float(message.remaining))}
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(message)]
    if len(leaves) == 1 and leaves[0].shape == (2,):
        return {"points": units.points_out(leaves[0][None])} if np.isfinite(leaves[0]).all() else None
    return {"arrays": [_plain(leaf.tolist()) for leaf in leaves]} if leaves else None


def _plain(value: Any) -> Any:
    """The number or nested lists with null for what JSON has no number for."""
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value if not isinstance(value, float) or np.isfinite(value) else None
