"""Planning one agent's next legs: what every continuous receding-horizon planner does."""

import equinox as eqx
import jax.numpy as jnp

from maipp.belief import Belief
from maipp.errors import InputError
from maipp.planners.headings import walk
from maipp.planners.lookahead import predicted_trace, predicted_variance
from maipp.planners.plan_search import SearchOptions, search
from maipp.simulator.decision import Planner
from maipp.typing import Array, Bool, Float, Key


class LegPlanner(Planner):
    """Finds the legs, one measurement each, with the lowest predicted Tr(P)."""

    horizon: int = eqx.field(static=True, default=4)  # legs planned, one measurement each
    candidates: int = eqx.field(static=True, default=128)  # random plans scored
    elites: int = eqx.field(static=True, default=8)  # of them refined by gradient
    steps: int = eqx.field(static=True, default=20)  # gradient steps
    rate: float = eqx.field(static=True, default=0.2)  # first gradient step, radians
    temperature: float = eqx.field(static=True, default=0.1)  # width of the smoothed area border, field units
    stride: int = eqx.field(static=True, default=2)  # search on every stride-th grid point per axis; choose on all

    def check(self) -> None:
        """Raise InputError for options out of range."""
        for name in ("horizon", "candidates", "elites", "steps", "stride"):
            if getattr(self, name) < 1:
                raise InputError(f"{name}={getattr(self, name)}: give a whole number >= 1")
        if self.elites > self.candidates:
            raise InputError(f"elites={self.elites} is more than candidates={self.candidates}; give at most as many")
        if not self.rate > 0 or not self.temperature > 0:
            raise InputError(f"rate={self.rate}, temperature={self.temperature}: both must be > 0")
        if self.stride > self.scenario.grid:
            raise InputError(f"stride={self.stride} leaves no point of a grid of {self.scenario.grid} per side")

    @property
    def missions_per_core(self) -> int:
        """Measured: 4 is a fifth slower, 32 gains nothing and needs twice the memory."""
        return 16

    def plan_legs(
        self,
        key: Key,
        belief: Belief,
        inside: Bool[Array, " q"],
        position: Float[Array, "2"],
        last: Float[Array, " h"],
        steps: Float[Array, " h"],
        affordable: Bool[Array, " h"],
    ) -> Float[Array, " h"]:
        """Headings of the best plan found for one agent, given what the belief already counts as measured."""
        index = self.coarse_points()
        coarse, coarse_inside = belief.at(index), inside[index]

        def legs(headings: Float[Array, "c h"]) -> tuple[Float[Array, "c h 2"], Bool[Array, "c h"]]:
            return walk(position, headings, steps, self.scenario.extent), jnp.broadcast_to(affordable, headings.shape)

        def exact(belief: Belief, inside: Bool[Array, " i"], headings: Float[Array, "c h"]) -> Float[Array, " c"]:
            value = self.scenario.virtual_value
            return predicted_trace(belief, self.interest, inside, *legs(headings), virtual_value=value)

        def smooth(headings: Float[Array, "c h"]) -> Float[Array, " c"]:
            variance = predicted_variance(coarse, *legs(headings))
            mean = jnp.broadcast_to(coarse.mean, variance.shape)
            return self.interest.soft_trace(mean, variance, coarse_inside, self.temperature)

        return search(
            key,
            last,
            score=lambda headings: exact(coarse, coarse_inside, headings),
            smooth=smooth,
            final=lambda headings: exact(belief, inside, headings),
            options=SearchOptions(self.candidates, self.elites, self.steps, self.rate),
        )

    def coarse_points(self) -> Array:
        """Indices of the grid points that the search looks at."""
        side = jnp.arange(self.stride // 2, self.scenario.grid, self.stride)
        return (side[:, None] * self.scenario.grid + side).reshape(-1)
