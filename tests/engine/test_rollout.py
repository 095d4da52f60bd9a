"""Running batches: the same record whatever the batch, the lanes and the devices, and one compilation per shape."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine import Decision, Planner, draw_missions, rollout, run_missions
from maipp.errors import InputError
from maipp.planners.greedy import Greedy
from maipp.scenario import Scenario

SETTINGS = {"agents": 2, "budget": (0.6, 0.5), "grid": 8, "nodes": 20, "neighbours": 5, "comm_range": 0.4}
SCENARIO = Scenario(**SETTINGS)
KEY = jax.random.key(7)


class Drift(Planner):
    """A random walk in the plane that counts how often it is traced."""

    stride: jax.Array  # () longest step along an axis, domain units
    traces: ClassVar[int] = 0

    def decide(self, key, observation, memory):
        Drift.traces += 1
        step = jax.random.uniform(key, (2,), minval=-self.stride, maxval=self.stride)
        return Decision((observation.position + step)[None], (), memory)


def drift(stride=0.15):
    return Drift(SCENARIO, jnp.asarray(stride))


@pytest.fixture(scope="module")
def missions():
    return draw_missions(SCENARIO, seed=1, instances=5)


@pytest.fixture(scope="module")
def together(missions):
    return run_missions(drift(), missions, KEY)


def head(missions, count):
    return jax.tree.map(lambda a: a[:count], missions)


def assert_same(states, others):
    for a, b in zip(jax.tree.leaves(states), jax.tree.leaves(others), strict=True):
        np.testing.assert_array_equal(a, b)


def assert_close(states, others):
    """The same decisions; numbers up to the rounding of batched products."""
    for a, b in zip(jax.tree.leaves(states), jax.tree.leaves(others), strict=True):
        if jnp.issubdtype(a.dtype, jnp.floating):
            np.testing.assert_allclose(a, b, atol=1e-5)
        else:
            np.testing.assert_array_equal(a, b)


def test_the_same_key_gives_the_same_record_to_the_bit(missions, together):
    assert not together.active.any()
    assert together.route.shape[0] == 5
    assert_same(together, run_missions(drift(), missions, jax.random.key(7)))


def test_another_key_gives_another_record_in_every_mission(missions, together):
    other = run_missions(drift(), missions, jax.random.key(8))
    different = np.any(np.asarray(other.route != together.route), axis=(1, 2, 3))
    assert different.all()


def test_every_decision_has_its_own_randomness(together):
    """No two missions of a batch take the same steps, nor do two agents, nor one agent twice."""
    moves = np.diff(np.asarray(together.route[:, :, :3]), axis=2).reshape(-1, 2)
    assert len(np.unique(moves.round(5), axis=0)) == 5 * 2 * 2


def test_a_mission_does_not_depend_on_the_batch_it_runs_in(missions, together):
    assert_close(run_missions(drift(), head(missions, 3), KEY), head(together, 3))
    # The later part of a batch, run for itself, knows where it begins.
    rest = jax.tree.map(lambda a: a[2:], missions)
    assert_close(run_missions(drift(), rest, KEY, first=2), jax.tree.map(lambda a: a[2:], together))


def test_a_planner_without_randomness_can_run_each_mission_alone(missions):
    planner = Greedy(SCENARIO, shared=True)
    batch = run_missions(planner, missions, KEY)
    for i in (0, 3, 4):
        alone = run_missions(planner, jax.tree.map(lambda a, i=i: a[i : i + 1], missions), KEY)
        assert_close(alone, jax.tree.map(lambda a, i=i: a[i : i + 1], batch))


@pytest.mark.parametrize(("lanes", "devices"), [(1, 1), (2, 1), (2, 2), (32, 2)])
def test_lanes_and_devices_do_not_matter(missions, together, monkeypatch, lanes, devices):
    """Five missions fit no number of lanes and no number of devices: the batch is padded, and the padding cut off."""
    if len(jax.local_devices()) < devices:
        pytest.skip(f"needs {devices} devices")
    monkeypatch.setattr(rollout, "missions_devices", lambda: jax.local_devices()[:devices])
    monkeypatch.setattr(rollout, "lanes_at_most", lambda planner: lanes)
    assert_close(run_missions(drift(), missions, KEY), together)


def test_thousands_of_lanes_wait_for_each_other_and_nothing_changes(monkeypatch):
    """With 32 lanes two missions must have ended before any lane takes up another."""
    many = draw_missions(SCENARIO, seed=1, instances=64, roadmaps=False)
    monkeypatch.setattr(rollout, "missions_devices", lambda: jax.local_devices()[:1])
    ended = []
    for lanes in (32, 5):
        monkeypatch.setattr(rollout, "lanes_at_most", lambda planner, lanes=lanes: lanes)
        ended.append(run_missions(drift(), many, KEY))
    assert_close(*ended)


class Counted(Drift):
    """Counts how often lanes are stepped, whether their mission has ended or not."""

    steps: ClassVar[int] = 0

    def decide(self, key, observation, memory):
        def count(_):
            Counted.steps += 1

        jax.debug.callback(count, observation.time)
        return super().decide(key, observation, memory)


def test_a_lane_takes_the_next_mission_as_soon_as_its_own_has_ended(monkeypatch):
    """In pairs that wait for each other each of the four long missions would cost its partner's lane as much again."""
    count, lanes = 8, 2
    drawn = draw_missions(SCENARIO, seed=1, instances=count, roadmaps=False)
    short = drawn.params.budgets.at[1::2].set(0.05)
    mixed = eqx.tree_at(lambda m: m.params.budgets, drawn, short)
    monkeypatch.setattr(rollout, "missions_devices", lambda: jax.local_devices()[:1])
    monkeypatch.setattr(rollout, "lanes_at_most", lambda planner: lanes)
    Counted.steps = 0
    states = run_missions(Counted(SCENARIO, jnp.asarray(0.1)), mixed, KEY)
    jax.effects_barrier()
    events = np.asarray(states.events)
    assert events[1::2].max() * 3 < events[0::2].min()
    # Graham's bound: nobody is idle before the last mission has begun.
    assert events.sum() <= Counted.steps <= events.sum() + (lanes - 1) * events.max()
    assert Counted.steps < lanes * events.reshape(-1, lanes).max(axis=1).sum()


def test_work_is_spread_over_the_devices(missions, monkeypatch):
    if len(jax.local_devices()) < 2:
        pytest.skip("needs 2 devices")
    monkeypatch.setattr(rollout, "missions_devices", lambda: jax.local_devices()[:2])
    states = run_missions(drift(), head(missions, 4), KEY)
    assert states.route.sharding.device_set == set(jax.local_devices()[:2])


def test_equal_calls_share_one_compilation(missions, together):
    """Equal scenarios and options, other worlds, other keys, other weights: nothing of that compiles again."""
    before = Drift.traces
    assert before > 0
    again = Scenario(**SETTINGS)
    others = draw_missions(again, seed=2, instances=5)
    run_missions(Drift(again, jnp.asarray(0.15)), others, jax.random.key(1))
    short = run_missions(drift(0.05), missions, KEY)
    assert Drift.traces == before
    assert (np.asarray(short.events) > np.asarray(together.events)).all()  # the new weights are the ones used
    run_missions(drift(), head(missions, 2), KEY)
    assert Drift.traces > before  # the counter does count


def test_missions_that_end_early_wait_unchanged(missions, together):
    """One mission of five with a hundredth of the budget stops long before the others."""
    budgets = missions.params.budgets.at[2].set(0.05)
    mixed = eqx.tree_at(lambda m: m.params.budgets, missions, budgets)
    states = run_missions(drift(), mixed, KEY)
    np.testing.assert_allclose(states.odometer[2], 0.05, atol=1e-6)
    assert not np.isfinite(states.measurement_time[2]).any()
    others = np.array([0, 1, 3, 4])
    assert_close(jax.tree.map(lambda a: a[others], states), jax.tree.map(lambda a: a[others], together))


def test_a_roadmap_planner_without_roadmaps_says_what_to_do():
    bare = draw_missions(SCENARIO, seed=1, instances=1, roadmaps=False)
    with pytest.raises(ValueError, match="roadmaps=True"):
        run_missions(Greedy(SCENARIO), bare, KEY)


def test_a_planner_that_would_cross_obstacles_is_refused():
    walled = SCENARIO.replace(obstacles=(((0.4, 0.4), (0.6, 0.4), (0.5, 0.6)),))
    missions = draw_missions(walled, seed=1, instances=1)
    with pytest.raises(InputError, match="Drift: this planner would cross the scenario's no-go zones"):
        run_missions(Drift(walled, jnp.asarray(0.1)), missions, KEY)
