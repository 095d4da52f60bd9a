"""The area found: how much of what is truly of interest a survey predicts, and how much of its prediction is true."""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from maipp.engine.episode import Episode
from maipp.typing import Array, Bool, Float

# What counts as predicted: where the upper confidence bound reaches the threshold (the predicted high-interest area),
# or where the mean does (the map of it that one would draw). The first misses little, the second claims little.
Rule = Literal["bound", "mean"]


class AreaFound(eqx.Module):
    """Shares of the survey area, one entry per survey; leading axes are those of the predictions."""

    true: Float[Array | np.ndarray, "*b"]  # truly of interest
    predicted: Float[Array | np.ndarray, "*b"]  # predicted to be of interest
    both: Float[Array | np.ndarray, "*b"]  # predicted, and truly so

    @property
    def recall(self) -> Float[Array | np.ndarray, "*b"]:
        """Share of the true area that is predicted; 1 where there is nothing of interest to be found.

        Who has measured nothing predicts everything by the rule "bound": read it together with the precision.
        """
        return _share(self.both, self.true)

    @property
    def precision(self) -> Float[Array | np.ndarray, "*b"]:
        """Share of the predicted area that is truly of interest; 1 where nothing is predicted."""
        return _share(self.both, self.predicted)


def _share(part: Float[Array | np.ndarray, "*b"], whole: Float[Array | np.ndarray, "*b"]) -> Array | np.ndarray:
    """part / whole, 1 where the whole is nothing; on the host for what is on the host."""
    xp = np if isinstance(part, np.ndarray | np.generic) else jnp
    return xp.where(whole > 0, part / xp.where(whole > 0, whole, 1), 1.0)


def area_found(
    true: Bool[Array | np.ndarray, "*#b q"],
    predicted: Bool[Array | np.ndarray, "*#b q"],
    inside: Bool[Array | np.ndarray, "*#b q"],
) -> AreaFound:
    """The area found at the points inside the survey area; leading axes broadcast."""
    xp = np if isinstance(predicted, np.ndarray) else jnp
    true, predicted = true & inside, predicted & inside
    points = xp.maximum(xp.sum(inside, axis=-1), 1)
    shares = (xp.sum(area, axis=-1) / points for area in (true, predicted, true & predicted))
    return AreaFound(*xp.broadcast_arrays(*shares))


def found_by(episode: Episode, times: Float[np.ndarray, " t"] | None = None, rule: Rule = "bound") -> AreaFound:
    """What the team had found by each of these times (default: at the end, one entry), from its pooled belief."""
    beliefs = episode.beliefs(np.array([np.inf]) if times is None else times)
    threshold = episode.scenario.threshold
    predicted = beliefs.area if rule == "bound" else beliefs.mean >= threshold
    return area_found(episode.truth >= threshold, predicted, episode.inside)
