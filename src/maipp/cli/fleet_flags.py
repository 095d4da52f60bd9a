"""The flags of `maipp fleet`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from maipp.cli.team_flags import TeamFlags


@dataclass(frozen=True, kw_only=True)
class FleetFlags(TeamFlags):
    """Watch a fleet on a page, or simulate one: every robot a process of its own (docs/fleet.md).

    maipp fleet mission.yaml --simulate --speedup 60: all robots on this computer, and what they took home

    maipp fleet mission.yaml --connect tls/192.168.1.12:7447 --keys keys/shore: watch one that is under way

    maipp fleet keys DIR --robots NAME ...: the certificates by which robots know each other
    """

    simulate: bool = False
    """run all robots on this computer, with simulated vehicles"""

    speedup: Annotated[float, tyro.conf.arg(metavar="TIMES")] = 60.0
    """simulated: seconds of the survey in a second"""

    range: Annotated[float | None, tyro.conf.arg(metavar="LENGTH", help_behavior_hint="")] = None
    """simulated radio: who is farther away is not heard; planners count on that"""

    loss: Annotated[float, tyro.conf.arg(metavar="SHARE")] = 0.0
    """simulated radio: share of messages that are lost"""

    options: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(name="with", metavar="KEY=VALUE [KEY=VALUE ...]"),
    ] = ()
    """simulated: options of the vehicles"""

    out: Path = Path("out/fleet")
    """simulated: folder of the robots' logs, and of the result"""

    epoch: Annotated[float | None, tyro.conf.arg(metavar="SECONDS", help_behavior_hint="")] = None
    """of a fleet under way: Unix time of its start; left out: 0:00 UTC of today"""

    connect: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ADDRESS [ADDRESS ...]")] = ()
    """of a fleet under way: addresses of robots"""

    keys: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="")] = None
    """of a fleet under way: folder of the watcher's keys"""

    name: Annotated[str, tyro.conf.arg(metavar="NAME")] = "shore"
    """of a fleet under way: name of the watcher, as its keys have it"""

    page: Annotated[str, tyro.conf.arg(metavar="HOST:PORT")] = "127.0.0.1:8321"
    """where the page is; none: no page"""

    token: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """file with the word that opens the page; needed beyond this computer"""

    certificate: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """certificate of the page (PEM); needed beyond this computer"""

    certificate_key: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """its key"""

    stay: bool = False
    """simulated: go on showing the page when all robots are done, until Ctrl-C"""
