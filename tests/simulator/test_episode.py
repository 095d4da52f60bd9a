"""The record of a survey: true to the simulation, read back as written, and enough to compute every number anew."""

import copy
import csv
import dataclasses
import io
import json
import math
import re
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Matern

from maipp.belief import PriorSamples
from maipp.errors import InputError
from maipp.fields.raster import Mapping
from maipp.planners.random_walk import RandomWalk
from maipp.planners.sga_rrt import SgaRrt
from maipp.scenario import Scenario
from maipp.simulator import draw_missions, run_missions
from maipp.simulator.checked_json import pretty
from maipp.simulator.episode import AgentRecord, Episode, replay, shortest
from maipp.simulator.episode_io import (
    dump_episode,
    measurements_csv,
    parse_episode,
    read_episode,
    waypoints_csv,
    write_episode,
)
from maipp.simulator.metrics import score_missions

SCENARIO = Scenario.create(agents=2, budget=1.0, grid=8, nodes=12, neighbours=4, comm_range=0.3)
MAPPING = Mapping((500.0, 40.0), (2000.0, 2000.0), (1.0, 1.0), 30.0, 10.0, "easting", "northing", "temperature")
PRIOR = PriorSamples(*(np.array(a, np.float32) for a in ([[0.1, 0.2], [0.1, 0.2], [1.5, 0]], [0.3, 0.4, -2.0])))
GOLDEN = Path(__file__).parent / "golden" / "prior.json"


@pytest.fixture(scope="module")
def batch():
    missions = draw_missions(SCENARIO, seed=5, instances=2)
    return missions, run_missions(SCENARIO, RandomWalk(SCENARIO), missions, jax.random.key(5))


@pytest.fixture(scope="module")
def episode(batch):
    return Episode.from_state(SCENARIO, "random", {}, 5, *batch, index=1)


@pytest.fixture(scope="module")
def text(episode):
    return dump_episode(episode)


def test_the_record_agrees_with_the_simulation(batch, episode):
    missions, states = batch
    scores = score_missions(SCENARIO, missions, states)
    metrics = episode.metrics
    assert metrics.trace == pytest.approx(float(scores.trace[1]), rel=1e-4)
    assert metrics.own_trace.mean() == pytest.approx(float(scores.own_trace[1]), rel=1e-4)
    assert metrics.true_trace == pytest.approx(float(scores.true_trace[1]), rel=1e-4, abs=1e-4)
    assert metrics.rmse == pytest.approx(float(scores.rmse[1]), rel=1e-4)
    assert episode.distance == pytest.approx(float(scores.distance[1]), rel=1e-6)
    assert episode.decisions == int(scores.decisions[1]) == int(states.events[1])
    assert (metrics.own_trace >= metrics.trace - 1e-3).any()


def test_by_the_end_means_what_was_measured(episode):
    one, other = episode.agents
    names = ("measurement_x", "measurement_y", "measurement_time")
    early = dataclasses.replace(one, **{name: getattr(one, name)[:2] for name in names})
    cut = dataclasses.replace(episode, agents=(early, other))
    last = max(agent.measurement_time.max() for agent in cut.agents)
    by_end, by_last = cut.beliefs(np.array([np.inf])), cut.beliefs(np.array([last]))
    np.testing.assert_array_equal(by_end.variance, by_last.variance)
    np.testing.assert_array_equal(by_end.mean, by_last.mean)


def test_routes_are_what_was_travelled(episode):
    for agent in episode.agents:
        lengths = np.linalg.norm(np.diff(agent.route, axis=0), axis=-1)
        assert (lengths > 0).all()
        assert lengths.sum() == pytest.approx(agent.distance, rel=1e-5)
        assert agent.distance <= agent.budget + 1e-5
        np.testing.assert_allclose(np.diff(agent.route_time), lengths / agent.speed, atol=1e-5)
        assert len(agent.measurement_y) == math.floor(agent.distance / SCENARIO.measurement_interval + 1e-4)


def test_measurements_lie_on_the_routes_at_their_time(episode):
    for index, agent in enumerate(episode.agents):
        where = episode.positions(agent.measurement_time)[index]
        np.testing.assert_allclose(where, agent.measurement_x, atol=1e-5)


def test_the_curve_starts_at_the_prior_and_ends_at_the_final_trace(episode):
    metrics = episode.metrics
    prior = episode.inside.sum() * SCENARIO.signal_variance
    assert metrics.curve_trace[0] == pytest.approx(prior)
    assert metrics.curve_trace[-1] == np.float32(metrics.trace)
    assert (np.diff(metrics.curve_time) > 1e-5).all()
    assert metrics.curve_time[-1] == max(agent.measurement_time[-1] for agent in episode.agents)


def test_repeated_waypoints_are_recorded_once_and_messages_weighed():
    planner = SgaRrt(SCENARIO, nodes=20)
    missions = draw_missions(SCENARIO, seed=0, instances=1, roadmaps=False)
    states = run_missions(SCENARIO, planner, missions, jax.random.key(0))
    episode = Episode.from_state(SCENARIO, "sga-rrt", {"nodes": "20"}, 0, missions, states)
    per_measurement = 3 * 4  # position and time, float32
    assert episode.message_bytes == planner.horizon * per_measurement
    assert episode.decisions == int(states.events[0])
    for agent in episode.agents:
        assert (np.diff(agent.route_time) > 0).all()


def test_a_file_reads_back_as_it_was_and_replays_to_the_same_numbers(episode, tmp_path):
    write_episode(episode, tmp_path / "episode.json")
    again = read_episode(tmp_path / "episode.json")
    assert dump_episode(again) == (tmp_path / "episode.json").read_text()
    for field in dataclasses.fields(again.agents[0]):
        for one, other in zip(again.agents, episode.agents, strict=True):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))
    np.testing.assert_array_equal(again.truth, episode.truth)
    assert again.truth.dtype == episode.truth.dtype
    recorded, computed = again.metrics, replay(again)
    for field in dataclasses.fields(recorded):
        np.testing.assert_allclose(getattr(computed, field.name), getattr(recorded, field.name), rtol=1e-6)


def test_replay_depends_on_the_measurements(episode):
    agent = episode.agents[0]
    moved = dataclasses.replace(agent, measurement_y=agent.measurement_y + np.float32(0.1))
    other = dataclasses.replace(episode, agents=(moved, *episode.agents[1:]))
    assert replay(other).rmse != replay(episode).rmse


def test_a_mapping_and_obstacles_survive(episode):
    scenario = SCENARIO.replace(obstacles=[[[0.1, 0.1], [0.5, 0.1], [0.3, 0.4]]])
    inside = np.arange(64) % 7 > 0
    there = dataclasses.replace(episode, scenario=scenario, inside=inside, mapping=MAPPING)
    again = parse_episode(dump_episode(there))
    assert again.mapping == MAPPING and again.scenario == scenario
    np.testing.assert_array_equal(again.inside, inside)


@pytest.mark.parametrize("noise", [None, np.array([0.0, 1e-3, 2.5], np.float32)])
def test_prior_samples_survive_and_count_in_a_replay(episode, noise):
    there = dataclasses.replace(episode, prior=PRIOR._replace(noise=noise))
    again = parse_episode(dump_episode(there))
    assert dump_episode(again) == dump_episode(there)
    assert again.prior is not None
    for found, wanted in zip(again.prior, there.prior, strict=True):
        np.testing.assert_array_equal(found, wanted)
        assert found is None or found.dtype == np.float32
    for field in dataclasses.fields(again.metrics):
        np.testing.assert_allclose(getattr(replay(again), field.name), getattr(there.metrics, field.name), rtol=1e-6)
    assert there.metrics.curve_trace[0] < episode.metrics.curve_trace[0]


def test_without_prior_samples_the_file_says_nothing_of_them(text):
    assert "prior" not in json.loads(text) and parse_episode(text).prior is None


def by_hand():
    """A record in round numbers, whose metrics are those of its measurements and prior samples."""
    scenario = Scenario.create(agents=1, budget=0.5, grid=3, start=[0.25, 0.5], threshold=0.5)
    agent = AgentRecord(
        start=np.array([0.25, 0.5], np.float32),
        budget=0.5,
        speed=1.0,
        distance=0.5,
        decisions=2,
        route=np.array([[0.25, 0.5], [0.75, 0.5]], np.float32),
        route_time=np.array([0.0, 0.5], np.float32),
        measurement_x=np.array([[0.45, 0.5], [0.65, 0.5]], np.float32),
        measurement_y=np.array([0.5, 0.75], np.float32),
        measurement_time=np.array([0.2, 0.4], np.float32),
        known=np.array([2]),
    )
    prior = PriorSamples(
        np.array([[0.125, 0.25], [0.875, 1.0]], np.float32),
        np.array([0.25, -0.5], np.float32),
        np.array([0.0625, 0.25], np.float32),
    )
    truth = np.linspace(0, 1, 9).astype(np.float32)
    return Episode(scenario, "by-hand", {}, 0, 0, (agent,), truth, np.ones(9, bool), 0, prior=prior)


def golden_text():
    """The golden file, which leaves out the scenario: a setting more does not make another format."""
    scenario = pretty(by_hand().scenario.to_dict(), "  ")
    return GOLDEN.read_text(encoding="utf-8").replace('"scenario": {}', f'"scenario": {scenario}')


def test_a_file_with_prior_samples_is_as_it_was():
    """The golden file was written once; the next test holds its metrics against scikit-learn."""
    golden = golden_text()
    recorded = parse_episode(golden)
    assert dump_episode(recorded) == golden
    now = by_hand()
    assert dump_episode(dataclasses.replace(now, recorded=recorded.recorded)) == golden
    for field in dataclasses.fields(recorded.metrics):
        found, wanted = getattr(replay(now), field.name), getattr(recorded.metrics, field.name)
        np.testing.assert_allclose(found, wanted, rtol=1e-4)


def test_the_golden_file_s_metrics_are_those_of_the_posterior():
    episode = parse_episode(golden_text())
    (agent,), prior = episode.agents, episode.prior
    assert prior is not None and prior.noise is not None
    noise = np.append(np.full(2, episode.scenario.noise), prior.noise)
    kernel: Any = Matern(0.45, nu=1.5)
    process: Any = GaussianProcessRegressor(kernel, alpha=noise, optimizer=None)  # type: ignore[arg-type]
    process.fit(np.concatenate([agent.measurement_x, prior.x]), np.append(agent.measurement_y, prior.y))
    line = np.linspace(0, 1, 3)
    grid = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    mean, std = process.predict(grid, return_std=True)
    area = mean + std >= 0.5
    assert 0 < area.sum() < 9
    assert episode.metrics.trace == pytest.approx((std[area] ** 2).sum(), rel=1e-4)
    assert episode.metrics.true_trace == pytest.approx((std[episode.truth >= 0.5] ** 2).sum(), rel=1e-4)
    assert episode.metrics.rmse == pytest.approx(np.sqrt(((mean - episode.truth) ** 2).mean()), rel=1e-4)


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_shortest_decimals_are_exact(value):
    assert np.float32(json.loads(json.dumps(shortest(np.float32(value))))) == np.float32(value)


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
    documented = set(re.findall(r"^\| `([^`]+)` \|", page, re.MULTILINE))
    written = set(keys_of(json.loads(dump_episode(dataclasses.replace(episode, mapping=MAPPING, prior=PRIOR)))))
    fields = {f"scenario.{name}" for name in Scenario.__dataclass_fields__}  # documented in docs/scenario.md
    assert fields <= written
    assert written - fields <= documented
    assert {key for key in documented if not re.search(r"\.(json|csv|png|mp4)$", key)} <= written


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
        ("schema", "maipp.episode/2", "schema: 'maipp.episode/2' is not a schema"),
        ("schema", None, "schema: missing"),
        ("precision", "float16", "precision: 'float16'"),
        ("seed", 1.5, "seed: must be a whole number"),
        ("seed", True, "seed: must be a whole number"),
        ("planner", [], "planner: must be an object"),
        ("planner/name", 3, "planner.name: must be a text"),
        ("scenario/budget", -1, r"scenario.budget: -1 is not a budget"),
        ("scenario/noise", None, "scenario.noise: missing"),
        ("scenario/agents", 3, "agents: has 2 entries; there must be 3"),
        ("agents/1/route/x", None, r"agents\[1\].route.x: missing"),
        ("agents/1/route/x/0", "far", r"agents\[1\].route.x\[0\]: must be a number"),
        ("agents/0/route/y", [0.5], r"agents\[0\].route.y: has 1 entries"),
        ("agents/0/route/time", [], r"agents\[0\].route.time: is empty"),
        ("agents/0/route/time/1", -1.0, r"agents\[0\].route.time: goes back"),
        ("agents/0/measurements/value/0", 10**400, r"agents\[0\].measurements.value\[0\]: is inf"),
        ("agents/0/measurements/value/0", 1e300, r"agents\[0\].measurements.value\[0\]: is too large for float32"),
        ("agents/0/measurements/time", [0.1] * 9, r"agents\[0\].measurements.time: has 9 entries; the scenario allows"),
        ("agents/0/known/1", 99, r"agents\[0\].known\[1\]: is 99, but agent 1 took"),
        ("agents/0/speed", 0, r"agents\[0\].speed: is 0.0"),
        ("metrics/own_trace", {}, "metrics.own_trace: must be a list"),
        ("metrics/curve/time", [], "metrics.curve.time: is empty"),
        ("truth/3", [1.0], r"truth\[3\]: has 1 entries; there must be 8"),
        ("outside", [64], r"outside\[0\]: is 64; it must be below 64"),
        ("outside", [10**30], r"outside\[0\]"),
        ("mapping", {}, "mapping.origin: missing"),
        ("mapping", "none", "mapping: must be an object"),
        ("prior", [], "prior: must be an object"),
        ("prior", {"x": [], "y": [], "value": [], "noise": None}, "prior.value: is empty; leave prior out"),
        ("prior", {"x": [0], "y": [0, 1], "value": [0.5], "noise": None}, "prior.y: has 2 entries; there must be 1"),
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
    with pytest.raises(InputError, match=r"^survey.json: metrics.rmse: is (nan|inf)"):
        parse_episode(changed, source="survey.json")


def test_every_key_is_required(text):
    record = json.loads(text)
    for path in {key.replace("[].", "/0/").replace(".", "/") for key in keys_of(record)}:
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
    there = dataclasses.replace(episode, mapping=MAPPING)
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
    there = dataclasses.replace(episode, mapping=dataclasses.replace(MAPPING, size=(2000.0, 900.0)))
    last = table(waypoints_csv(there))[-1]
    assert float(last["distance_domain"]) == pytest.approx(episode.agents[-1].distance, rel=1e-5)


def test_columns_of_the_same_name_are_told_apart(episode):
    there = dataclasses.replace(episode, mapping=dataclasses.replace(MAPPING, value_name="time", x_name='a,"b"'))
    header = list(table(measurements_csv(there))[0])
    assert header == ["agent", "order", 'a,"b"', "northing", "time_4", "time_5"]
