"""Driven by a planner's choices, both environments go through the planner's own survey, and reward what it did."""

from typing import Any, get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("pettingzoo")

import maipp  # noqa: E402
import maipp.adapters.pettingzoo as environments  # noqa: E402
from maipp import Scenario  # noqa: E402
from maipp.engine import Decision, Planner  # noqa: E402
from maipp.engine.reward import RewardKind, final_reward, reward  # noqa: E402
from maipp.engine.state import route_capacity  # noqa: E402
from maipp.planners.roadmap.edges import roadmap_of  # noqa: E402
from maipp.roadmap import nearest_node  # noqa: E402
from tests.conftest import slow  # noqa: E402

surveys: Any = environments  # its observations are arrays or dictionaries, by the options
ALIKE = Scenario(agents=3, budget=1.2, grid=8, nodes=14, neighbours=4)
# Unequal robots that seldom hear each other: what is known, and who is due when, depends on the order of events.
UNEQUAL = ALIKE.replace(budget=(1.2, 0.9, 1.1), speed=(1.0, 0.7, 1.3), comm_range=0.3, last_leg="stop")
# Two zones between which a leg fits.
ZONES = UNEQUAL.replace(
    obstacles=(((0.3, 0.0), (0.4, 0.0), (0.4, 0.6), (0.3, 0.6)), ((0.7, 0.4), (0.8, 0.4), (0.8, 1.0))),
    start=(0.1, 0.1),
    last_leg="cut",
)


class Recorded(Planner):
    """A planner that writes down which neighbour it chose at each decision, and Tr(P) of the agent's belief then."""

    inner: Planner

    uses_roadmap = True
    avoids_obstacles = True

    def empty_message(self):
        return self.inner.empty_message()

    def initial_memory(self):
        room = route_capacity(self.scenario, self)
        return self.inner.initial_memory(), jnp.int32(0), jnp.zeros(room, jnp.int32), jnp.zeros(room)

    def decide(self, key, observation, memory):
        own, count, choices, traces = memory
        decision = self.inner.decide(key, observation, own)
        roadmap, belief = roadmap_of(observation), observation.belief
        targets = roadmap.nodes[roadmap.neighbours[nearest_node(roadmap, observation.position)]]
        choice = jnp.argmin(jnp.sum((targets - decision.waypoints[0]) ** 2, axis=-1)).astype(jnp.int32)
        trace = self.interest.trace(belief.mean, belief.variance, observation.inside)
        record = decision.memory, count + 1, choices.at[count].set(choice), traces.at[count].set(trace)
        return Decision(decision.waypoints, decision.message, record, decision.stop)


def planner_survey(scenario, name, seed):
    """The final state of a registered planner's survey, and what each agent chose and knew; the last time, it stopped.

    Both are lists by agent: the indices of neighbours, and Tr(P) at each decision.
    """
    planner = Recorded(scenario, maipp.make_planner(name, scenario))
    missions = maipp.draw_missions(scenario, seed=seed, instances=1, planner=planner)
    final = maipp.run_missions(planner, missions, jax.random.key(seed))
    _, counts, choices, traces = jax.tree.map(lambda a: np.asarray(a)[0], final.memory)
    chosen = [row[: count - 1].tolist() for row, count in zip(choices, counts, strict=True)]
    return final, chosen, [row[:count] for row, count in zip(traces, counts, strict=True)]


class Play:
    """Plays given choices in an environment, and writes down what each agent was told whenever it had arrived."""

    def __init__(self, env, chosen):
        self.env, self.left = env, dict(zip(env.possible_agents, map(iter, chosen), strict=True))
        self.rewards, self.traces = ({name: [] for name in env.possible_agents} for _ in range(2))

    def told(self, name, reward, info):
        self.rewards[name].append(reward)
        self.traces[name].append(info["trace"])

    def in_turns(self, seed):
        self.env.reset(seed=seed)
        for name in self.env.agent_iter():
            _, reward, terminated, truncated, info = self.env.last()
            self.told(name, reward, info)
            self.env.step(None if terminated or truncated else next(self.left[name]))

    def together(self, seed):
        _, infos = self.env.reset(seed=seed)
        rewards = dict.fromkeys(self.env.agents, 0.0)
        while True:
            for name, info in infos.items():
                if info["travelling"]:
                    assert rewards[name] == 0.0
                else:
                    self.told(name, rewards[name], info)
            if not self.env.agents:
                return
            actions = {name: next(self.left[name]) for name in self.env.agents if not infos[name]["travelling"]}
            _, rewards, *_, infos = self.env.step(actions)


def numbers(state):
    """All fields that do not depend on the planner."""
    names = set(state.__dataclass_fields__) - {"messages", "memory"}
    return {name: np.asarray(getattr(state, name))[0] for name in sorted(names)}


@pytest.mark.parametrize(
    ("scenario", "name"),
    [(ALIKE, "shared-greedy"), (UNEQUAL, "random"), (ZONES, "shared-greedy"), (ZONES, "random")],
    ids=["alike", "unequal", "zones", "zones random"],
)
@pytest.mark.parametrize("seed", [5, slow(6)])
def test_a_planner_s_choices_give_its_survey_and_the_rewards_of_its_traces(scenario, name, seed):
    final, chosen, traces = planner_survey(scenario, name, seed)
    assert sum(map(len, chosen)) >= 8
    for kind in get_args(RewardKind):
        for make, way in ((surveys.aec_env, Play.in_turns), (surveys.parallel_env, Play.together)):
            play = Play(make(scenario, reward=kind, masked="raise"), chosen)
            way(play, seed)
            missions, state = play.env.simulator_state()
            for key, value in numbers(final).items():
                np.testing.assert_allclose(numbers(state)[key], value, atol=1e-5, err_msg=key)
            expected = maipp.score_missions(missions, final)
            np.testing.assert_allclose(play.env.metrics().own_trace, expected.own_trace, rtol=1e-3)
            assert play.env.episode().decisions == int(final.events[0])
            for agent, seen in zip(play.env.possible_agents, traces, strict=True):
                assert next(play.left[agent], None) is None, "the survey ended before all choices were made"
                np.testing.assert_allclose(play.traces[agent], seen, rtol=1e-4)
                wanted = np.zeros(len(seen))
                wanted[1:] = reward(kind, jnp.asarray(seen[:-1]), jnp.asarray(seen[1:]))
                wanted[-1] += float(final_reward(kind, float(seen[-1])))
                np.testing.assert_allclose(play.rewards[agent], wanted, atol=1e-4)
