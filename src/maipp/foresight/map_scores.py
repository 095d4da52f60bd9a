"""How good the map of a survey is that a foresight draws, beside the belief's: errors, and how often intervals hold."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from maipp.belief import rmse
from maipp.engine import Mission
from maipp.engine.score import pooled_belief
from maipp.engine.state import State
from maipp.foresight.foresight import Foresight
from maipp.kept import kept
from maipp.typing import Array, Bool, Float

# Half widths of the intervals that hold a normal value with 68 and 95 %, in standard deviations.
_INTERVALS = {"68": 1.0, "95": 1.959964}

# What the names of the metrics end with, after the foresight's or the belief's.
SUFFIXES = ("_rmse", *(f"_{share}" for share in _INTERVALS))


class MapScores(NamedTuple):
    """Of finished missions: the team's pooled measurements, over the survey area."""

    rmse: Float[Array, "*b"]  # of the foresight's mean, normalised field units
    within: dict[str, Float[Array, "*b"]]  # share of points whose truth lies in its intervals, by their percentage
    belief_within: dict[str, Float[Array, "*b"]]  # and in the belief's

    def values(self, name: str) -> dict[str, np.ndarray]:
        """The scores by the names of metrics; `name` is the foresight's."""
        held = {f"{name}_rmse": self.rmse}
        held |= {f"{name}_{key}": self.within[key] for key in _INTERVALS}
        held |= {f"belief_{key}": self.belief_within[key] for key in _INTERVALS}
        return {key: np.asarray(values) for key, values in held.items()}


@kept
def map_scores(foresight: Foresight, missions: Mission, states: State) -> MapScores:
    """The scores of a batch, one mission after the other to keep the memory of one."""
    return lax.map(lambda pair: _score(foresight, *pair), (missions, states))


def _score(foresight: Foresight, mission: Mission, state: State) -> MapScores:
    belief, inside = pooled_belief(mission, state), mission.inside
    law = foresight.on(mission.problem)(belief)
    return MapScores(
        rmse(law.mean, mission.truth, inside),
        _within(jnp.abs(mission.truth - law.mean), law.deviation, inside),
        _within(jnp.abs(mission.truth - belief.mean), belief.std, inside),
    )


def _within(
    error: Float[Array, " q"], deviation: Float[Array, " q"], inside: Bool[Array, " q"]
) -> dict[str, Float[Array, ""]]:
    count = jnp.sum(inside)
    return jax.tree.map(lambda half: jnp.sum(inside & (error <= half * deviation)) / count, _INTERVALS)
