"""The four tables of the paper as data: which lines, on which missions, beside which printed numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from maipp.bench import paper
from maipp.bench.cells import Cell
from maipp.bench.table_rows import (
    CATNIPP,
    DI,
    JOINT,
    OURS,
    RRT_LONG,
    RRT_MEDIUM,
    RRT_SHORT,
    TI,
    TI_STAR,
    Row,
    intent_row,
)
from maipp.errors import InputError
from maipp.planners.options import unknown
from maipp.problem import Shape, shape_of
from maipp.scenario import Scenario


@dataclass(frozen=True)
class Part:
    """The missions of a table that differ in their budget only, and what the paper prints for them."""

    scenario: Scenario
    printed: paper.Block


@dataclass(frozen=True)
class TableSpec:
    """One table."""

    name: str
    title: str
    rows: tuple[Row, ...]
    parts: tuple[Part, ...]
    budgets: tuple[float, ...]  # domain units
    metric: str = "trace"  # that the paper prints, a field of `Metrics`
    beside: tuple[str, ...] = ("true_trace", "rmse")  # further ones that are tabulated
    reference: str = TI_STAR.name  # the line that the others are paired with
    left_out: Mapping[str, str] = field(default_factory=dict)  # lines of other tables that this one lacks, and why
    kind: type[Cell] = Cell  # how the worlds are drawn

    def shape(self, part: Part) -> Shape:
        """That all cells over areas like the part's fit: each line is compiled once for them."""
        like = [other.scenario for other in self.parts if other.scenario.extent == part.scenario.extent]
        return shape_of([scenario.replace(budget=budget) for scenario in like for budget in self.budgets])

    def chosen(self, names: Sequence[str]) -> tuple[Row, ...]:
        """The lines of these names or, where no line has the name, of the planner of that name.

        For no names all lines but those computed by name only. Raises `InputError` for a name that no line has.
        """
        for name in names:
            if not any(name in (row.name, row.planner) for row in self.rows):
                raise InputError(f"--planners: {unknown('row', name, [row.name for row in self.rows])}")
        if not names:
            return tuple(row for row in self.rows if not row.by_name)
        planners = set(names) - {row.name for row in self.rows}
        return tuple(row for row in self.rows if row.name in names or row.planner in planners)


_THREE = Scenario(agents=3)
_TEN = Scenario(agents=10, length_scale=0.25)

TABLES = {
    table.name: table
    for table in (
        TableSpec(
            "table1",
            "Table I: three agents, global communication",
            (RRT_LONG, RRT_MEDIUM, RRT_SHORT, CATNIPP, DI, TI, TI_STAR, *OURS),
            (Part(_THREE, paper.TABLE_1),),
            (2.0, 3.0, 4.0, 5.0),
        ),
        TableSpec(
            "table2",
            "Table II: ten agents, length scale 0.25",
            (RRT_SHORT, CATNIPP, DI, TI_STAR, *(row for row in OURS if row is not JOINT)),
            (Part(_TEN, paper.TABLE_2),),
            (2.0, 3.0, 4.0),
            left_out={JOINT.name: "planning ten agents together costs twenty searches at every decision"},
        ),
        TableSpec(
            "table3",
            "Table III: nodes of the paths that an intent is fitted to",
            (*(intent_row(kind, steps) for kind in ("di", "ti") for steps in (3, 6, 9)), *OURS),
            (Part(_THREE, paper.TABLE_3),),
            (3.0, 4.0),
            reference="ti-6",
        ),
        TableSpec(
            "table4",
            "Table IV: limited communication",
            (RRT_SHORT, CATNIPP, DI, TI_STAR, *OURS),
            (
                Part(_THREE.replace(comm_range=0.3), paper.TABLE_4_NEAR),
                Part(_THREE.replace(comm_range=0.6), paper.TABLE_4_FAR),
                Part(_THREE, paper.TABLE_4_GLOBAL),
            ),
            (2.0, 3.0, 4.0),
            metric="own_trace",
            beside=("trace", "true_trace", "rmse"),
        ),
    )
}
