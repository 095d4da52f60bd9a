"""The flags of whoever runs a survey of a team: live, a robot, a fleet."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True, kw_only=True)
class TeamFlags:
    """The survey, and who decides."""

    mission: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="MISSION")]
    """mission file (`maipp survey --new` prints one) or scenario file (`maipp scenario`), the same for all robots"""

    planner: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")] = None
    """planner; left out: the mission file's, or receding-horizon with a scenario file"""

    settings: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(name="set", metavar="KEY=VALUE [KEY=VALUE ...]"),
    ] = ()
    """options of the planner"""

    seed: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """seed of starts left open, of roadmaps, and of the planner's randomness, the same for all robots; left out: the
    mission file's, or 0"""
