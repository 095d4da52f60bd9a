import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.live import LiveSurvey
from tests.live.events import arrived, measured, text


def row(survey, index=0):
    return survey.state()["robots"][index]


def test_a_survey_ends_with_every_budget_spent(make, events):
    told, answers = events
    with make() as survey:
        again = [survey.handle(event) for event in told]
        rows = survey.state()["robots"]
    assert text(again) == text(answers)
    assert [each["status"] for each in rows] == ["stopped"] * 2
    assert [each["travelled"] for each in rows] == pytest.approx([1.2] * 2, abs=1e-4)
    assert all(each["message"] is None and each["waypoints"] == [] for each in rows)
    assert sum(event["event"] == "measurement" for event in told) == 12  # 1.2 / 0.2 for each of two robots
    assert {answer.get("reason") for answer in answers if answer["answer"] == "stop"} == {"budget"}


@given(data=st.data())
@settings(max_examples=25)
def test_the_belief_depends_on_neither_order_nor_copies(make, events, data):
    told, _ = events
    kinds = data.draw(st.sampled_from([["measurement"], ["measurement", "arrived"]]))
    some = [event for event in told if event["event"] in kinds]
    copies = data.draw(st.lists(st.sampled_from(some), max_size=20))
    order = data.draw(st.permutations(some + copies))
    with make() as calm, make() as disturbed:
        for event in some:
            calm.handle(event)
        for event in order:
            disturbed.handle(event)
        assert text(calm.belief()) == text(disturbed.belief())
        assert text(calm.belief([(0.3, 0.4)])) == text(disturbed.belief([(0.3, 0.4)]))


def test_an_answered_event_gets_the_same_answer_and_changes_nothing(make, events, tmp_path):
    told, answers = events
    with make(tmp_path / "j") as survey:
        for event in told[:12]:
            survey.handle(event).clear()  # what the caller does with an answer is its own affair
        before = text(survey.state()), text(survey.belief()), (tmp_path / "j").read_bytes()
        for event, answer in zip(told[:12], answers, strict=False):
            respelled = json.loads(json.dumps(dict(reversed(event.items()))))
            assert text(survey.handle(respelled)) == text(answer)
        for event in told[:12]:
            with pytest.raises(InputError, match="another event has the id"):
                survey.handle(event | {"time": event["time"] + 1.0})
        assert (text(survey.state()), text(survey.belief()), (tmp_path / "j").read_bytes()) == before


@pytest.mark.parametrize("kept", [0, 1, 2, 9, 20])
def test_after_a_kill_everything_goes_on_as_if_nothing_had_happened(make, events, tmp_path, kept):
    told, answers = events
    with make(tmp_path / "whole") as survey:
        for event in told:
            survey.handle(event)
        state, belief = text(survey.state()), text(survey.belief())
    lines = (tmp_path / "whole").read_bytes().splitlines(keepends=True)
    (tmp_path / "cut").write_bytes(b"".join(lines[: kept + 1]) + lines[kept + 1][:-20])
    with make(tmp_path / "cut") as survey:
        assert survey.cut == len(lines[kept + 1]) - 20
        assert text([survey.handle(event) for event in told]) == text(answers)
        assert (text(survey.state()), text(survey.belief())) == (state, belief)
    assert (tmp_path / "cut").read_bytes() == (tmp_path / "whole").read_bytes()
    with make(tmp_path / "whole") as survey:
        assert (text(survey.state()), text(survey.belief())) == (state, belief)


def test_a_journal_belongs_to_one_mission(make, scenario, tmp_path):
    with make(tmp_path / "j") as survey:
        survey.handle(arrived("a"))
    before = (tmp_path / "j").read_bytes()
    others = {"seed": 1}, {"planner": "greedy"}, {"robots": ["x", "y"]}, {"epoch": 5.0}
    for changes in (*others, {"prior": (np.array([[0.1, 0.1]]), np.array([1.0]))}):
        with pytest.raises(InputError, match=r"j: the journal of another survey") as error:
            make(tmp_path / "j", **changes)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="survey: threshold: 0.4 in the journal, 0.5 here; leave it"):
        LiveSurvey.from_scenario(scenario.replace(threshold=0.5), "shared-greedy", journal=tmp_path / "j")
    assert (tmp_path / "j").read_bytes() == before


def test_two_surveys_on_one_journal_are_refused(make, tmp_path):
    with make(tmp_path / "j"), pytest.raises(InputError, match="another process is using this journal"):
        make(tmp_path / "j")
    make(tmp_path / "j").close()


def test_what_is_refused_is_not_in_the_journal(make, tmp_path):
    with make(tmp_path / "j", gate=0.0) as survey:  # which would take a value of any size
        before = (tmp_path / "j").read_bytes()
        for wrong in (
            arrived("a", position=(0.5, 90.0)),
            arrived("a", time=1e9),
            arrived("a", travelled=1e9),
            measured("m", value=1e30),
            {"event": "budget", "id": "b", "robot": "robot1", "budget": 1e9, "time": 0},
            {"event": "heard", "id": "h", "robot": "robot1", "position": [0, 0], "time": 0, "packed": "AAAA"},
            {"query": "belief", "points": [[0, 50]]},
            {"query": "weather"},
            {"query": "hello", "protocol": "maipp.live/2"},
            {"id": "x"},
        ):
            with pytest.raises(InputError) as error:
                survey.handle(wrong)
            assert "\n" not in str(error.value)
        assert survey.state()["events"] == 0 and (tmp_path / "j").read_bytes() == before


def test_robots_that_land_elsewhere_early_or_off_the_map_get_answers(make):
    with make() as survey:
        answer = survey.handle(arrived("a"))
        for index, position in enumerate([(0.31, 0.77), (1.4, -0.3), (0.99, 0.01)]):
            answer = survey.handle(arrived(f"a{index}", position=position, time=0.1 * (index + 1), travelled=0.1))
            assert answer["answer"] == "go"
            (x, y) = answer["waypoints"][-1]
            assert 0 <= x <= 1 and 0 <= y <= 1
            assert answer["remaining"] == pytest.approx(1.1)


def test_the_last_leg_is_cut_at_the_budget(make):
    with make() as survey:
        answer = survey.handle(arrived("a", travelled=1.17))
        way = np.array([[0.5, 0.5], *answer["waypoints"]])
        assert np.hypot(*np.diff(way, axis=0).T).sum() == pytest.approx(0.03, abs=1e-5)
        assert survey.handle(arrived("b", travelled=1.3, time=1.0))["answer"] == "stop"
        assert row(survey)["status"] == "stopped"


def test_a_late_arrival_is_told_the_plan_in_force(make):
    with make() as survey:
        survey.handle(arrived("a"))
        plan = survey.handle(arrived("c", position=(0.6, 0.5), time=2.0))
        state, late = text(survey.state()["robots"]), survey.handle(arrived("b", position=(0.55, 0.5), time=1.0))
        assert late == plan | {"id": "b", "late": True}
        assert text(survey.state()["robots"]) == state


def test_a_robot_that_is_gone_claims_nothing_until_it_is_back(make):
    with make() as survey, make() as alone:
        survey.handle(arrived("a", robot="robot2"))
        assert row(survey, 1)["message"] is not None
        gone = {"event": "gone", "id": "g", "robot": "robot2", "time": 0.05}
        assert survey.handle(gone) == {"answer": "noted", "id": "g"}
        assert row(survey, 1) | {"status": "gone", "message": None, "waypoints": []} == row(survey, 1)
        # The other robot decides as if nobody else were there.
        assert text(survey.handle(arrived("b", time=0.1))) == text(alone.handle(arrived("b", time=0.1)))
        late = survey.handle(arrived("d", robot="robot2", time=0.02))
        assert (late["answer"], late["reason"], late["late"]) == ("stop", "gone", True)
        assert row(survey, 1)["status"] == "gone"
        assert survey.handle(arrived("c", robot="robot2", time=0.2))["answer"] == "go"
        survey.handle(gone | {"id": "late"})
        assert row(survey, 1)["status"] == "travelling"


def test_a_changed_budget_stops_a_robot_and_lets_it_go_on(make):
    with make() as survey:
        budget = {"event": "budget", "robot": "robot1"}
        survey.handle(budget | {"id": "less", "budget": 0.5, "time": 1.0})
        assert survey.handle(arrived("a", travelled=0.5, time=1.0))["answer"] == "stop"
        survey.handle(budget | {"id": "more", "budget": 2.0, "time": 2.0})
        survey.handle(budget | {"id": "stale", "budget": 0.1, "time": 0.5})
        answer = survey.handle(arrived("b", travelled=0.5, time=2.0))
        assert answer["answer"] == "go" and answer["remaining"] == pytest.approx(1.5)


def test_a_process_for_each_robot_hears_of_the_others(make):
    """Messages carried by hand from process to process: the same decisions as in one process."""
    with make() as both, make() as one, make() as two:
        for survey in (both, one):
            first = survey.handle(arrived("a"))
        told = {"event": "heard", "id": "h", "robot": "robot1", "position": [0.5, 0.5], "time": 0.0}
        two.handle(told | {"packed": first["message"]["packed"]})
        assert row(two)["message"] == first["message"]
        assert text(two.handle(arrived("b", robot="robot2"))) == text(both.handle(arrived("b", robot="robot2")))
        with pytest.raises(InputError, match="packed: 3 bytes; this planner's message has 8"):
            two.handle(told | {"id": "h2", "packed": "AAAA"})
        with pytest.raises(InputError, match="packed: holds a number beyond"):
            two.handle(told | {"id": "h2", "packed": "//9/f///f38="})
        with pytest.raises(InputError, match="packed: not base64"):
            two.handle(told | {"id": "h2", "packed": "?"})


def test_prior_samples_are_believed(make):
    prior = (np.array([[0.2, 0.3], [0.8, 0.7]]), np.array([1.5, -0.5]))
    with make(prior=prior) as survey:
        answer = survey.belief([(0.2, 0.3), (0.8, 0.7)])
        assert answer["mean"] == pytest.approx([1.5, -0.5], abs=1e-3) and max(answer["std"]) < 0.01
        assert answer["measurements"] == 0
    with make(prior=prior, prior_noise=0.25) as survey:
        doubtful = survey.belief([(0.2, 0.3), (0.8, 0.7)])
        # A variance of 1 and a noise of 0.25 leave 0.2, or a little less with another sample about.
        assert 0.4 < min(doubtful["std"]) and max(doubtful["std"]) < 0.2**0.5
        survey.handle(measured("m", (0.2, 0.3), 0.0, 1.0))
        assert survey.belief([(0.2, 0.3)])["mean"] == pytest.approx([1.0], abs=1e-3)  # the robot's is exact


def test_the_belief_is_that_of_the_measurements(make, measure):
    with make() as survey:
        for index, point in enumerate([(0.1, 0.1), (0.9, 0.4), (0.5, 0.8)]):
            survey.handle(measured(f"m{index}", point, float(index), measure(list(point))))
        answer = survey.belief([(0.1, 0.1), (0.9, 0.4), (0.5, 0.8)])
        assert answer["mean"] == pytest.approx(
            [measure([0.1, 0.1]), measure([0.9, 0.4]), measure([0.5, 0.8])], abs=1e-3
        )
        grid = survey.belief()
        assert len(grid["points"]) == len(grid["mean"]) == len(grid["inside"]) == 64 and all(grid["inside"])
        assert max(grid["std"]) <= 1.0


def test_the_same_measurement_under_another_id_counts_once(make):
    with make() as survey:
        survey.handle(measured("a"))
        before = text(survey.belief())
        assert survey.handle(measured("b")) == {"answer": "noted", "id": "b", "surprise": 1.0}
        assert text(survey.belief()) == before and survey.state()["measurements"] == 1


def test_more_measurements_than_there_is_room_for(make, tmp_path):
    rng = np.random.default_rng(0)
    with make(tmp_path / "j") as survey:
        for index in range(40):  # room for 15, rounded up to 16
            survey.handle(measured(f"m{index}", rng.uniform(0, 1, 2).tolist(), 0.1 * index, 0.2))
        answer = text([survey.handle(arrived("a", time=9.0)), survey.belief()])
    with make(tmp_path / "j") as survey:
        assert text([survey.handle(arrived("a", time=9.0)), survey.belief()]) == answer


def test_nothing_in_an_answer_is_infinite_or_missing(make):
    """Contradicting values at one place, far outside values, robots on one spot: numbers all the same."""
    with make() as survey:
        for index in range(12):
            survey.handle(measured(f"m{index}", (0.5, 0.5), 0.01 * index, (-1.0) ** index * 9e3))
        for index in range(4):
            text(survey.handle(arrived(f"a{index}", robot=f"robot{index % 2 + 1}", time=1.0 + index)))
        text([survey.belief(), survey.state(), survey.hello()])


def test_points_in_no_go_zones_are_told(scenario):
    zone = scenario.replace(obstacles=(((0.1, 0.1), (0.3, 0.1), (0.2, 0.3)),))
    with LiveSurvey.from_scenario(zone, "shared-greedy") as survey:
        assert not all(survey.belief()["inside"])


def test_wrong_teams_are_told(make):
    with pytest.raises(InputError, match="robots: 1 different names; give 2"):
        make(robots=["a", "a"])


@pytest.mark.slow  # compiles a policy
def test_a_policy_s_memory_and_intents_outlive_the_process(scenario, team, tmp_path):
    def opened(name):
        options = {"weights": "untrained", "paths": 4, "steps": 2}
        return LiveSurvey.from_scenario(scenario, "intent-paths", options, journal=tmp_path / name)

    with opened("whole") as survey:
        start = [0.5, 0.5]
        told = team(survey.handle, {"robot1": start, "robot2": start})
        answers = [survey.handle(event) for event in told]
    going = [answer for answer in answers if answer["answer"] == "go"]
    assert all(len(a["message"]["mean"]) == 2 and len(a["message"]["covariance"]) == 3 for a in going)
    lines = (tmp_path / "whole").read_bytes().splitlines(keepends=True)
    for kept in (2, len(lines) // 2):
        (tmp_path / "cut").write_bytes(b"".join(lines[: kept + 1]))
        with opened("cut") as survey:
            assert text([survey.handle(event) for event in told]) == text(answers)
        assert (tmp_path / "cut").read_bytes() == b"".join(lines)


def test_a_way_too_short_to_tell_from_none_is_a_stop(make, monkeypatch):
    """What single precision calls a leg may be none in double precision."""
    from maipp.live import arrival

    decide = arrival.decide

    def nearly_nowhere(*args):
        departure = decide(*args)
        near = jnp.asarray(args[3].position) + jnp.asarray([2e-7, 0.0])
        return dataclasses.replace(departure, leg=jnp.stack([args[3].position, near]))

    monkeypatch.setattr(arrival, "decide", nearly_nowhere)
    with make() as survey:
        answer = survey.handle(arrived("a", position=(0.4, 0.6)))
        assert (answer["answer"], answer["reason"]) == ("stop", "planner")
        assert survey.handle(arrived("a", position=(0.4, 0.6))) == answer
