"""The Tr(P) expected under what is foreseen."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from maipp.belief import Interest
from maipp.errors import InputError
from maipp.foresight import Law
from maipp.foresight.protocol import trusted_spread
from maipp.planners import make_planner
from maipp.planners.search.plan_search import PlanSearch
from maipp.planners.search.prospect import Prospect
from maipp.problem import problem_of
from maipp.scenario import Scenario

POINTS, BLUR = 50, 0.005


@pytest.fixture(scope="module")
def case():
    """Mean and variance of a belief, what a plan leaves of the variance, and a law of the truth."""
    rng = np.random.default_rng(0)
    mean, known = (jnp.asarray(rng.uniform(0, 1, POINTS), jnp.float32) for _ in range(2))
    left = known * jnp.asarray(rng.uniform(0, 1, POINTS), jnp.float32)
    law = Law(mean + jnp.asarray(rng.normal(0, 0.2, POINTS), jnp.float32), jnp.asarray(rng.uniform(0, 0.3, POINTS)))
    return mean, known, left, law


def expected(prospect, left, known, aim, interest=None):
    inside = jnp.arange(POINTS) % 7 > 0
    return prospect.expected_trace(interest or Interest(), left, known, inside, aim=aim, blur=BLUR), inside


def test_the_protocol_s_foresight_changes_nothing(case):
    """Its law, aimed at nothing, is what `receding-horizon` counts on: the same sums, rounded otherwise."""
    mean, known, left, _ = case
    search = PlanSearch(Scenario())
    assert search.foreseer is None and PlanSearch(Scenario(), aim=0.0).foreseer is None  # nothing is worked out

    law = Law(mean, trusted_spread(Scenario()) * jnp.sqrt(known))  # as `ProtocolForesight` gives it
    prospect = Prospect(mean, law, law.above(0.4))
    value, inside = expected(prospect, left, known, 0.0)
    np.testing.assert_allclose(value, search.objective.expected(mean, left, known, inside), rtol=1e-5)


def test_it_is_what_draws_of_the_law_leave(case):
    """Of 40,000 futures, within five standard errors of their mean, with half of the aim and without.

    The border is smoothed by `blur`, which is drawn with.
    """
    mean, known, left, law = (np.asarray(each, np.float64) for each in (*case[:3], np.stack(case[3])))
    rng, told = np.random.default_rng(1), 1.0 - left / known
    truth, deviation = law
    shape = 40_000, POINTS
    after = mean + told * (truth - mean) + rng.normal(size=shape) * np.sqrt(told * deviation**2 + BLUR**2)
    predicted = after + np.sqrt(left) >= 0.4
    high = truth + rng.normal(size=shape) * deviation >= 0.4
    prospect = Prospect(case[0], case[3], case[3].above(0.4))
    for aim in (0.0, 0.5):
        value, inside = expected(prospect, case[2], case[1], aim)
        traces = (((1 - aim) * predicted + aim * high) * np.where(inside, left, 0.0)).sum(axis=1)
        assert abs(traces.mean() - float(value)) < 5 * traces.std() / shape[0] ** 0.5


def test_its_slope_is_finite_where_all_is_known(case):
    """At points that nothing is left to learn of, before the plan or after it, and a law that is certain."""
    mean, known, left, law = case
    known, left = known.at[:3].set(0.0), left.at[:6].set(0.0)
    law = Law(law.mean, law.deviation.at[::2].set(0.0))
    prospect = Prospect(mean, law, law.above(0.4))
    for rule in ("std", "variance"):
        slope = jax.grad(lambda left, rule=rule: expected(prospect, left, known, 0.4, Interest(rule=rule))[0])(left)
        assert np.isfinite(slope).all() and np.abs(slope).max() > 0


@pytest.mark.parametrize("name", ["receding-horizon", "intent-paths", "intent-search"])
def test_options_that_make_no_sense_are_refused(name):
    weights = {} if name == "receding-horizon" else {"weights": "untrained"}
    for options, told in (
        ({"aim": -0.1}, "aim=-0.1: give a number from 0 to 1"),
        ({"foresight": "fitted", "aim": 1.5}, "aim=1.5"),
        ({"foresight": "gipsy"}, "foresight"),
    ):
        with pytest.raises(InputError, match=told):
            make_planner(name, Scenario(), weights | options)
    with pytest.raises(InputError, match="spread of its own"):
        make_planner(name, Scenario(), weights | {"spread": 0.5, "foresight": "fitted"})
    if name == "intent-paths":
        with pytest.raises(InputError, match="give rank=expected"):
            make_planner(name, Scenario(), weights | {"rank": "intents", "foresight": "fitted"})


def test_a_foresight_is_that_of_the_planner_s_scenario():
    wide = Scenario(extent=(2.0, 1.0))
    search = PlanSearch(Scenario(), foresight="fitted")
    assert search.foreseer is not None and search.foreseer.scenario == Scenario()
    moved = dataclasses.replace(search, scenario=wide).foreseer
    assert moved is not None and moved.scenario == wide
    with pytest.raises(InputError, match="made of a scenario"):
        PlanSearch(problem_of(wide), foresight="fitted")
