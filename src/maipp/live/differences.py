"""How a mission differs from the one that a journal was begun with, key by key, and which event makes it so."""

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from maipp.errors import InputError, one_line
from maipp.scenario import Scenario
from maipp.surveys.mission_file import MissionFile
from maipp.surveys.shapes import Drawing, Rings
from maipp.typing import Float

# What of a header must be alike; the rest of it is for people.
_SAME = ("journal", "maipp", "planner", "seed", "robots", "epoch", "mission")
# Keys of mission files that no answer depends on, that the header has already, or that only say where others stand.
_LEFT_OUT = ("source", "lines", "name", "vehicle", "rehearsal", "planner", "planner_options", "seed", "robots")
_ROBOT_KEYS = ("start", "end", "budget_m", "reserve_m", "speed")
_LONGEST = 300  # characters of a value that is kept as it is; of others the digest
_NEVER = "it cannot change under way: give the mission as it was, or start a new journal"


class AnotherMissionError(InputError):
    """A journal of another mission: one line for each key that differs."""

    def __init__(self, where: str, lines: list[str]) -> None:
        super().__init__(where, lines)
        self.where, self.lines = where, lines

    def __str__(self) -> str:
        lines, began = [*map(one_line, self.lines)], one_line(f"{self.where}: the journal of another survey")
        return f"{began}: {lines[0]}" if len(lines) == 1 else "\n  ".join([f"{began}:", *lines])


def check_same(found: Mapping[str, Any], mine: Mapping[str, Any], where: str) -> None:
    """Raise `InputError` where the header of a journal, found at `where`, is not of the same survey as `mine`."""
    differing = [key for key in _SAME if found.get(key) != mine.get(key)]
    if not differing:
        return
    lines = list(_lines(found, mine)) if "keys" in found else []
    if lines:
        raise AnotherMissionError(where, lines)
    key = differing[0]
    told = "" if key == "mission" else f" ({key} {found.get(key)!r} instead of {mine.get(key)!r})"
    raise InputError(f"{where}: the journal of another survey{told}; give it its own mission, or a new file")


def keys_of_survey(survey: MissionFile, options: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a mission file that a survey depends on, by their keys; `options` are the planner's."""
    fields = {name: getattr(survey, name) for name in survey.__dataclass_fields__ if name not in _LEFT_OUT}
    robots = {f"robots.{robot.name}.{name}": getattr(robot, name) for robot in survey.robots for name in _ROBOT_KEYS}
    return _kept(robots | fields | {"planner_options": options})


def keys_of_scenario(
    scenario: Scenario,
    options: Mapping[str, Any],
    gate: float,
    prior: tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, " p"]] | None,
    prior_noise: float | None,
) -> dict[str, Any]:
    """The values of a scenario by its keys, and what else a survey of it depends on."""
    samples = None if prior is None else [np.asarray(array).tolist() for array in prior]
    more = {"planner_options": options, "gate": gate, "prior": samples, "prior_noise": prior_noise}
    return _kept(scenario.to_dict() | more)


def _kept(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values as JSON has them; of long ones the digest."""
    kept = {}
    for key, value in values.items():
        text = json.dumps(_plain(value), sort_keys=True, default=str)
        long = len(text) > _LONGEST
        digest = hashlib.sha256(text.encode("ascii")).hexdigest()[:16]
        kept[key] = f"{len(text)} characters, SHA-256 {digest}" if long else json.loads(text)
    return kept


def _plain(value: Any) -> Any:
    """A value of a mission file without what only says where it stands; of a file the digest of what is in it."""
    if isinstance(value, Path):
        with open(value, "rb") as file:
            return f"{value.name}, SHA-256 {hashlib.file_digest(file, 'sha256').hexdigest()[:16]}"
    if isinstance(value, Drawing | Rings):
        value = value._asdict()
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = {each.name: getattr(value, each.name) for each in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if key not in ("where", "source", "notes")}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _lines(found: Mapping[str, Any], mine: Mapping[str, Any]) -> Iterator[str]:
    """One line for each key that differs: both values, and how to have the new one."""
    old, new = found["keys"], mine["keys"]
    was, now = (
        list(dict.fromkeys(key.rsplit(".", 1)[0] for key in keys if key.startswith("robots."))) for keys in (old, new)
    )
    for key in _SAME[:-1]:
        theirs, ours = found.get(key), mine.get(key)
        if theirs != ours and not (key == "robots" and was != now):
            never = "give it that version, or start a new journal" if key in ("journal", "maipp") else _NEVER
            yield f"{key}: {_json(theirs)} in the journal, {_json(ours)} here; {never}"
    for robot in was:
        if robot not in now:
            name = robot.removeprefix("robots.")
            yield f"{robot}: in the journal, not here; leave it in, and send {_event('gone', robot=name)}"
    for robot in now:
        if robot not in was:
            event = _event(
                "joined", robot=robot.removeprefix("robots."), **dict.fromkeys(("position", "budget", "speed"))
            )
            yield f"{robot}: here, not in the journal; leave it out, and send {event}"
    for key in dict.fromkeys([*old, *new]):
        theirs, ours = old.get(key), new.get(key)
        if theirs == ours or key.rsplit(".", 1)[0] in set(was) ^ set(now):
            continue
        told = f"{_json(theirs)} in the journal, {_json(ours)} here"
        how = _how(key, ours)
        yield f"{key}: {told}; {_NEVER if how is None else f'leave it as in the journal, and send {how}'}"


def _how(key: str, value: Any) -> str | None:
    """The event that gives a key this value; None: there is none."""
    robot, _, last = key.removeprefix("robots.").rpartition(".")
    if robot and last == "budget_m":
        return _event("budget", robot=robot, budget=value)
    if robot and last == "speed":
        return _event("speed", robot=robot, speed=value)
    if robot:
        return None
    if key == "threshold" and value is not None:
        return _event("threshold", threshold=value)
    if key in ("no_go", "obstacles"):
        event = _event("zone", name=None, polygon=None)
        return f"{event} for each one that is new; those of the mission stay where they are"
    if key in ("budget", "speed"):
        each = None if isinstance(value, list) else value
        return f"{_event(key, robot=None, **{key: each})} for each robot that has another one"
    if key == "agents":
        return f"{_event('joined', robot=None, position=None, budget=None, speed=None)} for each robot that is new"
    return None


def _event(kind: str, **values: Any) -> str:
    """The event as a person may copy it, with dots for what is to be filled in."""
    told = {"event": kind, "id": None} | values | {"time": None}
    return "{" + ", ".join(f'"{key}": {"..." if value is None else _json(value)}' for key, value in told.items()) + "}"


def _json(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else f"{text[:60]} ..."
