"""`maipp planners`: names, what each does, and its options."""

import dataclasses
from dataclasses import dataclass
from typing import Annotated

import tyro
from rich.console import Console

from maipp.markdown import typed
from maipp.planners import planner_names, planner_options, planner_summary


@dataclass(frozen=True)
class PlannersFlags:
    """List the planners with their options. Give options as `--set KEY=VALUE`."""

    planner: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PLANNER")] = ()
    """only these; path/to/file.py:ClassName for one of your own"""


def run(flags: PlannersFlags) -> int:
    """Print the list; raises `InputError` for an unknown planner."""
    console = Console(highlight=False, markup=False, soft_wrap=True)
    for name in flags.planner or planner_names():
        options = planner_options(name)
        console.print(name, style="bold", end="")
        console.print(f"  {planner_summary(name)}")
        for option in options:
            default = "" if option.default is dataclasses.MISSING else f" (default {typed(option.default)})"
            meaning = f"  {option.meaning}" if option.meaning else ""
            console.print(f"    {option.name}: {option.allowed}{default}{meaning}")
    return 0
