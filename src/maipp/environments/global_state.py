"""The survey as nobody in it sees it: a global state for critics that are trained centrally."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from maipp.engine.mission import Mission
from maipp.engine.observe import belief_near, time_tolerance, with_prior
from maipp.engine.state import positions
from maipp.environments.environment import EnvState, mission_of
from maipp.environments.form import MEAN_LIMIT, Block
from maipp.problem import longest_side
from maipp.renamed import renamed
from maipp.scenario import Scenario
from maipp.typing import Array, Float

# Of each agent, lengths in longest sides of the extent: where it is, where its leg ends, the share of its budget that
# is left on arrival, and whether its survey goes on.
AGENT = ("x", "y", "end_x", "end_y", "left", "active")


def global_state(state: EnvState, time: Float[Array, ""], params: Mission) -> Float[Array, " w"]:
    """The rows `AGENT` of all agents, then mean and standard deviation by all measurements until now, and the truth.

    The last three are on the evaluation grid; means are cut as in observations. float32.
    """
    mission, survey = mission_of(params, state), dataclasses.replace(state.survey, time=time)
    longest = longest_side(mission.params.extent)
    left = 1.0 - survey.odometer / mission.params.budgets
    where = positions(survey, mission.params.speeds) / longest
    agents = jnp.concatenate([where, survey.leg[:, -1] / longest, left[:, None], survey.active[:, None]], axis=-1)
    taken = survey.measurement_time <= time + time_tolerance(mission.params.speeds)
    x, y = survey.measurement_x.reshape(-1, 2), survey.measurement_y.reshape(-1)
    belief = belief_near(mission, with_prior(mission, x, y, taken.reshape(-1)), mission.grid, mission.grid[0])
    spread = jnp.minimum(belief.std, jnp.sqrt(mission.params.signal_variance))
    maps = jnp.clip(jnp.stack([belief.mean, spread, mission.truth]), -MEAN_LIMIT, MEAN_LIMIT)
    return jnp.concatenate([jnp.clip(agents, 0.0, 1.0).ravel(), maps.ravel()]).astype(jnp.float32)


def global_state_bounds(scenario: Scenario) -> Block:
    """Bounds of the global state, float32."""
    points, spread = scenario.grid_points, scenario.signal_variance**0.5
    agents, value, std = (
        (scenario.agents * len(AGENT), 0.0, 1.0),
        (points, -MEAN_LIMIT, MEAN_LIMIT),
        (points, 0.0, spread),
    )
    rows = agents, value, std, value
    low, high = (np.concatenate([np.full(row[0], row[side]) for row in rows]).astype(np.float32) for side in (1, 2))
    return Block(low, high)


renamed(__name__, whole_state="global_state", whole_bounds="global_state_bounds")
