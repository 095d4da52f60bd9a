"""`maipp benchmark figures`: the paper's figures, curves of all planners, and how stable intents are."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from maipp.bench.evaluate import check_counts
from maipp.bench.figure_files import FigurePlan, write_figures
from maipp.bench.tables import TABLES
from maipp.cli.notes import notes_console
from maipp.errors import InputError
from maipp.scenario import Scenario
from maipp.seeds import check_seed


@dataclass(frozen=True)
class FiguresFlags:
    """Draw one survey, one decision's intents, Tr(P) over the distance, and the stability of intents."""

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """folder to write to; made if need be"""

    instances: int = 30
    """worlds of the curves and of the stability, one mission each"""

    budget: float = 3.0
    """length of path each agent may travel, domain units"""

    seed: int = 0
    """seed of the worlds"""

    planners: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ROW|PLANNER [...]", help_behavior_hint="")] = ()
    """rows of table1 to draw curves of; left out: all but the joint receding horizon"""


def run(flags: FiguresFlags) -> int:
    """Draw everything. Raises `InputError` for what is wrong."""
    check_counts("--", instances=flags.instances)
    check_seed(flags.seed, "--seed")
    if flags.budget < 1.0:
        raise InputError(f"--budget: {flags.budget:g} ends before agents have plans to draw; give at least 1")
    rows = TABLES["table1"].chosen(flags.planners) if flags.planners else FigurePlan().rows
    plan = FigurePlan(Scenario(budget=flags.budget), flags.instances, flags.seed, rows)
    notes = notes_console()
    for path in write_figures(plan, flags.out, told=notes.print):
        print(f"wrote {path}")
    return 0
