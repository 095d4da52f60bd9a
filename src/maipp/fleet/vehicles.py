"""Vehicles by their names: ours, and those that other packages bring under the entry point `maipp.vehicles`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, cast

from maipp.errors import InputError
from maipp.extensions import VEHICLES, extension, extensions
from maipp.fleet.clock import Clock
from maipp.fleet.vehicle import Vehicle
from maipp.live.team import TeamSurvey
from maipp.renamed import renamed
from maipp.surveys.standardise import PreparedSurvey

_OURS = {"simulated": "maipp.fleet.simulation", "lines": "maipp.fleet.lines", "mavlink": "maipp.fleet.mavlink"}


@dataclass(frozen=True)
class VehicleContext:
    """What a vehicle is made for."""

    robot: str  # its name
    survey: TeamSurvey
    mission: PreparedSurvey | None  # None: the survey is of a scenario, in domain units
    folder: Path  # of the robot's logs, for what is to outlast the process
    clock: Clock
    seed: int
    tell: Callable[[str], None]


# Makes a vehicle of the options that were given by name; raises `InputError` for those that make no sense.
Maker = Callable[[VehicleContext, Mapping[str, str]], Vehicle]


def names() -> list[str]:
    """Of all vehicles that can be chosen."""
    return sorted({*_OURS, *extensions(VEHICLES)})


def maker_of(name: str) -> Maker:
    """What makes the vehicles of that name. Raises `InputError` for one that is not there, or cannot be loaded."""
    if name in _OURS:
        return import_module(_OURS[name]).make
    brought = extension(VEHICLES, name, f"--vehicle {name}")
    if brought is None:
        raise InputError(f"--vehicle {name}: not known; there is {', '.join(names())}")
    where, make = f"--vehicle {name}: {brought.where}", brought.thing
    if not callable(make):
        raise InputError(f"{where} is no function that makes a vehicle")
    return partial(_made, cast(Maker, make), where)


def _made(make: Maker, where: str, place: VehicleContext, options: Mapping[str, str]) -> Vehicle:
    """The vehicle that another package makes. Raises `InputError` where it fails to."""
    try:
        vehicle = make(place, options)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{where} failed: {type(error).__name__}: {_line(error)}") from error
    if not isinstance(vehicle, Vehicle):
        raise InputError(f"{where} made an {type(vehicle).__name__}, which is no vehicle (`maipp.fleet.vehicle`)")
    return vehicle


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


def numbers(options: Mapping[str, str], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """The options as the types of their defaults have them. Raises `InputError` for one unknown or wrong."""
    chosen = dict(defaults)
    for key, text in options.items():
        if key not in defaults:
            raise InputError(f"--with {key}: not known; there is {', '.join(defaults)}")
        kind = type(defaults[key])
        try:
            if kind is tuple:
                chosen[key] = tuple(float(part) for part in text.split(","))
                if len(chosen[key]) != len(defaults[key]):
                    raise ValueError
            else:
                chosen[key] = kind(text)
        except ValueError:
            like = ",".join(map(str, defaults[key])) if kind is tuple else defaults[key]
            raise InputError(f"--with {key}={text}: not as it should be; give one such as {key}={like}") from None
    return chosen


renamed(__name__, Place="VehicleContext")
