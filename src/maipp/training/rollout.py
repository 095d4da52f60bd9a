"""Sampling: missions stepped together, one decision each at a time, begun anew as soon as they end."""

import dataclasses
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from maipp.engine.advance import advance
from maipp.engine.observe import begin_event
from maipp.engine.state import State, reset
from maipp.policy import Memory
from maipp.scenario import Scenario
from maipp.training.config import TrainConfig
from maipp.training.search import Elites, PolicyPlanner, find_elites
from maipp.training.teacher import no_plan, teach
from maipp.training.worlds import Bank, TrainingWorld, agent_roadmap, draw_world, mission_of
from maipp.typing import Array, Bool, Float, Index, Int, Key

# What an update learns from: the teacher, the policy's own search, or the reward.
Phase = Literal["imitate", "search", "reinforce"]


class RolloutState(NamedTuple):
    """A mission in progress and the world it is in."""

    world: TrainingWorld
    state: State
    plans: Float[Array, "m h"]  # the teacher's last plan for each agent


class Transition(NamedTuple):
    """One decision, as the update needs it. The encoding is not kept: the bank has it."""

    features: Float[Array, "n 5"]
    roadmap: Index  # row of the bank
    agent: Index
    signs: Float[Array, " e"]
    node: Index
    neighbours: Int[Array, " k"]
    allowed: Bool[Array, " k"]
    neighbour_std: Float[Array, " k"]
    remaining: Float[Array, ""]
    threshold: Float[Array, ""]
    memory: Memory
    index: Index  # the neighbour chosen
    log_probability: Float[Array, ""]  # of it, by the policy
    value: Float[Array, ""]
    lesson: Float[Array, " k"]  # the teacher's choice, or that of the best path; zero without either
    elites: Elites | None  # the best paths, where it learns from them
    trace: Float[Array, ""]  # Tr(P) of the agent's belief when it decided
    stopped: Bool[Array, ""]  # it had nowhere to go: the end of its mission
    ended: Bool[Array, ""]  # it was the last of its team


def new_environment(
    config: TrainConfig, scenario: Scenario, planner: PolicyPlanner, bank: Bank, key: Key
) -> RolloutState:
    """A fresh mission in a world of its own."""
    world = draw_world(config, scenario, bank, key)
    plans = jnp.broadcast_to(no_plan(), (scenario.agents, *no_plan().shape))
    return RolloutState(world, reset(planner, mission_of(config, bank, world)), plans)


def step(
    config: TrainConfig,
    scenario: Scenario,
    planner: PolicyPlanner,
    bank: Bank,
    environment: RolloutState,
    key: Key,
    phase: Phase,
    follow: float | Float[Array, ""],
) -> tuple[RolloutState, Transition]:
    """One decision. `follow` is the probability of doing as the teacher, or the search, says.

    The last agent to stop knows all measurements of a team without range limits: its trace is the final one.
    """
    world, state, plans = environment
    act_key, teach_key, follow_key, pick_key, new_key = jax.random.split(key, 5)
    mission = mission_of(config, bank, world)
    state, agent, observation = begin_event(mission, state)
    observation = dataclasses.replace(observation, roadmap=agent_roadmap(bank, world, agent))
    memory = jax.tree.map(lambda a: a[agent], state.memory)
    planner = planner.on(mission.problem)
    decision, choice = planner.act(act_key, observation, memory)
    view, index = choice.view, choice.index
    lesson = jnp.zeros(view.allowed.shape, jnp.float32)
    elites = None
    if phase == "imitate":
        advice = teach(mission.problem, teach_key, observation, planner.counted(observation), view, plans[agent])
        lesson, plans = advice.choice.astype(jnp.float32), plans.at[agent].set(advice.plan)
    elif phase == "search":
        elites = find_elites(config, planner, teach_key, observation, choice)
        lesson = jax.nn.one_hot(elites.index[0, 0], len(lesson)) * elites.taken[0, 0]
    if phase != "reinforce":
        obey = jax.random.bernoulli(follow_key, follow) & view.allowed.any()
        taught = jax.random.categorical(pick_key, jnp.log(jnp.maximum(lesson, 1e-30))).astype(jnp.int32)
        index = jnp.where(obey, taught, index)
        target = jnp.asarray(observation.roadmap.nodes)[view.neighbours[index]]  # type: ignore[union-attr]
        decision = dataclasses.replace(decision, waypoints=jnp.where(obey, target[None], decision.waypoints))
    after = advance(planner, mission, state, agent, decision)
    ended = ~after.active.any() | after.full.any()  # a route of so many decisions leads nowhere
    transition = Transition(
        features=view.features.astype(jnp.float32),
        roadmap=world.roadmap,
        agent=agent,
        signs=world.signs,
        **{name: getattr(view, name) for name in ("node", "neighbours", "allowed", "neighbour_std", "remaining")},
        threshold=view.threshold,
        memory=choice.memory,
        index=index,
        log_probability=choice._replace(index=index).log_probability,
        value=choice.insight.value,
        lesson=lesson,
        elites=elites,
        trace=planner.interest.trace(observation.belief.mean, observation.belief.variance, observation.inside),
        stopped=~view.allowed.any(),
        ended=ended,
    )
    fresh = new_environment(config, scenario, planner, bank, new_key)
    going = RolloutState(world, after, plans)
    return jax.tree.map(lambda new, old: jnp.where(ended, new, old), fresh, going), transition


def roll_out(
    config: TrainConfig,
    scenario: Scenario,
    planner: PolicyPlanner,
    bank: Bank,
    environments: RolloutState,
    key: Key,
    phase: Phase,
    follow: float | Float[Array, ""],
) -> tuple[RolloutState, Transition]:
    """`config.events` decisions of each of a shard's missions; transitions have leading axes (events, missions)."""

    def event(environments: RolloutState, key: Key) -> tuple[RolloutState, Transition]:
        keys = jax.random.split(key, config.missions)
        return jax.vmap(lambda e, k: step(config, scenario, planner, bank, e, k, phase, follow))(environments, keys)

    return lax.scan(event, environments, jax.random.split(key, config.events))
