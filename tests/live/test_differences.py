"""A journal that is opened with another mission: which key, both values, and the event that makes it so."""

import json
import re

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.live import LiveSurvey
from maipp.live.differences import check_same
from maipp.live.events import read_event
from maipp.live.recorded_survey import read_record
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey

MISSION = """
metres: true
area: [[0, 0], [400, 0], [400, 300], [0, 300]]
no_go: [[[50, 50], [80, 50], [80, 80]]]
robots:
  - {name: boat1, start: [10, 10], speed: 1.0, budget_m: 600, reserve: 10 %}
  - {name: boat2, start: [390, 10], speed: 1.0, budget_minutes: 10}
measurement_spacing_m: 80
threshold: 12
unit: ug/L
kernel: {length_scale_m: 120, mean: 8, std: 4}
clearance_m: 5
planner: shared-greedy
scenario: {grid: 8, nodes: 16, neighbours: 5}
"""
NEVER = "it cannot change under way: give the mission as it was, or start a new journal"


def opened(journal, text=MISSION, **more):
    return LiveSurvey.from_prepared(prepare(parse_survey(text)), journal=journal, **more)


@pytest.fixture
def journal(tmp_path):
    with opened(tmp_path / "j"):
        return tmp_path / "j"


def told(journal, *edits, **more):
    """What is said of the mission with these edits, line by line; the journal stays as it was."""
    text, before = MISSION, journal.read_bytes()
    for old, new in edits:
        assert old in text
        text = text.replace(old, new, 1)
    with pytest.raises(InputError) as error:
        opened(journal, text, **more)
    assert journal.read_bytes() == before
    first, *rest = str(error.value).splitlines()
    begin = f"{journal}: the journal of another survey:"
    assert first.startswith(begin)
    return [line.strip() for line in rest] or [first[len(begin) + 1 :]]


@pytest.mark.parametrize(
    ("edit", "line", "event"),
    [
        (("budget_m: 600", "budget_m: 550"), "robots.boat1.budget_m: 600.0 in the journal, 550.0 here", "budget"),
        (("budget_minutes: 10", "budget_minutes: 9"), "robots.boat2.budget_m: 600.0 in the journal, 540.0", "budget"),
        (("speed: 1.0", "speed: 0.5"), "robots.boat1.speed: 1.0 in the journal, 0.5 here", "speed"),
        (("threshold: 12", "threshold: 9"), "threshold: 12.0 in the journal, 9.0 here", "threshold"),
        (("[80, 80]]]", "[80, 80]], [[200, 50], [230, 50], [230, 80]]]"), "no_go: ", "zone"),
    ],
)
def test_what_an_event_can_change_is_told_with_the_event(journal, edit, line, event):
    found = told(journal, edit)
    # A budget's reserve is a share of it, and a smaller speed takes it fewer metres.
    assert all(each.startswith(("robots.boat1.reserve_m", line)) for each in found)
    (mine,) = (each for each in found if each.startswith(line))
    sent = re.search(r"leave it as in the journal, and send (\{.*\})", mine)
    assert sent is not None
    filled = {"id": "x", "time": 0.0, "name": "n", "polygon": [[0, 0], [9, 0], [0, 9]]}
    keys = re.findall(r'"(\w+)": ([^,}]+)', sent[1])
    values = {key: filled[key] if value == "..." else json.loads(value) for key, value in keys}
    assert values["event"] == event and read_event(values, ["boat1", "boat2"]).id == "x"


@pytest.mark.parametrize(
    ("edit", "line"),
    [
        (("[400, 300]", "[400, 310]"), "area: "),
        (("[10, 10]", "[12, 10]"), "robots.boat1.start: [10.0, 10.0] in the journal, [12.0, 10.0] here"),
        (("clearance_m: 5", "clearance_m: 6"), "clearance_m: 5.0 in the journal, 6.0 here"),
        (("length_scale_m: 120", "length_scale_m: 110"), "kernel: {"),
        (("planner: shared-greedy", "planner: greedy"), 'planner: "shared-greedy" in the journal, "greedy" here'),
        (("threshold: 12\n", ""), "threshold: 12.0 in the journal, null here"),
        (("planner: sh", "gate: 4\nplanner: sh"), "gate: 5.0 in the journal, 4.0 here"),
    ],
)
def test_what_no_event_can_change_is_told(journal, edit, line):
    (found,) = told(journal, edit)
    assert found.startswith(line) and found.endswith(f"; {NEVER}")


def test_every_key_has_its_line(journal):
    more = "\n  - {name: boat3, start: [200, 10], speed: 1.0, budget_m: 300}\nmeasurement"
    lines = told(journal, ("name: boat2", "name: ship"), ("\nmeasurement", more), ("threshold: 12", "threshold: 9"))
    assert [line.partition(":")[0] for line in lines] == ["robots.boat2", "robots.ship", "robots.boat3", "threshold"]
    assert 'leave it in, and send {"event": "gone", "id": ..., "robot": "boat2", "time": ...}' in lines[0]
    assert 'leave it out, and send {"event": "joined", "id": ..., "robot": "boat3", "position": ...' in lines[2]


def test_seed_and_epoch_are_told(journal):
    assert told(journal, seed=5, epoch=9.0) == [
        f"seed: 0 in the journal, 5 here; {NEVER}",
        f"epoch: 0.0 in the journal, 9.0 here; {NEVER}",
    ]


def test_what_no_answer_depends_on_may_change(journal):
    for extra in ("name: lake\n", "vehicle: boat\n", "rehearsal: 5\n"):
        opened(journal, extra + MISSION).close()


def test_a_journal_without_keys_says_what_it_can():
    mine = dict.fromkeys(("journal", "maipp", "planner", "seed", "robots", "epoch", "mission"), 1) | {"keys": {"a": 1}}
    check_same({key: value for key, value in mine.items() if key != "keys"}, mine, "j")
    with pytest.raises(InputError, match=r"^j: the journal of another survey \(seed 2 instead of 1\); give it its own"):
        check_same({"seed": 2} | {key: 1 for key in mine if key not in ("keys", "seed")}, mine, "j")
    with pytest.raises(InputError, match="^j: the journal of another survey; give it its own"):
        check_same(mine | {"mission": 2}, mine, "j")


def test_changes_of_a_mission_are_in_its_own_units(tmp_path):
    """Zones with the mission's clearance, a threshold in ug/L with the confidence that goes with it, speeds in m/s."""
    with opened(tmp_path / "j") as survey:
        before = survey.world.scenario
        assert survey.state()["threshold"] == 12.0
        ring = [[200, 100], [240, 100], [240, 140], [200, 140]]
        survey.handle({"event": "zone", "id": "z", "name": "ferry", "polygon": ring, "time": 1.0})
        survey.handle({"event": "threshold", "id": "t", "threshold": 16, "time": 1.0})
        survey.handle({"event": "speed", "id": "s", "robot": "boat2", "speed": 1.5, "time": 1.0})
        state, scenario = survey.state(), survey.world.scenario
        assert (state["zones"], state["threshold"]) == ([{"name": "ferry", "polygon": ring}], 16.0)
        assert [row["speed"] for row in state["robots"]] == [1.0, 1.5]
        (zone,) = scenario.obstacles[len(before.obstacles) :]
        low, high = np.min(zone, axis=0) * 400, np.max(zone, axis=0) * 400
        # 5 m, and what the mission adds for rounding: a two-thousandth of 400 m.
        assert low == pytest.approx([194.8, 94.8]) and high == pytest.approx([245.2, 145.2])
        assert (scenario.threshold, scenario.beta, before.threshold, before.beta) == (2.0, 4.0, 1.0, 2.0)
        told = json.dumps(state)
    with opened(tmp_path / "j") as survey:
        assert json.dumps(survey.state()) == told
    read = read_record(tmp_path / "j").place.scenario
    assert (read.threshold, read.beta) == (2.0, 4.0)
