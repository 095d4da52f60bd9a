"""The foresight that is learned: a network that corrects the fitted one, where it knows its way."""

from typing import NamedTuple

import jax.numpy as jnp

from maipp.belief import Belief
from maipp.foresight.bumps import Bumps
from maipp.foresight.features import Family, Foretold, Rules, between, features, lattice_points
from maipp.foresight.fitted import ODDS, FittedForesight, fitted_foresight
from maipp.foresight.foresight import Foresight
from maipp.foresight.law import Law
from maipp.foresight.model import CELLS, FieldModel, group_of
from maipp.foresight.own_kernel import own_kernel
from maipp.foresight.weighed import averaged
from maipp.scenario import Scenario
from maipp.typing import Array, Bool, Extent, Float, Int


class Correction(NamedTuple):
    """What the network adds to the fitted law on its lattice, all of it zero where it does not know its way."""

    shift: Float[Array, "h w"]  # of the mean, in deviations
    stretch: Float[Array, "h w"]  # of the logarithm of the deviation
    trusted: Bool[Array, ""]

    def of(self, law: Law, points: Float[Array, "p 2"], extent: Extent) -> Law:
        """The law at these points, corrected; the law itself where nothing is to be corrected."""
        shift, stretch = between(self.shift, points, extent), between(self.stretch, points, extent)
        return Law(law.mean + law.deviation * shift, law.deviation * jnp.exp(stretch))


class LearnedForesight(Foresight):
    """The fitted law, corrected by a network that has seen many surveys of many fields.

    Where what it is told lies outside of what it was trained on, the scores of the measurements so far among it, and
    for fields of no known family, the law is the fitted one.
    """

    fitted: FittedForesight
    model: FieldModel

    def __call__(self, belief: Belief) -> Law:
        """The law on the evaluation grid."""
        return self._law(belief, self.scenario.grid)

    def at(self, belief: Belief, points: Float[Array, "p 2"]) -> Law:
        """The law at any points (domain units), given the same belief."""
        return self._law(belief.on(points), None)

    def _law(self, belief: Belief, side: int | None) -> Law:
        """The fitted law at the belief's query points, a grid of `side` points a side or (None) any, corrected."""
        if self.fitted.bumps is None:
            return self.fitted.law(belief, side)
        factor = self.fitted.bumps.factored(belief, self.scenario.extent)
        law = self.fitted.law(belief, side, factor)
        return self.correction(belief, factor).of(law, belief.query, self.scenario.extent)

    def correction(self, belief: Belief, factor: Float[Array, "n n"] | None = None) -> Correction:
        """What the network corrects, given these measurements; `factor` is that of the family, if it is there."""
        assert self.fitted.bumps is not None
        scenario = self.scenario
        rules = Rules(scenario.threshold, scenario.length_scale, scenario.signal_variance, scenario.extent)
        maps, numbers = told(rules, self.fitted.bumps, belief, CELLS, factor)
        count = jnp.sum(belief.mask)
        return corrected(self.model, maps, numbers, count, self.model.knows(numbers, count))


def told(
    rules: Rules, bumps: Bumps, belief: Belief, cells: int, factor: Float[Array, "n n"] | None = None
) -> tuple[Float[Array, "h w c"], Float[Array, " g"]]:
    """What a network with a lattice of `cells` points a side is told of a belief."""
    extent = rules.extent
    lattice = lattice_points(cells, extent)
    there = belief.on(lattice)
    family, kernel = bumps.given(there, extent, cells, factor), own_kernel(there)
    foretold = Foretold(averaged(family, kernel, ODDS), there.mean, there.std, family.evidence, kernel.evidence)
    maps, numbers = features(family_of(bumps, extent), rules, belief, foretold, lattice)
    return maps.reshape(cells, cells, -1), numbers


def family_of(bumps: Bumps, extent: Extent) -> Family:
    """Mean, deviation and width of the family's fields, in the middle of the domain."""
    middle = 0.5 * jnp.asarray(extent)[None]
    width = jnp.sqrt(jnp.sum(bumps.widths * bumps.weights))
    return Family(bumps.mean(middle, extent)[0], jnp.sqrt(bumps.signal), width)


def corrected(
    model: FieldModel, maps: Float[Array, "h w c"], numbers: Float[Array, " g"], count: Int[Array, ""], trusted: Array
) -> Correction:
    """What the model's network says, as far as it is trusted."""
    shift, stretch = model.network(maps, numbers)
    stretch = stretch + jnp.log(model.widening[group_of(count)])
    return Correction(jnp.where(trusted, shift, 0.0), jnp.where(trusted, stretch, 0.0), trusted)


def learned_foresight(scenario: Scenario, weights: str | None = None) -> LearnedForesight:
    """The learned foresight of a scenario: with the weights that ship, or those of a file or run folder."""
    from maipp.foresight.shipped import model_named

    return LearnedForesight(scenario, fitted_foresight(scenario), model_named(weights))
