"""The scenario: what it accepts, what it says of what it does not, and what follows from its fields."""

import dataclasses
import itertools
import json
import math
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.records import FieldError, fields_of
from maipp.scenario import Scenario

FIELDS = [field.name for field in dataclasses.fields(Scenario)]
SQUARE = [[0.2, 0.2], [0.4, 0.2], [0.4, 0.4], [0.2, 0.4]]
NAN, INF = math.nan, math.inf


def complaint(**values):
    with pytest.raises(FieldError) as caught:
        Scenario(**values)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_defaults_are_the_calibrated_protocol():
    scenario = Scenario()
    assert (scenario.agents, scenario.budget, scenario.measurement_interval) == (3, 3.0, 0.2)
    assert (scenario.length_scale, scenario.threshold, scenario.beta) == (0.45, 0.4, 1.0)
    assert (scenario.interest_rule, scenario.nodes, scenario.neighbours) == ("std", 200, 20)
    assert scenario.grid_points * scenario.signal_variance == 900  # Tr(P) before any measurement
    assert not scenario.limited and scenario.starts is None
    # A bump's standard deviation is the fourth root of what mixture_variance holds.
    assert [round(x**0.25, 3) for x in scenario.mixture_variance] == [0.084, 0.119]


def test_the_error_reads_as_documented():
    assert complaint(budget=-1.0) == ("scenario.budget: -1.0 is not a length > 0 (domain units), or one per agent")


NUMBERS = [
    "budget",
    "speed",
    "comm_range",
    "measurement_interval",
    "length_scale",
    "signal_variance",
    "noise",
]
NUMBERS += ["threshold", "beta"]
WHOLES = ["agents", "grid", "nodes", "neighbours"]


@pytest.mark.parametrize("key", NUMBERS)
@pytest.mark.parametrize(
    "value",
    [NAN, INF, -INF, "3", True, {}, object(), 1e39, 10**400, 1 + 0j, np.True_],
    ids=lambda v: repr(v)[:9],
)
def test_numbers_are_finite_numbers(key, value):
    assert complaint(**{key: value}).startswith(f"scenario.{key}: ")


@pytest.mark.parametrize("key", sorted({*NUMBERS, *WHOLES, "extent"} - {"comm_range"}))
def test_only_optional_fields_may_be_none(key):
    assert f"scenario.{key}: None is not " in complaint(**{key: None})


@pytest.mark.parametrize("key", ["budget", "speed", "comm_range", "measurement_interval", "length_scale"])
@pytest.mark.parametrize("value", [0, 0.0, -0.0, -1, 1e-46])
def test_lengths_are_positive_in_single_precision(key, value):
    assert f"scenario.{key}: " in complaint(**{key: value})


@pytest.mark.parametrize("key", WHOLES)
@pytest.mark.parametrize("value", [0, -1, 3.0, "3", True, NAN, [3], 2**31])
def test_whole_numbers_are_positive_integers(key, value):
    assert complaint(**{key: value}).startswith(f"scenario.{key}: ")


WRONG = {
    "two budgets for three": ({"budget": [1, 2]}, "scenario.budget: (1.0, 2.0) holds 2 for 3 agents"),
    "one speed for three": ({"speed": (1.0,)}, "scenario.speed: (1.0,) holds 1 for 3 agents"),
    "no budgets": ({"budget": []}, "scenario.budget: [] is not a length > 0"),
    "a bad one among them": ({"budget": [1, 2, -3]}, "scenario.budget[2]: -3 does not fit; give a length > 0"),
    "start outside": ({"start": [0.5, 1.5]}, "scenario.start: (0.5, 1.5) is outside the domain"),
    "one start outside": (
        {"start": [[0, 0], [0, 0], [-0.1, 0]]},
        "scenario.start[2]: (-0.1, 0.0) is outside",
    ),
    "two starts for three": ({"start": [[0, 0], [1, 1]]}, "holds 2 for 3 agents"),
    "start of three": ({"start": [0.1, 0.2, 0.3]}, "scenario.start[0]: 0.1 does not fit; give [x, y]"),
    "empty start": ({"start": []}, "scenario.start: [] is not [x, y]"),
    "start with NaN": ({"start": [0.1, NAN]}, "scenario.start[1]: nan does not fit; give [x, y]"),
    "mixed starts": ({"start": [[0, 0], 1, [0, 0]]}, "scenario.start[1]: 1 does not fit; give [x, y]"),
    "text for a start": ({"start": "centre"}, "scenario.start: 'centre' is not [x, y]"),
    "nothing measured": ({"measurement_interval": 3.5}, "so nothing would ever be measured"),
    "too fine": ({"measurement_interval": 1e-7}, "means 3e+07 measurements per agent"),
    "extent in metres": ({"extent": [1500, 1000]}, "scenario.extent[0]: 1500 does not fit; give [width, height]"),
    "flat extent": ({"extent": [1, 0]}, "scenario.extent[1]: 0 does not fit; give [width"),
    "extent of one": ({"extent": 2.0}, "scenario.extent: 2.0 is not [width, height]"),
    "grid of one": ({"grid": 1}, "scenario.grid: 1 is not a whole number >= 2"),
    "obstacle not nested": (
        {"obstacles": SQUARE},
        "scenario.obstacles[0][0]: 0.2 does not fit; give a list of polygons",
    ),
    "two corners": ({"obstacles": [[[0, 0], [1, 1], [0, 0]]]}, "too few distinct vertices for a polygon (2)"),
    "infinite corner": ({"obstacles": [[[0, 0], [1, 1], [0, INF]]]}, "scenario.obstacles[0][2][1]: inf"),
    "corner in space": ({"obstacles": [[[0, 0, 0], [1, 1, 0], [0, 1, 0]]]}, "scenario.obstacles[0][0]: "),
    "no path": ({"field": ""}, "scenario.field: '' is not the path"),
    "number for a path": ({"field": 3}, "scenario.field: 3 is not the path"),
    "path with NUL": ({"field": "a\0b"}, "is not the path"),
    "bytes for a path": ({"field": b"a"}, "is not the path"),
    "empty count range": ({"mixture_components": (12, 8)}, "(12, 8) is an empty range"),
    "no bumps": ({"mixture_components": (0, 8)}, "scenario.mixture_components[0]: 0 does not fit"),
    "half a bump": ({"mixture_components": (8, 8.5)}, "scenario.mixture_components[1]: 8.5 does not fit"),
    "empty variance range": ({"mixture_variance": (2e-4, 5e-5)}, "is an empty range"),
    "zero variance": ({"mixture_variance": (0, 5e-5)}, "scenario.mixture_variance[0]: 0 does not fit"),
    "negative noise": (
        {"noise": -1e-9},
        "scenario.noise: -1e-09 is not a variance >= 0",
    ),
    "negative beta": ({"beta": -1}, "scenario.beta: -1 is not a number >= 0"),
    "other rule": (
        {"interest_rule": "ucb"},
        "scenario.interest_rule: 'ucb' is not one of std, variance",
    ),
    "unhashable rule": ({"interest_rule": ["std"]}, "is not one of std, variance"),
    "other virtual value": ({"virtual_value": 0}, "0 is not one of mean, zero"),
    "one node": ({"nodes": 1}, "scenario.nodes: 1 is not a whole number >= 2"),
    "k = n": ({"nodes": 20}, "scenario.neighbours: 20 is not below nodes (20)"),
}


@pytest.mark.parametrize("values, said", WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_said(values, said):
    text = complaint(**values)
    assert said in text and (" is not " in text or "; give " in text)


def test_the_bounds_themselves_are_right():
    Scenario(agents=1, grid=2, nodes=2, neighbours=1, noise=0, beta=0, threshold=-1, mixture_components=(1, 1))
    Scenario(start=(2, 0), extent=(2, 1), mixture_variance=(1e-4, 1e-4), measurement_interval=3)


def test_the_longest_budget_bounds_the_measurement_interval():
    assert Scenario(budget=(0.1, 0.1, 0.5), measurement_interval=0.5).measurements_per_agent == 1


@pytest.mark.parametrize("budget, slots", [(3, 15), (0.2, 1), (0.6, 3), (0.7, 3), (1.4, 7), ((0.1, 1, 0.2), 5)])
def test_the_measurement_at_exactly_the_budget_counts(budget, slots):
    scenario = Scenario(budget=budget)
    assert scenario.measurements_per_agent == slots  # 0.6 / 0.2 is 2.9999999999999996
    assert scenario.measurements == 3 * slots


def test_lists_arrays_and_array_scalars_become_plain_values():
    scenario = Scenario.create(
        agents=np.int64(3),
        budget=np.array([1, 2, 3]),
        speed=[1, np.float32(0.5), 2],
        start=np.array([0.25, 0.5]),
        obstacles=[np.array(SQUARE)],
        field=Path("data") / "field.npy",
        interest_rule=np.str_("std"),
        nodes=np.array(50),
    )
    plain = Scenario.create(
        agents=3,
        budget=(1.0, 2.0, 3.0),
        speed=(1.0, 0.5, 2.0),
        start=(0.25, 0.5),
        obstacles=(tuple(map(tuple, SQUARE)),),
        field=str(Path("data") / "field.npy"),
        nodes=50,
    )
    assert scenario == plain and hash(scenario) == hash(plain)
    assert repr(scenario) == repr(plain)  # no np.float64 left inside, no list, no whole number for a float
    json.dumps(scenario.to_dict())


def test_a_whole_number_is_the_same_scenario_as_its_float():
    assert repr(Scenario(budget=3, extent=(1, 1))) == repr(Scenario(budget=3.0, extent=(1.0, 1.0)))


def test_a_scenario_cannot_be_changed():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Scenario().agents = 4  # type: ignore[misc]


def test_one_value_is_shared_by_every_agent():
    shared = Scenario(agents=2, budget=2, speed=0.5, start=(0.1, 0.2))
    assert shared.budgets == (2.0, 2.0) and shared.speeds == (0.5, 0.5)
    assert shared.starts == ((0.1, 0.2), (0.1, 0.2))
    own = Scenario(agents=2, budget=(2, 3), speed=(1, 2), start=((0.1, 0.2), (0.3, 0.4)))
    assert own.budgets == (2.0, 3.0) and own.speeds == (1.0, 2.0)
    assert own.starts == ((0.1, 0.2), (0.3, 0.4))


def test_limited_range_is_not_global():
    assert Scenario(comm_range=0.3).limited


@pytest.mark.parametrize(
    "typo, meant",
    [
        ("bugdet", "budget"),
        ("neighbors", "neighbours"),
        ("Agents", "agents"),
        ("lenght_scale", "length_scale"),
    ],
)
def test_an_unknown_field_names_the_nearest_one(typo, meant):
    said = rf"^scenario\.{typo}: no such key; did you mean {meant}\?$"
    for call in (lambda: Scenario.create(**{typo: 3}), lambda: Scenario().replace(**{typo: 3})):
        with pytest.raises(InputError, match=said):
            call()


def test_an_unknown_field_like_no_other_lists_them_all():
    with pytest.raises(InputError) as caught:
        Scenario.create(xyzzy=3)
    assert all(name in str(caught.value) for name in FIELDS)


def test_errors_name_the_source():
    with pytest.raises(InputError, match=r"^survey\.json: budget: -1 is not a length > 0"):
        Scenario.from_dict({"budget": -1}, source="survey.json")
    with pytest.raises(InputError, match=r"^survey\.json: agent: no such key; did you mean agents\?$"):
        Scenario.from_dict({"agent": 1}, source="survey.json")
    with pytest.raises(InputError, match=r"^survey\.json: \[3\] is not a mapping"):
        Scenario.from_dict([3], source="survey.json")


def test_errors_survive_pickling():
    with pytest.raises(FieldError) as caught:
        Scenario.from_dict({"budget": [1, 2, -1]}, source="survey.json")
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value) and copy.key == "budget[2]"


def test_long_values_are_cut_in_errors():
    assert len(complaint(start=[0.1] * 10_000)) < 200
    assert len(complaint(field="a" * 10_000 + "\0")) < 200


def test_replace_validates_anew():
    scenario = Scenario(budget=(1, 2, 3))
    assert scenario.replace(agents=4, budget=2) == Scenario(agents=4, budget=2)
    with pytest.raises(InputError, match="holds 3 for 4 agents"):
        scenario.replace(agents=4)


@given(
    st.sampled_from(FIELDS),
    st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(), st.lists),
)
def test_any_value_is_accepted_or_refused_in_one_line(key, value):
    try:
        scenario = Scenario.create(**{key: value})
    except InputError as error:
        assert re.match(r"scenario\.\w+(\[\d+\])*: .+( is not |; give ).+$", str(error))
    else:
        hash(scenario)
        assert Scenario.from_dict(json.loads(json.dumps(scenario.to_dict()))) == scenario


def test_every_field_is_described_once():
    rows = fields_of(Scenario)
    assert [row.name for row in rows] == FIELDS
    for row, text in itertools.product(rows, ("unit", "source")):
        assert row.meaning and row.allowed and row.about[text], f"{row.name} has no {text}"
    assert all(row.default == getattr(Scenario(), row.name) for row in rows)
    assert all(row.meaning in (Scenario.__doc__ or "") for row in rows)
