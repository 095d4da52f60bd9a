"""The survey as it is expected to go: the simulated mission on the field that the samples lead to expect."""

import dataclasses
from typing import Any, NamedTuple

import jax
import numpy as np

from maipp.engine import Mission, Planner, draw_missions, run_missions
from maipp.engine.episode import Episode
from maipp.engine.keys import key_of
from maipp.engine.rollout import run_recorded
from maipp.errors import InputError
from maipp.planners.announced.recorded_messages import broadcasts_of, tells_plans, whole_message
from maipp.renamed import renamed
from maipp.surveys.expected_field import ExpectedField
from maipp.surveys.standardise import PreparedSurvey
from maipp.team.broadcast import Broadcast


class ExpectedSurvey(NamedTuple):
    """The survey as it is expected to go."""

    episode: Episode
    broadcasts: tuple[Broadcast, ...]  # what the robots tell each other, where that says where they are going


def expected_mission(prepared: PreparedSurvey, *, seed: int | None = None) -> Episode:
    """The record of the adaptive mission in which every measurement gives what the samples lead to expect.

    Its routes can be loaded today: they are what the planner would do if nothing surprised it. `seed` replaces the
    survey's. Raises `InputError` for a planner or option that does not fit.
    """
    return expected_course(prepared, seed=seed).episode


def expected_course(prepared: PreparedSurvey, *, seed: int | None = None) -> ExpectedSurvey:
    """As `expected_mission`, with what the robots tell each other on the way."""
    planner = prepared.make_planner()
    seed = prepared.survey.seed if seed is None else seed
    field = ExpectedField.of(prepared.scenario, prepared.prior_x, prepared.prior_y, noise=prepared.prior_noise)
    missions = draw(prepared, planner, seed=seed, instances=1, field=field)
    key, told = key_of(seed), ()
    if tells_plans(planner):
        states, events = run_recorded(planner, missions, key, whole_message)
        told = broadcasts_of(events)
    else:
        states = jax.block_until_ready(run_missions(planner, missions, key))
    options = {name: _plain(value) for name, value in prepared.planner_options.items()}
    episode = Episode.from_state(
        prepared.scenario, prepared.planner, options, seed, missions, states, reference=prepared.frame
    )
    return ExpectedSurvey(dataclasses.replace(episode, expected=True), told)


def draw(
    prepared: PreparedSurvey, planner: Planner, *, seed: int, instances: int, trials: int = 1, field: Any = None
) -> Mission:
    """Missions of a survey, conditioned on its samples. Raises `InputError` where there is no way to go."""
    try:
        return draw_missions(
            prepared.scenario,
            seed=seed,
            instances=instances,
            trials=trials,
            planner=planner,
            field=field,
            prior=prepared.prior,
            prior_noise=None if prepared.prior is None else prepared.prior_noise,
        )
    except InputError as error:
        raise InputError(f"{prepared.survey.where('area')}: {error}") from None


def _plain(value: Any) -> Any:
    """Lists for tuples and arrays, as JSON has them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


renamed(__name__, Expected="ExpectedSurvey")
