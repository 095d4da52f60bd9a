"""A field's file is the same world for every command that reads one."""

import numpy as np
import pytest

from maipp.bench import evaluation_jobs
from maipp.cli import evaluate as evaluate_module
from maipp.cli import plan as plan_module
from maipp.cli.evaluate import EvaluateFlags
from maipp.cli.plan import PlanFlags
from maipp.errors import InputError
from maipp.geo import WGS84

X, Y = np.linspace(13.30, 13.34, 9), np.linspace(53.40, 53.42, 7)
DEPTH = np.hypot(X[None] - 13.31, 2 * (Y[:, None] - 53.415)) * 1000


class ReachedError(Exception):
    """Everything is known that the test asks for."""


@pytest.fixture
def folder(tmp_path):
    np.savez(tmp_path / "f.npz", depth=DEPTH, salt=-DEPTH, longitude=X, latitude=Y)
    np.save(tmp_path / "bare.npy", DEPTH)
    (tmp_path / "scenario.yaml").write_text(f"agents: 2\nbudget: 1.5\nfield: {tmp_path / 'f.npz'}\n")
    return tmp_path


def worlds(monkeypatch, flags):
    """What `maipp plan` and `maipp evaluate` are about to survey: scenario and field of each."""
    caught = []

    def survey(scenario, planner, options, *, field, **_):
        caught.append((scenario, field))
        raise ReachedError

    def evaluate(scenario, planner, options, *, field, **_):
        caught.append((scenario, field))
        raise ReachedError

    monkeypatch.setattr(plan_module, "survey", survey)
    monkeypatch.setattr(evaluation_jobs, "evaluate", evaluate)
    with pytest.raises(ReachedError):
        plan_module.run(PlanFlags(planner="random", **flags))
    with pytest.raises(ReachedError):
        evaluate_module.run(EvaluateFlags(planner=("random",), **flags))
    return caught


@pytest.mark.parametrize(
    "flags",
    [
        {"value": "depth"},
        {"value": "depth", "geographic": True, "low": 1.0, "high": 30.0, "start": (13.31, 53.41), "threshold": 12.0},
        {"value": "salt", "crs": "EPSG:4326", "invert": True},
    ],
)
def test_plan_and_evaluate_read_one_world(folder, monkeypatch, flags):
    (planned, field), (evaluated, other) = worlds(monkeypatch, {"scenario": folder / "scenario.yaml", **flags})
    assert planned == evaluated and field.reference == other.reference
    np.testing.assert_array_equal(field.values, other.values)
    assert field.reference.geographic == ("geographic" in flags or "crs" in flags)
    assert planned.extent == field.domain
    if "threshold" in flags:
        assert planned.threshold == pytest.approx((12 - 1) / 29)


def test_a_file_without_coordinates_is_placed_alike(folder, monkeypatch):
    flags = {"field": folder / "bare.npy", "corners": (13.30, 13.34, 53.40, 53.42), "geographic": True}
    (planned, field), (evaluated, other) = worlds(monkeypatch, flags)
    assert planned == evaluated and field.reference == other.reference and field.reference.crs == WGS84
    # At this latitude a degree of longitude is 0.6 of one of latitude.
    assert planned.extent == pytest.approx((1.0, 0.5 / 0.598), abs=0.005)


@pytest.mark.parametrize(
    ("flags", "told"),
    [
        ({"crs": "EPSG:25833", "geographic": True}, "--geographic: says degrees, --crs EPSG:25833 does not"),
        ({"crs": "none", "geographic": True}, "--geographic: says degrees, --crs none does not"),
        ({"crs": "Atlantis"}, "crs: 'Atlantis' is no coordinate reference system"),
        ({"field": None, "crs": "EPSG:25833"}, "--crs: says how to read a field's file, but there is none"),
    ],
)
def test_flags_that_contradict_are_told(folder, flags, told):
    pytest.importorskip("pyproj")
    both = {"field": folder / "bare.npy", **flags}
    for command in (PlanFlags, EvaluateFlags):
        given = command(**both)
        with pytest.raises(InputError, match=told):
            given.read_field(given.to_scenario())
