"""The record of a survey: true to the simulation, read back as written, and enough to compute every number anew."""

import dataclasses
import json
import math
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
from maipp.engine import draw_missions, run_missions
from maipp.engine.episode import AgentRecord, Episode, replay, shortest
from maipp.engine.episode_io import (
    dump_episode,
    parse_episode,
    read_episode,
    write_episode,
)
from maipp.engine.score import score_missions
from maipp.geo import GeoReference
from maipp.planners.sga_rrt import SgaRrt
from maipp.records import pretty
from maipp.scenario import Scenario

MAPPING = GeoReference((500.0, 40.0), (2000.0, 2000.0), (1.0, 1.0), 30.0, 10.0, "easting", "northing", "temperature")
PRIOR = PriorSamples(*(np.array(a, np.float32) for a in ([[0.1, 0.2], [0.1, 0.2], [1.5, 0]], [0.3, 0.4, -2.0])))
GOLDEN = Path(__file__).parent / "golden" / "prior.json"


def test_the_record_agrees_with_the_simulation(batch, episode):
    missions, states = batch
    scores = score_missions(missions, states)
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
        assert len(agent.measurement_y) == math.floor(agent.distance / episode.scenario.measurement_interval + 1e-4)


def test_measurements_lie_on_the_routes_at_their_time(episode):
    for index, agent in enumerate(episode.agents):
        where = episode.positions(agent.measurement_time)[index]
        np.testing.assert_allclose(where, agent.measurement_x, atol=1e-5)


def test_the_curve_starts_at_the_prior_and_ends_at_the_final_trace(episode):
    metrics = episode.metrics
    prior = episode.inside.sum() * episode.scenario.signal_variance
    assert metrics.curve_trace[0] == pytest.approx(prior)
    assert metrics.curve_trace[-1] == np.float32(metrics.trace)
    assert (np.diff(metrics.curve_time) > 1e-5).all()
    assert metrics.curve_time[-1] == max(agent.measurement_time[-1] for agent in episode.agents)


def test_repeated_waypoints_are_recorded_once_and_messages_weighed(episode):
    scenario = episode.scenario
    planner = SgaRrt(scenario, nodes=20)
    missions = draw_missions(scenario, seed=0, instances=1, roadmaps=False)
    states = run_missions(planner, missions, jax.random.key(0))
    episode = Episode.from_state(scenario, "sga-rrt", {"nodes": "20"}, 0, missions, states)
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
    scenario = episode.scenario.replace(obstacles=[[[0.1, 0.1], [0.5, 0.1], [0.3, 0.4]]])
    inside = np.arange(64) % 7 > 0
    there = dataclasses.replace(episode, scenario=scenario, inside=inside, reference=MAPPING)
    again = parse_episode(dump_episode(there))
    assert again.reference == MAPPING and again.scenario == scenario
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
