"""What installed packages bring: planners, vehicles and readers of fields, by their entry points.

The groups are `maipp.planners` (a name to a `Planner` class), `maipp.vehicles`, and `maipp.readers` (a file ending
without its dot to a function of a path that gives a `RasterData`).
"""

from importlib.metadata import entry_points
from typing import Any, NamedTuple

from maipp.errors import InputError, first_line

PLANNERS, READERS, VEHICLES = "maipp.planners", "maipp.readers", "maipp.vehicles"


class Brought(NamedTuple):
    """What an installed package brings."""

    where: str  # module:name
    thing: Any


def extensions(group: str) -> tuple[str, ...]:
    """The names that installed packages bring in a group."""
    return tuple(sorted({point.name for point in entry_points(group=group)}))


def extension(group: str, name: str, what: str) -> Brought | None:
    """What is brought under a name; None where nothing is.

    Raises `InputError`, which begins with `what`, where two packages bring one, or it cannot be loaded.
    """
    points = [point for point in entry_points(group=group) if point.name == name]
    if not points:
        return None
    if len({point.value for point in points}) > 1:
        told = ", ".join(sorted(point.value for point in points))
        raise InputError(f"{what}: two packages bring one: {told}; remove one")
    try:
        return Brought(points[0].value, points[0].load())
    except Exception as error:  # whatever another package raises
        raise InputError(f"{what}: {points[0].value} cannot be loaded: {first_line(error)}") from error
