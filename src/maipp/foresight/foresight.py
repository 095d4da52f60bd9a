"""The protocol between whoever foresees the field and whoever asks."""

from abc import abstractmethod
from typing import TypeVar

import equinox as eqx
import jax

from maipp.belief import Belief
from maipp.foresight.law import Law
from maipp.problem import Problem
from maipp.scenario import Scenario
from maipp.typing import Array, Float

F = TypeVar("F", bound="Foresight")


class Foresight(eqx.Module):
    """Base of all foresights: a pytree whose weights and fitted numbers are arrays.

    `scenario` is the one that it was made for; while it is compiled it is a `Problem` with the same names, of which
    what sets sizes is a Python value and any other number (`threshold`, `extent`) an array. All methods must be
    traceable by JAX, and are vmapped over missions.
    """

    scenario: Scenario | Problem

    def on(self: F, problem: Problem) -> F:
        """The same, and those that it is made of, for compiled code: this problem in place of the scenario."""
        return jax.tree.map(
            lambda node: problem if isinstance(node, Scenario) else node,
            self,
            is_leaf=lambda node: isinstance(node, Scenario),
        )

    @abstractmethod
    def __call__(self, belief: Belief) -> Law:
        """The law of the field on the evaluation grid.

        `belief` is the protocol's, its `query` the evaluation grid (x slowest), and holds real measurements alone: they
        are `belief.y` at `belief.x` where `belief.mask`, of noise variance `belief.noise` plus `belief.extra_noise`
        (None: zero). There may be none at all.
        """

    def at(self, belief: Belief, points: Float[Array, "p 2"]) -> Law:
        """The law at any points (domain units), given the same belief."""
        return self(belief.on(points))
