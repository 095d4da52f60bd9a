"""A scenario as compiled programs take it: what sets their shapes apart from the numbers they are given.

Two scenarios of one `Shape` share every compiled program; their `Params` are arrays that may differ from mission to
mission. People write a `Scenario`; whatever is compiled reads a `Problem`, under the scenario's own names.
"""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.errors import InputError
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Extent, Float


@dataclass(frozen=True)
class Shape:
    """What sets the sizes of arrays, or which program is compiled. Hashable."""

    agents: int  # m
    slots: int  # S: measurements that there is room for, each agent
    grid: int  # points per side of the evaluation grid
    nodes: int  # of each roadmap
    neighbours: int  # of each of its nodes
    belief_capacity: int
    kernel: str
    interest_rule: str
    virtual_value: str
    last_leg: str
    limited: bool  # whether the range of any radio may be limited
    has_zones: bool  # whether there are no-go zones
    homes: int  # places of which each agent ends at one; 0: it may end anywhere
    finest_interval: float  # shortest measurement interval that look-aheads have room for, domain units
    usual_edge: float  # length of a roadmap's edge that they have room for, domain units


def shape_of(scenarios: Scenario | Sequence[Scenario], *, slots: int | None = None) -> Shape:
    """The smallest shape that all these scenarios fit; with `slots`, room for that many measurements an agent.

    Raises `InputError` where they differ in what sets a program apart, and for too few slots.
    """
    rows = [scenarios] if isinstance(scenarios, Scenario) else list(scenarios)
    first = rows[0]
    for name in ("agents", "grid", "nodes", "neighbours", "belief_capacity", "has_zones", "homes", *_RULES):
        values = {getattr(each, name) for each in rows}
        if len(values) > 1:
            raise InputError(
                f"scenario.{name}: {', '.join(map(str, sorted(values)))}; one shape has one, compile them apart"
            )
    least = max(each.measurements_per_agent for each in rows)
    if slots is not None and slots < least:
        raise InputError(f"slots: {slots}; budgets and intervals need at least {least}")
    return Shape(
        agents=first.agents,
        slots=least if slots is None else slots,
        grid=first.grid,
        nodes=first.nodes,
        neighbours=first.neighbours,
        belief_capacity=first.belief_capacity,
        **{name: getattr(first, name) for name in _RULES},
        limited=any(each.limited for each in rows),
        has_zones=first.has_zones,
        homes=first.homes,
        finest_interval=min(each.finest_interval for each in rows),
        usual_edge=max(each.usual_edge for each in rows),
    )


_RULES = ("kernel", "interest_rule", "virtual_value", "last_leg")


class Params(eqx.Module):
    """Every number of a scenario as an array; a batch of missions has its leading axis on each."""

    budgets: Float[Array, "*b m"]  # domain units
    reserves: Float[Array, "*b m"]  # of these, what is not to be spent
    speeds: Float[Array, "*b m"]  # domain units per unit of time
    present: Bool[Array, "*b m"]  # False for agents that take no part: a team smaller than the shape's
    comm_range: Float[Array, "*b"]  # domain units; inf hears everyone
    measurement_interval: Float[Array, "*b"]  # domain units
    extent: Float[Array, "*b 2"]  # width and height, domain units
    length_scale: Float[Array, "*b"]  # domain units
    signal_variance: Float[Array, "*b"]
    noise: Float[Array, "*b"]
    threshold: Float[Array, "*b"]
    beta: Float[Array, "*b"]
    warp: Float[Array, "*b 2 2"] | None = None  # of the kernel; None: the field is alike in all directions

    @property
    def spendable(self) -> Float[Array, "*b m"]:
        """The budgets less the reserves."""
        return self.budgets - self.reserves


def params_of(scenario: Scenario) -> Params:
    """The numbers of a scenario, at JAX's precision."""
    real = jnp.result_type(float)
    values = {
        field.name: np.asarray(getattr(scenario, field.name), real)
        for field in dataclasses.fields(Params)
        if field.name not in ("present", "comm_range", "warp")
    }
    reach = math.inf if scenario.comm_range is None else scenario.comm_range
    present = np.ones(scenario.agents, bool)
    # All are made on the host: nothing is compiled for them.
    return Params(**jax.device_put(values | {"present": present, "comm_range": np.asarray(reach, real)}))


class Problem(eqx.Module):
    """Shape and numbers together, under the names that the scenario has for them."""

    shape: Shape = eqx.field(static=True)
    params: Params

    def __getattr__(self, name: str) -> Any:
        """A field of the shape, or a number."""
        if name.startswith("__") or name in ("shape", "params"):
            raise AttributeError(name)
        try:
            return getattr(self.shape if hasattr(self.shape, name) else self.params, name)
        except AttributeError:
            raise AttributeError(f"{name}: compiled code knows no such part of a scenario") from None

    @property
    def measurements_per_agent(self) -> int:
        """S: slots of each agent."""
        return self.shape.slots

    @property
    def measurements(self) -> int:
        """m * S: measurement slots of the team."""
        return self.shape.agents * self.shape.slots

    @property
    def grid_points(self) -> int:
        """Points of the evaluation grid."""
        return self.shape.grid**2


def problem_of(scenario: Scenario, shape: Shape | None = None) -> Problem:
    """The scenario for compiled code, in its own shape or in one that others share."""
    return Problem(shape or shape_of(scenario), params_of(scenario))


ScenarioLike = Scenario | Problem  # on the host the one, in compiled code the other


def longest_side(extent: Extent) -> Float[Array, ""]:
    """Of a domain, domain units."""
    return jnp.max(jnp.asarray(extent))
