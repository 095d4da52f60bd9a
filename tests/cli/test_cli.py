"""The command line: what it prints, where, and with which exit code."""

import subprocess
import sys
from pathlib import Path

import pytest

import maipp
from maipp.cli.main import COMMANDS, main
from maipp.cli.scenario_flags import ScenarioFlags
from maipp.devices import cache_folder
from maipp.errors import InputError
from maipp.planners import planner_names
from maipp.scenario import Scenario
from maipp.scenario_io import parse_scenario


@pytest.fixture(autouse=True)
def devices_are_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """JAX is running already, with the devices that tests/conftest.py asked for."""
    monkeypatch.setattr("maipp.devices._configured", True)


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]])
def test_help_lists_every_command(arguments, capsys):
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert all(f"  {name} " in out for name in COMMANDS)


def test_help_imports_nothing_heavy():
    heavy = "{'jax', 'matplotlib', 'scipy', 'numpy', 'equinox', 'tyro'}"
    code = f"import sys; from maipp.cli.main import main; main([]); sys.exit(bool({heavy} & sys.modules.keys()))"
    assert subprocess.run([sys.executable, "-c", code], check=False, capture_output=True).returncode == 0


def test_importing_maipp_imports_no_jax():
    code = "import sys, maipp; maipp.Scenario, maipp.make_planner, maipp.register; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_benchmarks_alone_wait_for_pandas():
    """Nor do the processes that compute their cells."""
    modules = "[module_of(name) for name in COMMANDS if name != 'benchmark']"
    code = f"import sys, maipp.bench.cells; from maipp.cli.main import *; {modules}; sys.exit('pandas' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_every_public_name_is_there():
    assert all(getattr(maipp, name) is not None for name in maipp.__all__)
    assert set(maipp.__all__) <= set(dir(maipp))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        maipp.nothing  # type: ignore[attr-defined]  # noqa: B018


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"maipp {maipp.__version__}\n"


def test_an_unknown_command_is_told_the_nearest(capsys):
    assert main(["evalute"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("error: no command 'evalute' (did you mean evaluate?)")
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize("command", ["evaluate", "planners", "scenario"])
def test_an_unknown_flag_is_an_input_error(command, capsys):
    assert main([command, "--bogus"]) == 2
    assert "--bogus" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["evaluate", "planners", "scenario"])
def test_every_command_has_help(command, capsys):
    assert main([command, "--help"]) == 0
    assert f"usage: maipp {command}" in capsys.readouterr().out


def test_the_module_is_the_command():
    result = subprocess.run([sys.executable, "-m", "maipp", "scenari"], check=False, capture_output=True, text=True)
    assert result.returncode == 2 and result.stderr.startswith("error: ") and "Traceback" not in result.stderr


def test_a_closed_pipe_is_no_error():
    code = "import sys; from maipp.cli.main import main; sys.stdin.readline(); sys.exit(main(['scenario']))"
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdin is not None and process.stdout is not None and process.stderr is not None
        process.stdout.close()  # as `maipp scenario | head` does, and only then does it print
        process.stdin.write("go\n")
        process.stdin.flush()
        assert process.stderr.read() == ""
        assert process.wait() == 141


def test_compiled_programs_are_kept_where_the_user_says(monkeypatch):
    monkeypatch.setenv("MAIPP_CACHE", "somewhere/else")
    assert cache_folder() == Path("somewhere/else")
    monkeypatch.setenv("MAIPP_CACHE", "")
    assert cache_folder() is None
    monkeypatch.delenv("MAIPP_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "caches")
    monkeypatch.setattr(sys, "platform", "linux")
    assert cache_folder() == Path("caches/maipp")


# maipp scenario


def test_scenario_prints_the_defaults(capsys):
    assert main(["scenario"]) == 0
    text = capsys.readouterr().out
    assert parse_scenario(text) == Scenario() and text.count("# ") >= len(Scenario().to_dict())


def test_scenario_checks_a_file(tmp_path, capsys):
    path = tmp_path / "a.yaml"
    path.write_text("agents: 4\nbudget: 2\n", encoding="utf-8")
    assert main(["scenario", "--check", str(path)]) == 0
    assert "4 agents" in capsys.readouterr().out
    path.write_text("agents: 4\nbudget: -2\n", encoding="utf-8")
    assert main(["scenario", "--check", str(path)]) == 2
    assert capsys.readouterr().err.startswith(f"error: {path}:2: budget: -2")


# The flags that commands share


def test_flags_left_out_keep_what_the_file_says(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("agents: 4\nbudget: 2\n", encoding="utf-8")
    assert ScenarioFlags(scenario=path, agents=5).to_scenario() == Scenario(agents=5, budget=2.0)
    assert ScenarioFlags().to_scenario() == Scenario()


def test_several_budgets_are_one_per_agent():
    assert ScenarioFlags(agents=2, budget=(1.0, 2.0)).to_scenario().budgets == (1.0, 2.0)
    assert ScenarioFlags(agents=2, budget=(1.0,)).to_scenario().budgets == (1.0, 1.0)
    assert ScenarioFlags(agents=2, budget=(1.0, 2.0)).to_scenario(3.0).budgets == (3.0, 3.0)


def test_settings_are_the_planners_or_the_scenarios():
    settings = (("joint=true", "scenario.noise=1e-5"), ("scenario.start=.3,.4", "lengths = 0.3,0.4"))
    settings += (
        ("scenario.beta = .5", "scenario.interest_rule=variance", "scenario.obstacles=[]", "scenario.field=null"),
    )
    flags = ScenarioFlags(settings=settings)
    assert flags.planner_options() == {"joint": "true", "lengths": "0.3,0.4"}
    expected = Scenario(noise=1e-5, start=(0.3, 0.4), beta=0.5, interest_rule="variance")
    assert flags.to_scenario() == expected


@pytest.mark.parametrize(
    ("flags", "problem"),
    [
        (ScenarioFlags(agents=0), "--agents: 0 is not"),
        (ScenarioFlags(budget=(-1.0,)), "--budget: -1.0 is not a length > 0"),
        (ScenarioFlags(length_scale=0.0), "--length-scale: 0.0 is not"),
        (ScenarioFlags(settings=(("scenario.gird=3",),)), "did you mean grid?"),
        (ScenarioFlags(settings=(("scenario.grid=x",),)), "scenario.grid: 'x' is not"),
        (ScenarioFlags(settings=(("grid",),)), "--set grid: not an assignment"),
        (ScenarioFlags(settings=(("a=1",), ("a=2",))), "--set a: given twice"),
        (ScenarioFlags(scenario=Path("nowhere.yaml")), "nowhere.yaml: cannot read"),
    ],
)
def test_bad_flags_are_told_by_their_own_name(flags, problem):
    with pytest.raises(InputError) as error:
        flags.to_scenario()
    assert problem in str(error.value)


# maipp planners


def test_planners_lists_names_and_options(capsys):
    assert main(["planners"]) == 0
    out = capsys.readouterr().out
    assert all(f"{name}  " in out for name in planner_names())
    assert "    lengths: 2 values such as 0.3,0.4 (default 0.3,0.4)" in out
    assert "    shared: true or false (default true)  announce the next node" in out  # preset by shared-greedy
    assert main(["planners", "greedi"]) == 2
    assert "did you mean greedy?" in capsys.readouterr().err


# maipp evaluate
