"""`maipp benchmark NAME`: the paper's tables and figures, and yours, each by one command."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import tyro

from maipp.cli import benchmark_figures, benchmark_latency, benchmark_report, benchmark_scaling, benchmark_table
from maipp.cli.benchmark_figures import FiguresFlags
from maipp.cli.benchmark_latency import LatencyFlags
from maipp.cli.benchmark_report import ReportFlags
from maipp.cli.benchmark_scaling import ScalingFlags
from maipp.cli.benchmark_table import Table1, Table2, Table3, Table4, TableFile

_Named = (
    Annotated[Table1, tyro.conf.subcommand("table1")]
    | Annotated[Table2, tyro.conf.subcommand("table2")]
    | Annotated[Table3, tyro.conf.subcommand("table3")]
    | Annotated[Table4, tyro.conf.subcommand("table4")]
    | Annotated[TableFile, tyro.conf.subcommand("table")]
    | Annotated[FiguresFlags, tyro.conf.subcommand("figures")]
    | Annotated[LatencyFlags, tyro.conf.subcommand("latency")]
    | Annotated[ScalingFlags, tyro.conf.subcommand("scaling")]
    | Annotated[ReportFlags, tyro.conf.subcommand("report")]
)

_RUN: dict[type, Callable[[Any], int]] = {
    Table1: benchmark_table.run,
    Table2: benchmark_table.run,
    Table3: benchmark_table.run,
    Table4: benchmark_table.run,
    TableFile: benchmark_table.run,
    FiguresFlags: benchmark_figures.run,
    LatencyFlags: benchmark_latency.run,
    ScalingFlags: benchmark_scaling.run,
    ReportFlags: benchmark_report.run,
}


@dataclass(frozen=True)
class BenchmarkFlags:
    """Regenerate the tables and figures of the paper, and measure how fast planners are."""

    name: tyro.conf.OmitArgPrefixes[tyro.conf.OmitSubcommandPrefixes[_Named]]


def arguments(given: list[str]) -> list[str]:
    """The words of the command as they are read: a file stands for itself, `table FILE`."""
    return ["table", *given] if given and given[0].endswith((".yaml", ".yml")) else given


def run(flags: BenchmarkFlags) -> int:
    """Run the benchmark of that name; gives its exit code."""
    return _RUN[type(flags.name)](flags.name)
