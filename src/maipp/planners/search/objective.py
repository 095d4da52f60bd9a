"""What plans in the plane are judged by: the Tr(P) expected after them."""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax
from jax.scipy.special import ndtr

from maipp.belief import Belief, Interest
from maipp.foresight.protocol import trusted_spread
from maipp.planners.lookahead import predicted
from maipp.planners.search.prospect import Prospect
from maipp.planners.search.variance import variance_left
from maipp.problem import ScenarioLike
from maipp.typing import Array, Bool, Float, Int, Real

# Width of the border of the area by which grid points are picked for the search, field units.
_BORDER = 0.15

# Powers of the inverse plastic number: multiples of them fill a plane evenly (Roberts 2018, the R2 sequence).
_LATTICE = (0.7548776662, 0.5698402910)

# How far from a measurement it still tells of a point, in length scales.
_NEAR = 0.6


class Objective(NamedTuple):
    """The Tr(P) expected after measuring somewhere, smooth in where that is."""

    scenario: ScenarioLike
    spread: float | None  # trust in the spread of values not yet measured; None: by the scenario
    blur: float  # smoothing of the area's border, field units
    aim: float = 0.0  # weight of the places that are foreseen to be of interest

    @property
    def interest(self) -> Interest:
        """The scenario's high-interest rule."""
        return Interest(self.scenario.threshold, self.scenario.beta, self.scenario.interest_rule)

    def after(
        self, belief: Belief, points: Float[Array, "c h 2"], taken: Bool[Array, "c h"]
    ) -> tuple[Float[Array, "c q"], Float[Array, "c q"]]:
        """Mean and variance at the query points after each plan's measurements."""
        if self.scenario.virtual_value == "zero":
            return predicted(belief, points, taken, virtual_value="zero")
        variance = variance_left(belief, points, taken)
        return jnp.broadcast_to(belief.mean, variance.shape), variance

    def expected(
        self,
        mean: Float[Array, "*c q"],
        variance: Float[Array, "*c q"],
        known: Float[Array, " q"],
        inside: Bool[Array, " q"],
        prospect: Prospect | None = None,
    ) -> Float[Array, "*c"]:
        """The Tr(P) expected of the measured values, which leave the variance `known`."""
        if prospect is not None:
            return prospect.expected_trace(self.interest, variance, known, inside, aim=self.aim, blur=self.blur)
        return self.interest.expected_trace(mean, variance, known, inside, spread=self._trusted(), blur=self.blur)

    def _trusted(self) -> Real:
        """The spread of values not yet measured that plans count on, in units of the belief's deviation."""
        # Who takes planned values for zero has no doubt about them.
        if self.scenario.virtual_value == "zero":
            return 0.0
        if self.spread is not None:
            return self.spread
        return trusted_spread(self.scenario)

    def worth(self, belief: Belief, prospect: Prospect | None = None) -> Float[Array, " q"]:
        """How uncertain the grid points are, as far as they may be of high interest."""
        bound = self.interest.bound(belief.mean, belief.variance)
        likely = ndtr((bound - self.interest.threshold) / _BORDER)
        return belief.variance * (likely if prospect is None else prospect.weighed(likely, self.aim))

    def in_play(
        self,
        belief: Belief,
        inside: Bool[Array, " q"],
        most: int,
        position: Float[Array, "2"] | None = None,
        reach: Float[Array, ""] | None = None,
        prospect: Prospect | None = None,
    ) -> Int[Array, " i"]:
        """Indices of the grid points that matter most: uncertain, maybe of high interest, and within reach if given."""
        weight = self.worth(belief, prospect)
        if position is not None and reach is not None:
            offset = belief.query - position
            far = jnp.sum(offset * offset, axis=-1) > (reach + _NEAR * self.scenario.length_scale) ** 2
            # Not nothing: where few points are within reach, the rest is filled up by weight.
            weight = jnp.where(far, 1e-3 * weight, weight)
        # Where all points are worth alike, as at first, an even lattice of them and not the first ones.
        count = belief.query.shape[0]
        x, y = jnp.divmod(jnp.arange(count), self.scenario.grid)
        weight = weight * (1.0 + (_LATTICE[0] * x + _LATTICE[1] * y) % 1.0)
        return lax.top_k(jnp.where(inside, weight, -1.0), min(most, count))[1]
