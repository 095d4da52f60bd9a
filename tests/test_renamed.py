"""Old names of modules and of what they hold: they give the new thing, and say what it is called now."""

import importlib
import subprocess
import sys

import pytest

from maipp.renamed import MODULES, renamed

# Module, old name, new name.
NAMES = [
    ("maipp", "edges_here", "feasible_edges"),
    ("maipp.adapters.base_env", "Survey", "BaseSurveyEnv"),
    ("maipp.bench.tables", "Part", "TablePart"),
    ("maipp.bench.tables", "Sample", "SampleSize"),
    ("maipp.engine.observe", "turn", "begin_event"),
    ("maipp.engine.score", "Standing", "BeliefScore"),
    ("maipp.engine.score", "standing", "score_belief"),
    ("maipp.environments.global_state", "whole_bounds", "global_state_bounds"),
    ("maipp.environments.global_state", "whole_state", "global_state"),
    ("maipp.fleet.logs", "Part", "LogSegment"),
    ("maipp.fleet.vehicles", "Place", "VehicleContext"),
    ("maipp.planners.paths", "Situation", "AgentState"),
    ("maipp.planners.roadmap.edges", "edges_here", "feasible_edges"),
    ("maipp.policy.weights", "Kind", "WeightsKind"),
    ("maipp.route_files", "Vehicle", "VehicleSettings"),
    ("maipp.route_files", "write_mission_files", "write_route_files"),
    ("maipp.route_files.vehicle_settings", "Vehicle", "VehicleSettings"),
    ("maipp.route_files.writer", "write_mission_files", "write_route_files"),
    ("maipp.surveys.expected_mission", "Expected", "ExpectedSurvey"),
    ("maipp.surveys.mission_file", "Kernel", "KernelSpec"),
    ("maipp.surveys.mission_file", "Robot", "RobotSpec"),
    ("maipp.surveys.mission_file", "Survey", "MissionFile"),
    ("maipp.team", "is_told", "is_announced"),
    ("maipp.team.intent", "is_told", "is_announced"),
    ("maipp.viz.report", "Told", "Broadcast"),
]


def old_modules() -> dict[str, object]:
    """The old modules that have been imported, and what lies below them."""
    return {
        name: sys.modules[name] for name in [*sys.modules] if any(f"{name}.".startswith(f"{old}.") for old in MODULES)
    }


@pytest.fixture(autouse=True)
def imported_anew():
    before = old_modules()
    for name in before:
        del sys.modules[name]
    yield
    for name in old_modules():
        del sys.modules[name]
    sys.modules.update(before)  # type: ignore[arg-type]


@pytest.mark.parametrize("old", MODULES)
def test_an_old_module_gives_what_the_new_one_holds(old):
    with pytest.warns(DeprecationWarning, match=rf"^{old} is now {MODULES[old]};"):
        module = importlib.import_module(old)
    new = importlib.import_module(MODULES[old])
    public = [name for name in vars(new) if not name.startswith("_")]
    assert public and all(getattr(module, name) is vars(new)[name] for name in public)
    with pytest.raises(AttributeError):
        _ = module.nothing_of_the_kind


@pytest.mark.parametrize(("module", "old", "new"), NAMES)
def test_an_old_name_gives_the_new_thing(module, old, new):
    holder = importlib.import_module(module)
    with pytest.warns(DeprecationWarning, match=rf"^{module}\.{old} is now {module}\.{new};"):
        thing = getattr(holder, old)
    assert thing is getattr(holder, new)
    with pytest.raises(AttributeError):
        _ = holder.nothing_of_the_kind


def test_the_warning_names_the_line_that_imports(tmp_path):
    # In a process of its own: what checks shapes in tests stands between the caller and the warning.
    script = tmp_path / "script.py"
    script.write_text(
        "import maipp\nfrom maipp.missions import Route\nprint(maipp.edges_here, Route)", encoding="utf-8"
    )
    done = subprocess.run([sys.executable, "-W", "always", script], capture_output=True, text=True, check=True)
    assert "feasible_edges" in done.stdout and "maipp.route_files." in done.stdout
    assert [line.partition(": DeprecationWarning: ")[0] for line in done.stderr.splitlines() if "Deprec" in line] == [
        f"{script}:2",
        f"{script}:3",
    ]


def test_names_that_nobody_has_are_not_found():
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("maipp.live.surveyor")


def test_a_module_with_names_of_its_own_making_keeps_them(monkeypatch):
    module = type(sys)("made_up")
    vars(module).update(New=1, __getattr__=lambda name: f"made {name}")
    monkeypatch.setitem(sys.modules, "made_up", module)
    renamed("made_up", Old="New")
    assert module.Other == "made Other"
    with pytest.warns(DeprecationWarning, match=r"^made_up\.Old is now made_up\.New;"):
        assert module.Old == 1
