"""What stays the same during a live survey: the problem, the planner, the team, and the random draws."""

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
from maipp.errors import InputError
from maipp.live.gate import LEVEL, Gate
from maipp.live.refits import Refits
from maipp.live.seen import Old
from maipp.live.units import Units
from maipp.scenario import Scenario
from maipp.seeds import check_seed
from maipp.surveys.standardise import EVERYTHING
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
    least_beta: float = 0.0  # where it is above 0, the confidence is this many times the standardised threshold, or 1

    @cached_property
    def compiled(self) -> Planner:
        """The planner as compiled code takes it."""
        return self.planner.on(self.mission.problem)

    @property
    def guess(self) -> Hyperparameters:
        """The kernel of the scenario."""
        scenario = self.scenario
        return Hyperparameters(0.0, scenario.signal_variance**0.5, scenario.length_scale, scenario.noise)

    def under(self, kernel: Hyperparameters) -> "World":
        """The same in which the field has another kernel, and values are standardised by that one's mean and deviation.

        All are numbers of the problem, so that nothing is compiled for them.
        """
        mission, scale = self.mission, kernel.std / self.guess.std
        real = mission.grid.dtype
        threshold = float(self.scenario.threshold)
        threshold = threshold if threshold <= EVERYTHING else (threshold - kernel.mean) / scale
        values = {
            "length_scale": kernel.length_scale,
            "noise": kernel.noise / scale**2,
            "threshold": threshold,
            "beta": max(1.0, self.least_beta * threshold) if self.least_beta else self.scenario.beta,
            "warp": kernel.warp,
        }
        params = dataclasses.replace(mission.params, **{key: jnp.asarray(value, real) for key, value in values.items()})
        changed: dict[str, Any] = {"params": params}
        if mission.prior_y is not None:
            changed["prior_y"] = (mission.prior_y - kernel.mean) / scale
            if mission.prior_noise is not None:
                changed["prior_noise"] = mission.prior_noise * (kernel.noise / self.guess.noise / scale**2)
        return dataclasses.replace(self, mission=dataclasses.replace(mission, **changed))


def make_gate(world: World, level: float, adapt: HyperPrior | None) -> Gate:
    """The gate of a survey: it judges by the kernel and the old samples that beliefs are of."""
    mission, kernel = world.mission, world.guess
    refits = None if adapt is None else Refits(adapt)
    if mission.prior_x is None or mission.prior_y is None:
        return Gate(kernel, level, None, refits)
    noise = np.full(len(mission.prior_y), kernel.noise) if mission.prior_noise is None else mission.prior_noise
    x, y, variance = (np.asarray(array, np.float64) for array in (mission.prior_x, mission.prior_y, noise))
    return Gate(kernel, level, Old(x, y, variance / kernel.noise), refits)


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
    adapt: HyperPrior | None = None  # what the kernel is refitted with under way; None: it stays as it is

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
    adapt: HyperPrior | None = None,
) -> Setup:
    """The setup with room for the measurements that budgets allow and some more; `InputError` for the wrong robots."""
    if len(set(robots)) != len(robots) or len(robots) != scenario.agents:
        raise InputError(f"robots: {len(set(robots))} different names; give {scenario.agents}, one per agent")
    room = math.ceil(_RESERVE * scenario.measurements_per_agent)
    return Setup(name, dict(options or {}), check_seed(seed), tuple(robots), room, units, gate, adapt)
