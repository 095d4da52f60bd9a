"""The state of a mission in progress, and where everybody is in it."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from maipp.engine.decision import Planner
from maipp.engine.mission import Mission
from maipp.engine.polyline import along
from maipp.engine.rows import pick
from maipp.problem import ScenarioLike
from maipp.roadmap.home import WAYPOINTS
from maipp.typing import Array, Bool, Float, Index, Int

# What an agent does, or why it stopped. Two are the engine's doing with budget left, NOT_FINITE and RECORD_FULL: a
# fault of the planner, or of its steps.
TRAVELLING = 0
BY_PLANNER = 1  # its planner said so
SPENT = 2  # no budget left, or its planner wanted to go nowhere
NOT_FINITE = 3  # its planner named a waypoint that is not a finite number
RECORD_FULL = 4  # its record of the route holds no more vertices
AT_HOME = 5  # it has turned for home in time, and is there
HOMEWARD = 6  # it travels: its leg ends on the way home, which it follows to its end
ABSENT = 7  # it takes no part; this one and HOMEWARD are no reasons to stop
UNDER_WAY = TRAVELLING, HOMEWARD
REASONS = (None, "planner", "budget", "not-finite", "record-full", "home")  # the same in records of a survey


class State(eqx.Module):
    """Everything that changes during a mission. Shapes depend on the scenario and the planner's options only."""

    time: Float[Array, ""]  # of the last event
    events: Int[Array, ""]  # decisions taken so far by the team
    status: Int[Array, " m"]  # what each agent does, or why it stopped, int8: TRAVELLING to ABSENT
    leg: Float[Array, "m v 2"]  # polyline each agent travels: departure point, then w waypoints
    departure: Float[Array, " m"]  # time it left leg[:, 0]
    arrival: Float[Array, " m"]  # time it reaches leg[:, -1]
    odometer: Float[Array, " m"]  # distance travelled on arrival
    taken: Int[Array, " m"]  # measurements taken on arrival
    measurement_x: Float[Array, "m s 2"]  # where each measurement is taken
    measurement_y: Float[Array, "m s"]  # its value, normalised units
    measurement_time: Float[Array, "m s"]  # when it is taken; inf for an empty slot
    # [i, j]: of agent j, agent i knows since its last decision what j had measured by then; -inf: nothing yet. One
    # column, the same for every j, where the range is unlimited: k = m, or 1.
    known_until: Float[Array, "m k"]
    messages: Any  # last message of each agent, leading axis m
    memory: Any  # the planner's memory of each agent, leading axis m
    route: Float[Array, "m e 2"]  # vertices visited, starting with the start
    route_time: Float[Array, "m e"]  # when; inf beyond route_length
    route_length: Int[Array, " m"]  # vertices recorded
    full: Bool[Array, " m"]  # the record has no room for what the agent decided: it waits for more

    @property
    def known(self) -> Any:
        """(m, m, s), [i, j, s]: agent i has taken over slot s of agent j at its last decision."""
        return self.measurement_time[..., None, :, :] <= self.known_until[..., None]

    @property
    def active(self) -> Any:
        """False for an agent that has stopped, or takes no part."""
        return (self.status == TRAVELLING) | self.homeward

    @property
    def homeward(self) -> Any:
        """Whether each agent has turned for home, and is on its way."""
        return self.status == HOMEWARD

    @property
    def stopped_by(self) -> Any:
        """Why each agent stopped, an index of REASONS; TRAVELLING for one that has not."""
        return self.status * (self.status < HOMEWARD)


def route_capacity(scenario: ScenarioLike, planner: Planner) -> int:
    """Vertices recorded per agent. Eight decisions per measurement is four times what a roadmap planner usually takes.

    A mission that needs more is run on with more. At four, one agent in some 40 missions of ten ran into it: it had
    gone to and fro between two nodes close together.
    """
    return (8 * scenario.measurements_per_agent + 16) * leg_waypoints(scenario, planner) + 1


def leg_waypoints(problem: ScenarioLike, planner: Planner) -> int:
    """Waypoints of each leg: the planner's, and after them the way home where there is one."""
    return planner.waypoints_per_decision + (WAYPOINTS if problem.homes else 0)


def reset(planner: Planner, mission: Mission, capacity: int | None = None) -> State:
    """State of an unbatched mission before the first decision: everybody is due at time 0."""
    m, s = mission.shape.agents, mission.shape.slots
    real = mission.start.dtype
    capacity = capacity or route_capacity(mission.problem, planner)
    planner = planner.on(mission.problem)

    def per_agent(tree: Any) -> Any:
        return jax.tree.map(lambda a: jnp.broadcast_to(a, (m, *jnp.shape(a))), tree)

    vertices = leg_waypoints(mission.problem, planner) + 1
    return State(
        time=jnp.zeros((), real),
        events=jnp.zeros((), jnp.int32),
        status=jnp.where(mission.params.present, TRAVELLING, ABSENT).astype(jnp.int8),
        leg=jnp.broadcast_to(mission.start[:, None], (m, vertices, 2)),
        departure=jnp.zeros(m, real),
        arrival=jnp.zeros(m, real),
        odometer=jnp.zeros(m, real),
        taken=jnp.zeros(m, jnp.int32),
        measurement_x=jnp.zeros((m, s, 2), real),
        measurement_y=jnp.zeros((m, s), real),
        measurement_time=jnp.full((m, s), jnp.inf, real),
        known_until=jnp.full((m, m if mission.shape.limited else 1), -jnp.inf, real),
        messages=per_agent(planner.empty_message()),
        memory=per_agent(planner.initial_memory()),
        route=jnp.zeros((m, capacity, 2), real).at[:, 0].set(mission.start),
        route_time=jnp.full((m, capacity), jnp.inf, real).at[:, 0].set(0.0),
        route_length=jnp.ones(m, jnp.int32),
        full=jnp.zeros(m, bool),
    )


def with_capacity(state: State, capacity: int) -> State:
    """The state with room for that many vertices per agent, and nobody waiting for room; leading axes are kept."""
    room = [(0, 0)] * (state.route_time.ndim - 1) + [(0, capacity - state.route_time.shape[-1])]
    route = jnp.pad(state.route, [*room, (0, 0)])
    times = jnp.pad(state.route_time, room, constant_values=jnp.inf)
    return eqx.tree_at(lambda s: (s.route, s.route_time, s.full), state, (route, times, jnp.zeros_like(state.full)))


def known_by(state: State, agent: Index) -> Bool[Array, "m s"]:
    """The measurements that one agent has taken over at its last decision, of an unbatched mission."""
    return state.measurement_time <= pick(state.known_until, agent)[:, None]


def positions(state: State, speeds: Float[Array, " m"]) -> Float[Array, "m 2"]:
    """Where every agent is at `state.time`; one that has stopped stays where it is."""
    travelled = (state.time - state.departure) * speeds
    return jax.vmap(along)(state.leg, travelled)
