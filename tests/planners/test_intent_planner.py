"""`di`, `ti`, `intent-paths`: what they tell, whom they count on, and which way they go."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from shapely.geometry import LineString
from sklearn.gaussian_process.kernels import Matern

from maipp.engine import draw_missions, reset, run_missions
from maipp.engine.observe import due_agent, hear, knowledge, observe
from maipp.engine.rollout import step
from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.planners.announced.intents import intent_points
from maipp.planners.intent import IntentPlanner
from maipp.planners.options import values_of
from maipp.scenario import Scenario
from maipp.team import COVARIANCE_FLOOR, Intent, destination_intent, fuse_intents, trajectory_intent

SCENARIO = Scenario(agents=3, budget=(0.9, 0.7, 0.5), grid=8, nodes=24, neighbours=6, extent=(1.0, 0.8))
KEY = jax.random.key(0)
EVENTS = 20


@pytest.fixture(scope="module")
def planner(tiny):
    """A function that makes a planner with the small network."""
    return lambda scenario=SCENARIO, **options: IntentPlanner.of(
        scenario, **({"network": tiny, "paths": 6, "steps": 3} | options)
    )


@pytest.fixture(scope="module")
def seen(planner):
    """Observations and memories of the first events of a mission, agents that stop among them, leading axis EVENTS."""
    mission = jax.tree.map(lambda a: a[0], draw_missions(SCENARIO, seed=6, instances=1, encodings=4))
    walker = planner(choose="sample", paths=3, steps=2)

    @eqx.filter_jit
    def events(planner, mission):
        def event(state, _):
            agent = due_agent(mission, state)
            now = jnp.where(state.active.any(), state.arrival[agent], state.time)
            there = eqx.tree_at(lambda s: s.time, state, jnp.maximum(state.time, now))
            there, heard = hear(mission, there, agent)
            observation = observe(mission, knowledge(mission, there, agent, heard))
            memory = jax.tree.map(lambda a: a[agent], state.memory)
            return step(planner, mission, state, KEY), (observation, memory, state.active.any())

        return lax.scan(event, reset(planner, mission), length=EVENTS)[1]

    observations, memories, running = events(walker, mission)
    assert running[:12].all()
    return jax.tree.map(lambda a: a[np.flatnonzero(np.asarray(running))], (observations, memories))


@eqx.filter_jit
def _act(planner, keys, observations, memories):
    """Decisions, what a trainer is told, and the paths that were sampled."""

    def act(key, observation, memory):
        decision, choice = planner.act(key, observation, memory)
        return decision, choice, choice.paths

    return jax.vmap(act)(keys, observations, memories)


@pytest.fixture(scope="module")
def act(seen):
    """Runs a planner on what was seen, with one and the same key per event, each planner once."""
    done = {}

    def run(planner, change=None, intents=None):
        observations, memories = seen
        if change is not None:
            memories = memories if intents is None else memories._replace(intents=intents)
            return _act(planner, jax.random.split(KEY, len(memories.trajectory.cell)), change(observations), memories)
        options = planner.scenario, *values_of(planner).items()
        if options not in done:
            done[options] = _act(planner, jax.random.split(KEY, len(memories.trajectory.cell)), observations, memories)
        return done[options]

    return run


def each(observations):
    """One observation after the other, as NumPy arrays."""
    host = jax.tree.map(np.asarray, observations)
    return [jax.tree.map(lambda a, e=e: a[e], host) for e in range(len(host.time))]


def assert_same(one, other):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-5)


# Compiling is what these tests cost: a few planners serve all of them.
STAR = {"choose": "best", "share": "best"}
COLD = {"choose": "sample", "intent": "destination", "temperature": 1e-6}
HOT = {"choose": "sample", "temperature": 100.0}


@pytest.mark.parametrize("options", [{}, COLD, STAR], ids=["ti", "di", "best"])
def test_the_message_is_the_intent_of_the_sampled_nodes(planner, act, seen, options):
    decisions, choices, paths = act(planner(**options))
    fit = eqx.filter_jit(destination_intent if "intent" in options else trajectory_intent)
    told = 0
    for e, observation in enumerate(each(seen[0])):
        message = jax.tree.map(lambda a, e=e: a[e], decisions.message)
        assert np.isfinite(message.mean).all() == (not decisions.stop[e]) == np.isfinite(message.covariance).all()
        if decisions.stop[e]:
            continue
        told += 1
        rows = np.arange(6)
        if "share" in options:  # of the paths with this first step, the best one
            rows = rows[np.asarray(paths.choices[e]) == int(choices.index[e])]
        candidates = [[row] for row in rows] if "share" in options else [rows]
        floor = COVARIANCE_FLOOR * max(SCENARIO.extent) ** 2
        nodes = jnp.asarray(observation.roadmap.nodes)
        fits = [
            fit(nodes[paths.nodes[e][jnp.array(c)]], paths.taken[e][jnp.array(c)], jnp.float32(floor))
            for c in candidates
        ]
        assert any(
            np.allclose(message.mean, a.mean, atol=1e-5) and np.allclose(message.covariance, a.covariance, atol=1e-6)
            for a in fits
        )
    assert told > 8 and decisions.stop.any()


def test_the_policy_sees_the_intents_of_those_it_hears(planner, act, seen):
    _, choices, _ = act(planner())
    shown = np.asarray(choices.view.features[..., 4])
    for e, observation in enumerate(each(seen[0])):
        messages = Intent(*map(jnp.asarray, observation.messages))
        expected = fuse_intents(messages, jnp.asarray(observation.heard), jnp.asarray(observation.roadmap.nodes))
        np.testing.assert_allclose(shown[e], expected, atol=1e-5)
    assert (shown[0] == 0).all() and (shown[3].max() == 1)  # at first nobody has told anything


def out_of_range(observation):
    """As if nobody were heard."""
    return eqx.tree_at(lambda o: o.heard, observation, jnp.zeros_like(observation.heard))


def test_an_agent_out_of_range_is_counted_on_as_last_heard(planner, act, seen):
    heard, messages = seen[0].heard, seen[0].messages
    last = jax.tree.map(lambda a: jnp.where(heard[..., None], a, jnp.nan), messages)
    star = planner(**STAR)
    assert_same(act(star)[:2], act(star, out_of_range, last)[:2])


def test_hearing_no_message_is_a_map_of_zeros_and_the_same_as_not_listening(planner, act):
    deaf = act(planner(**STAR, listen=False))
    assert (np.asarray(deaf[1].view.features[..., 4]) == 0).all()
    alone = act(planner(**STAR, recall=False), out_of_range)
    silent = act(
        planner(**STAR),
        lambda o: eqx.tree_at(lambda o: o.messages, o, jax.tree.map(lambda a: jnp.full_like(a, jnp.nan), o.messages)),
    )
    for other in (alone, silent):  # they remember other intents, and make the same of it
        assert_same((deaf[0].waypoints, deaf[0].message, deaf[1]), (other[0].waypoints, other[0].message, other[1]))
    heard = act(planner(**STAR))
    assert not np.allclose(heard[1].insight.value, deaf[1].insight.value, atol=1e-4)


def refit(x, y, grid):
    """Posterior mean and variance in NumPy, with the noise of the scenario."""
    joint = np.asarray(Matern(SCENARIO.length_scale, nu=1.5)(np.concatenate([x, grid])))
    gram, cross = joint[: len(x), : len(x)] + SCENARIO.noise * np.eye(len(x)), joint[: len(x), len(x) :]
    weights = np.linalg.solve(gram, cross)
    return y @ weights, 1.0 - np.sum(cross * weights, axis=0)


def passed(observation, nodes):
    """Where an agent measures on its way through these nodes."""
    line = LineString([observation.position, *observation.roadmap.nodes[nodes]])
    end = min(line.length, float(observation.remaining)) + 1e-5
    marks = np.arange(float(observation.to_next_measurement), end, SCENARIO.measurement_interval)
    return np.array([line.interpolate(mark).coords[0] for mark in marks]).reshape(-1, 2)


def test_what_is_left_of_the_best_path_competes_again(planner, seen):
    observations, memories = seen
    keys = jax.random.split(KEY, len(memories.trajectory.cell))
    star = planner(keep=True, **STAR)
    _, choices, paths = _act(star, keys, observations, memories)
    best = np.argmin(np.asarray(choices.scores), axis=1)
    turns = np.asarray(paths.turns)[np.arange(len(best)), best]
    assert (turns[:, 0] == np.where(turns[:, 0] < 0, -1, choices.index)).all()
    # As if that path had been planned before, and as if nothing had: all that is random stays the same.
    planned = _act(star, keys, observations, memories._replace(plan=jnp.asarray(turns)))
    unplanned = _act(star, keys, observations, memories._replace(plan=jnp.full_like(memories.plan, -1)))
    np.testing.assert_array_equal(planned[2].turns[:, 0], turns)
    np.testing.assert_array_equal(planned[2].turns[:, 1:], unplanned[2].turns[:, 1:])
    assert (np.asarray(planned[2].turns[:, 0]) != np.asarray(unplanned[2].turns[:, 0])).any()
    # The next decision starts from the rest of the best path, which now may be the one planned.
    best = np.argmin(np.asarray(planned[1].scores), axis=1)
    chosen = np.asarray(planned[2].turns)[np.arange(len(best)), best]
    np.testing.assert_array_equal(planned[0].memory.plan[:, :-1], chosen[:, 1:])
    assert (np.asarray(planned[0].memory.plan[:, -1]) == -1).all()


@pytest.mark.parametrize(
    ("rank", "virtual_value"), [("stationary", "mean"), ("intents", "mean"), ("intents", "zero")], ids=str
)
def test_best_is_the_first_step_of_the_path_with_the_lowest_predicted_trace(planner, act, seen, rank, virtual_value):
    star = planner(SCENARIO.replace(virtual_value=virtual_value), rank=rank, **STAR)
    decisions, choices, paths = act(star)
    telling = 0
    for e, observation in enumerate(each(seen[0])):
        if decisions.stop[e]:
            continue
        x = observation.measurement_x[observation.known].astype(np.float64)
        y = observation.measurement_y[observation.known].astype(np.float64)
        others = np.zeros((0, 2))
        told = observation.heard & np.isfinite(observation.messages.mean[:, 0])
        if rank == "intents" and told.any():
            others = np.asarray(intent_points(Intent(*(jnp.asarray(a[told]) for a in observation.messages))))
            others = others.reshape(-1, 2)
        scores = []
        for nodes, taken in zip(np.asarray(paths.nodes[e]), np.asarray(paths.taken[e]), strict=True):
            virtual = np.concatenate([others, passed(observation, nodes[taken])])
            values = np.zeros(len(virtual))
            if virtual_value == "mean" and len(x) and len(virtual):
                values = refit(x, y, virtual)[0]
            mean, variance = np.zeros(len(observation.inside)), np.ones(len(observation.inside))
            if len(x) + len(virtual):
                joint = np.concatenate([x, virtual]), np.concatenate([y, values])
                mean, variance = refit(*joint, observation.belief.query.astype(np.float64))
            bound = mean + np.sqrt(np.maximum(variance, 0))
            scores.append(variance[(bound >= SCENARIO.threshold) & observation.inside].sum())
        chosen = np.asarray(paths.choices[e]) == int(choices.index[e])
        # A grid point at the threshold may count or not, by rounding.
        assert min(np.array(scores)[chosen]) <= min(scores) * (1 + 2e-3) + 1e-4
        telling += min(np.array(scores)[~chosen], default=0) > 1.02 * min(scores)
        target = observation.roadmap.nodes[choices.view.neighbours[e][choices.index[e]]]
        np.testing.assert_allclose(decisions.waypoints[e, 0], target)
    assert telling > 4


def test_both_modes_agree_on_everything_but_virtual_steps(planner, act):
    once, again = (act(planner(mode=mode)) for mode in ("encode-once", "reencode"))
    for same in ("situation", "insight", "memory", "index"):
        assert_same(getattr(once[1], same), getattr(again[1], same))
    assert_same(once[0].waypoints, again[0].waypoints)
    np.testing.assert_array_equal(once[2].choices, again[2].choices)
    np.testing.assert_array_equal(once[2].nodes[..., 0], again[2].nodes[..., 0])
    assert (np.asarray(once[2].nodes) != np.asarray(again[2].nodes)).any()


def test_with_one_step_the_modes_are_the_same(planner, act):
    assert_same(*(act(planner(mode=mode, steps=1, choose="best")) for mode in ("encode-once", "reencode")))


def test_sampling_at_a_temperature_of_almost_zero_is_the_likeliest(planner, act):
    cold, sure = act(planner(**COLD)), act(planner())
    going = ~np.asarray(cold[0].stop)
    np.testing.assert_array_equal(np.asarray(cold[1].index)[going], np.asarray(sure[1].index)[going])
    np.testing.assert_array_equal(cold[2].choices[going], np.tile(np.asarray(sure[1].index)[going, None], 6))
    hot = act(planner(**HOT))
    assert (np.asarray(hot[1].index) != np.asarray(sure[1].index))[going].any()


def test_a_trainer_is_told_the_log_probability_of_the_choice(planner, act, tiny, seen):
    decisions, choices, _ = act(planner(**HOT))

    @eqx.filter_jit
    def again(network, view, memory):
        prepared = network.prepare(network.encode(view.features, view.encoding))
        return network.decode(prepared, *view[2:], memory)[0]

    told = jax.vmap(lambda choice: choice.log_probability)(choices)
    logits = np.asarray(jax.vmap(again, (None, 0, 0))(tiny, choices.view, seen[1].trajectory), np.float64)
    for e, row in enumerate(logits):
        if decisions.stop[e]:
            assert told[e] == 0 and not choices.view.allowed[e].any()
            continue
        probability = np.exp(row - row.max())[int(choices.index[e])] / np.exp(row - row.max()).sum()
        assert probability > 0 and float(told[e]) == pytest.approx(np.log(probability), abs=1e-4)


def missions_of(scenario, count):
    return draw_missions(scenario, seed=1, instances=count, encodings=4)


@pytest.fixture(scope="module")
def survey(planner):
    """Three missions with sampled steps, and how they ended."""
    walker, missions = planner(choose="sample", paths=2, steps=2), missions_of(SCENARIO, 3)
    return walker, missions, run_missions(walker, missions, KEY)


def test_the_same_seed_gives_the_same_survey_and_another_key_another(survey):
    walker, missions, states = survey
    for a, b in zip(*map(jax.tree.leaves, (states, run_missions(walker, missions, KEY))), strict=True):
        np.testing.assert_array_equal(a, b)
    other = run_missions(walker, missions, jax.random.key(9))
    assert not np.array_equal(other.route, states.route)


def test_a_mission_in_a_batch_is_the_mission_alone(survey):
    walker, missions, states = survey
    for i in range(3):
        alone = run_missions(walker, jax.tree.map(lambda a, i=i: a[i : i + 1], missions), KEY, first=i)
        np.testing.assert_allclose(alone.route[0], states.route[i], atol=1e-5)


def test_agents_that_have_stopped_claim_nothing(survey):
    *_, states = survey
    assert np.isnan(states.messages.mean).all() and np.isnan(states.messages.covariance).all()


def test_other_roadmaps_float64_and_a_lone_agent_need_no_other_network(tiny):
    """More neighbours than a roadmap of the paper has, one agent, float64: the network stays float32."""
    scenario = Scenario(agents=1, budget=0.5, grid=6, nodes=40, neighbours=26)
    with jax.enable_x64(True):
        star = IntentPlanner.of(scenario, network=tiny, paths=3, steps=2, choose="best")
        states = run_missions(star, missions_of(scenario, 1), KEY)
        assert states.route.dtype == jnp.float64 and states.memory.trajectory.hidden.dtype == jnp.float32
        np.testing.assert_allclose(states.odometer, 0.5, atol=1e-5)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"temperature": 0.0}, "temperature=0.0: give a number > 0"),
        ({"paths": 0}, "paths=0: give a whole number >= 1"),
        ({"steps": -1}, "steps=-1: give a whole number >= 1"),
        ({"intent": "hidden"}, "intent: 'hidden' is not one of trajectory, destination"),
        ({"weights": "best"}, "weights 'best': give ti, sga-catnipp, untrained, or a .safetensors file"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, problem):
    with pytest.raises(InputError, match="^planner ti: ") as error:
        make_planner("ti", SCENARIO, {"weights": "untrained"} | options)
    assert problem in str(error.value)


@pytest.mark.parametrize(("drawn", "problem"), [({"roadmaps": False}, "roadmaps=True"), ({}, "encodings=32")])
def test_missions_without_what_the_policy_reads_are_refused(planner, drawn, problem):
    missions = draw_missions(SCENARIO, seed=1, instances=1, **drawn)
    with pytest.raises(ValueError, match=problem):
        run_missions(planner(), missions, KEY)
