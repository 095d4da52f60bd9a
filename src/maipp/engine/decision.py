"""What a planner sees, what it answers, and the protocol between it and the engine."""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax

from maipp.belief import Belief, Interest
from maipp.problem import Problem
from maipp.roadmap import Home, Roadmap
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Float, Index, Int, Key

PyTree = Any


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
    home: Home | None = None  # where it is to end; None: anywhere


class Decision(eqx.Module):
    """A planner's answer: the polyline to travel before deciding again, and what to tell the others."""

    waypoints: Float[Array, "w 2"]  # straight legs through these, domain units; repeat the last one to go less far
    message: PyTree  # same structure as `Planner.empty_message()`
    memory: PyTree  # same structure as `Planner.initial_memory()`
    stop: Bool[Array, ""] | bool = False  # True ends this agent's mission here


def option(default: Any = dataclasses.MISSING, *, meaning: str = "") -> Any:
    """A static field of a planner that users may set by its name, with what it means on one line.

    Text is read by the field's annotation: `bool`, `int`, `float`, `str`, a tuple of these, a `Literal`, or one of them
    `| None`. Without a default the option must be given, by keyword.
    """
    required = default is dataclasses.MISSING
    return eqx.field(static=True, default=default, kw_only=required, metadata={"option": meaning})


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

    def on(self, problem: Problem) -> Any:
        """The planner, and those that it holds, for compiled code: this problem in place of their scenario."""
        return jax.tree.map(lambda node: problem if _is_scenario(node) else node, self, is_leaf=_is_scenario)

    @property
    def waypoints_per_decision(self) -> int:
        """w: vertices of the polyline that `decide` returns."""
        return 1

    @property
    def encoding_dimensions(self) -> int:
        """Columns of the spectral encoding that each roadmap needs; 0: none is computed."""
        return 0

    @property
    def interest(self) -> Interest:
        """The scenario's high-interest rule."""
        return Interest(self.scenario.threshold, self.scenario.beta, self.scenario.interest_rule)

    @property
    def missions_per_core(self) -> int:
        """Missions that one CPU core steps together, at most: fewer where a decision alone fills the core's cache."""
        return 16

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
