"""What the folder of a robot's logs says of its survey, so that a result can be made of it without the mission file."""

import json
import time
from pathlib import Path
from typing import Any

from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.live.belief_problem import place_of
from maipp.live.queries import header
from maipp.live.team import TeamSurvey
from maipp.records import Value, read_json
from maipp.records.kinds import Finite

PLACE = "place.json"
_DAY = 86_400.0


def mark_folder(folder: Path, survey: TeamSurvey) -> None:
    """Write down what survey the logs in a folder are of, as the first line of a journal says it."""
    path = folder / PLACE
    if not path.exists():
        told = header(survey.world, survey.setup) | {"place": place_of(survey.world, survey.setup).to_dict()}
        write_atomic(path, json.dumps(told, allow_nan=False) + "\n")


def read_folder(folder: Path) -> dict[str, Any]:
    """What `mark_folder` wrote. Raises `InputError` where it is missing or damaged."""
    path = folder / PLACE
    try:
        text = path.read_text("utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}; give the folder of a robot") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not UTF-8 text; give the folder of a robot") from None
    return read_json(text, str(path)).mapping()


def epoch_of(folder: Path, given: float | None) -> float:
    """The Unix time of the survey's start: as given, as the folder has it, or 0:00 UTC of today."""
    if given is not None:
        return given
    if (folder / PLACE).exists():
        return Value(read_folder(folder), str(folder / PLACE))["epoch"].fit(Finite)
    return time.time() // _DAY * _DAY
