"""The event-driven engine against an independent replay in NumPy, and the laws of motion."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from maipp.scenario import Scenario

AGENTS, DECISIONS, WAYPOINTS, INTERVAL = 3, 6, 2, 0.2
TOLERANCE = 1e-5
SEEDS = st.integers(0, 2**32 - 1)
# The budget and the speed are the largest that any world below uses, so that all of them share one compilation.
GLOBAL = Scenario(agents=AGENTS, budget=1.0, speed=2.0, measurement_interval=INTERVAL, grid=8)
SHORT = GLOBAL.replace(comm_range=0.3)
SLOTS = GLOBAL.measurements


class World(NamedTuple):
    """One small survey."""

    start: np.ndarray  # (m, 2)
    budgets: np.ndarray  # (m,)
    speeds: np.ndarray  # (m,)
    script: np.ndarray  # (m, DECISIONS, WAYPOINTS, 2)
    halt: np.ndarray  # (m, DECISIONS)


class Event(NamedTuple):
    """One decision, as it should have been."""

    agent: int
    time: float
    position: np.ndarray
    odometer: float
    taken: int
    heard: set
    known: set  # of (agent, number of the measurement)
    messages: list


class Replay:
    """The rules of docs/protocol.md once more, in float64, with sets and lists in the place of masks.

    `ambiguous` says that some comparison was so close that rounding may decide it either way.
    """

    def __init__(self, world, comm_range):
        self.world, self.range = world, np.inf if comm_range is None else comm_range
        m = AGENTS
        self.paths = [[(0.0, np.array(start))] for start in world.start]  # (time, vertex)
        self.spots = [[] for _ in range(m)]  # (time, position) of every measurement
        self.odometer, self.steps, self.messages = np.zeros(m), [0] * m, [-1] * m
        self.known = [set() for _ in range(m)]
        self.running = set(range(m))
        self.events, self.ambiguous, self.now = [], False, 0.0
        while self.running:
            self.event()

    def close(self, a, b):
        """Whether a and b differ by about a tolerance: more than rounding, less than anything meant."""
        self.ambiguous |= bool(1e-6 < abs(a - b) < 4e-5)
        return abs(a - b) <= TOLERANCE / 2

    def place(self, agent, time):
        times, vertices = zip(*self.paths[agent], strict=True)
        return np.array([np.interp(time, times, [v[axis] for v in vertices]) for axis in (0, 1)])

    def event(self):
        arrivals = {i: self.paths[i][-1][0] for i in self.running}
        soonest = min(arrivals.values())
        agent = min(i for i, t in arrivals.items() if self.close(t, soonest) or t == soonest)
        self.now = max(self.now, arrivals[agent])
        here = self.place(agent, self.now)
        distances = [np.linalg.norm(self.place(j, self.now) - here) for j in range(AGENTS)]
        self.ambiguous |= any(abs(d - self.range) < 1e-4 for d in distances)
        heard = {j for j in range(AGENTS) if j != agent and distances[j] <= self.range}
        taken = {
            (j, k)
            for j in heard | {agent}
            for k, (time, _) in enumerate(self.spots[j])
            if time < self.now or self.close(time, self.now)
        }
        self.known[agent] = self.known[agent].union(taken, *(self.known[j] for j in heard))
        self.events.append(
            Event(
                agent,
                self.now,
                here,
                self.odometer[agent],
                len(self.spots[agent]),
                heard,
                set(self.known[agent]),
                list(self.messages),
            )
        )
        self.messages[agent] = self.steps[agent]
        if self.steps[agent] >= DECISIONS or self.world.halt[agent, self.steps[agent]]:
            self.running.discard(agent)
            return
        self.travel(agent, here)

    def travel(self, agent, here):
        left, speed = self.world.budgets[agent] - self.odometer[agent], self.world.speeds[agent]
        travelled, legs = 0.0, []
        for waypoint in np.clip(self.world.script[agent, self.steps[agent]], 0.0, 1.0):
            length = np.linalg.norm(waypoint - here)
            share = min(1.0, (left - travelled) / length) if length else 0.0
            here = here + share * (waypoint - here)
            travelled += share * length
            legs.append((self.now + travelled / speed, here))
        self.steps[agent] += 1
        if travelled < TOLERANCE:
            self.running.discard(agent)
            return
        self.paths[agent][-1] = (self.now, self.paths[agent][-1][1])
        self.paths[agent] += legs
        # The measurements are those that the odometer passes on the way.
        while True:
            offset = (len(self.spots[agent]) + 1) * INTERVAL - self.odometer[agent]
            if offset > travelled and not self.close(offset, travelled):
                break
            time = self.now + min(offset, travelled) / speed
            self.spots[agent].append((time, self.place(agent, time)))
        self.odometer[agent] += travelled


def random_world(seed):
    """Waypoints in and out of the domain, standing still, tiny and exact steps, unequal agents, shared starts."""
    rng = np.random.default_rng(seed)
    start = rng.random((AGENTS, 2))
    if rng.random() < 0.5:
        start[:] = start[0]
    script = rng.uniform(-0.3, 1.3, (AGENTS, DECISIONS, WAYPOINTS, 2))
    kind = rng.random((AGENTS, DECISIONS))
    script[kind < 0.15, 1] = script[kind < 0.15, 0]  # one leg only
    beside = start[:, None, None] + rng.uniform(-0.1, 0.1, script.shape)
    script = np.where((kind > 0.4)[..., None, None], np.clip(beside, 0, 1), script)  # short legs around the start
    return World(
        start=start,
        budgets=np.where(rng.random(AGENTS) < 0.5, 1.0, rng.uniform(0.05, 1.0, AGENTS)),
        speeds=np.full(AGENTS, 1.0) if rng.random() < 0.3 else rng.uniform(0.3, 2.0, AGENTS),
        script=script,
        halt=rng.random((AGENTS, DECISIONS)) < 0.05,
    )


def slots_of(known):
    """The set {(agent, number)} as a mask over the team's slots."""
    mask = np.zeros((AGENTS, SLOTS // AGENTS), bool)
    for agent, number in known:
        mask[agent, number] = True
    return mask.reshape(-1)


@pytest.mark.parametrize("scenario", [GLOBAL, SHORT], ids=["global", "limited"])
@settings(max_examples=60)
@given(seed=SEEDS)
def test_every_event_is_that_of_the_replay(play, scenario, seed):
    """Who decides when, where it is, whom it hears, what it knows: never a measurement before its time."""
    world = random_world(seed)
    replay = Replay(world, scenario.comm_range)
    assume(not replay.ambiguous)
    mission, states = play(scenario, world)
    for number, event in enumerate(replay.events):
        before, after = (jax.tree.map(lambda a, i=i: a[i], states) for i in (number, number + 1))
        assert after.events == number + 1
        deciders = np.flatnonzero(after.memory["step"] - before.memory["step"])
        np.testing.assert_array_equal(deciders, [event.agent])
        saw = {name: value[event.agent] for name, value in after.memory.items()}
        assert after.time == pytest.approx(event.time, abs=1e-5)
        assert saw["time"] == after.time
        np.testing.assert_allclose(saw["position"], event.position, atol=1e-5)
        np.testing.assert_allclose(saw["positions"][event.agent], event.position, atol=1e-5)
        assert saw["remaining"] == pytest.approx(world.budgets[event.agent] - event.odometer, abs=1e-5)
        assert saw["to_next_measurement"] == pytest.approx((event.taken + 1) * INTERVAL - event.odometer, abs=1e-5)
        np.testing.assert_array_equal(np.flatnonzero(saw["heard"]), sorted(event.heard))
        np.testing.assert_array_equal(saw["known"], slots_of(event.known))
        heard = sorted(event.heard)
        np.testing.assert_array_equal(saw["messages"][heard], np.array(event.messages)[heard])
        known = np.flatnonzero(saw["known"])
        times = after.measurement_time.reshape(-1)[known]
        assert (times <= after.time + TOLERANCE).all()
        np.testing.assert_array_equal(saw["measurement_y"][known], after.measurement_y.reshape(-1)[known])
    final = jax.tree.map(lambda a: a[len(replay.events)], states)
    assert not final.active.any()
    np.testing.assert_allclose(final.odometer, replay.odometer, atol=1e-5)
    for agent in range(AGENTS):
        count = len(replay.spots[agent])
        assert final.taken[agent] == count
        assert np.isfinite(final.measurement_time[agent]).sum() == count
        if count:
            times, spots = zip(*replay.spots[agent], strict=True)
            np.testing.assert_allclose(final.measurement_time[agent, :count], times, atol=1e-5)
            np.testing.assert_allclose(final.measurement_x[agent, :count], spots, atol=1e-5)
            truth = mission.field(jnp.asarray(final.measurement_x[agent, :count]))
            np.testing.assert_allclose(final.measurement_y[agent, :count], truth, atol=1e-6)


@settings(max_examples=60)
@given(seed=SEEDS)
@example(seed=13460727)  # a waypoint on the border, once reached 1e-9 outside of it
def test_the_record_keeps_the_laws_of_motion(play, seed):
    """Budget, speed, domain, and measurements at every interval of travelled distance, up to exactly the budget."""
    world = random_world(seed)
    _, states = play(GLOBAL, world)
    final = jax.tree.map(lambda a: a[-1], states)
    assert not final.active.any()
    for agent in range(AGENTS):
        length = int(final.route_length[agent])
        route, times = final.route[agent, :length].astype(np.float64), final.route_time[agent, :length]
        assert np.isfinite(times).all() and np.isinf(final.route_time[agent, length:]).all()
        legs = np.linalg.norm(np.diff(route, axis=0), axis=1)
        distance = np.concatenate([[0.0], np.cumsum(legs)])
        assert distance[-1] <= world.budgets[agent] + 2e-6
        assert distance[-1] == pytest.approx(final.odometer[agent], abs=2e-6)
        assert (route >= 0).all() and (route <= 1).all()
        np.testing.assert_allclose(route[0], world.start[agent], atol=1e-7)
        # An agent travels without a pause from its start to its end.
        np.testing.assert_allclose(times * world.speeds[agent], distance, atol=1e-4)
        marks = INTERVAL * np.arange(1, SLOTS + 1)
        margin = np.abs(distance[-1] - marks).min()
        assume(margin < 1e-6 or margin > 2e-5)
        count = int(np.sum(marks <= distance[-1] + TOLERANCE))
        assert np.isfinite(final.measurement_time[agent]).sum() == count
        for axis in (0, 1):
            expected = np.interp(marks[:count], distance, route[:, axis])
            np.testing.assert_allclose(final.measurement_x[agent, :count, axis], expected, atol=5e-6)
        expected = np.interp(marks[:count], distance, times)
        np.testing.assert_allclose(final.measurement_time[agent, :count], expected, atol=1e-5)
