"""The tables are the paper's, and each line can be run."""

import pytest

from maipp.bench import paper
from maipp.bench.evaluate import evaluate
from maipp.bench.tables import TABLES
from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.problem import shape_of
from maipp.scenario import Scenario


def test_the_paper_s_best_rows():
    # Yang et al. 2023, the numbers in bold.
    assert [paper.best(paper.TABLE_1, budget) for budget in (2.0, 3.0, 4.0, 5.0)] == [30.30, 7.76, 3.32, 1.99]
    assert [paper.best(paper.TABLE_2, budget) for budget in (2.0, 3.0, 4.0)] == [19.39, 5.87, 3.07]
    assert [paper.best(paper.TABLE_3, budget) for budget in (3.0, 4.0)] == [8.43, 3.67]
    assert [paper.best(paper.TABLE_4_NEAR, budget) for budget in (2.0, 3.0, 4.0)] == [50.95, 16.04, 6.21]
    assert [paper.best(paper.TABLE_4_FAR, budget) for budget in (2.0, 3.0, 4.0)] == [40.99, 11.39, 5.12]
    assert all(paper.TABLE_4_GLOBAL["TI(8, 5)*"][b] == paper.TABLE_1["TI(8, 5)*"][b] for b in (2.0, 3.0, 4.0))


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_every_printed_line_has_a_row_and_the_other_way_round(table):
    ours = {row.paper for row in table.rows} - {None}
    for part in table.parts:
        assert set(part.printed) <= ours
        assert all(set(column) == set(table.budgets) for column in part.printed.values())
    assert ours == set().union(*(part.printed for part in table.parts))
    names = [row.name for row in table.rows]
    assert len(set(names)) == len(names) and table.reference in names


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_every_row_makes_a_planner(table):
    for row in table.rows:
        make_planner(row.planner, table.parts[0].scenario, row.options)


def test_rows_are_chosen_by_their_name_or_their_planner_s():
    table = TABLES["table1"]
    assert [row.name for row in table.chosen(["sga-rrt"])] == ["sga-rrt-0.9", "sga-rrt-0.6", "sga-rrt-0.3"]
    assert [row.name for row in table.chosen(["ti-5-star", "random"])] == ["ti-5-star", "random"]
    assert table.chosen([]) == tuple(row for row in table.rows if row.name != "ti-star-reencode")
    assert [row.name for row in table.chosen(["ti-star-reencode"])] == ["ti-star-reencode"]
    with pytest.raises(InputError, match=r"no row 'rndom' \(did you mean random\?\)"):
        table.chosen(["rndom"])


@pytest.mark.parametrize(
    ("planner", "options"),
    [
        ("random", {}),
        ("shared-greedy", {}),
        ("lawnmower", {}),
        ("sga-rrt", {"nodes": 12, "lengths": (0.2, 0.3)}),
        ("receding-horizon", {"horizon": 2, "candidates": 4, "elites": 2, "steps": 1, "points": 16}),
        ("receding-horizon", {"horizon": 2, "candidates": 4, "elites": 2, "steps": 1, "points": 16, "joint": True}),
        ("ti-star", {"weights": "untrained", "paths": 2, "steps": 2}),
    ],
)
def test_planners_compiled_in_a_shared_shape_do_the_same(planner, options):
    scenario = Scenario(agents=2, budget=0.6, grid=8, nodes=12, neighbours=4)
    shape = shape_of([scenario, scenario.replace(budget=1.2, comm_range=0.3)])
    own, longer = (
        evaluate(scenario, planner, options, instances=2, trials=1, timing=False, shape=one).values
        for one in (None, shape)
    )
    assert own["distance"] == pytest.approx(longer["distance"], abs=1e-4)
    assert own["trace"] == pytest.approx(longer["trace"], rel=1e-3)
