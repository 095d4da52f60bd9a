"""The files of the scaling benchmark: they hold all of it, read back, and say no to what is not theirs."""

import csv
import json
import math

import pytest

from maipp.bench.belief_error import BeliefError
from maipp.bench.scaling import Cost
from maipp.bench.scaling_report import Results, read_json, to_markdown, write_json, write_report
from maipp.errors import InputError

SETTINGS = {"planner": ["shared-greedy", "intent-paths"], "seed": 0}
COSTS = [
    Cost(planner, "grid", 10, 500, grid, 200, 1.5 * grid, 2.0 * grid, 30, 4.0, 0.25 * grid, 1.0)
    for planner in SETTINGS["planner"]
    for grid in (30, 60)
]
ERRORS = [BeliefError(1500, 0.2, 0.25, 1, 3.5, 0.0123, math.nan, 0.0123, 1e-4, 2e-5)]


def test_all_files_are_written(tmp_path):
    written = write_report(Results(SETTINGS, COSTS, ERRORS), tmp_path)
    assert sorted(path.name for path in written) == sorted(path.name for path in tmp_path.iterdir())
    rows = list(csv.DictReader((tmp_path / "scaling.csv").read_text().splitlines()))
    assert [float(row["decision_ms"]) for row in rows] == [cost.decision_ms for cost in COSTS]
    content = json.loads((tmp_path / "scaling.json").read_text())
    assert [line["time"] for line in content["growth"]] == pytest.approx([1.0, 1.0])
    assert (tmp_path / "scaling.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_page_has_exponents_points_and_errors():
    page = to_markdown(Results(SETTINGS, COSTS, ERRORS))
    assert "| `intent-paths` | grid | 1.00 | 1.00 | 1.00 |" in page
    assert "| `shared-greedy` | grid | 10 | 500 | 60 | 200 | 90.0 | 120.0 | 4.0 | 15.0 | 1.0 |" in page
    assert "| 1500 | 0.2 | 0.25 | 1 | 3.5 | 1.230 % |" in page
    assert "float64" not in to_markdown(Results(SETTINGS, COSTS, []))


def test_results_read_back_for_the_same_settings_only(tmp_path):
    assert read_json(tmp_path, SETTINGS) == Results(SETTINGS, [], [])
    write_json(Results(SETTINGS, COSTS, ERRORS), tmp_path)
    found = read_json(tmp_path, SETTINGS)
    assert found.costs == COSTS and math.isnan(found.errors[0].error_se)
    assert found.errors[0]._replace(error_se=0.0) == ERRORS[0]._replace(error_se=0.0)
    assert read_json(tmp_path, SETTINGS | {"seed": 1}) == Results(SETTINGS | {"seed": 1}, [], [])


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"settings": 1}', "\x00"])
def test_another_file_of_that_name_is_refused(tmp_path, content):
    (tmp_path / "scaling.json").write_text(content)
    with pytest.raises(InputError, match=r"scaling\.json.*another --out"):
        read_json(tmp_path, SETTINGS)
