"""A vehicle with an autopilot, made of a mission and the options that were given."""

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from maipp.errors import InputError
from maipp.fleet.clock import Clock
from maipp.fleet.line_streams import LineInput
from maipp.fleet.mavlink.autopilot import Autopilot
from maipp.fleet.mavlink.course import AutopilotSettings, Notices
from maipp.fleet.mavlink.drive import Drive, LocalPlane, Senses
from maipp.fleet.mavlink.inside import Inside
from maipp.fleet.mavlink.link import MavlinkConnection
from maipp.fleet.mavlink.mission_items import fence_items
from maipp.fleet.mavlink.modes import modes_of
from maipp.fleet.mavlink.sensor import Sensor
from maipp.fleet.vehicles import VehicleContext, numbers
from maipp.live.request import parse_line
from maipp.records import Value
from maipp.records.kinds import Finite
from maipp.route_files.fences import Fence
from maipp.route_files.route_plan import Route, RoutePlan
from maipp.route_files.vehicle_settings import AUTOPILOTS
from maipp.route_files.writer import fence_for
from maipp.surveys.standardise import PreparedSurvey

KEEP, UPLOAD = "keep", "upload"  # the autopilot's fence
OPTIONS = {
    "url": "udpin:0.0.0.0:14550",
    "baud": 57600,
    "system": 0,
    "source": 245,
    "sensor": "",
    "age": 5.0,
    "hold": "",
    "margin": 1.0,
    "fence": KEEP,
    "radius": 5.0,
    "wait": 60.0,
}
_LIKE = '{"value": 3.2}'
LINES = "lines"  # the sensor whose values come as lines of standard input


def make(place: VehicleContext, options: Mapping[str, str]) -> Drive:
    """The vehicle; its options are in docs/vehicles.md.

    Waits for the autopilot to say where it is. Raises `InputError` where it does not, for a mission without longitudes
    and latitudes, and for an option that is unknown or wrong.
    """
    told = numbers(options, OPTIONS)
    _check(told)
    mission = place.mission
    if mission is None or not mission.frame.geographic:
        raise InputError("--vehicle mavlink: needs longitudes and latitudes; give a mission file of a real place")
    vehicle, survey = mission.survey.vehicle, place.survey
    modes_of(AUTOPILOTS[vehicle.autopilot], vehicle.kind, told["hold"])
    fence = _fence(place, mission)
    ground = _ground(place, mission, fence, told["margin"], told["radius"])
    speed = lambda: survey.setup.units.speed_out(survey.robot(place.robot).speed)  # noqa: E731
    if told["fence"] == UPLOAD and not vehicle.fence:
        raise InputError("--with fence=upload: the mission says vehicle: {fence: false}; keep one of the two")
    items = fence_items(fence) if told["fence"] == UPLOAD else []
    choice = AutopilotSettings(vehicle, speed, told["hold"], items)
    sensor = Sensor(told["age"])
    senses = Senses(sensor, told["sensor"])
    if told["sensor"] == LINES:
        senses = senses._replace(take=_values(sensor, place.clock, place.tell))
    link = MavlinkConnection(told["url"], told["baud"], told["source"], place.clock.now)
    autopilot = Autopilot(told["system"], told["source"], link.send)
    drive = Drive(link, autopilot, ground, choice, senses, place.clock, Notices(place.robot, place.tell))
    end = time.monotonic() + told["wait"]
    while not drive.known:
        if time.monotonic() > end:
            link.close()
            what = "no autopilot" if autopilot.kind is None else "the autopilot does not know where it is"
            raise InputError(f"--with url={told['url']}: {what}: nothing heard of that in {told['wait']:g} s")
        time.sleep(0.02)
        drive.poll()
    return drive


def _check(told: Mapping[str, Any]) -> None:
    for key, most in (("baud", 10**7), ("system", 255), ("source", 255)):
        if not (key != "system") <= told[key] <= most:
            raise InputError(f"--with {key}={told[key]}: give a whole number from {int(key != 'system')} to {most}")
    if told["fence"] not in (KEEP, UPLOAD):
        raise InputError(f"--with fence={told['fence']}: give {KEEP} or {UPLOAD}")
    for key in ("age", "margin", "radius", "wait"):
        if not (math.isfinite(told[key]) and told[key] >= 0 and (told[key] > 0 or key in ("margin", "wait"))):
            raise InputError(f"--with {key}={told[key]:g}: give a number above 0")


def _fence(place: VehicleContext, mission: PreparedSurvey) -> Fence:
    """The fence that route files of this survey have."""
    frame, number, world = mission.frame, mission.names.index(place.robot), place.survey.world
    start = frame.to_user(np.asarray(world.mission.start, np.float64)[number : number + 1])
    route = Route(place.robot, start, np.zeros(1), mission.survey.robots[number].speed)
    plan = RoutePlan(mission.survey.name, (route,), mission.area, mission.no_go, geographic=True)
    return fence_for(plan, mission.survey.vehicle)


def _ground(place: VehicleContext, mission: PreparedSurvey, fence: Fence, margin: float, radius: float) -> LocalPlane:
    """Where it drives."""
    frame, inside = mission.frame, Inside(fence, margin, mission.frame.to_plane)
    interval = place.survey.setup.units.length_out(place.survey.world.scenario.measurement_interval)
    return LocalPlane(frame.to_plane, frame.from_plane, inside, interval, radius)


def _values(sensor: Sensor, clock: Clock, tell: Callable[[str], None]) -> Callable[[], None]:
    """Takes up values that come as lines of standard input, such as {"value": 3.2}."""
    source = LineInput()

    def take() -> None:
        before = source.ended
        for number, line in source.take(200):
            try:
                values = Value(parse_line(line))
                values.mapping(("value",))
                sensor.heard(clock.now(), values["value"].fit(Finite))
            except InputError as error:
                problem = " ".join(str(error).split())
                tell(f"standard input, line {number}: {problem}; give a line such as {_LIKE}")
        if source.ended and not before:
            tell("standard input has ended: no more values of the sensor")

    return take
