"""What a result is made of: the journal of a live survey, or the record of a survey and its folder."""

import os
from pathlib import Path

from maipp.errors import InputError
from maipp.fleet.folder import PLACE
from maipp.fleet.recorded_fleet import is_fleet_folder, read_fleet_record
from maipp.results.journals import taken_from, taken_live
from maipp.results.records import taken_recorded
from maipp.results.taken import Taken
from maipp.scenario import Scenario
from maipp.surveys.standardise import PreparedSurvey

_JOURNAL = b'{"sum":"'
_GIVE = "give the journal of a `maipp live`, the folder of a `maipp robot`, or an episode.json or its folder"


def read_taken(path: str | os.PathLike[str], mission: PreparedSurvey | Scenario | None = None) -> Taken:
    """What the survey of a journal, of a robot's folder, of an episode.json or its folder took home.

    `mission` is for a journal of an earlier version, which does not hold it. Raises `InputError`, one line with the
    path, for a file that is neither, or damaged.
    """
    if is_fleet_folder(Path(path)):
        if mission is not None:
            raise InputError(f"{path}: holds its own mission; leave out --mission")
        return taken_from(read_fleet_record(Path(path)), str(path))
    file = source_file(path)
    try:
        with open(file, "rb") as opened:
            begin = opened.read(64)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}; {_GIVE}") from None
    except ValueError:  # a NUL in the name
        raise InputError(f"{str(path)!r}: not the name of a file") from None
    if begin.startswith(_JOURNAL):
        return taken_live(file, mission)
    if not begin:
        raise InputError(f"{file}: is empty; {_GIVE}")
    if not begin.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        raise InputError(f"{file}: neither a journal nor a record of a survey; {_GIVE}")
    if mission is not None:
        raise InputError(f"{file}: holds its own mission; leave out --mission")
    return taken_recorded(file)


def source_file(path: str | os.PathLike[str]) -> Path:
    """The file that is read: of a folder its episode.json. Raises `InputError` for a folder without one."""
    file = Path(path)
    if is_fleet_folder(file):
        return file / PLACE
    if not file.is_dir():
        return file
    if not (file / "episode.json").is_file():
        raise InputError(f"{path}: a folder without an episode.json; {_GIVE}")
    return file / "episode.json"
