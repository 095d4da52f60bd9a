"""`maipp robot`: one robot of a fleet, on a computer of its own."""

import math
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from maipp.cli.team_flags import TeamFlags
from maipp.errors import InputError
from maipp.records import assignments

if TYPE_CHECKING:  # they import JAX, which `maipp robot --help` can do without
    from maipp.fleet.transport import Transport
    from maipp.fleet.vehicle import Vehicle
    from maipp.live.units import Units

_SETTINGS = tyro.conf.arg(metavar="KEY=VALUE [KEY=VALUE ...]")


@dataclass(frozen=True, kw_only=True)
class RobotFlags(TeamFlags):
    """Run one robot of a fleet: its own belief, log and decisions; it tells the others what its radio reaches.

    Started again on its folder it goes on as itself (docs/fleet.md).
    """

    name: Annotated[str, tyro.conf.arg(metavar="NAME")]
    """which of the mission's robots this is"""

    log: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """folder of its logs; made if it is not there"""

    listen: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ADDRESS [ADDRESS ...]")] = ()
    """addresses to be found at, such as tls/0.0.0.0:7447"""

    connect: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ADDRESS [ADDRESS ...]")] = ()
    """addresses of other robots, such as tls/192.168.1.12:7447"""

    keys: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="")] = None
    """folder of this robot's keys (`maipp fleet keys`); needed for addresses beyond this computer"""

    vehicle: Annotated[str, tyro.conf.arg(metavar="NAME")] = "lines"
    """what it drives: lines, mavlink, simulated, or one that another package brings"""

    options: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(name="with", metavar="KEY=VALUE [KEY=VALUE ...]"),
    ] = ()
    """options of the vehicle"""

    epoch: Annotated[float | None, tyro.conf.arg(metavar="SECONDS", help_behavior_hint="")] = None
    """Unix time of the survey's start, the same for all robots; left out: its log's, or 0:00 UTC of today"""

    range: Annotated[float | None, tyro.conf.arg(metavar="LENGTH", help_behavior_hint="")] = None
    """simulated radio: who is farther away is not heard; planners count on that"""

    loss: Annotated[float, tyro.conf.arg(metavar="SHARE")] = 0.0
    """simulated radio: share of messages that are lost"""

    speedup: Annotated[float, tyro.conf.arg(metavar="TIMES")] = 1.0
    """seconds of the survey in a second, with a simulated vehicle"""

    held: bool = False
    """begin only when a line with the Unix time to begin at comes in on standard input, and end with that input"""


def run(flags: RobotFlags) -> int:
    """Until it is told to end."""
    from maipp.fleet.clock import WallClock
    from maipp.fleet.ending import Ending
    from maipp.fleet.fleet_survey import check_team, open_team
    from maipp.fleet.folder import epoch_of, mark_folder
    from maipp.fleet.logs import Logs
    from maipp.fleet.robot import Robot as FleetRobot
    from maipp.fleet.run import run as run_robot
    from maipp.fleet.security import security_of
    from maipp.fleet.vehicles import VehicleContext, maker_of
    from maipp.fleet.zenoh_link import ZenohLink

    _check(flags)
    with Ending() as ending, ExitStack() as stack:
        maker, vehicle_options = maker_of(flags.vehicle), assignments(flags.options, "--with")
        security = security_of(flags.keys, flags.name, tell)
        epoch = epoch_of(flags.log, flags.epoch)
        team = open_team(
            flags.mission, flags.planner, assignments(flags.settings), flags.seed, epoch, flags.range, tell
        )
        survey, digest = team.survey, team.survey.setup.digest(team.survey.world)
        check_team(survey, flags.name)
        seal = None if security is None else security.seal()
        logs = Logs(flags.log, flags.name, digest, seal=seal, tell=tell)
        stack.callback(logs.close)
        mark_folder(flags.log, survey)
        survey.warm_up()
        begun = None
        if flags.held:
            tell("ready")
            begun = _begin()
            threading.Thread(target=_until_input_ends, args=(ending.end,), daemon=True).start()
            if ending.requested.is_set():
                return ending.exit_code
        clock = WallClock(epoch, flags.speedup, begun)
        vehicle = maker(
            VehicleContext(flags.name, survey, team.prepared, flags.log, clock, survey.setup.seed, tell),
            vehicle_options,
        )
        stack.callback(vehicle.close)
        link = ZenohLink(flags.name, digest, connect=flags.connect, listen=flags.listen, security=security, tell=tell)
        stack.callback(link.close)
        transport = _radio(flags, link, vehicle, survey.setup.units)
        robot = FleetRobot(survey, logs, transport, vehicle, clock, monotonic=time.monotonic, tell=tell)
        tell("begins" if flags.held else "ready")
        run_robot(robot, ending.requested)
    return ending.exit_code


def tell(text: str) -> None:
    """A line for people, with the time."""
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def _check(flags: RobotFlags) -> None:
    """Raise `InputError` for numbers that make no sense."""
    from maipp.seeds import check_seed

    if flags.seed is not None:
        check_seed(flags.seed, "--seed")
    if flags.epoch is not None and not math.isfinite(flags.epoch):
        raise InputError(f"--epoch: {flags.epoch} is no time; give seconds, such as the start's Unix time")
    if not 0 <= flags.loss < 1:
        raise InputError(f"--loss: {flags.loss} is no share; give a number from 0 to below 1")
    if not (math.isfinite(flags.speedup) and flags.speedup > 0):
        raise InputError(f"--speedup: {flags.speedup} is no number of times; give one such as 60")
    if flags.speedup != 1 and flags.vehicle != "simulated":
        raise InputError(f"--speedup: {flags.vehicle} is no simulated vehicle; leave it out")
    if flags.held and flags.vehicle != "simulated":
        raise InputError(f"--held: standard input may be the vehicle's ({flags.vehicle}); leave it out")
    if flags.range is not None and not (math.isfinite(flags.range) and flags.range > 0):
        raise InputError(f"--range: {flags.range} is no distance; give one above 0")


def _begin() -> float:
    """The Unix time to begin at, from a line of standard input."""
    line = sys.stdin.readline()
    try:
        begin = float(line)
    except ValueError:
        raise InputError(f"standard input: {line.strip()[:60]!r} is no Unix time to begin at") from None
    if not math.isfinite(begin):
        raise InputError(f"standard input: {begin} is no Unix time to begin at")
    return begin


def _until_input_ends(end: Callable[[], None]) -> None:
    """End when whoever started this process is gone."""
    while sys.stdin.readline():
        pass
    end()


def _radio(flags: RobotFlags, link: "Transport", vehicle: "Vehicle", units: "Units") -> "Transport":
    """The network, through a simulated radio if one was asked for."""
    from maipp.fleet.filtered import Filtered

    if flags.range is None and not flags.loss:
        return link

    def where() -> tuple[float, float]:
        return units.position("position", vehicle.where().position)

    reach = None if flags.range is None else units.length("--range", flags.range)
    return Filtered(link, where, reach, flags.loss)
