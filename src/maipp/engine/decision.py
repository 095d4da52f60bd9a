"""What a planner sees, what it answers, and the protocol between it and the engine."""

from typing import Any, ClassVar, TypeVar

import equinox as eqx
import jax

from maipp.belief import Belief, Interest
from maipp.engine.options import parts_of, taken
from maipp.problem import Problem
from maipp.roadmap import Home, Roadmap
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Float, Index, Int, Key

PyTree = Any
P = TypeVar("P", bound="Planner")


class AgentView(eqx.Module):
    """What an agent that is due has before it computes anything. The slots of measurements are in no order."""

    agent: Index  # index of the agent that decides
    time: Float[Array, ""]  # now
    position: Float[Array, "2"]  # where the agent is, domain units
    start: Float[Array, "2"]  # where it began
    budget: Float[Array, ""]  # its whole budget, domain units
    speed: Float[Array, ""]  # its speed
    measurement_x: Float[Array, "s 2"]  # positions, domain units
    measurement_y: Float[Array, " s"]  # measured values, normalised units
    measurement_time: Float[Array, " s"]  # when; -inf for prior samples, inf in an empty slot
    measured_by: Int[Array, " s"]  # agent whose measurement each slot is for; -1 for samples from before the survey
    known: Bool[Array, " s"]  # the slots whose value this agent knows
    heard: Bool[Array, " m"]  # agents within communication range now; never itself
    messages: PyTree  # last message of every agent, leading axis m; valid only where heard
    positions: Float[Array, "m 2"]  # where the agents are now; valid only where heard, and its own


class Knowledge(AgentView):
    """What comes from whichever record: the batch engine's state, or a live survey's. Holds no prior samples."""

    odometer: Float[Array, ""]  # what of the budget has been travelled
    homeward: Bool[Array, ""]  # whether it has turned for home
    next_measurement: Float[Array, ""]  # odometer at which it measures next


class Observation(AgentView):
    """What a planner sees at the moment it decides. The prior samples, which every agent knows, are in the slots."""

    remaining: Float[Array, ""]  # what is left of the budget above the reserve; with it the agent must come home
    to_next_measurement: Float[Array, ""]  # distance it travels before it measures again, in (0, interval]
    belief: Belief  # its own belief, predicted on the evaluation grid
    inside: Bool[Array, " q"]  # grid points of the survey area
    roadmap: Roadmap | None  # the agent's own roadmap
    at_nodes: Belief | None  # its own belief, predicted at the nodes of that roadmap
    home: Home | None = None  # where it is to end; None: anywhere


class Decision(eqx.Module):
    """A planner's answer: the polyline to travel before deciding again, and what to tell the others."""

    waypoints: Float[Array, "w 2"]  # straight legs through these, domain units; repeat the last one to go less far
    message: PyTree  # same structure as `Planner.empty_message()`
    memory: PyTree  # same structure as `Planner.initial_memory()`
    stop: Bool[Array, ""] | bool = False  # True ends this agent's mission here


def _is_scenario(node: object) -> bool:
    return isinstance(node, Scenario | Problem)


class Planner(eqx.Module):
    """Base of every planner: a pytree whose options are static and whose weights, if any, are arrays.

    Subclass it, implement `decide`, and register a constructor with `maipp.planners.register`. All methods must be
    traceable by JAX; `decide` is compiled once and vmapped over missions.

    `scenario` is the one that the planner was made for; while `decide` is compiled it is a `Problem` with the same
    names: what sets sizes (`agents`, `grid`) is a Python value, any other number (`threshold`, `extent`) an array.
    """

    scenario: Scenario | Problem

    uses_roadmap: ClassVar[bool] = False  # draw a roadmap for every agent
    avoids_obstacles: ClassVar[bool] = (
        False  # its legs never cross a no-go zone; others are refused where there are any
    )
    # What it remembers counts places of the roadmap, of the zones or of the team's parts of the area: where a live
    # survey changes those, its agents begin with `initial_memory` again.
    memory_of_place: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for name, part in parts_of(type(self)).items():
            if getattr(self, name) is None:
                setattr(self, name, part.made(self.scenario, {}))

    @classmethod
    def of(cls: type[P], scenario: Scenario | Problem, **values: Any) -> P:
        """The planner with these values of its own fields and of its parts', which go by their names alone."""
        parts = parts_of(cls)
        made = {name: part.made(scenario, values) for name, part in parts.items() if name not in values}
        theirs = {name for part in parts.values() for name in taken(part.kind, values)} - taken(cls, values).keys()
        return cls(scenario, **made, **{name: value for name, value in values.items() if name not in theirs})

    @property
    def parts(self) -> tuple[Any, ...]:
        """The modules that it is composed of, see `maipp.engine.part`."""
        return tuple(getattr(self, name) for name in parts_of(type(self)))

    def on(self, problem: Problem) -> Any:
        """The planner, and those that it holds, for compiled code: this problem in place of their scenario."""
        return jax.tree.map(lambda node: problem if _is_scenario(node) else node, self, is_leaf=_is_scenario)

    @property
    def waypoints_per_decision(self) -> int:
        """w: vertices of the polyline that `decide` returns."""
        return 1

    @property
    def encoding_dimensions(self) -> int:
        """Columns of the spectral encoding that each roadmap needs, for the planner or a part of it; 0: none."""
        return max((getattr(part, "encoding_dimensions", 0) for part in self.parts), default=0)

    @property
    def interest(self) -> Interest:
        """The scenario's high-interest rule."""
        return Interest(self.scenario.threshold, self.scenario.beta, self.scenario.interest_rule)

    @property
    def missions_per_core(self) -> int:
        """Missions that one CPU core steps together, at most: fewer where a decision alone fills the core's cache."""
        return min((getattr(part, "missions_per_core", 16) for part in self.parts), default=16)

    def check(self) -> None:
        """Raise InputError where an option makes no sense; called once, before anything is compiled."""

    def empty_message(self) -> PyTree:
        """The message of an agent that has not decided yet (arrays without an agent axis)."""
        return ()

    def initial_memory(self) -> PyTree:
        """What an agent remembers before its first decision (arrays without an agent axis)."""
        return ()

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """The next waypoints of the agent that is due."""
        raise NotImplementedError
