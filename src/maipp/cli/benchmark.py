"""`maipp benchmark NAME`: the paper's tables and figures, and ours, each by one command."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from maipp.cli import benchmark_table
from maipp.cli.benchmark_table import Table1, Table2, Table3, Table4

_Named = (
    Annotated[Table1, tyro.conf.subcommand("table1")]
    | Annotated[Table2, tyro.conf.subcommand("table2")]
    | Annotated[Table3, tyro.conf.subcommand("table3")]
    | Annotated[Table4, tyro.conf.subcommand("table4")]
)

# A line for each kind of flags: the function that runs it.
_RUN = {
    Table1: benchmark_table.run,
    Table2: benchmark_table.run,
    Table3: benchmark_table.run,
    Table4: benchmark_table.run,
}


@dataclass(frozen=True)
class Benchmark:
    """Regenerate the tables and figures of the paper, and measure how fast planners are."""

    name: tyro.conf.OmitArgPrefixes[tyro.conf.OmitSubcommandPrefixes[_Named]]


def run(flags: Benchmark) -> int:
    """Run the benchmark of that name; gives its exit code."""
    return _RUN[type(flags.name)](flags.name)
