"""What decisions of a live survey are made of: the problem, the planner, and the random draws; and its setup."""

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import equinox as eqx
import jax
import numpy as np

from maipp.engine import Mission, Planner, draw_missions
from maipp.errors import InputError
from maipp.live.gate import LEVEL, Gate, Kernel
from maipp.live.units import Units
from maipp.scenario import Scenario
from maipp.seeds import check_seed
from maipp.typing import Float, Key

# Measurements there is room for at first, over those that budgets and interval allow.
_RESERVE = 1.25


@dataclasses.dataclass(frozen=True, eq=False)
class World:
    """What decisions are made of, besides what is known when a robot arrives; arrays on the device."""

    scenario: Scenario
    planner: Planner  # as it was made
    mission: Mission  # unbatched; its ground truth is nobody's, and never read
    key: Key

    @cached_property
    def compiled(self) -> Planner:
        """The planner as compiled code takes it."""
        return self.planner.on(self.mission.problem)


def make_gate(world: World, level: float) -> Gate:
    """The gate of a survey: it judges by the kernel and the old samples that beliefs are of."""
    params, mission = world.mission.params, world.mission
    kernel = Kernel(*(float(number) for number in (params.length_scale, params.signal_variance, params.noise)))
    if mission.prior_x is None or mission.prior_y is None:
        return Gate(kernel, level)
    noise = np.full(len(mission.prior_y), kernel.noise) if mission.prior_noise is None else mission.prior_noise
    x, y, variance = (np.asarray(array, np.float64) for array in (mission.prior_x, mission.prior_y, noise))
    return Gate(kernel, level, (x, y, variance))


Prior = tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, " p"]]


def draw_world(
    planner: Planner, scenario: Scenario, seed: int, prior: Prior | None = None, prior_noise: float | None = None
) -> World:
    """The world that the seed draws: starts where the scenario gives none, roadmaps, and the key of what is random."""
    if prior is None or not len(prior[1]):
        prior, prior_noise = None, None
    drawn = draw_missions(scenario, seed=seed, instances=1, planner=planner, prior=prior, prior_noise=prior_noise)
    return World(scenario, planner, jax.tree.map(lambda a: a[0], drawn), jax.random.key(seed))


@dataclasses.dataclass(frozen=True)
class Setup:
    """What makes two live surveys the same one, besides the scenario: all that is in the journal's header."""

    planner: str  # name
    options: dict[str, Any]
    seed: int
    robots: tuple[str, ...]
    room: int  # measurements of each robot that there is room for at first
    units: Units
    gate: float = LEVEL  # surprise beyond which a measurement is kept out; 0: none is
    # What follows from the above, and is in no digest:
    clearance: float = 0.0  # that zones added under way are kept clear of, domain units
    beta_follows: bool = False  # whether the scenario's `beta` follows from the threshold, as in mission files
    threshold: float | None = None  # in the caller's unit, as given; None: every place matters alike
    keys: Mapping[str, Any] = dataclasses.field(default_factory=dict)  # of the mission, for people: `differences`

    def digest(self, world: World) -> str:
        """SHA-256 of everything that answers depend on, weights and roadmaps included."""
        told = [
            self.planner,
            {key: str(value) for key, value in self.options.items()},
            self.seed,
            self.robots,
            self.room,
            self.gate,
            dataclasses.asdict(self.units),
            world.scenario.to_dict(),
        ]
        digest = hashlib.sha256(json.dumps(told, sort_keys=True).encode())
        mission = world.mission
        drawn = (world.planner, mission.grid, mission.inside, mission.start, mission.roadmap, mission.prior)
        leaves = jax.tree.leaves(eqx.filter(drawn, eqx.is_array))
        for array in map(np.asarray, leaves):
            digest.update(f"{array.shape} {array.dtype}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def make_setup(
    scenario: Scenario,
    name: str,
    options: Mapping[str, object] | None,
    seed: int,
    robots: Sequence[str],
    units: Units,
    gate: float = LEVEL,
) -> Setup:
    """The setup with room for the measurements that budgets allow and some more; `InputError` for the wrong robots."""
    if len(set(robots)) != len(robots) or len(robots) != scenario.agents:
        raise InputError(f"robots: {len(set(robots))} different names; give {scenario.agents}, one per agent")
    return Setup(name, dict(options or {}), check_seed(seed), tuple(robots), room_in(scenario), units, gate)


def room_in(scenario: Scenario) -> int:
    """Measurements of each robot to have room for at first: those that budgets allow and some more."""
    return math.ceil(_RESERVE * scenario.measurements_per_agent)
