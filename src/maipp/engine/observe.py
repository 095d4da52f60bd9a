"""The first half of an event: whose turn it is, whom that agent hears, and what it knows."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import KERNELS, Belief, condition_near
from maipp.belief.prior_samples import Measurements
from maipp.engine.decision import AgentView, Knowledge, Observation
from maipp.engine.mission import Mission
from maipp.engine.rows import pick, put
from maipp.engine.state import State, known_by, positions
from maipp.renamed import renamed
from maipp.roadmap import Roadmap
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float, Index, Point, Real

# Measurements ahead that planners look; one and two were worse at 5,000 measurements, in which plan came out best.
_AHEAD = 4


def time_tolerance(speeds: Float[Array | np.ndarray, " m"]) -> Float[Array, ""] | float:
    """The distance tolerance as a time: arrivals closer than this are simultaneous."""
    return DISTANCE_TOLERANCE / speeds.max()


def window_reach(interval: Real) -> Real:
    """How far around an agent a belief of limited capacity favours no measurement, domain units."""
    return _AHEAD * interval


def due_agent(mission: Mission, state: State) -> Index:
    """The agent that arrives first; agents that arrive together decide in the order of their index."""
    arrival = jnp.where(state.active, state.arrival, jnp.inf)
    return jnp.argmax(arrival <= jnp.min(arrival) + time_tolerance(mission.params.speeds)).astype(jnp.int32)


def hear(mission: Mission, state: State, agent: Index) -> tuple[State, Bool[Array, " m"]]:
    """The state after `agent` took over what everyone within range knows now, and whom it heard.

    With a limited range an agent takes over all measurements that the heard ones know at this moment: their own and
    those they had taken over at their last decision (docs/protocol.md, "limited communication").
    """
    shape, params = mission.shape, mission.params
    everyone = jnp.arange(shape.agents)
    within = params.present
    if shape.limited:
        where = positions(state, params.speeds)
        offset = where - pick(where, agent)
        within &= jnp.sum(offset * offset, axis=-1) <= params.comm_range**2
    # Whoever is heard tells all that it has measured by now: none is known before the moment it is taken.
    now = state.time + time_tolerance(params.speeds)
    if shape.limited:
        hearing = within | (everyone == agent)
        taken_over = jnp.max(jnp.where(hearing[:, None], state.known_until, -jnp.inf), axis=0)
        learned = jnp.where(hearing, now, taken_over)
    else:
        learned = now[None]
    known_until = put(state.known_until, agent, learned, jnp.asarray(True))
    return dataclasses.replace(state, known_until=known_until), within & (everyone != agent)


def knowledge(mission: Mission, state: State, agent: Index, heard: Bool[Array, " m"]) -> Knowledge:
    """What `agent`, which has heard these, knows at `state.time`."""
    where = positions(state, mission.params.speeds)
    slots = jnp.arange(mission.shape.agents * mission.shape.slots)
    return Knowledge(
        agent=agent,
        time=state.time,
        position=pick(where, agent),
        start=pick(mission.start, agent),
        budget=pick(mission.params.budgets, agent),
        odometer=pick(state.odometer, agent),
        homeward=pick(state.homeward, agent),
        next_measurement=(pick(state.taken, agent) + 1) * mission.params.measurement_interval,
        speed=pick(mission.params.speeds, agent),
        measurement_x=state.measurement_x.reshape(-1, 2),
        measurement_y=state.measurement_y.reshape(-1),
        measurement_time=state.measurement_time.reshape(-1),
        measured_by=slots // mission.shape.slots,
        known=known_by(state, agent).reshape(-1),
        heard=heard,
        messages=state.messages,
        positions=where,
    )


def with_prior(
    mission: Mission, x: Float[Array, "s 2"], y: Float[Array, " s"], known: Bool[Array, " s"]
) -> Measurements:
    """The known measurements, and after them the samples from before the survey, which everybody knows."""
    if mission.prior is None:  # decided while tracing: without a prior nothing is added to the computation
        return Measurements(x, y, known)
    return mission.prior.after(x, y, known, mission.params.noise)


def belief_near(mission: Mission, known: Measurements, query: Float[Array, "q 2"], place: Point) -> Belief:
    """What these measurements give at `query`; of very many, those that tell most of `place` are in its slots."""
    params = mission.params
    return condition_near(
        KERNELS[mission.shape.kernel](params.length_scale, params.signal_variance, params.warp),
        known.x,
        known.y,
        known.mask,
        query,
        params.noise,
        known.extra_noise,
        near=place,
        reach=window_reach(params.measurement_interval),
        capacity=mission.shape.belief_capacity,
    )


def _beliefs(
    mission: Mission, known: Measurements, roadmap: Roadmap | None, place: Point
) -> tuple[Belief, Belief | None]:
    """What these measurements give on the evaluation grid, and at the nodes of a roadmap if there is one."""
    if roadmap is None:
        return belief_near(mission, known, mission.grid, place), None
    nodes = jnp.asarray(roadmap.nodes)
    if known.x.shape[0] <= mission.shape.belief_capacity:
        belief = belief_near(mission, known, mission.grid, place)
        return belief, belief.on(nodes)
    # Together: the tiles that serve the grid take a few more points each, and others for the nodes as long again.
    both = belief_near(mission, known, jnp.concatenate([mission.grid, nodes]), place)
    points = mission.grid.shape[0]
    return both.at(jnp.arange(points)), both.at(points + jnp.arange(nodes.shape[0]))


def observe(mission: Mission, known: Knowledge) -> Observation:
    """What an agent observes that knows this. Parts a planner does not read are never computed (dead code in XLA)."""
    all_known = with_prior(mission, known.measurement_x, known.measurement_y, known.known)
    times, by = known.measurement_time, known.measured_by
    if mission.prior is not None:
        old = mission.prior.y.shape[0]
        times = jnp.concatenate([times, jnp.full(old, -jnp.inf, times.dtype)])
        by = jnp.concatenate([by, jnp.full(old, -1, by.dtype)])
    slots = {
        "measurement_x": all_known.x,
        "measurement_y": all_known.y,
        "measurement_time": times,
        "measured_by": by,
        "known": all_known.mask,
    }
    roadmap = jax.tree.map(lambda a: a[known.agent], mission.roadmap)
    belief, at_nodes = _beliefs(mission, all_known, roadmap, known.position)
    return Observation(
        **{each.name: getattr(known, each.name) for each in dataclasses.fields(AgentView)} | slots,
        remaining=known.budget - pick(mission.params.reserves, known.agent) - known.odometer,
        to_next_measurement=known.next_measurement - known.odometer,
        belief=belief,
        inside=mission.inside,
        roadmap=roadmap,
        at_nodes=at_nodes,
        home=mission.home_of(known.agent),
    )


def begin_event(mission: Mission, state: State) -> tuple[State, Index, Observation]:
    """The first half of an event: the state once the due agent has heard the others, who that is, what it observes."""
    agent = due_agent(mission, state)
    running = jnp.any(state.active)
    now = jnp.where(running, pick(state.arrival, agent), state.time)
    state = dataclasses.replace(state, time=jnp.maximum(state.time, now))
    heard_state, heard = hear(mission, state, agent)
    state = jax.tree.map(lambda new, old: jnp.where(running, new, old), heard_state, state)
    return state, agent, observe(mission, knowledge(mission, state, agent, heard))


renamed(__name__, turn="begin_event")
