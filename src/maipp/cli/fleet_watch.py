"""`maipp fleet MISSION --connect ADDRESS`: watch a fleet that is under way."""

from maipp.cli.fleet_flags import FleetFlags as Flags
from maipp.cli.fleet_page import NONE, Page
from maipp.cli.robot import tell
from maipp.errors import InputError
from maipp.records import assignments

_TICK = 0.05  # s


def watch(flags: Flags) -> int:
    """Show the fleet until it is told to end."""
    from pathlib import Path

    from maipp.fleet.clock import WallClock
    from maipp.fleet.ending import Ending
    from maipp.fleet.fleet_survey import check_team, open_team
    from maipp.fleet.folder import epoch_of
    from maipp.fleet.log import check_name
    from maipp.fleet.security import security_of

    if flags.page == NONE:
        raise InputError("--page: none leaves nothing to watch on; give an address such as 127.0.0.1:8321")
    check_name(flags.name, "--name")
    with Ending() as ending:
        security = security_of(flags.keys, flags.name, tell)
        epoch = epoch_of(Path(), flags.epoch)
        team = open_team(
            flags.mission, flags.planner, assignments(flags.settings), flags.seed, epoch, flags.range, tell
        )
        check_team(team.survey, None)
        if flags.name in team.survey.names:
            raise InputError(f"--name: {flags.name} is a robot of the mission; give another name")
        with Page(flags, team.survey, WallClock(epoch), flags.connect, flags.name, security) as page:
            tell(f"the page is at {page.url}")
            while not ending.requested.wait(_TICK):
                page.work()
    return ending.exit_code
