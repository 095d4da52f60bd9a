"""The files of a record: every key told and asked for, what is wrong named, tables in the units of the field."""

import copy
import csv
import dataclasses
import io
import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.belief import PriorSamples
from maipp.engine.episode_io import (
    dump_episode,
    measurements_csv,
    parse_episode,
    read_episode,
    waypoints_csv,
)
from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.scenario import Scenario
from tests.tools.schemas import texts

MAPPING = GeoReference((500.0, 40.0), (2000.0, 2000.0), (1.0, 1.0), 30.0, 10.0, "easting", "northing", "temperature")
PRIOR = PriorSamples(*(np.array(a, np.float32) for a in ([[0.1, 0.2], [0.1, 0.2], [1.5, 0]], [0.3, 0.4, -2.0])))


def keys_of(value, prefix=""):
    if isinstance(value, dict):
        for key, item in value.items():
            name = f"{prefix}.{key}" if prefix else key
            yield name
            yield from keys_of(item, name)
    elif isinstance(value, list):
        for item in value:
            yield from keys_of(item, f"{prefix}[]")


def test_every_key_is_documented(episode):
    page = (Path(__file__).parents[2] / "docs" / "episode.md").read_text(encoding="utf-8")
    cells = re.findall(r"^\| (`[^|]+`) \|", page, re.MULTILINE)
    documented = {name for cell in cells for name in re.findall(r"`([^`]+)`", cell)}
    whole = dataclasses.replace(episode, reference=MAPPING, prior=PRIOR, expected=True)
    written = set(keys_of(json.loads(dump_episode(whole))))
    fields = {f"scenario.{name}" for name in Scenario.__dataclass_fields__}  # documented in docs/scenario.md
    assert fields <= written
    assert written - fields <= documented
    assert {key for key in documented if not re.search(r"\.(json|csv|png|mp4)$", key)} <= written


def test_the_schema_takes_the_record_and_further_keys_but_none_that_is_wrong(episode):
    schema = jsonschema.Draft7Validator(json.loads(texts()["episode.json"]))
    whole = json.loads(dump_episode(dataclasses.replace(episode, reference=MAPPING, prior=PRIOR, expected=True)))
    older = change(json.loads(dump_episode(episode)), "agents/0/stopped_by", None)
    for record in (whole, older, whole | {"more": 1}):
        schema.validate(record)
    for key in older:
        assert not schema.is_valid({name: value for name, value in older.items() if name != key})
    for path, value in (("seed", -1), ("agents/0/budget", 0), ("scenario/agents", 0), ("mapping/size", [1])):
        assert not schema.is_valid(change(whole, path, value))


def change(record, path, value):
    """A copy of the record with one entry replaced, or removed where `value` is None."""
    record = copy.deepcopy(record)
    *parents, last = [int(part) if part.isdigit() else part for part in path.split("/")]
    place = record
    for part in parents:
        place = place[part]
    if value is None:
        del place[last]
    else:
        place[last] = value
    return record


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("schema", "maipp.episode/2", "schema: 'maipp.episode/2' is not 'maipp.episode/1'"),
        ("schema", None, "schema: missing"),
        ("precision", "float16", "precision: 'float16'"),
        ("seed", 1.5, "seed: (1.5|True) is not a whole number from 0"),
        ("seed", True, "seed: (1.5|True) is not a whole number from 0"),
        ("planner", [], r"planner: \[\] is not a mapping"),
        ("planner/name", 3, "planner.name: 3 is not a text"),
        ("scenario/budget", -1, r"scenario.budget: -1 is not a length > 0"),
        ("scenario/noise", None, "scenario.noise: missing"),
        ("scenario/agents", 3, "agents: has 2 entries; give 3"),
        ("agents/1/route/x", None, r"agents\[1\].route.x: missing"),
        ("agents/1/route/x/0", "far", r"agents\[1\].route.x\[0\]: 'far' does not fit; give finite numbers"),
        ("agents/0/route/y", [0.5], r"agents\[0\].route.y: has 1 entries"),
        ("agents/0/route/time", [], r"agents\[0\].route.time: is empty"),
        ("agents/0/route/time/1", -1.0, r"agents\[0\].route.time: goes back"),
        (
            "agents/0/measurements/value/0",
            10**400,
            r"agents\[0\].measurements.value\[0\]: 10+\.\.\.0+ does not fit; give finite numbers",
        ),
        ("agents/0/measurements/value/0", 1e300, r"agents\[0\].measurements.value\[0\]: is too large for float32"),
        ("agents/0/measurements/time", [0.1] * 9, r"agents\[0\].measurements.time: has 9 entries; the scenario allows"),
        ("agents/0/known/1", 99, r"agents\[0\].known\[1\]: is 99, but agent 1 took"),
        ("agents/0/speed", 0, r"agents\[0\].speed: 0 is not a number > 0"),
        ("agents/0/stopped_by", "tired", r"agents\[0\].stopped_by: 'tired' is not one of planner, "),
        ("metrics/own_trace", {}, r"metrics.own_trace: \{\} is not finite numbers"),
        ("metrics/curve/time", [], "metrics.curve.time: is empty"),
        ("truth/3", [1.0], r"truth\[3\]: has 1 entries; give 8"),
        ("outside", [64], r"outside\[0\]: 64 does not fit; give whole numbers from 0 to 63"),
        ("outside", [10**30], r"outside\[0\]"),
        ("mapping", {}, "mapping.origin: missing"),
        ("mapping", "none", "mapping: 'none' is not a mapping"),
        ("prior", [], r"prior: \[\] is not a mapping"),
        ("prior", {"x": [], "y": [], "value": [], "noise": None}, "prior.value: is empty; leave prior out"),
        ("prior", {"x": [0], "y": [0, 1], "value": [0.5], "noise": None}, "prior.y: has 2 entries; give 1"),
        ("prior", {"x": [0], "y": [0], "value": [1e300], "noise": None}, r"prior.value\[0\]: is too large for float32"),
        ("prior", {"x": [0], "y": [0], "value": [0.5], "noise": [-1]}, "prior.noise: goes below 0"),
        ("prior", {"x": [0], "y": [0], "value": [0.5]}, "prior.noise: missing"),
    ],
)
def test_what_is_wrong_is_named_with_file_and_key(text, path, value, message):
    changed = json.dumps(change(json.loads(text), path, value))
    with pytest.raises(InputError, match=f"^survey.json: {message}") as caught:
        parse_episode(changed, source="survey.json")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("literal", ["NaN", "Infinity", "1e999"])
def test_numbers_that_are_not_finite_are_refused(text, literal):
    changed = re.sub(r'"rmse": [^,]+', f'"rmse": {literal}', text)
    with pytest.raises(InputError, match=r"^survey.json: metrics.rmse: (nan|inf) is not a finite number"):
        parse_episode(changed, source="survey.json")


def test_records_of_earlier_versions_are_read(episode):
    record = json.loads(dump_episode(dataclasses.replace(episode, reference=MAPPING)))
    for key in ("plane", "user", "metres_per_unit"):
        del record["mapping"][key]
    record["mapping"]["x_name"] = None
    there = parse_episode(json.dumps(record)).reference
    assert there == dataclasses.replace(MAPPING, x_name="x")


def test_the_place_of_a_survey_reads_back(episode):
    place = GeoReference.of_area((-50.0, -50.0, 50.0, 50.0), (13.3, 53.4)).standardised(9.0, 4.0)
    text = dump_episode(dataclasses.replace(episode, reference=place))
    assert parse_episode(text).reference == place
    for key, value, told in (
        ("metres_per_unit", -1.0, "mapping.metres_per_unit: -1.0 is not a number > 0"),
        ("user", {}, "mapping.user.crs: missing"),
        ("plane", {"geographic": 1, "crs": None, "metres": None}, "mapping.plane.geographic: 1 is not true or false"),
    ):
        record = json.loads(text)
        record["mapping"][key] = value
        with pytest.raises(InputError, match=told):
            parse_episode(json.dumps(record))


def test_every_key_is_required(text):
    record = json.loads(text)
    optional = {"agents[].stopped_by"}  # not there in older files
    for path in {key.replace("[].", "/0/").replace(".", "/") for key in set(keys_of(record)) - optional}:
        with pytest.raises(InputError, match="missing"):
            parse_episode(json.dumps(change(record, path, None)))


@given(st.data())
def test_a_file_cut_anywhere_is_refused_in_one_line(text, data):
    cut = data.draw(st.integers(0, len(text) - 3))
    with pytest.raises(InputError, match=r"^survey.json:\d+: not JSON") as caught:
        parse_episode(text[:cut], source="survey.json")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", ["[" * 100_000, "1" * 5000, "[]", "null", '"text"'])
def test_other_json_is_refused(content):
    with pytest.raises(InputError, match="^survey.json"):
        parse_episode(content, source="survey.json")


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(InputError, match="nowhere.json: cannot read the episode: No such file"):
        read_episode(tmp_path / "nowhere.json")
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="binary.json: not UTF-8 text"):
        read_episode(tmp_path / "binary.json")


def table(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_tables_without_a_file_are_in_domain_units(episode):
    rows = table(waypoints_csv(episode))
    assert list(rows[0]) == ["agent", "order", "x", "y", "time", "distance"]
    for index, agent in enumerate(episode.agents):
        own = [row for row in rows if row["agent"] == str(index)]
        assert [int(row["order"]) for row in own] == list(range(len(agent.route)))
        np.testing.assert_array_equal([np.float32(row["x"]) for row in own], agent.route[:, 0])
        assert float(own[-1]["distance"]) == pytest.approx(agent.distance, rel=1e-5)
    rows = table(measurements_csv(episode))
    assert list(rows[0]) == ["agent", "order", "x", "y", "value", "time"]
    values = np.concatenate([agent.measurement_y for agent in episode.agents])
    np.testing.assert_array_equal([np.float32(row["value"]) for row in rows], values)


def test_tables_of_a_field_from_a_file_are_in_its_units(episode):
    there = dataclasses.replace(episode, reference=MAPPING)
    first = table(waypoints_csv(there))[0]
    assert list(first) == ["agent", "order", "easting", "northing", "time", "distance"]
    start = episode.agents[0].start
    assert float(first["easting"]) == pytest.approx(500 + 2000 * float(start[0]), rel=1e-8)
    assert float(first["northing"]) == pytest.approx(40 + 2000 * float(start[1]), rel=1e-8)
    last = table(waypoints_csv(there))[-1]
    assert float(last["distance"]) == pytest.approx(2000 * episode.agents[-1].distance, rel=1e-5)
    measured = table(measurements_csv(there))[0]
    assert float(measured["temperature"]) == pytest.approx(30 - 20 * float(episode.agents[0].measurement_y[0]))


def test_distances_stay_in_domain_units_where_the_axes_differ(episode):
    there = dataclasses.replace(episode, reference=dataclasses.replace(MAPPING, size=(2000.0, 900.0)))
    last = table(waypoints_csv(there))[-1]
    assert float(last["distance_domain"]) == pytest.approx(episode.agents[-1].distance, rel=1e-5)


def test_columns_of_the_same_name_are_told_apart(episode):
    there = dataclasses.replace(episode, reference=dataclasses.replace(MAPPING, value_name="time", x_name='a,"b"'))
    header = list(table(measurements_csv(there))[0])
    assert header == ["agent", "order", 'a,"b"', "northing", "time_4", "time_5"]


def test_a_file_from_before_reasons_to_stop_were_kept_is_read(episode, text):
    assert {agent.stopped_by for agent in episode.agents} <= {"planner", "budget"}
    assert [agent.stopped_by for agent in parse_episode(text).agents] == [a.stopped_by for a in episode.agents]
    older = parse_episode(json.dumps(change(json.loads(text), "agents/0/stopped_by", None)))
    assert older.agents[0].stopped_by is None and older.unspent == episode.unspent
