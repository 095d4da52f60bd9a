"""The modes of autopilots, by name: numbers of ArduPilot's and PX4's own headers."""

from typing import NamedTuple

from maipp.errors import InputError

ARDUPILOT, PX4 = 3, 12  # MAV_AUTOPILOT

_PX4_AUTO = 4  # PX4_CUSTOM_MAIN_MODE_AUTO
_PX4 = {"MISSION": (_PX4_AUTO, 4), "LOITER": (_PX4_AUTO, 3), "HOLD": (_PX4_AUTO, 3)}
_ROVER = {"AUTO": 10, "HOLD": 4, "LOITER": 5, "GUIDED": 15}
_COPTER = {"AUTO": 3, "BRAKE": 17, "LOITER": 5, "GUIDED": 4}


class Mode(NamedTuple):
    """What a heartbeat says, and what a command to change the mode is given."""

    name: str
    custom: int  # of a heartbeat
    parameters: tuple[int, int]  # second and third of MAV_CMD_DO_SET_MODE


class Modes(NamedTuple):
    """The two that are used."""

    mission: Mode
    hold: Mode


def modes_of(autopilot: int, kind: str, hold: str = "") -> Modes:
    """The mode that follows a mission, and the one that holds: HOLD of a rover, LOITER of a boat, BRAKE of a copter.

    `autopilot` is a MAV_AUTOPILOT, `kind` boat, rover or copter. Raises `InputError` for a mode that is not known.
    """
    if autopilot == PX4:
        return Modes(_px4("MISSION"), _px4(hold or "HOLD"))
    known = _COPTER if kind == "copter" else _ROVER
    hold = hold or {"boat": "LOITER", "rover": "HOLD", "copter": "BRAKE"}[kind]
    if hold not in known or hold == "AUTO":
        raise InputError(f"--with hold={hold}: no mode to hold in; give {', '.join(sorted({*known} - {'AUTO'}))}")
    return Modes(*(Mode(name, known[name], (known[name], 0)) for name in ("AUTO", hold)))


def _px4(name: str) -> Mode:
    if name not in _PX4:
        raise InputError(f"--with hold={name}: no mode of PX4 to hold in; give HOLD")
    main, sub = _PX4[name]
    return Mode(name, main << 16 | sub << 24, (main, sub))
