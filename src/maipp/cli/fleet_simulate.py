"""`maipp fleet MISSION --simulate`: all robots as processes of this computer, and what they took home."""

import shutil
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from maipp.cli.fleet_flags import FleetFlags as Flags
from maipp.cli.fleet_page import NONE, Page
from maipp.cli.robot import tell
from maipp.errors import InputError
from maipp.records import assignments

if TYPE_CHECKING:
    from maipp.fleet.launch import FleetProcesses, Process
    from maipp.live.team import TeamSurvey

_READY = 300.0  # s that robots have to compile what they need
_TICK = 0.05  # s
_SETTLE = 10.0  # s that they have to tell each other what they measured last


def simulate(flags: Flags) -> int:
    """Run the fleet until all robots are done, and write the result."""
    from maipp.cli.result import print_result
    from maipp.fleet.ending import Ending
    from maipp.fleet.fleet_survey import check_team, open_team
    from maipp.fleet.launch import FleetProcesses, Process, endpoints, robot_command
    from maipp.results import read_taken, write_result

    settings = assignments(flags.settings)
    assignments(flags.options, "--with")
    team = open_team(flags.mission, flags.planner, settings, flags.seed, 0.0, flags.range, tell)
    check_team(team.survey, None)
    names = team.survey.names
    folders = {name: flags.out / "robots" / name for name in names}
    _clear(flags.out / "robots")
    more = _options(flags)
    done = {name: threading.Event() for name in names}

    def heard(name: str, line: str) -> None:
        tell(f"{name}: {line.partition(' ')[2]}")
        if " done: " in line:
            done[name].set()
        elif " go: " in line or " home: " in line:
            done[name].clear()

    processes = []
    addresses = endpoints(names)
    for name, (listen, connect) in addresses.items():
        folders[name].mkdir(parents=True, exist_ok=True)
        own = [*more, "--listen", listen, *(["--connect", *connect] if connect else [])]
        command = robot_command(flags.mission, name, folders[name], own)
        processes.append(Process(name, command, folders[name] / "notes.txt", heard))
    with Ending() as ending, ExitStack() as stack:
        fleet = stack.enter_context(FleetProcesses(processes))
        if not _all(lambda each: each.ready.is_set(), fleet, ending.requested, _READY):
            if ending.requested.is_set():
                return ending.code
            failed = ", ".join(process.name for process in fleet.ended()) or "some robots"
            raise InputError(f"{failed} could not begin; their notes are in {flags.out / 'robots'}")
        begin = time.time() + 0.2
        for process in processes:
            process.begin(begin)
        page = _page(flags, team.survey, [listen for listen, _ in addresses.values()], begin, stack)
        show = _nothing if page is None else page.work
        _all(lambda each: done[each.name].is_set() or not each.running, fleet, ending.requested, None, show)
        _settled(list(folders.values()), ending.requested, show)
        best = max(folders.values(), key=_size)
        if ending.requested.is_set():
            cure = f"maipp result {best} --out {flags.out / 'result'}"
            tell(f"ended before all robots were done; what they have until then is a result too: {cure}")
            return ending.code
        for process in fleet.ended():
            tell(f"{process.name} has ended by itself; its notes are in {process.notes}")
        if page is not None:
            page.save(flags.out / "page.html")
            tell(f"the page, as it stood at the end: {flags.out / 'page.html'}")
        print_result(write_result(read_taken(best), flags.out / "result"), flags.out / "result")
        if flags.stay and page is not None:
            tell("all robots are done; Ctrl-C ends the page")
            while not ending.requested.wait(_TICK):
                show()
    return ending.exit_code


def _options(flags: Flags) -> list[str]:
    """What all robots are told."""
    more = ["--vehicle", "simulated", "--held", "--epoch", "0", "--speedup", repr(flags.speedup)]
    for flag, value in (("--planner", flags.planner), ("--seed", flags.seed), ("--range", flags.range)):
        more += [] if value is None else [flag, str(value)]
    more += ["--loss", repr(flags.loss)] if flags.loss else []
    for flag, groups in (("--set", flags.settings), ("--with", flags.options)):
        for group in groups:
            more += [flag, *group]
    return more


def _nothing() -> None:
    pass


def _page(flags: Flags, survey: "TeamSurvey", connect: list[str], begin: float, stack: ExitStack) -> Page | None:
    """The page, if one is wanted."""
    from maipp.fleet.clock import WallClock

    if flags.page == NONE:
        return None
    page = Page(flags, survey, WallClock(0.0, flags.speedup, begin), connect, _free_name(survey.names))
    stack.enter_context(page)
    tell(f"the page is at {page.url}")
    return page


def _free_name(names: Sequence[str]) -> str:
    """A name for the page that no robot has."""
    return next(name for name in ("page", *(f"page{i}" for i in range(len(names) + 1))) if name not in names)


def _all(
    true: "Callable[[Process], bool]",
    fleet: "FleetProcesses",
    told: threading.Event,
    seconds: float | None,
    work: Callable[[], None] = _nothing,
) -> bool:
    """Wait until something is true of all processes; False where one has ended before, or it takes too long."""
    begun = time.monotonic()
    while not all(true(process) for process in fleet.processes.values()):
        late = seconds is not None and (time.monotonic() - begun > seconds or bool(fleet.ended()))
        if told.wait(_TICK) or late:
            return False
        work()
    return True


def _settled(folders: list[Path], told: threading.Event, work: Callable[[], None]) -> None:
    """Wait until all robots have the same logs."""
    end = time.monotonic() + _SETTLE
    while len({_size(folder) for folder in folders}) > 1 and time.monotonic() < end and not told.wait(0.1):
        work()
    work()


def _size(folder: Path) -> int:
    """Bytes of all logs that a robot has."""
    return sum(path.stat().st_size for path in folder.glob("*.log"))


def _clear(folder: Path) -> None:
    """Remove the robots' folders of an earlier simulation. Raises `InputError` for a folder that is something else."""
    from maipp.fleet.recorded_fleet import is_fleet_folder

    for path in sorted(folder.glob("*")) if folder.is_dir() else []:
        known = path.is_dir() and (
            is_fleet_folder(path) or all(each.name in ("notes.txt", "lock") for each in path.glob("*"))
        )
        if not known:
            raise InputError(f"{path}: is no folder of a simulated robot; give another --out")
        shutil.rmtree(path)
