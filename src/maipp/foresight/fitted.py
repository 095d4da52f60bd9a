"""The foresight that is fitted: a Gaussian process of the field's own statistics."""

from maipp.belief import Belief
from maipp.foresight.bump_moments import bumps_of
from maipp.foresight.bumps import Bumps
from maipp.foresight.foresight import Foresight
from maipp.foresight.law import Law
from maipp.foresight.own_kernel import any_length_scale, own_kernel
from maipp.foresight.weighed import averaged
from maipp.scenario import Scenario
from maipp.typing import Array, Float

# Logarithm of the odds, before anything is measured, that a field is of the family that its scenario names.
# In fields of the family the measurements themselves say so by some 3 after nine of them and 8 after thirty; in fields
# that are not, standardised values for instance, a few measurements outweigh these odds.
ODDS = 8.0


class FittedForesight(Foresight):
    """The field is of the scenario's family, or else of the belief's own kernel with another level and scale.

    The family has been fitted to draws of it (`bumps_of`); level and scale are fitted to the measurements at hand,
    old samples among them; the kernel itself is the problem's, which a survey fits to its samples and under way, but
    that a field of no known family may have a shorter length scale. Between all these the measurements decide.
    """

    bumps: Bumps | None  # None: the field is of no known family

    def __call__(self, belief: Belief) -> Law:
        """The law on the evaluation grid."""
        return self.law(belief, self.scenario.grid)

    def at(self, belief: Belief, points: Float[Array, "p 2"]) -> Law:
        """The law at any points (domain units), given the same belief."""
        return self.law(belief.on(points), None)

    def law(self, belief: Belief, side: int | None, factor: Float[Array, "n n"] | None = None) -> Law:
        """The law at the belief's query points; `side` and `factor` as in `Bumps.given`."""
        if self.bumps is None:
            return any_length_scale(belief).law
        return averaged(self.bumps.given(belief, self.scenario.extent, side, factor), own_kernel(belief), ODDS)


def fitted_foresight(scenario: Scenario) -> FittedForesight:
    """The fitted foresight of a scenario."""
    drawn = scenario.field is None and scenario.field_family == "bumps"
    return FittedForesight(scenario, bumps_of(scenario) if drawn else None)
