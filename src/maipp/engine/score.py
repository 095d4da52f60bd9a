"""How well a mission went: the objective and the measures that cannot be gamed by shrinking the predicted area."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from maipp.belief import KERNELS, Belief, Interest, Kernel, condition, rmse, trace
from maipp.engine.finite import mission_number, refuse_non_finite
from maipp.engine.mission import Mission
from maipp.engine.state import NOT_FINITE, RECORD_FULL, State, known_by
from maipp.kept import kept
from maipp.problem import ScenarioLike
from maipp.renamed import renamed
from maipp.scenario import DISTANCE_TOLERANCE
from maipp.typing import Array, Bool, Float


class Metrics(eqx.Module):
    """Quality of finished missions; every array has the missions' leading axis b."""

    trace: Float[Array, "*b"]  # Tr(P_f) of the team's pooled belief over the predicted high-interest area
    own_trace: Float[Array, "*b"]  # the same of each agent's own belief, mean over agents (paper Table IV)
    true_trace: Float[Array, "*b"]  # pooled variance over the points where the truth is of high interest
    rmse: Float[Array, "*b"]  # of the pooled mean over the survey area, normalised field units
    distance: Float[Array, "*b"]  # travelled by the team, domain units
    decisions: Float[Array, "*b"]  # taken by the team
    unspent: Float[Array, "*b"]  # budget that an agent had left, domain units, mean over agents
    not_finite: Float[Array, "*b"]  # agents stopped at a waypoint that is not a finite number
    record_full: Float[Array, "*b"]  # agents stopped since their record of the route was full


def belief_of(mission: Mission, state: State, mask: Bool[Array, "m s"]) -> Belief:
    """The belief on the evaluation grid that the masked measurements give, and the prior samples after them."""
    x, y, known = state.measurement_x.reshape(-1, 2), state.measurement_y.reshape(-1), mask.reshape(-1)
    extra_noise = None
    if mission.prior is not None:
        x, y, known, extra_noise = mission.prior.after(x, y, known, mission.params.noise)
    return condition(kernel_of(mission.problem), x, y, known, mission.grid, mission.params.noise, extra_noise)


Moments = Callable[[Bool[Array, "m s"]], tuple[Float[Array, " q"], Float[Array, " q"]]]


def moments_of(mission: Mission, state: State) -> Moments:
    """Mean and variance on the evaluation grid as a function of which measurements are known.

    Those of `belief_of`; of many masks, each is as cheap with prior samples as without, as these are factored once.
    """
    if mission.prior is None:

        def given(mask: Bool[Array, "m s"]) -> tuple[Float[Array, " q"], Float[Array, " q"]]:
            belief = belief_of(mission, state, mask)
            return belief.mean, belief.variance

        return given
    x, y = state.measurement_x.reshape(-1, 2), state.measurement_y.reshape(-1)
    process = mission.prior.process(kernel_of(mission.problem), x, mission.grid, mission.params.noise)
    return lambda mask: process.given(y, mask.reshape(-1), mission.params.noise)


def taken_by(state: State, time: float | Float[Array, ""] = jnp.inf) -> Bool[Array, "m s"]:
    """The measurements that the team has taken by `time` (default: all of them)."""
    return jnp.isfinite(state.measurement_time) & (state.measurement_time <= time)


def pooled_belief(mission: Mission, state: State, time: float | Float[Array, ""] = jnp.inf) -> Belief:
    """The belief from all measurements that the team has taken by `time` (default: all of them)."""
    return belief_of(mission, state, taken_by(state, time))


def kernel_of(scenario: ScenarioLike) -> Kernel:
    """The scenario's prior covariance."""
    return KERNELS[scenario.kernel](scenario.length_scale, scenario.signal_variance)


def interest_of(scenario: ScenarioLike) -> Interest:
    """The scenario's high-interest rule."""
    return Interest(scenario.threshold, scenario.beta, scenario.interest_rule)


class BeliefScore(eqx.Module):
    """How a survey stands that knows some of its measurements: the one place where beliefs are scored."""

    mean: Float[Array, " q"]  # on the evaluation grid
    variance: Float[Array, " q"]
    trace: Float[Array, ""]  # as in `Metrics`
    true_trace: Float[Array, ""]
    rmse: Float[Array, ""]


def score_belief(mission: Mission, moments: Moments, known: Bool[Array, "m s"]) -> BeliefScore:
    """How an unbatched mission stands with these measurements; `moments` are those of its state."""
    mean, variance = moments(known)
    high = (mission.truth >= mission.params.threshold) & mission.inside
    return BeliefScore(
        mean=mean,
        variance=variance,
        trace=interest_of(mission.problem).trace(mean, variance, mission.inside),
        true_trace=trace(variance, high),
        rmse=rmse(mean, mission.truth, mission.inside),
    )


def _score(mission: Mission, state: State) -> Metrics:
    """Metrics of one unbatched mission."""
    moments, there = moments_of(mission, state), mission.params.present
    final = score_belief(mission, moments, taken_by(state))

    agents = jnp.arange(mission.shape.agents)
    own = lax.map(lambda agent: score_belief(mission, moments, known_by(state, agent)).trace, agents)
    left = mission.params.budgets - state.odometer
    return Metrics(
        trace=final.trace,
        own_trace=jnp.sum(jnp.where(there, own, 0.0)) / jnp.sum(there),
        true_trace=final.true_trace,
        rmse=final.rmse,
        distance=jnp.sum(state.odometer),
        decisions=state.events.astype(own.dtype),
        unspent=jnp.sum(jnp.where(there & (left > DISTANCE_TOLERANCE), left, 0.0)) / jnp.sum(there),
        not_finite=jnp.sum(state.stopped_by == NOT_FINITE).astype(own.dtype),
        record_full=jnp.sum(state.stopped_by == RECORD_FULL).astype(own.dtype),
    )


def score_missions(missions: Mission, states: State, *, name: Callable[[int], str] | None = None) -> Metrics:
    """Metrics of a batch of finished missions.

    Raises InputError where a metric is not a finite number, and says of which mission: by `name`, or its number in the
    batch.
    """
    metrics = _score_missions(missions, states)
    refuse_non_finite(vars(jax.device_get(metrics)), mission_number() if name is None else name)
    return metrics


@kept
def _score_missions(missions: Mission, states: State) -> Metrics:
    """The metrics, one mission after the other to keep the memory of one."""
    return lax.map(lambda pair: _score(*pair), (missions, states))


@kept
def trace_over_time(mission: Mission, state: State, times: Float[Array, " t"]) -> Float[Array, " t"]:
    """Tr(P) of the pooled belief of one mission at each time."""
    moments = moments_of(mission, state)
    return lax.map(lambda time: score_belief(mission, moments, taken_by(state, time)).trace, times)


renamed(__name__, Standing="BeliefScore", standing="score_belief")
