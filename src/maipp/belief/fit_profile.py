"""How surely samples tell the length scale: the profile of the likelihood over it."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from maipp.belief.fit_samples import checked_samples
from maipp.belief.fit_search import bounds, profile

_MOST_SAMPLES = 400  # an eigendecomposition for each length scale: 400 samples take 0.05 s, 2,000 take 5 s
_RATIOS = 60  # noise ratios tried at each length scale


class LikelihoodProfile(NamedTuple):
    """The highest log marginal likelihood at each length scale, over mean, variances and noise."""

    length_scale: Float[np.ndarray, " s"]  # ascending, units of the positions
    log_likelihood: Float[np.ndarray, " s"]  # less its maximum over these length scales
    samples: int  # how many it was computed from, chosen by place where there were more


def likelihood_profile(
    x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], *, points: int = 30, also: float | None = None
) -> LikelihoodProfile:
    """The profile at `points` length scales over the range of the search, and at the one of `also`.

    Length scales whose value is above -1.92 are a 95 % confidence interval, for many samples. Raises InputError for
    samples that tell nothing.
    """
    samples = checked_samples(x, y, _MOST_SAMPLES)
    (low, high), (least, most) = bounds(samples.x)
    scales = np.linspace(low, high, points)
    if also is not None:
        scales = np.unique(np.append(scales, np.log(also)))
    spread = samples.y.std()
    values, _ = profile(samples.x, (samples.y - samples.y.mean()) / spread, scales, np.linspace(least, most, _RATIOS))
    return LikelihoodProfile(np.exp(scales), values - values.max(), len(samples.y))
