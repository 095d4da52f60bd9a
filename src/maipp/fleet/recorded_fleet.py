"""The survey of a fleet read back from the folder of any of its robots: what all logs in it make up together."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from maipp.errors import InputError
from maipp.fleet.folder import PLACE, read_folder
from maipp.fleet.log import Log, read_lines, read_origin
from maipp.fleet.logs import check_header
from maipp.live.recorded_survey import RecordedSurvey, make_record
from maipp.records import Value


def is_fleet_folder(path: Path) -> bool:
    """Whether this is the folder of a robot of a fleet."""
    return (path / PLACE).is_file()


def read_fleet_record(folder: Path) -> RecordedSurvey:
    """The survey so far, as the robot of this folder knows it; the folder may be in use, and is not changed.

    Raises `InputError`, one line with the path, for logs that are damaged, or of another mission.
    """
    header = read_folder(folder)
    mission = Value(header, str(folder / PLACE))["mission"].fit(str)
    torn, rows = 0, list[tuple[str, dict[str, Any]]]()
    for path in sorted(folder.glob("*.log")):
        lines, rest = read_lines(path)
        torn += rest
        rows += _records(path, lines, mission)
    # In the order of time, so that nobody reports before it has joined.
    rows.sort(key=lambda row: row[1].get("event", {}).get("time", 0.0))
    return make_record(str(folder), header, rows, torn)


def _records(path: Path, lines: list[bytes], mission: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """The records of one log, each with where it stands."""
    try:
        origin = read_origin(path.name.removesuffix(".log"))
        records, _ = Log(origin).read(0, lines)
        if records:
            check_header(records[0], origin, mission)
    except ValueError as error:
        raise InputError(f"{path}: {error}; take the folder of another robot") from None
    for number, record in enumerate(records[1:], start=2):
        event = record.get("event")
        if not isinstance(event, dict) or not isinstance(event.get("time"), int | float):
            raise InputError(f"{path}: line {number} is no record of an event; take the folder of another robot")
        if event.get("robot", origin.robot) == origin.robot or event.get("event") == "joined":
            yield f"{path}: line {number}", record
