"""`maipp benchmark figures`, `latency` and `report`: bad input is one line and code 2, and files are named."""

import pytest

from maipp.cli import benchmark_figures, benchmark_latency
from maipp.cli.main import main


@pytest.fixture(autouse=True)
def devices_are_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("maipp.devices._configured", True)  # JAX is running already


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["figures", "--instances", "0"], "--instances: 0 is not a number of instances"),
        (["figures", "--seed", "-1"], "--seed: -1 is no seed"),
        (["figures", "--budget", "0.4"], "--budget: 0.4 ends before"),
        (["figures", "--planners", "gredy"], "--planners: no row 'gredy' (did you mean greedy?)"),
        (["latency", "--decisions", "0"], "--decisions: 0 is not"),
        (["latency", "--batch", "0"], "--batch: 0 is not"),
        (["latency", "--seed", "-1"], "--seed: -1 is no seed"),
        (["latency", "--agents", "0"], "scenario.agents: 0 is not a whole number >= 1"),
    ],
)
def test_bad_input_is_one_line_and_code_2(arguments, problem, tmp_path, capsys):
    assert main(["benchmark", *arguments, "--out", str(tmp_path / "run")]) == 2
    captured = capsys.readouterr().err
    assert captured.startswith(f"error: {problem}") and captured.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_flags_become_the_plan(monkeypatch, tmp_path, capsys):
    plans = []
    monkeypatch.setattr(benchmark_figures, "write_figures", lambda plan, out, told: plans.append(plan) or [out / "a"])
    monkeypatch.setattr(benchmark_latency, "write_latency", lambda plan, out, told: plans.append(plan) or [out / "b"])
    assert main(["benchmark", "figures", "--out", "x", "--instances", "5", "--planners", "di", "--budget", "2"]) == 0
    assert main(["benchmark", "latency", "--out", "x", "--agents", "4", "--decisions", "7", "--batch", "9"]) == 0
    figures, latency = plans
    assert (figures.scenario.budget, figures.instances, [r.name for r in figures.rows]) == (2.0, 5, ["di-3"])
    assert (latency.scenario.agents, latency.decisions, latency.batch, len(latency.rows)) == (4, 7, 9, 17)
    assert capsys.readouterr().out == "wrote x/a\nwrote x/b\n"


def test_the_report_fills_the_page_and_says_so(tmp_path, capsys):
    page, run = tmp_path / "page.md", tmp_path / "run"
    run.mkdir()
    page.write_text("<!-- latency:start -->\n<!-- latency:end -->\n", encoding="utf-8")
    (run / "latency.md").write_text("fast\n", encoding="utf-8")
    assert main(["benchmark", "report", str(run), "--out", str(page)]) == 0
    assert capsys.readouterr().out == f"wrote latency to {page}\n" and "fast" in page.read_text(encoding="utf-8")
    assert main(["benchmark", "report", str(tmp_path / "none"), "--out", str(page)]) == 2
    assert "holds no results" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["table1", "figures", "latency", "report"])
def test_every_benchmark_has_help(name, capsys):
    assert main(["benchmark", name, "--help"]) == 0
    assert f"usage: maipp benchmark {name}" in capsys.readouterr().out
