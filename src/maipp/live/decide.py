"""One decision of one robot, compiled: what it knows becomes an `Observation`, and the planner's answer a leg."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.belief import condition_near
from maipp.engine.decision import Observation
from maipp.engine.observe import window_reach
from maipp.engine.polyline import cut_leg
from maipp.live.world import World
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Index


class Situation(NamedTuple):
    """What is known when a robot arrives."""

    agent: Index
    arrival: Index  # decisions taken for it before: with the seed and the agent, the source of randomness
    time: Float[Array, ""]  # the scenario's time
    budget: Float[Array, ""]  # domain units
    remaining: Float[Array, ""]
    to_next_measurement: Float[Array, ""]
    x: Float[Array, "n 2"]  # measured positions, domain units
    y: Float[Array, " n"]  # standardised values
    mask: Bool[Array, " n"]  # slots that hold a measurement
    heard: Bool[Array, " m"]  # agents whose messages count
    positions: Float[Array, "m 2"]  # where all agents are, its own included
    messages: Any  # leading axis m
    memory: Any


class Outcome(NamedTuple):
    """What was decided."""

    leg: Float[Array, "v 2"]  # from the position through the waypoints, cut at the budget
    length: Float[Array, ""]  # of the leg
    go: Bool[Array, ""]  # False: stop here
    message: Any
    memory: Any


@eqx.filter_jit
def decide(world: World, situation: Situation) -> Outcome:
    """The planner's decision in a situation, cut at the budget as the engine does."""
    scenario, planner = world.scenario, world.planner
    agent = situation.agent
    position = situation.positions[agent]
    belief = condition_near(
        world.kernel,
        situation.x,
        situation.y,
        situation.mask,
        world.grid,
        scenario.noise,
        world.extra_noise(len(situation.y)),
        near=position,
        reach=window_reach(scenario),
        capacity=scenario.belief_capacity,
    )
    observation = Observation(
        agent=agent,
        time=situation.time,
        position=position,
        start=world.start[agent],
        budget=situation.budget,
        remaining=situation.remaining,
        speed=world.speeds[agent],
        to_next_measurement=situation.to_next_measurement,
        measurement_x=situation.x,
        measurement_y=situation.y,
        known=situation.mask,
        belief=belief,
        inside=world.inside,
        heard=situation.heard,
        messages=situation.messages,
        positions=situation.positions,
        roadmap=jax.tree.map(lambda a: a[agent], world.roadmap),
    )
    key = jax.random.fold_in(jax.random.fold_in(world.key, agent), situation.arrival)
    decision = planner.decide(key, observation, situation.memory)
    leg, reach = cut_leg(scenario, position, decision.waypoints, situation.remaining)
    go = ~jnp.asarray(decision.stop, bool) & (reach[-1] > DISTANCE_TOLERANCE)
    return Outcome(leg, reach[-1], go, decision.message, decision.memory)
