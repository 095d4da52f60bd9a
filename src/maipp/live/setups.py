"""The setup of a live survey: what a scenario or a mission file makes of it."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from maipp.belief.refit import HyperPrior
from maipp.errors import InputError
from maipp.live.differences import keys_of_scenario, keys_of_survey
from maipp.live.site import Site
from maipp.live.units import Units
from maipp.live.world import Setup, make_setup
from maipp.scenario import Scenario
from maipp.surveys.standardise import PreparedSurvey
from maipp.typing import Float


def scenario_setup(
    scenario: Scenario,
    planner: str,
    options: Mapping[str, object] | None,
    seed: int,
    robots: Sequence[str] | None,
    epoch: float,
    gate: float,
    adapt: HyperPrior | bool,
    prior: tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, " p"]] | None,
    prior_noise: float | None,
) -> Setup:
    """Of a scenario in its own units; robots are called robot1, robot2 and so on if not otherwise."""
    if scenario.kernel != "matern32" and (gate > 0 or adapt):
        raise InputError(
            f"kernel: {scenario.kernel}: live surveys judge samples and refit by matern32 alone; give that, or gate=0 "
            "and adapt=False"
        )
    names = tuple(robots or (f"robot{i + 1}" for i in range(scenario.agents)))
    around = HyperPrior(scenario.length_scale, scenario.noise, scenario.signal_variance**0.5)
    hyper = around if adapt is True else adapt or None
    setup = make_setup(scenario, planner, options, seed, names, Units(scenario.extent, epoch=epoch), gate, hyper)
    keys = keys_of_scenario(scenario, setup.options, gate, prior, prior_noise)
    return dataclasses.replace(setup, threshold=scenario.threshold, keys=keys)


def prepared_setup(prepared: PreparedSurvey, seed: int, epoch: float) -> Setup:
    """Of a real place, in its own coordinates and units."""
    survey, scenario, options = prepared.survey, prepared.scenario, prepared.planner_options
    units = Units(scenario.extent, prepared.frame, epoch, prepared.seconds_per_time)
    return dataclasses.replace(
        make_setup(scenario, prepared.planner, options, seed, prepared.names, units, survey.gate, prepared.adapt),
        site=Site.of(prepared),
        clearance=prepared.margin / prepared.frame.scale,
        beta_follows="beta" not in survey.scenario,
        threshold=survey.threshold,
        keys=keys_of_survey(survey, options),
    )
