"""What stays the same during a live survey: the problem, the planner, the team, and the random draws."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.belief import Matern32
from maipp.engine import Mission, Planner, draw_missions
from maipp.errors import InputError
from maipp.live.units import Units
from maipp.roadmap import Roadmap
from maipp.scenario import Scenario
from maipp.seeds import check_seed
from maipp.typing import Array, Bool, Float, Key

# Measurements there is room for at first, over those that budgets and interval allow.
_RESERVE = 1.25


class World(eqx.Module):
    """What a compiled decision reads besides the situation; arrays on the device."""

    scenario: Scenario = eqx.field(static=True)
    planner: Planner
    grid: Float[Array, "q 2"]  # evaluation grid, domain units
    inside: Bool[Array, " q"]  # grid points of the survey area
    start: Float[Array, "m 2"]  # domain units
    speeds: Float[Array, " m"]  # domain units per second
    roadmap: Roadmap | None  # arrays (m, n, ...)
    key: Key
    # Of the prior samples, which fill the first slots: how many, and their noise variance (None: the scenario's)
    prior_count: int = eqx.field(static=True, default=0)
    prior_noise: float | None = eqx.field(static=True, default=None)

    def extra_noise(self, slots: int) -> Float[Array, " s"] | None:
        """Noise variance of each slot beyond the scenario's; None where all have that one."""
        if self.prior_noise is None or not self.prior_count:
            return None
        return jnp.where(jnp.arange(slots) < self.prior_count, self.prior_noise - self.scenario.noise, 0.0)

    @property
    def kernel(self) -> Matern32:
        """The prior covariance."""
        return self.planner.kernel


def draw_world(planner: Planner, seed: int, prior_count: int = 0, prior_noise: float | None = None) -> World:
    """The world that the seed draws: starts where the scenario gives none, roadmaps, and the key of what is random."""
    drawn = draw_missions(
        planner.scenario,
        seed=seed,
        instances=1,
        planner=planner,
    )
    mission: Mission = jax.tree.map(lambda a: a[0], drawn)
    return World(
        scenario=planner.scenario,
        planner=planner,
        grid=mission.grid,
        inside=mission.inside,
        start=mission.start,
        speeds=mission.speeds,
        roadmap=mission.roadmap,
        key=jax.random.key(seed),
        prior_count=prior_count,
        prior_noise=prior_noise,
    )


@dataclasses.dataclass(frozen=True)
class Setup:
    """What makes two live surveys the same one, besides the scenario: all that is in the journal's header."""

    planner: str  # name
    options: dict[str, Any]
    seed: int
    robots: tuple[str, ...]
    room: int  # measurements there is room for at first
    units: Units
    prior_x: Float[np.ndarray, "p 2"]  # domain units
    prior_y: Float[np.ndarray, " p"]  # standardised

    def digest(self, world: World) -> str:
        """SHA-256 of everything that answers depend on, weights and roadmaps included."""
        told = [
            self.planner,
            {key: str(value) for key, value in self.options.items()},
            self.seed,
            self.robots,
            self.room,
            dataclasses.asdict(self.units),
            world.scenario.to_dict(),
            world.prior_noise,
        ]
        digest = hashlib.sha256(json.dumps(told, sort_keys=True).encode())
        drawn = (world.planner, world.grid, world.inside, world.start, world.speeds, world.roadmap)
        leaves = jax.tree.leaves(eqx.filter(drawn, eqx.is_array))
        for array in (self.prior_x, self.prior_y, *map(np.asarray, leaves)):
            digest.update(f"{array.shape} {array.dtype}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def make_setup(
    planner: Planner,
    name: str,
    options: Mapping[str, object] | None,
    seed: int,
    robots: Sequence[str],
    units: Units,
    prior: tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, " p"]] | None,
) -> Setup:
    """The setup with room for the measurements that budgets allow and some more; `InputError` for the wrong robots."""
    if len(set(robots)) != len(robots) or len(robots) != planner.scenario.agents:
        raise InputError(f"robots: {len(set(robots))} different names; give {planner.scenario.agents}, one per agent")
    prior_x, prior_y = (np.zeros((0, 2)), np.zeros(0)) if prior is None else prior
    room = int(_RESERVE * planner.scenario.measurements) + len(prior_y)
    return Setup(name, dict(options or {}), check_seed(seed), tuple(robots), room, units, prior_x, prior_y)
