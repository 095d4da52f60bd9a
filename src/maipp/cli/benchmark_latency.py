"""`maipp benchmark latency`: how long planners think, one decision at a time on one core and in batches."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from maipp.bench.evaluate import check_counts
from maipp.bench.latency import LatencyPlan, write_latency
from maipp.bench.tables import TABLES
from maipp.cli.notes import notes_console
from maipp.scenario import Scenario
from maipp.seeds import check_seed


@dataclass(frozen=True)
class LatencyFlags:
    """Time single decisions on one core (median, p95, p99, compilation apart), and batches on all devices."""

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """folder to write to; made if need be"""

    planners: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ROW|PLANNER [...]", help_behavior_hint="")] = ()
    """rows of table1 to time; left out: all"""

    agents: int = 3
    """robots in the team"""

    budget: float = 3.0
    """length of path each agent may travel, domain units"""

    decisions: int = 300
    """single decisions to time, at least"""

    batch: int = 64
    """missions run together"""

    seed: int = 0
    """seed of the worlds"""


def run(flags: LatencyFlags) -> int:
    """Time every row. Raises `InputError` for what is wrong."""
    check_counts("--", decisions=flags.decisions, batch=flags.batch)
    check_seed(flags.seed, "--seed")
    rows = TABLES["table1"].chosen(flags.planners)
    scenario = Scenario(agents=flags.agents, budget=flags.budget)
    plan = LatencyPlan(scenario, rows, flags.decisions, flags.batch, flags.seed)
    notes = notes_console()
    for path in write_latency(plan, flags.out, told=notes.print):
        print(f"wrote {path}")
    return 0
