"""A live survey read back from its journal is the one that wrote it, without planner and mission file."""

import json

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.live.belief_problem import mission_of, place_of, read_place
from maipp.live.journal import Journal, read_journal
from maipp.live.recorded_survey import read_record
from maipp.records import Value
from maipp.results import read_taken, write_result
from maipp.scenario import Scenario
from tests.live.events import arrived, measured

PRIOR = np.array([[0.9, 0.1], [0.2, 0.2]]), np.array([0.5, -1.0])


@pytest.fixture(scope="module")
def flown(make, events, tmp_path_factory):
    """A survey from begin to end, a robot reported gone, one back with a larger budget; still open."""
    path = tmp_path_factory.mktemp("record") / "j"
    with make(path) as survey:
        for event in events[0]:
            survey.handle(event)
        survey.handle(measured("spike", value=900.0, time=0.5))
        survey.handle({"event": "gone", "id": "g", "robot": "robot2", "time": 9.0})
        survey.handle({"event": "budget", "id": "b", "robot": "robot1", "budget": 1.5, "time": 9.0})
        yield survey, path


def test_robots_measurements_and_belief_are_those_of_the_survey(flown):
    survey, path = flown
    record, state = read_record(path), survey.state()
    for robot, row in zip(record.robots, state["robots"], strict=True):
        assert (robot.name, robot.status, robot.budget) == (row["name"], row["status"], row["budget"])
        assert robot.odometer == pytest.approx(row["travelled"], abs=1e-7) and robot.leg[0].tolist() == row["position"]
    out = [(report, reason) for report, _, reason in record.measurements.everything if reason]
    assert out == [(row["id"], row["reason"]) for row in state["kept_out"]] == [("spike", "surprise")]
    answer, points = survey.belief([(0.3, 0.4), (0.8, 0.8)]), np.array([[0.3, 0.4], [0.8, 0.8]])
    mean, std = record.belief(points)
    assert mean.tolist() == pytest.approx(answer["mean"]) and std.tolist() == pytest.approx(answer["std"])
    # Where each robot was: its start, every arrival and every measurement.
    told = [event for event in survey._answers if event not in ("g", "b")]
    assert sum(map(len, record.fixes)) == 2 + len(told)


def test_the_place_comes_back_from_the_header(make):
    with make(prior=PRIOR, prior_noise=0.01, gate=4.0, epoch=7.0) as survey:
        place = place_of(survey.world, survey.setup)
    written = json.loads(json.dumps(place.to_dict()))
    again = read_place(Value(written), 7.0)
    assert json.loads(json.dumps(again.to_dict())) == written and again.units == survey.setup.units
    assert again.scenario == survey.world.scenario and again.gate == 4.0 and again.site == survey.setup.site
    assert again.prior is not None and again.prior.noise == pytest.approx([0.01, 0.01])
    for key in written:
        with pytest.raises(InputError, match=key):
            read_place(Value(written | {key: "?"} if key != "title" else {**written, key: 3}), 7.0)


def test_a_start_on_the_border_stays_inside_in_single_precision():
    scenario = Scenario(agents=1, extent=(1.0, 0.3), start=(1.0, 0.3), grid=4, nodes=6, neighbours=3)
    start = np.array([[1.0, 0.3]], np.float32)  # 0.3 becomes 0.30000001
    assert float(start[0, 1]) > 0.3 and mission_of(scenario, start, None, None).start.shape == (1, 2)


def test_a_result_of_a_scenario_is_in_its_own_units(flown, tmp_path):
    pytest.importorskip("rasterio")
    _, path = flown
    told = write_result(read_taken(path), tmp_path, cells=10).numbers
    one, two = told["robots"]
    assert told["units"]["length"] == "domain units" and told["map"]["crs"] is None and told["map"]["cells"] == [10, 10]
    assert one["travelled"] == pytest.approx(1.2, abs=1e-4) and one["budget"] == 1.5 and one["came_home"] is None
    assert two["status"] == "reported gone" and one["status"] == "stopped: budget used up"
    # 1.2 / 0.2 for each robot, and the spike.
    assert told["samples"]["counted"] == 12 and told["samples"]["taken"] == 13


def test_nothing_measured_yet_is_a_result_too(make, tmp_path):
    pytest.importorskip("rasterio")
    with make(tmp_path / "j") as survey:
        survey.handle(arrived("a"))
        told = write_result(read_taken(tmp_path / "j"), tmp_path / "out", cells=10).numbers
    assert told["uncertainty_left"]["share"] == 1.0
    assert told["samples"] == {"taken": 0, "counted": 0, "before_the_survey": 0, "kept_out": []}
    assert told["robots"][1]["status"] == "never reported that it set out"


def test_a_journal_is_read_without_its_lock_and_left_as_it_is(tmp_path):
    journal = Journal(tmp_path / "j")
    for index in range(3):
        journal.append({"value": index})
    with open(tmp_path / "j", "ab") as file:
        file.write(b'{"sum":"123')  # as while a line is being written
    before = (tmp_path / "j").read_bytes()
    records, torn = read_journal(tmp_path / "j")
    assert [record["value"] for record in records] == [0, 1, 2] and torn == 11
    assert (tmp_path / "j").read_bytes() == before
    journal.close()
