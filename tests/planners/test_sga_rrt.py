"""SGA + RRT: the tree, the choice among its paths, and that agents do what they announce."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax import lax

from maipp.engine import draw_missions, reset
from maipp.engine.observe import due_agent, hear, knowledge, observe
from maipp.engine.rollout import step
from maipp.errors import InputError
from maipp.planners.announced.announcement import Announcement, nothing_announced, with_announced
from maipp.planners.lookahead import measurement_offsets, predicted_trace
from maipp.planners.sga_rrt import SgaRrt, grow_tree
from maipp.scenario import Scenario

SCENARIO = Scenario(agents=3, budget=(0.9, 0.9, 0.5), speed=(1.0, 1.0, 0.5), grid=8, extent=(1.0, 0.8))
PLANNER = SgaRrt(SCENARIO, nodes=40)
NODES, BRANCH = 40, 0.1
VERTICES = NODES  # no path has more
EXTENT = (1.0, 0.8)
KEY = jax.random.key(3)

grow = eqx.filter_jit(grow_tree)


@settings(max_examples=30)
@given(st.integers(0, 2**31 - 1), st.floats(0.01, 0.2))
def test_every_node_of_the_tree_carries_its_path(seed, to_next):
    rng = np.random.default_rng(seed)
    root = (rng.random(2) * EXTENT).astype(np.float32)
    if seed % 3 == 0:
        root[0] = 0.0  # on the border
    offsets = measurement_offsets(jnp.asarray(to_next), 0.2, 4)
    tree = grow(
        jax.random.key(seed),
        jnp.asarray(root),
        nodes=NODES,
        branch=BRANCH,
        extent=EXTENT,
        offsets=offsets,
        vertices=VERTICES,
    )
    tree = jax.tree.map(np.asarray, tree)
    assert ((tree.position >= 0) & (tree.position <= np.array(EXTENT, np.float32))).all()
    np.testing.assert_array_equal(tree.position[0], root)
    assert tree.length[0] == 0 and tree.depth[0] == 0 and (tree.depth[1:] >= 1).all()
    for node in range(NODES):
        path = np.concatenate([root[None], tree.vertices[node, : max(tree.depth[node], 1)]]).astype(np.float64)
        np.testing.assert_allclose(path[-1], tree.position[node], atol=1e-6)
        beyond = tree.vertices[node, tree.depth[node] :]
        np.testing.assert_allclose(beyond, np.broadcast_to(tree.position[node], beyond.shape), atol=1e-6)
        edges = np.linalg.norm(np.diff(path, axis=0), axis=1)
        assert (edges <= BRANCH + 1e-6).all()
        assert tree.length[node] == pytest.approx(edges.sum(), abs=1e-5)
        distance = np.concatenate([[0.0], np.cumsum(edges)])
        on_it = np.asarray(offsets) <= tree.length[node]
        for axis in (0, 1):
            expected = np.interp(np.asarray(offsets)[on_it], distance, path[:, axis])
            np.testing.assert_allclose(tree.marks[node, on_it, axis], expected, atol=5e-6)
    # Every vertex of a path is a node of the tree: the tree is joined to its root.
    gaps = np.linalg.norm(tree.vertices[:, :, None] - tree.position[None, None], axis=-1).min(axis=-1)
    assert gaps.max() < 1e-6


def test_the_tree_spreads_over_the_domain():
    """Nodes are added towards uniform samples from the nearest node: a larger tree covers the domain."""
    tree = grow(KEY, jnp.zeros(2), nodes=400, branch=BRANCH, extent=EXTENT, offsets=jnp.array([0.2]), vertices=2)
    spots = np.random.default_rng(0).random((200, 2)) * EXTENT
    gaps = np.linalg.norm(spots[:, None] - np.asarray(tree.position)[None], axis=-1).min(axis=1)
    assert gaps.max() < 0.2


@pytest.fixture(scope="module")
def mission():
    return jax.tree.map(lambda a: a[0], draw_missions(SCENARIO, seed=1, instances=1, roadmaps=False))


@pytest.fixture(scope="module")
def record(mission):
    """Observation, decision, and the state after it, of every event."""

    @jax.jit
    def events(mission):
        def event(state, _):
            agent = due_agent(mission, state)
            now = jnp.where(state.active.any(), state.arrival[agent], state.time)
            there = eqx.tree_at(lambda s: s.time, state, jnp.maximum(state.time, now))
            there, heard = hear(mission, there, agent)
            observation = observe(mission, knowledge(mission, there, agent, heard))
            decision = PLANNER.decide(jax.random.fold_in(KEY, state.events), observation, ())
            after = step(PLANNER, mission, state, KEY)
            return after, (state.active.any(), observation, decision, after)

        return lax.scan(event, reset(PLANNER, mission), length=24)[1]

    running, *rest = jax.tree.map(np.asarray, events(mission))
    assert not running[-1] and running.sum() > 12
    return [jax.tree.map(lambda a, e=e: a[e], tuple(rest)) for e in np.flatnonzero(running)]


def test_agents_measure_where_and_when_they_announced(record):
    """The part that is travelled before the next decision: the rest is only a plan."""
    checked = 0
    for saw, decision, after in record:
        agent = int(saw.agent)
        taken = np.isfinite(after.measurement_time[agent]) & (after.measurement_time[agent] > saw.time + 1e-5)
        count = int(taken.sum())
        points, times = decision.message
        assert np.isfinite(times).sum() >= count
        np.testing.assert_allclose(points[:count], after.measurement_x[agent][taken], atol=1e-5)
        np.testing.assert_allclose(times[:count], after.measurement_time[agent][taken], atol=1e-5)
        checked += count
    assert checked == int(np.isfinite(record[-1][2].measurement_time).sum())


def test_nothing_beyond_the_budget_is_announced(record):
    for saw, decision, _ in record:
        times = decision.message.times
        reach = saw.time + saw.remaining / saw.speed
        assert (times[np.isfinite(times)] <= reach + 1e-4).all()
    assert np.isinf(record[-1][1].message.times).all()  # at its end an agent announces nothing


def test_the_first_part_of_the_path_is_travelled(record):
    lengths = []
    for saw, decision, after in record:
        path = np.concatenate([saw.position[None], decision.waypoints])
        length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        assert length <= PLANNER.execute + 1e-5
        lengths.append(length)
        if saw.remaining > 1e-5:
            assert after.odometer[int(saw.agent)] == pytest.approx(
                saw.budget - saw.remaining + min(length, saw.remaining), abs=1e-5
            )
    assert np.median(lengths) == pytest.approx(PLANNER.execute, abs=1e-5)


def test_the_best_path_of_the_right_length_is_chosen(mission, record):
    """The tree is grown again from the same key, and every path of it scored."""
    planner = PLANNER

    @jax.jit
    def scores(key, saw):
        offsets = measurement_offsets(saw.to_next_measurement, SCENARIO.measurement_interval, planner.horizon)
        tree = grow_tree(
            key,
            saw.position,
            nodes=planner.nodes,
            branch=planner.branch,
            extent=EXTENT,
            offsets=offsets,
            vertices=planner.waypoints_per_decision,
        )
        belief = with_announced(saw, saw.messages, SCENARIO.virtual_value)
        taken = (offsets <= tree.length[:, None] + 1e-5) & (offsets <= saw.remaining + 1e-5)
        return tree, predicted_trace(belief, planner.interest, saw.inside, tree.marks, taken)

    for number in (0, 1, 5, 9):
        saw, decision, _ = record[number]
        tree, score = scores(jax.random.fold_in(KEY, number), jax.tree.map(jnp.asarray, saw))
        fits = (np.asarray(tree.length) >= 0.3 - 1e-5) & (np.asarray(tree.length) <= 0.4 + 1e-5)
        assert 0 < fits.sum() <= planner.nodes // 2
        best = np.where(fits, score, np.inf).min()
        same = np.abs(np.asarray(tree.marks) - decision.message.points).max(axis=(1, 2)) < 1e-5
        assert float(np.where(same & fits, score, np.inf).min()) == pytest.approx(float(best), rel=1e-4)


def test_announced_measurements_count_where_they_are_heard_and_still_to_come(record):
    """Heard and ahead: as good as measured. Past, unheard or one's own: no influence."""
    saw = jax.tree.map(jnp.asarray, next(saw for saw, *_ in record if saw.time > 0.1 and saw.heard.sum() == 2))
    agent, other = int(saw.agent), int(np.flatnonzero(saw.heard)[0])
    spot = jnp.array([0.43, 0.37])

    @jax.jit
    def variance(by, time, heard):
        """At the spot, where one agent means to measure at that time and the others announce nothing."""
        points = jnp.zeros((3, 2, 2)).at[by, 0].set(spot)
        times = jnp.full((3, 2), jnp.inf).at[by, 0].set(time)
        seen = eqx.tree_at(lambda o: o.heard, saw, heard)
        whitened = with_announced(seen, Announcement(points, times), "mean").whiten(spot)
        return 1.0 - whitened @ whitened

    prior = float(variance(other, jnp.inf, saw.heard))
    assert prior > 0.01
    assert float(variance(other, saw.time + 0.1, saw.heard)) < 1e-4
    for by, time, heard in (
        (other, saw.time, saw.heard),
        (other, saw.time - 0.1, saw.heard),
        (agent, saw.time + 0.1, saw.heard),  # its own plan is not a fact
        (other, saw.time + 0.1, jnp.zeros(3, bool)),
    ):
        assert float(variance(by, time, heard)) == pytest.approx(prior, abs=1e-5)
    points, times = nothing_announced(2)
    assert points.shape == (2, 2) and np.isinf(times).all()


@pytest.mark.parametrize(
    ("options", "problem"),
    [({"lengths": (0.4, 0.3)}, "shortest <= longest"), ({"nodes": 1}, "at least 2"), ({"branch": 0.0}, "lengths > 0")],
)
def test_options_that_make_no_path_are_refused(options, problem):
    with pytest.raises(InputError, match=problem):
        SgaRrt(SCENARIO, **options).check()
