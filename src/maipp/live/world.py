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
import jax.numpy as jnp
import numpy as np

from maipp.belief.refit import Hyperparameters, HyperPrior
from maipp.engine import Mission, Planner, draw_missions
from maipp.engine.keys import key_of
from maipp.errors import InputError
from maipp.live.gate import LEVEL, Gate
from maipp.live.incremental_posterior import ConditionedSamples
from maipp.live.kernel import guess_of, interest_under, under
from maipp.live.refits import Refits
from maipp.live.site import Site
from maipp.live.units import Units
from maipp.planners import planner_note
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

    def known(self, kernel: Hyperparameters | None, beta_follows: bool) -> "World":
        """The same in which the field has another kernel, by whose mean and deviation values are standardised.

        All are numbers of the problem, so that nothing is compiled for them. None: it stays as it is.
        `beta_follows` says that the confidence follows from the threshold.
        """
        if kernel is None:
            return self
        guess = guess_of(self.scenario)
        mission = under(self.mission, guess, kernel)
        threshold, beta = interest_under(self.scenario, kernel.mean, kernel.std / guess.std, beta_follows)
        real = mission.grid.dtype
        interest = {"threshold": jnp.asarray(threshold, real), "beta": jnp.asarray(beta, real)}
        params = dataclasses.replace(mission.params, **interest)
        return dataclasses.replace(self, mission=dataclasses.replace(mission, params=params))


def make_gate(mission: Mission, scenario: Scenario, level: float, adapt: HyperPrior | None) -> Gate:
    """The gate of a survey: it judges by the kernel and the old samples that beliefs are of."""
    kernel, refits = guess_of(scenario), None if adapt is None else Refits(adapt)
    if mission.prior_x is None or mission.prior_y is None:
        return Gate(kernel, level, None, refits)
    noise = np.full(len(mission.prior_y), kernel.noise) if mission.prior_noise is None else mission.prior_noise
    x, y, variance = (np.asarray(array, np.float64) for array in (mission.prior_x, mission.prior_y, noise))
    return Gate(kernel, level, ConditionedSamples(x, y, variance / kernel.noise), refits)


Prior = tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, " p"]]


def draw_world(
    planner: Planner, scenario: Scenario, seed: int, prior: Prior | None = None, prior_noise: float | None = None
) -> World:
    """The world that the seed draws: starts where the scenario gives none, roadmaps, and the key of what is random."""
    if prior is None or not len(prior[1]):
        prior, prior_noise = None, None
    drawn = draw_missions(scenario, seed=seed, instances=1, planner=planner, prior=prior, prior_noise=prior_noise)
    one = jax.device_put(jax.tree.map(lambda a: a[0], jax.device_get(drawn)))  # on the host: nothing is compiled for it
    return World(scenario, planner, one, key_of(seed))


@dataclasses.dataclass(frozen=True)
class Setup:
    """What makes two live surveys the same one, besides the scenario, and what is told of the place."""

    planner: str  # name
    options: dict[str, Any]
    seed: int
    robots: tuple[str, ...]
    room: int  # measurements of each robot that there is room for at first
    units: Units
    gate: float = LEVEL  # surprise beyond which a measurement is kept out; 0: none is
    adapt: HyperPrior | None = None  # what the kernel is refitted with under way; None: it stays as it is
    site: Site = Site()  # answers do not depend on it
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
            *([] if self.adapt is None else [self.adapt._asdict()]),
            # A name that has changed its meaning is another one.
            *filter(None, [planner_note(self.planner)]),
        ]
        digest = hashlib.sha256(json.dumps(told, sort_keys=True).encode())
        mission = world.mission
        drawn = (world.planner, mission.grid, mission.inside, mission.start, mission.roadmap, mission.prior)
        leaves = jax.tree.leaves(eqx.filter(drawn, eqx.is_array))
        for array in map(np.asarray, leaves):
            digest.update(f"{array.shape} {array.dtype}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def first_room(scenario: Scenario) -> int:
    """Measurements of each robot that there is room for at first: what budgets allow, and some more."""
    return math.ceil(_RESERVE * scenario.measurements_per_agent)


def make_setup(
    scenario: Scenario,
    name: str,
    options: Mapping[str, object] | None,
    seed: int,
    robots: Sequence[str],
    units: Units,
    gate: float = LEVEL,
    adapt: HyperPrior | None = None,
    site: Site | None = None,
) -> Setup:
    """The setup; `InputError` for the wrong robots."""
    if len(set(robots)) != len(robots) or len(robots) != scenario.agents:
        raise InputError(f"robots: {len(set(robots))} different names; give {scenario.agents}, one per agent")
    room, settings = first_room(scenario), dict(options or {})
    return Setup(name, settings, check_seed(seed), tuple(robots), room, units, gate, adapt, site or Site())
