"""A run that keeps what was told takes the same course as one that does not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.engine import draw_missions, run_missions
from maipp.engine.episode import Episode
from maipp.engine.rollout import Events, run_recorded
from maipp.planners import make_planner
from maipp.planners.announced.announcement import Announcement, TeamPlan
from maipp.planners.announced.recorded_messages import broadcasts_of, tells_plans, whole_message
from maipp.scenario import Scenario
from maipp.team import Intent

SCENARIO = Scenario(agents=2, budget=0.8, grid=8, nodes=12, neighbours=4)


@pytest.fixture(scope="module")
def survey():
    planner = make_planner("sga-rrt", SCENARIO, {"nodes": 12})
    missions = draw_missions(SCENARIO, seed=1, instances=1, roadmaps=False)
    key = jax.random.key(2)
    return run_recorded(planner, missions, key, whole_message), run_missions(planner, missions, key), missions


def test_the_survey_is_the_same(survey):
    (recorded, _), states, _ = survey
    np.testing.assert_array_equal(recorded.known, states.known)
    np.testing.assert_array_equal(recorded.events, states.events)
    for field in ("route", "route_time", "measurement_x", "measurement_y", "measurement_time"):
        # Two programs: where one fuses a product and a sum, the other rounds between them (1 ulp a leg, a dozen legs).
        np.testing.assert_allclose(getattr(recorded, field), getattr(states, field), rtol=2e-6, atol=2e-6)


def test_every_decision_has_its_entry_in_order(survey):
    (_, recorded), states, missions = survey
    episode = Episode.from_state(SCENARIO, "sga-rrt", {}, 1, missions, states)
    told = broadcasts_of(recorded)
    times = [entry.time for entry in told]
    assert times == sorted(times) and times[0] == 0
    for index, agent in enumerate(episode.agents):
        own = [entry for entry in told if entry.agent == index]
        assert len(own) == agent.decisions
        # A decision is taken where a leg ended, and the last one is to stop.
        assert all(np.isclose(agent.route_time, entry.time, atol=1e-6).any() for entry in own)
        assert not np.isfinite(own[-1].place_times).any()


def test_the_next_measurement_is_announced_where_it_will_be_taken(survey):
    (_, recorded), states, _ = survey
    places, times = np.asarray(states.measurement_x)[0], np.asarray(states.measurement_time)[0]
    entries = [entry for entry in broadcasts_of(recorded) if np.isfinite(entry.place_times[0])]
    assert len(entries) > 2
    for entry in entries:
        # The first one lies on the leg that is travelled now.
        slot = np.argmin(np.abs(times[entry.agent] - entry.place_times[0]))
        np.testing.assert_allclose(places[entry.agent, slot], entry.places[0], atol=1e-4)
        assert entry.place_times[0] > entry.time and np.isnan(entry.mean).all()


def made_up(message):
    kept = jax.tree.map(lambda a: np.asarray(a)[None, None], message)
    return Events(np.zeros((1, 1), int), np.ones((1, 1), bool), np.zeros((1, 1)), kept)


def test_intents_and_team_plans_are_read():
    (told,) = broadcasts_of(made_up(Intent(jnp.array([0.1, 0.2]), jnp.array([1.0, 0.5, 2.0]))))
    np.testing.assert_allclose(told.mean, [0.1, 0.2], rtol=1e-6)
    np.testing.assert_allclose(told.covariance, [1.0, 0.5, 2.0])
    assert len(told.places) == 0
    legs = Announcement(jnp.ones((2, 2)), jnp.array([1.0, jnp.inf]))
    (told,) = broadcasts_of(made_up(TeamPlan(legs, jnp.zeros(()))))
    np.testing.assert_array_equal(told.place_times, [1.0, np.inf])
    with pytest.raises(TypeError, match="neither an intent nor an announced path"):
        broadcasts_of(made_up(jnp.zeros(2)))


def test_only_planners_that_tell_plans_are_recorded():
    assert tells_plans(make_planner("sga-rrt", SCENARIO, {"nodes": 12}))
    assert not tells_plans(make_planner("random", SCENARIO, {}))
    assert not tells_plans(
        make_planner("shared-greedy", SCENARIO, {})
    )  # a bare node, as any planner's message could be
