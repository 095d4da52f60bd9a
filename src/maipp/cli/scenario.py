"""`maipp scenario`: the full default scenario as commented YAML, or the check of a file."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from maipp.scenario import Scenario
from maipp.scenario_io import dump_scenario, load_scenario


@dataclass(frozen=True)
class PrintScenario:
    """Print the full default scenario as YAML, every field with its meaning, unit and allowed values."""

    check: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """check this file instead and say in one line what is wrong with it, if anything"""


def run(flags: PrintScenario) -> int:
    """Print or check; raises `InputError` for a file that is not a valid scenario."""
    if flags.check is None:
        sys.stdout.write(dump_scenario(Scenario()))
    else:
        scenario = load_scenario(flags.check)
        print(f"{flags.check}: a valid scenario ({scenario.agents} agents, budget {scenario.budget})")
    return 0
