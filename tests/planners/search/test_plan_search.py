"""How far plans in the plane look, and how far they trust what is not measured yet."""

import jax.numpy as jnp
import numpy as np
import pytest

from maipp.errors import InputError
from maipp.planners import make_planner
from maipp.planners.search.plan_search import PlanSearch
from maipp.scenario import Scenario


@pytest.mark.parametrize(("agents", "legs"), [(1, 8), (3, 8), (4, 8), (5, 4), (6, 3), (7, 2), (10, 2), (100, 2)])
def test_the_more_agents_the_fewer_legs_each_plans(agents, legs):
    assert PlanSearch(Scenario(agents=agents)).legs == legs
    assert PlanSearch(Scenario(agents=agents), horizon=5).legs == 5


@pytest.mark.parametrize("name", ["receding-horizon", "intent-search"])
def test_agents_announce_as_many_measurements_as_they_plan(name):
    for agents, options, legs in ((3, {}, 8), (10, {}, 2), (10, {"horizon": 3}, 3), (10, {"horizon": "none"}, 2)):
        planner = make_planner(name, Scenario(agents=agents), options)
        assert planner.empty_message().points.shape == (legs, 2)


# Expected with these: what the scenario or the option says the plans trust.
@pytest.mark.parametrize(
    ("scenario", "given", "trusted"),
    [
        (Scenario(length_scale=0.45), None, 0.3),
        (Scenario(length_scale=0.4), None, 0.3),
        (Scenario(length_scale=0.2), None, 0.075),
        (Scenario(length_scale=0.1, measurement_interval=0.05), None, 0.3),
        (Scenario(length_scale=0.2), 0.5, 0.5),
        (Scenario(length_scale=0.45, virtual_value="zero"), 0.5, 0.0),
    ],
)
def test_plans_trust_the_spread_of_fields_they_resolve(scenario, given, trusted):
    search = PlanSearch(scenario, spread=given)
    rng = np.random.default_rng(0)
    mean, known = (jnp.asarray(rng.uniform(0, 1, 50), jnp.float32) for _ in range(2))
    inside = jnp.ones(50, bool)
    expected = search.objective.interest.expected_trace(
        mean, 0.3 * known, known, inside, spread=trusted, blur=search.blur
    )
    np.testing.assert_allclose(search.objective.expected(mean, 0.3 * known, known, inside), expected, rtol=1e-6)


@pytest.mark.parametrize(("agents", "decisions"), [(1, 1), (5, 1), (6, 2), (10, 2)])
def test_many_agents_plan_twice_on_the_way_of_each_leg(agents, decisions):
    assert PlanSearch(Scenario(agents=agents)).decisions_per_leg == decisions
    assert PlanSearch(Scenario(agents=agents), decisions=3).decisions_per_leg == 3


@pytest.mark.parametrize(("option", "value"), [("horizon", 0), ("decisions", 0), ("decisions", 5), ("spread", -0.1)])
def test_no_legs_and_less_than_no_trust_are_refused(option, value):
    with pytest.raises(InputError, match=f"{option}={value}: .*or none"):
        make_planner("receding-horizon", Scenario(), {option: value})
