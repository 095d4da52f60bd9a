"""`maipp evaluate`: rows, pairs, parts, processes, and what it says of bad input."""

import csv
import json
import os
from pathlib import Path

import numpy as np
import pytest

from maipp.bench import evaluation_jobs
from maipp.cli.main import main
from maipp.errors import InputError

TINY = "--agents 2 --set scenario.grid=8 scenario.nodes=12 scenario.neighbours=4 --instances 2 --trials 3".split()


def test_evaluate_prints_a_row_for_each_planner(tmp_path, capsys):
    path, every = tmp_path / "out.json", tmp_path / "out.csv"
    arguments = ["--planner", "random", "greedy", "--budget", "0.6", "--no-timing", "--json", str(path)]
    assert main(["evaluate", *TINY, *arguments, "--csv", str(every), "--set", "shared=no"]) == 0
    captured = capsys.readouterr()
    rows = json.loads(path.read_text(encoding="utf-8"))["evaluations"]
    assert [row["planner"] for row in rows] == ["random", "greedy"]
    assert [row["options"] for row in rows] == [{}, {"shared": False}]  # an option goes to who has it
    lines = [line.split() for line in captured.out.splitlines() if line.split()[:1] in (["random"], ["greedy"])]
    assert [line[:2] for line in lines] == [["random", "0.6"], ["greedy", "0.6"]]
    for line, row in zip(lines, rows, strict=True):
        assert float(line[2]) == pytest.approx(row["summary"]["trace"]["mean"], rel=5e-3)
    assert f"wrote {path}" in captured.err and f"wrote {every}" in captured.err
    told = list(csv.DictReader(every.open(encoding="utf-8")))
    assert [line["planner"] for line in told] == ["random"] * 6 + ["greedy"] * 6 and told[6][
        "options"
    ] == "shared=false"
    assert [float(line["trace"]) for line in told] == pytest.approx(np.ravel([row["values"]["trace"] for row in rows]))


def test_evaluate_compares_in_pairs_by_shards_and_goes_on(tmp_path, monkeypatch, capsys):
    common = [*TINY, "greedy", "random", "--budget", "0.6", "--no-timing", "--instances", "2:5", "--trials", "1"]
    whole, first, second = (str(tmp_path / name) for name in ("whole.json", "1.json", "2.json"))
    assert main(["evaluate", *common, "--reference", "greedy", "--json", whole]) == 0
    out = capsys.readouterr().out
    assert "minus greedy, in pairs" in out and "3 instances, from number 2 on" in out
    compared = json.loads(Path(whole).read_text(encoding="utf-8"))["comparisons"]
    (trace,) = [each for each in compared if each["metric"] == "trace"]
    assert trace["planner"] == "random" and trace["interval"][0] < trace["mean"] < trace["interval"][1]
    for shard, path in (("1/2", first), ("2/2", second)):
        assert main(["evaluate", *common, "--shard", shard, "--json", path]) == 0
    both = str(tmp_path / "both.json")
    assert main(["evaluate", "--merge", second, first, "--reference", "greedy", "--json", both]) == 0
    again = json.loads(Path(both).read_text(encoding="utf-8"))["comparisons"]
    (same,) = [each for each in again if each["metric"] == "trace"]
    assert same["mean"] == pytest.approx(trace["mean"], rel=1e-4)  # batches of other sizes round otherwise
    monkeypatch.setattr(evaluation_jobs, "evaluate", lambda *_, **__: pytest.fail("evaluated again"))
    before = Path(whole).read_text(encoding="utf-8")
    assert main(["evaluate", *common, "--reference", "greedy", "--json", whole, "--resume"]) == 0
    assert Path(whole).read_text(encoding="utf-8") == before
    assert main(["evaluate", *TINY, "greedy", "--budget", "0.6", "--json", whole, "--resume", "--instances", "x"]) == 2


def test_evaluate_in_processes_comes_to_the_same(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(evaluation_jobs, "_MISSIONS", 2)  # so that there are several jobs
    common = [*TINY, "greedy", "--budget", "0.6", "--no-timing", "--instances", "3", "--trials", "1"]
    here, there = (tmp_path / name for name in ("here.json", "there.json"))
    assert main(["evaluate", *common, "--json", str(here)]) == 0
    assert main(["evaluate", *common, "--workers", "1", "--json", str(there)]) == 0
    one, other = (json.loads(path.read_text(encoding="utf-8"))["evaluations"][0] for path in (here, there))
    assert one["fingerprint"] == other["fingerprint"] and other["instances"] == 3
    for metric, values in one["values"].items():  # batches of other sizes round otherwise
        np.testing.assert_allclose(other["values"][metric], values, rtol=1e-3, atol=1e-5)
    capsys.readouterr()
    assert main(["evaluate", *common, "--cluster", "tcp://127.0.0.1:1", "--workers", "1"]) == 2
    assert "leave --workers out" in capsys.readouterr().err


def test_evaluate_can_write_to_standard_output(capsys):
    assert main(["evaluate", *TINY, "--planner", "greedy", "--budget", "0.6", "--no-timing", "--json", "-"]) == 0
    captured = capsys.readouterr()
    assert len(json.loads(captured.out)["evaluations"]) == 1
    assert "greedy" in captured.err


def test_an_interrupt_keeps_the_rows_that_are_done(tmp_path, monkeypatch, capsys):
    real, calls = evaluation_jobs.evaluate, []

    def interrupted(*arguments, **options):
        calls.append(arguments)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(*arguments, **options)

    monkeypatch.setattr(evaluation_jobs, "evaluate", interrupted)
    path = tmp_path / "out.json"
    arguments = ["--planner", "greedy", "--budget", "0.6", "0.4", "0.2", "--no-timing", "--json", str(path)]
    assert main(["evaluate", *TINY, *arguments]) == 130
    captured = capsys.readouterr()
    assert [scenario.budget for scenario, *_ in calls] == [0.6, 0.4]  # budgets are evaluated one by one
    assert len(json.loads(path.read_text(encoding="utf-8"))["evaluations"]) == 1
    assert "interrupted: 1 of 3 rows are done" in captured.err and "greedy" in captured.out


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ([], "no planner is given; give one or more of random"),
        (["greedy", "--reference", "ti"], "--reference: ti is none of the planners given, greedy"),
        (["greedy", "--instances", "5:5"], "--instances: 5:5 are none"),
        (["greedy", "--instances", "many"], "--instances: 'many' is no number of instances"),
        (["greedy", "--shard", "31/31"], "--shard: '31/31' is no part of 30 instances"),
        (["greedy", "--resume"], "--resume: goes on with the file of --json"),
        (["greedy", "--merge", "a.json"], "--merge: evaluates nothing; leave out the planners"),
        (["--merge", "a.json"], "a.json: cannot read the evaluations"),
        (["--planner", "greedy", "gready"], "no planner 'gready' (did you mean greedy?)"),
        (["--planner", "greedy", "--budget", "1", "-1"], "--budget: -1.0 is not a length > 0"),
        (["--planner", "greedy", "--set", "sharde=1"], "no option 'sharde' (did you mean shared?)"),
        (["--planner", "greedy", "--json", "nowhere/out.json"], "--json: no folder nowhere"),
        (["--planner", "greedy", "--json", os.curdir], "--json: . is a folder"),
        (["--planner", "greedy", "--csv", "nowhere/out.csv"], "--csv: no folder nowhere"),
        (["--planner", "greedy", "--instances", "0"], "instances: 0"),
    ],
)
def test_evaluate_says_what_is_wrong_before_it_works(arguments, problem, capsys):
    assert main(["evaluate", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ") and problem in captured.err
    assert captured.err.count("\n") == 1 and captured.out == ""


NAN_WAY = """
import jax.numpy as jnp
from maipp.engine import Decision, Planner


class NanWay(Planner):
    'goes once, and then names NaN'

    def initial_memory(self):
        return jnp.zeros((), bool)

    def decide(self, key, observation, memory):
        ahead = jnp.where(observation.position < 0.5, 0.2, -0.2)
        return Decision(jnp.where(memory, jnp.nan, observation.position + ahead)[None], (), jnp.asarray(True))
"""


def test_evaluate_warns_of_agents_that_it_had_to_stop(tmp_path, capsys):
    (tmp_path / "bad.py").write_text(NAN_WAY, encoding="utf-8")
    path, bad = tmp_path / "out.json", f"{tmp_path / 'bad.py'}:NanWay"
    arguments = ["--planner", "greedy", bad, "--budget", "0.6", "--no-timing", "--json", str(path)]
    assert main(["evaluate", *TINY, *arguments]) == 0
    captured = capsys.readouterr()
    good, row = json.loads(path.read_text(encoding="utf-8"))["evaluations"]
    count = row["scenario"]["agents"] * row["instances"] * row["trials"]
    assert np.sum(row["values"]["not_finite"]) == count and not np.any(good["values"]["not_finite"])
    assert row["summary"]["unspent"]["mean"] == pytest.approx(0.6 - 0.2 * 2**0.5, abs=1e-5)
    (warning,) = [line for line in captured.err.splitlines() if "warning" in line]
    assert warning == (
        f"warning: {bad}, budget 0.6: of {count} agents the engine stopped {count} at a waypoint that is not a finite "
        "number; unspent budget 0.317 domain units each"
    )
    assert "unspent" in captured.out


def test_a_row_that_cannot_be_scored_keeps_the_rows_that_are_done(tmp_path, monkeypatch, capsys):
    real = evaluation_jobs.evaluate

    def refused(scenario, *arguments, **options):
        if scenario.budget == 0.4:
            raise InputError("instance 0, trial 0: trace is nan, not a finite number")
        return real(scenario, *arguments, **options)

    monkeypatch.setattr(evaluation_jobs, "evaluate", refused)
    arguments = ["--planner", "greedy", "--budget", "0.6", "0.4", "--no-timing", "--json", str(tmp_path / "out.json")]
    assert main(["evaluate", *TINY, *arguments]) == 2
    captured = capsys.readouterr()
    assert len(json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["evaluations"]) == 1
    assert "greedy" in captured.out
    assert captured.err.endswith("error: instance 0, trial 0: trace is nan, not a finite number\n")
    assert main(["evaluate", *TINY, "--planner", "greedy", "--budget", "0.4", "--no-timing"]) == 2
