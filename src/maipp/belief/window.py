"""The belief of a survey with more measurements than one factor should hold.

Factoring n measurements takes n^3 operations, and each place that a planner tries n^2. But what happens around an
agent depends on measurements around it, the far ones being screened by the near, and the mean and variance anywhere
else on those there. So a belief of limited capacity has

- in its slots a window of the survey: the measurements that tell most of the surroundings of the agent, ever fewer of
  those farther away. Planners look ahead from these.
- at its query points the mean and variance that tiles of the whole survey give (`belief/tiles.py`), wherever these
  know more than the window. What a planned measurement takes from the variance shrinks in the same proportion.

Up to the capacity it is exact. Beyond it, variances are those of a part of the measurements, and so not too low but for
rounding; docs/evidence/speed.md has the errors.
"""

from maipp.belief.kernel import Kernel
from maipp.belief.posterior import Belief, condition, condition_window
from maipp.belief.thinning import most_telling
from maipp.belief.tiles import survey_of
from maipp.typing import Array, Bool, Float


def condition_near(
    kernel: Kernel,
    x: Float[Array, "n 2"],
    y: Float[Array, " n"],
    mask: Bool[Array, " n"],
    query: Float[Array, "q 2"],
    noise: float | Float[Array, ""] = 1e-6,
    extra_noise: Float[Array, " n"] | None = None,
    *,
    near: Float[Array, "2"],
    reach: float | Float[Array, ""],
    capacity: int,
) -> Belief:
    """Belief of an agent that is at `near`, whose slots hold at most `capacity` of the measurements.

    `reach` (domain units) is how far around the agent no measurement counts more than another; `extra_noise` is that of
    `condition`. With up to `capacity` slots it is `condition`, bit for bit; with more slots but no more measurements it
    is the same up to rounding.
    """
    if x.shape[0] <= capacity:
        return condition(kernel, x, y, mask, query, noise, extra_noise)
    survey = survey_of(x, y, mask, noise, extra_noise)
    window = most_telling(x, mask, survey.spaced, near, near, reach, capacity)
    return condition_window(kernel, survey, window, query)
