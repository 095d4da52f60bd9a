"""What stays the same during a live survey: the problem, the planner, the team, and the random draws."""

import dataclasses
import hashlib
import json
from typing import Any

import equinox as eqx
import jax
import numpy as np

from maipp.belief import Matern32
from maipp.live.units import Units
from maipp.roadmap import Roadmap
from maipp.scenario import Scenario
from maipp.simulator import Mission, Planner
from maipp.typing import Array, Bool, Float, Key


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

    @property
    def kernel(self) -> Matern32:
        """The prior covariance."""
        return self.planner.kernel


def world_of(planner: Planner, mission: Mission, seed: int) -> World:
    """The world of an unbatched mission; its field is not looked at."""
    return World(
        scenario=planner.scenario,
        planner=planner,
        grid=mission.grid,
        inside=mission.inside,
        start=mission.start,
        speeds=mission.speeds,
        roadmap=mission.roadmap,
        key=jax.random.key(seed),
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
        ]
        digest = hashlib.sha256(json.dumps(told, sort_keys=True).encode())
        drawn = (world.planner, world.grid, world.inside, world.start, world.speeds, world.roadmap)
        leaves = jax.tree.leaves(eqx.filter(drawn, eqx.is_array))
        for array in (self.prior_x, self.prior_y, *map(np.asarray, leaves)):
            digest.update(f"{array.shape} {array.dtype}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()
