"""What installed packages bring: planners, vehicles and readers of fields, by their entry points.

The groups are `maipp.planners` (a name to a `Planner` class), `maipp.vehicles`, and `maipp.readers` (a file ending
without its dot to a function of a path that gives a `RasterData`).
"""

from importlib.metadata import entry_points
from typing import Any

from maipp.errors import InputError, first_line

PLANNERS, READERS = "maipp.planners", "maipp.readers"


def extensions(group: str) -> tuple[str, ...]:
    """The names that installed packages bring in a group."""
    return tuple(sorted({point.name for point in entry_points(group=group)}))


def extension(group: str, name: str, what: str) -> Any:
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
        return points[0].load()
    except Exception as error:  # whatever another package raises
        raise InputError(f"{what}: {points[0].value} cannot be loaded: {first_line(error)}") from error
