"""`maipp benchmark table1` to `table4`: files, resuming, several processes, and one line for what is wrong."""

import pytest

from maipp.bench import cells as cells_module
from maipp.bench import tables
from maipp.cli.main import main

HERE = ["--workers", "0"]  # in this process, where tests can reach in
SMALL = ["--instances", "2", "--trials", "2", *HERE]
FILES = ["table4.csv.gz", "table4.md", "table4.png"]


@pytest.fixture(autouse=True)
def small_tables(monkeypatch, tiny_table):
    monkeypatch.setattr("maipp.devices._configured", True)  # JAX is running already
    monkeypatch.setitem(tables.TABLES, "table4", tiny_table)


@pytest.fixture(scope="module")
def whole(tiny_table, tmp_path_factory):
    """A folder that one process has filled."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("maipp.devices._configured", True)
        patch.setitem(tables.TABLES, "table4", tiny_table)
        assert main(["benchmark", "table4", "--out", str(folder), *SMALL]) == 0
    return folder


def written(folder):
    return {name: (folder / name).read_bytes() for name in FILES}


def settled(page: bytes) -> list[str]:
    return [line for line in page.decode().splitlines() if not line.startswith("*Wall time")]


def test_it_leaves_csv_figure_and_markdown(whole):
    assert sorted(path.name for path in whole.iterdir()) == ["brief", "cells", *FILES]
    brief = (whole / "brief" / "table4.md").read_text(encoding="utf-8")
    assert "| `random` | " in brief and "--instances 2 --trials 2\n" in brief
    page = (whole / "table4.md").read_text(encoding="utf-8")
    assert "maipp benchmark table4 --out run --instances 2 --trials 2\n" in page


def test_the_same_command_again_computes_nothing_and_writes_the_same(whole, capsys, monkeypatch):
    monkeypatch.setattr(cells_module, "evaluate", lambda *_, **__: pytest.fail("computed again"))
    before = written(whole)
    assert main(["benchmark", "table4", "--out", str(whole), *SMALL]) == 0
    assert "12 cells: 0 computed, 12 found" in capsys.readouterr().err
    assert written(whole) == before


def test_processes_write_cells_and_a_last_run_merges_them(whole, tmp_path):
    folder = tmp_path / "run"
    for process in "01":
        flags = ["--process-id", process, "--processes", "2"]
        assert main(["benchmark", "table4", "--out", str(folder), *SMALL, *flags]) == 0
        assert [path.name for path in folder.iterdir()] == ["cells"]
    assert main(["benchmark", "table4", "--out", str(folder), *SMALL]) == 0
    merged, one = written(folder), written(whole)
    assert merged["table4.csv.gz"] == one["table4.csv.gz"] and merged["table4.png"] == one["table4.png"]
    assert settled(merged["table4.md"]) == settled(one["table4.md"])


def test_a_file_is_a_table(tmp_path, capsys):
    own = tmp_path / "own.yaml"
    own.write_text(
        "scenario: {agents: 2, grid: 8, nodes: 12, neighbours: 4, measurement_interval: 1}\n"
        "columns: {budget: [2, 3]}\nrows: [greedy, random]\ninstances: 2\ntrials: 2\n",
        encoding="utf-8",
    )
    assert main(["benchmark", str(own), "--out", str(tmp_path / "run"), *HERE]) == 0
    page = (tmp_path / "run" / "own.md").read_text(encoding="utf-8")
    assert f"maipp benchmark {own} --out run\n" in page and "the paper" not in page.lower()
    assert "| row | planner and options | B = 2 | B = 3 |" in page and "minus that of `greedy`" in page
    capsys.readouterr()
    assert main(["benchmark", str(own.with_name("none.yaml")), "--out", str(tmp_path / "run")]) == 2
    assert (
        capsys.readouterr().err
        == f"error: {own.with_name('none.yaml')}: cannot read the table: No such file or directory\n"
    )


def test_an_interrupt_is_told_and_gone_on_from(tmp_path, capsys, monkeypatch):
    original, begun = cells_module.evaluate, []

    def interrupted(*inputs, **named):
        begun.append(inputs)
        if len(begun) == 2:
            raise KeyboardInterrupt
        return original(*inputs, **named)

    monkeypatch.setattr(cells_module, "evaluate", interrupted)
    command = ["benchmark", "table4", "--out", str(tmp_path), *SMALL, "--planners", "random"]
    assert main(command) == 130
    assert "the same command goes on" in capsys.readouterr().err
    assert main(command) == 0
    assert "4 cells: 3 computed, 1 found" in capsys.readouterr().err
    assert "--planners random\n" in (tmp_path / "table4.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("flags", "problem"),
    [
        (["--planners", "rndom"], "error: --planners: no row 'rndom' (did you mean random?)"),
        (["--reference", "nobody"], "error: --reference: no row 'nobody'"),
        (["--quick", "--trials", "3"], "error: --quick: is 30 instances x 1 trial"),
        (["--instances", "0"], "error: --instances: 0 is not a number of instances"),
        (["--seed", "-1"], "error: --seed: -1 is no seed"),
        (["--processes", "2"], "error: --process-id and --processes: only one is given"),
        (["--workers", "-1"], "error: --workers: -1 is negative"),
        (["--cluster", "tcp://h:1", "--workers", "2"], "error: --workers: a cluster's workers are told there"),
        (["--cluster", "nowhere"], "error: --cluster: 'nowhere' is no address of a scheduler; give tcp://HOST:8786"),
        (["--tls", "keys"], "error: --tls: goes with --cluster tls://"),
        (["--patience", "0"], "error: --patience: 0 is no time to wait"),
        (["--process-id", "2", "--processes", "2"], "error: --process-id: 2 is none of 2"),
    ],
)
def test_bad_input_is_one_line_and_code_2(flags, problem, tmp_path, capsys):
    assert main(["benchmark", "table4", "--out", str(tmp_path / "run"), *flags]) == 2
    captured = capsys.readouterr().err
    assert captured.startswith(problem) and captured.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_an_unknown_benchmark_is_an_input_error(capsys):
    assert main(["benchmark", "table9"]) == 2
    assert "table9" in capsys.readouterr().err
