"""What planners count on of the field: a foresight's law at the grid points, and the Tr(P) expected under it."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.scipy.special import ndtr

from maipp.belief import Belief, Interest
from maipp.errors import InputError
from maipp.foresight import Foresight, ForesightName, Law, make_foresight
from maipp.problem import ScenarioLike
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Float, Int

# How much of a plan's worth lies in places that are likely of interest instead of predicted so, where a foresight says
# which these are (docs/evidence/foresight.md has the measurements behind this).
_AIM = 0.55


class Prospect(NamedTuple):
    """What is foreseen at the grid points, worked out once a decision."""

    mean: Float[Array, " q"]  # of the belief, given what is measured: from where planned measurements will move it
    law: Law  # of the truth
    interesting: Float[Array, " q"]  # probability that the truth is of high interest

    def at(self, index: Int[Array, " i"]) -> "Prospect":
        """The same at some of the points."""
        return jax.tree.map(lambda array: array[index], self)

    def expected_trace(
        self,
        interest: Interest,
        variance: Float[Array, "*c q"],
        known: Float[Array, " q"],
        inside: Bool[Array, " q"],
        *,
        aim: float,
        blur: float,
    ) -> Float[Array, "*c"]:
        """Tr(P) expected once planned measurements have been taken, as in `Interest.expected_trace`.

        There the belief's mean moves around where it is; here the part `rho = 1 - variance / known` of the way to the
        field that is foreseen, whatever the scenario takes planned values for. `aim` is the weight of the probability
        that a point is of interest; the rest is that of the probability that the belief will take it for such.
        """
        told = jnp.clip(1.0 - variance * (1.0 / jnp.maximum(known, 1e-8)), 0.0, 1.0)  # divided once a point, not a plan
        moved = self.mean + told * (self.law.mean - self.mean)
        width = jnp.sqrt(told * self.law.deviation**2 + blur**2)
        # The square root has no slope at a variance of zero; a point that well known weighs nothing.
        bound = interest.bound(moved, jnp.maximum(variance, 1e-8))
        weight = self.weighed(ndtr((bound - interest.threshold) / width), aim)
        return jnp.sum(jnp.where(inside, weight * variance, 0.0), axis=-1)

    def weighed(self, predicted: Float[Array, "*c q"], aim: float) -> Float[Array, "*c q"]:
        """The weight of each point of which it is this likely that it will be in the predicted area."""
        return (1.0 - aim) * predicted + aim * self.interesting


def prospect_of(foresight: Foresight | None, belief: Belief, interest: Interest) -> Prospect | None:
    """What is foreseen given a belief of real measurements on the evaluation grid; None without a foresight."""
    if foresight is None:
        return None
    law = foresight(belief)
    return Prospect(belief.mean, law, law.above(interest.threshold))


def aim_of(name: ForesightName, aim: float | None) -> float:
    """The aim: as given, else 0.55 where there is a foresight other than the protocol's."""
    if aim is not None:
        return aim
    return 0.0 if name == "protocol" else _AIM


def foresight_for(
    name: ForesightName, aim: float | None, scenario: ScenarioLike, made: Foresight | None
) -> Foresight | None:
    """The foresight that a planner asks: None where it would say what the planner knows without.

    One that was `made` for the scenario is kept, and made it must be for a compiled problem: else `InputError`.
    """
    if name == "protocol" and not aim:
        return None
    if not isinstance(scenario, Scenario):
        if made is None:
            raise InputError(f"foresight={name}: is made of a scenario, not of a compiled problem; give `foreseer` too")
        return made
    if made is not None and made.scenario == scenario:
        return made
    return make_foresight(name, scenario)


def check_aim(aim: float | None) -> None:
    """Raise InputError for an aim out of range."""
    if aim is not None and not 0.0 <= aim <= 1.0:
        raise InputError(f"aim={aim}: give a number from 0 to 1, or none")
