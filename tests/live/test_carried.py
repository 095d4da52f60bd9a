"""Messages and memories in a team of another size."""

import jax
import numpy as np
import pytest

from maipp.live.carried import carried
from maipp.live.robot_state import RobotState
from maipp.live.units import Units
from maipp.live.world import draw_world, make_setup
from maipp.live.worlds import Worlds
from maipp.planners import make_planner
from maipp.scenario import Scenario
from tests.conftest import TINY_PLANNERS


def shapes(tree):
    return [np.shape(leaf) for leaf in jax.tree.leaves(tree)]


def filled(tree, value):
    return jax.tree.map(lambda leaf: np.full_like(leaf, value), tree)


def nothing_of(planner, agents, options=None):
    scenario = Scenario(agents=agents, start=(0.5, 0.5), grid=8, nodes=12, neighbours=4)
    built = make_planner(planner, scenario, options)
    return jax.device_get((built.empty_message(), built.initial_memory()))


def robot_of(nothing):
    one = RobotState("a", 1.0, 1.0, filled(nothing[0], 3), filled(nothing[1], 4), earlier=filled(nothing[1], 5))
    one.arrivals = 2
    return one


@pytest.mark.parametrize("planner", TINY_PLANNERS)
def test_every_planner_s_memory_grows_with_the_team(planner):
    before, after = (nothing_of(planner, agents, TINY_PLANNERS[planner]) for agents in (2, 3))
    one = robot_of(before)
    (other,), forgot = carried([one], before, after, (2, 3), fresh=False)
    assert forgot == [] and other is not one
    for tree, like, value in ((other.message, after[0], 3), (other.memory, after[1], 4), (other.earlier, after[1], 5)):
        assert shapes(tree) == shapes(like)
        for leaf, new, old in zip(*map(jax.tree.leaves, (tree, like, before[tree is not other.message])), strict=True):
            kept = leaf if np.shape(old) == np.shape(new) else leaf[:2]
            assert (kept == np.asarray(value, leaf.dtype)).all()
            if kept is not leaf:
                np.testing.assert_array_equal(leaf[2:], new[2:])


def test_what_has_another_form_begins_anew_and_is_told():
    """From five robots on `receding-horizon` plans fewer legs."""
    before, after = (nothing_of("receding-horizon", agents) for agents in (4, 5))
    (other,), forgot = carried([robot_of(before)], before, after, (4, 5), fresh=False)
    assert forgot == ["memories", "messages"]
    for tree, like in ((other.message, after[0]), (other.memory, after[1]), (other.earlier, after[1])):
        jax.tree.map(np.testing.assert_array_equal, tree, like)
    (new,), forgot = carried([RobotState("a", 1.0, 1.0, *before)], before, after, (4, 5), fresh=False)
    assert forgot == [] and shapes(new.memory) == shapes(after[1])  # it had nothing to forget


def test_a_sweep_that_was_changed_is_begun_anew():
    nothing = nothing_of("lawnmower", 2)
    (other,), forgot = carried([robot_of(nothing)], nothing, nothing, (2, 2), fresh=True)
    assert forgot == ["memories"] and other.memory == other.earlier == 0


@pytest.mark.parametrize("planner", ["receding-horizon", "intent-search", "intent-paths", "lawnmower"])
def test_what_a_planner_begins_with_is_known_without_making_it(planner):
    scenario = Scenario(agents=4, start=(0.5, 0.5), grid=8, nodes=12, neighbours=4)
    options = {"weights": "untrained"} if planner in ("intent-paths", "intent-search") else {}
    built = make_planner(planner, scenario, options)
    setup = make_setup(scenario, planner, options, 0, ["a", "b", "c", "d"], Units(scenario.extent))
    worlds = Worlds(draw_world(built, scenario, 0), setup)
    jax.tree.map(np.testing.assert_array_equal, worlds.nothing(5), nothing_of(planner, 5, options))
