"""The tables are the paper's, and each line can be run."""

import pytest

from maipp.bench.cells import cells
from maipp.bench.evaluate import evaluate
from maipp.bench.tables import TABLES, SampleSize, best, read_table
from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.problem import shape_of
from maipp.scenario import Scenario
from tests.conftest import slow


def test_the_paper_s_best_rows():
    # Yang et al. 2023, the numbers in bold.
    found = {
        name: [[best(part.printed, b) for b in table.columns] for part in table.parts] for name, table in TABLES.items()
    }
    assert found == {
        "table1": [[30.30, 7.76, 3.32, 1.99]],
        "table2": [[19.39, 5.87, 3.07]],
        "table3": [[8.43, 3.67]],
        "table4": [[50.95, 16.04, 6.21], [40.99, 11.39, 5.12], [30.30, 7.76, 3.32]],
    }


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_every_printed_line_has_a_row_and_the_other_way_round(table):
    ours = {row.paper for row in table.rows} - {None}
    for part in table.parts:
        assert set(part.printed) <= ours
        assert all(set(column) == set(table.columns) for column in part.printed.values())
    assert ours == set().union(*(part.printed for part in table.parts))
    names = [row.name for row in table.rows]
    assert len(set(names)) == len(names) and table.reference in names


OWN = """
title: what hearing is worth
scenario: {agents: 2, grid: 8, nodes: 12, neighbours: 4, budget: 1}
columns: {threshold: [0.3, 0.4]}
rows:
  - greedy
  - ti-5-star
  - {name: short, planner: sga-rrt, options: {lengths: [0.2, 0.3]}, trials: 1}
parts: [{scenario: {comm_range: 0.3}}, {}]
worlds: prior
instances: 3
trials: 2
"""


def own(tmp_path, text):
    path = tmp_path / "own.yaml"
    path.write_text(text, encoding="utf-8")
    return read_table(path)


def test_a_table_of_one_s_own_is_what_its_file_says(tmp_path):
    table = own(tmp_path, OWN)
    assert (table.name, table.title, table.typed) == ("own", "what hearing is worth", str(tmp_path / "own.yaml"))
    assert table.sample == SampleSize(3, 2, 0) and table.reference == "greedy"
    near, everywhere = table.parts
    assert (near.scenario.comm_range, everywhere.scenario.comm_range) == (0.3, None)
    assert table.scenario(near, 0.3).threshold == 0.3 and table.heading(0.3) == "threshold = 0.3"
    assert table.rows[1] == TABLES["table1"].chosen(["ti-5-star"])[0]
    assert table.rows[2].typed_options == "lengths=0.2,0.3"
    every = list(cells(table, table.rows, table.sample))
    assert len({cell.key for cell in every}) == len(every) == 2 * 3 * 2
    assert {cell.worlds for cell in every} == {"prior"} and [cell.trials for cell in every[4:6]] == [1, 1]
    assert len({cell.kind for cell in every}) == 3  # a row is compiled once


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("title:", "titel:", "2: titel: no such key; did you mean title?"),
        ("agents: 2", "agnets: 2", "3: scenario.agnets: no such key; did you mean agents?"),
        ("agents: 2", "agents: 0", "3: scenario.agents: 0 is not a whole number >= 1"),
        ("threshold: [", "thresh: [", "4: columns.thresh: no such key; did you mean threshold?"),
        ("[0.3, 0.4]", "[]", "4: columns.threshold: [] is not a list of numbers, one or more"),
        ("[0.3, 0.4]", "[0.3, 0.3]", "4: columns.threshold: the same number twice"),
        ("- greedy", "- gredy", "5: rows[0]: no row or planner 'gredy' (did you mean greedy?)"),
        ("- ti-5-star", "- greedy", "5: rows[1]: there is a row 'greedy' already"),
        ("name: short", "name: a b", "8: rows[2].name: 'a b' is no word that can be typed"),
        ("planner: sga-rrt, ", "", "8: rows[2].planner: missing"),
        ("lengths:", "length:", "8: rows[2]: "),
        ("trials: 1", "trials: 0", "8: rows[2].trials: 0 is not a whole number >= 1"),
        ("worlds: prior", "worlds: priors", "10: worlds: 'priors': no such key; did you mean prior?"),
        ("trials: 2", "metric: rsme", "12: metric: 'rsme': no such key; did you mean rmse?"),
        ("trials: 2", "reference: random", "12: reference: 'random': no such key; there are greedy"),
        ("trials: 2", "printed: {}", "12: printed: there are parts; give it in each of them"),
    ],
)
def test_what_is_wrong_with_a_table_is_told_by_file_line_and_key(tmp_path, old, new, problem):
    assert OWN.count(old) == 1
    with pytest.raises(InputError) as caught:
        own(tmp_path, OWN.replace(old, new))
    assert str(caught.value).startswith(f"{tmp_path / 'own.yaml'}:{problem}")


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_every_row_makes_a_planner(table):
    for row in table.rows:
        make_planner(row.planner, table.parts[0].scenario, row.options)


def test_rows_are_chosen_by_their_name_or_their_planner_s():
    table = TABLES["table1"]
    assert [row.name for row in table.chosen(["sga-rrt"])] == ["sga-rrt-0.9", "sga-rrt-0.6", "sga-rrt-0.3"]
    assert [row.name for row in table.chosen(["ti-5-star", "random"])] == ["ti-5-star", "random"]
    assert table.chosen([]) == tuple(row for row in table.rows if row.name != "intent-paths-reencode")
    assert [row.name for row in table.chosen(["intent-paths-reencode"])] == ["intent-paths-reencode"]
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
        slow("receding-horizon", {"horizon": 2, "candidates": 4, "elites": 2, "steps": 1, "points": 16, "joint": True}),
        ("intent-paths", {"weights": "untrained", "paths": 2, "steps": 2}),
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
