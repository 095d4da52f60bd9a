"""The Markdown tables: the numbers of the files, and commands that give these files again."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
import tyro

from maipp.benchmarks.evaluate import Evaluation, evaluate, save_evaluations
from maipp.benchmarks.planner_table import END, START, PlannerTable, main, planner_table, read_results
from maipp.cli.evaluate import Evaluate, _rows
from maipp.errors import InputError
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=2, grid=8, nodes=12, neighbours=4, last_leg="stop", budget=0.4)


@pytest.fixture(scope="module")
def evaluations() -> list[Evaluation]:
    return [
        evaluate(SCENARIO.replace(budget=budget), name, instances=3, trials=2, seed=5, timing=False)
        for budget in (0.6, 0.4)
        for name in ("random", "shared-greedy")
    ]


@pytest.fixture
def file(evaluations, tmp_path) -> Path:
    save_evaluations(evaluations, tmp_path / "results.json")
    return tmp_path / "results.json"


def cells(table: str) -> list[list[str]]:
    """The cells of all table rows, the rulers left out."""
    rows = [line.strip("| ").split(" | ") for line in table.splitlines() if line.startswith("|")]
    return [row for row in rows if not row[0].startswith("---")]


def test_the_numbers_are_those_of_the_file(file):
    table = planner_table(read_results([file]))
    heading, *rows = cells(table)
    assert heading == ["planner", "B = 0.4", "B = 0.6", "message, bytes"]
    written = json.loads(file.read_text(encoding="utf-8"))["evaluations"]
    for row in rows:
        for budget, cell in zip((0.4, 0.6), row[1:3], strict=True):
            (found,) = (e for e in written if f"`{e['planner']}`" == row[0] and e["scenario"]["budget"] == budget)
            mean, error = map(float, cell.split(" ± "))
            assert mean == pytest.approx(found["summary"]["trace"]["mean"], abs=error)
            assert error == pytest.approx(found["summary"]["trace"]["se"], rel=0.06)
    assert [row[3] for row in rows] == ["0", "8"]
    assert "3 instances x 2 trials, seed 5" in table
    assert written[0]["machine"]["cpu"] in table


def test_the_commands_regenerate_the_files(file, evaluations):
    commands = re.findall(r"^maipp evaluate (.*)$", planner_table(read_results([file])), flags=re.MULTILINE)
    again = []
    for command in commands:
        flags = tyro.cli(Evaluate, args=shlex.split(command))
        assert (flags.instances, flags.trials, flags.seed, flags.timing) == (3, 2, 5, False)
        assert flags.json == "results.json"
        again += [(name, scenario) for name, scenario, _ in _rows(flags)]
    assert len(again) == len(evaluations)
    assert set(again) == {(e.planner, e.scenario) for e in evaluations}


def test_options_and_scenarios_that_are_special_are_told_and_typed(evaluations, tmp_path):
    special = replace(evaluations[1], options={"shared": False}, scenario=SCENARIO.replace(budget=(0.4, 0.6)))
    ten = replace(evaluations[0], scenario=SCENARIO.replace(agents=10, length_scale=0.25, extent=(1.0, 0.5)))
    save_evaluations([special], tmp_path / "a.json")
    save_evaluations([ten], tmp_path / "b.json")
    table = planner_table(read_results([tmp_path / "a.json", tmp_path / "b.json"]))
    assert "| `shared-greedy` shared=false |" in table and "| B = 0.4,0.6 |" in table
    assert "Tr(P), 10 agents, extent 1.0,0.5, grid 8, length_scale 0.25," in table
    rows = []
    for command in re.findall(r"^maipp evaluate (.*)$", table, flags=re.MULTILINE):
        rows += _rows(tyro.cli(Evaluate, args=shlex.split(command)))
    assert rows == [("shared-greedy", special.scenario, {"shared": "false"}), ("random", ten.scenario, {})]


def test_results_of_different_size_are_not_mixed(evaluations, tmp_path):
    fewer = replace(evaluations[0], instances=2, values={k: v[:2] for k, v in evaluations[0].values.items()})
    save_evaluations([*evaluations, fewer], tmp_path / "out.json")
    heading, *rows = cells(planner_table(read_results([tmp_path / "out.json"])))
    assert heading[3] == "instances x trials, seed"
    assert [row[3] for row in rows] == ["3 x 2, 5", "3 x 2, 5", "2 x 2, 5"]


def test_a_cell_that_two_results_claim_is_told(file):
    with pytest.raises(InputError, match=r"`random` at budget 0\.6 is there twice"):
        planner_table(read_results([file, file]))


def test_the_page_is_changed_between_its_marks_alone(file, tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{START}\nold\n{END}\nafter\n", encoding="utf-8")
    assert main(PlannerTable((file,), metric=("trace", "rmse"), page=page)) == 0
    text = page.read_text(encoding="utf-8")
    assert text.startswith(f"before\n{START}\n\nTr(P), 2 agents") and text.endswith(f"```\n\n{END}\nafter\n")
    assert "results.json --metric trace rmse --page page.md" in text
    assert "RMSE, 2 agents" in text and "old" not in text


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (None, "cannot be read"),
        ("no", "not JSON"),
        ("[1]", "not the results of an evaluation"),
        ('{"format": "maipp-evaluations", "evaluations": []}', "hold no evaluation"),
    ],
)
def test_files_that_are_no_results_are_told_in_one_line(content, problem, tmp_path, capsys):
    if content is not None:
        (tmp_path / "in.json").write_text(content, encoding="utf-8")
    assert main(PlannerTable((tmp_path / "in.json",))) == 2
    captured = capsys.readouterr().err
    assert problem in captured and captured.count("\n") == 1


def test_unknown_metrics_and_pages_without_marks_are_told(file, tmp_path, capsys):
    with pytest.raises(InputError, match="one of trace, own_trace, true_trace, rmse"):
        planner_table(read_results([file]), ["speed"])
    (tmp_path / "page.md").write_text("no marks", encoding="utf-8")
    assert main(PlannerTable((file,), page=tmp_path / "page.md")) == 2
    assert "no place for the table; add the lines <!-- table:start -->" in capsys.readouterr().err
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == "no marks"


def test_a_result_without_a_finite_number_is_told(file, tmp_path):
    document = json.loads(file.read_text(encoding="utf-8"))
    document["evaluations"][0]["summary"]["rmse"]["mean"] = None  # what earlier versions wrote for NaN
    (tmp_path / "old.json").write_text(json.dumps(document), encoding="utf-8")
    assert planner_table(read_results([tmp_path / "old.json"]))
    with pytest.raises(InputError, match=r"old\.json: .* has no finite rmse at budget"):
        planner_table(read_results([tmp_path / "old.json"]), ["rmse"])
