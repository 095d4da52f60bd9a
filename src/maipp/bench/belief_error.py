"""What a belief of limited capacity gets wrong: against the exact posterior of the same survey in float64."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.linalg import cholesky, solve_triangular

from maipp.belief import Matern32, condition_near
from maipp.engine import Mission, draw_missions
from maipp.engine.observe import window_reach
from maipp.engine.score import interest_of
from maipp.scenario import Scenario
from maipp.typing import Array, Float

# Made-up surveys: routes that criss-cross the whole domain, and such as hardly leave the start.
INTERVALS = (0.2, 0.04)
LENGTH_SCALES = (0.45, 0.25, 0.1)
COUNTS = (1500, 5000)
_AGENTS = 100
# Standard deviation of the turn at each measurement, radians: about as crooked as the routes of the planners here.
_TURN = 0.9


def walks(rng: np.random.Generator, agents: int, count: int, interval: float) -> Float[np.ndarray, "m c 2"]:
    """Measured positions of agents that set out together and wander over the unit square, `interval` apart (< 1).

    Whoever heads out of the square lingers along its border, so measurements are denser there.
    """
    position = np.broadcast_to(rng.random(2), (agents, 2))
    heading = rng.uniform(-np.pi, np.pi, agents)
    visited = np.empty((agents, count, 2))
    for i in range(count):
        heading = heading + rng.normal(0.0, _TURN, agents)
        # Straight on and mirrored at the borders: a step is less than the side, so nobody is mirrored twice.
        ahead = position + interval * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        position = np.abs(np.where(ahead > 1, 2 - ahead, ahead))
        visited[:, i] = position
    return visited


class BeliefError(NamedTuple):
    """Errors over a few surveys of one kind."""

    measurements: int
    interval: float  # between measurements, domain units
    length_scale: float  # domain units
    surveys: int
    trace: float  # exact Tr(P) over the predicted high-interest area, mean over the surveys
    error: float  # (Tr(P) - exact) / exact, mean over the surveys
    error_se: float  # its standard error; NaN of a single survey
    error_worst: float  # the largest of them in size, with its sign
    mean_worst: float  # largest error of the mean at any grid point of any survey, normalised field units
    variance_worst: float  # the same of the variance, its square

    @property
    def point(self) -> tuple[int, float, float]:
        """What was measured: surveys with these measurements, interval and length scale."""
        return self[:3]


def exact_moments(
    scenario: Scenario, x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], query: Float[np.ndarray, "q 2"]
) -> tuple[Float[np.ndarray, " q"], Float[np.ndarray, " q"]]:
    """Posterior mean and variance in float64, from one Cholesky factor of all measurements (SciPy)."""
    x, y, query = (np.asarray(array, np.float64) for array in (x, y, query))

    def covariance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        squared = (a[:, None, 0] - b[None, :, 0]) ** 2 + (a[:, None, 1] - b[None, :, 1]) ** 2
        distance = np.sqrt(3.0 * squared) / scenario.length_scale
        return scenario.signal_variance * (1.0 + distance) * np.exp(-distance)

    gram = covariance(x, x)
    gram[np.diag_indices(len(x))] += scenario.noise
    factor = cholesky(gram, lower=True, overwrite_a=True, check_finite=False)
    whitened = solve_triangular(factor, covariance(x, query), lower=True, check_finite=False)
    values = solve_triangular(factor, y, lower=True, check_finite=False)
    return values @ whitened, scenario.signal_variance - np.sum(whitened * whitened, axis=0)


def belief_error(
    measurements: int, interval: float, length_scale: float, *, surveys: int, seed: int, capacity: int | None = None
) -> BeliefError:
    """Errors of the belief that an agent of a hundred has, at float32, when all know `measurements` of them all.

    `capacity` replaces the scenario's `belief_capacity`.
    """
    each = max(1, measurements // _AGENTS)
    given = {} if capacity is None else {"belief_capacity": capacity}
    scenario = Scenario.create(
        agents=_AGENTS, budget=each * interval, measurement_interval=interval, length_scale=length_scale, **given
    )
    missions = draw_missions(scenario, seed=seed, instances=surveys, roadmaps=False)
    interest = interest_of(scenario)
    kernel = Matern32(scenario.length_scale, scenario.signal_variance)

    @jax.jit
    def limited(mission: Mission, x: Array, near: Array) -> tuple[Array, Array, Array, Array]:
        y = mission.field(x)
        belief = condition_near(
            kernel,
            x,
            y,
            jnp.ones(x.shape[0], bool),
            mission.grid,
            scenario.noise,
            near=near,
            reach=window_reach(scenario.measurement_interval),
            capacity=scenario.belief_capacity,
        )
        return belief.mean, belief.variance, interest.trace(belief.mean, belief.variance, mission.inside), y

    errors, traces, of_mean, of_variance = [], [], 0.0, 0.0
    for i in range(surveys):
        mission = jax.tree.map(lambda a, i=i: a[i], missions)
        x = jnp.asarray(walks(np.random.default_rng([seed, i]), _AGENTS, each, interval).reshape(-1, 2), jnp.float32)
        mean, variance, trace, y = jax.device_get(limited(mission, x, x[each - 1]))
        exact_mean, exact_variance = exact_moments(scenario, np.asarray(x), y, np.asarray(mission.grid))
        exact = float(interest.trace(jnp.asarray(exact_mean), jnp.asarray(exact_variance), mission.inside))
        traces.append(exact)
        errors.append(float(trace) / exact - 1.0)
        of_mean = max(of_mean, float(np.abs(mean - exact_mean).max()))
        of_variance = max(of_variance, float(np.abs(variance - exact_variance).max()))
    return BeliefError(
        measurements=_AGENTS * each,
        interval=interval,
        length_scale=length_scale,
        surveys=surveys,
        trace=float(np.mean(traces)),
        error=float(np.mean(errors)),
        error_se=float(np.std(errors, ddof=1) / math.sqrt(surveys)) if surveys > 1 else math.nan,
        error_worst=max(errors, key=abs),
        mean_worst=of_mean,
        variance_worst=of_variance,
    )
