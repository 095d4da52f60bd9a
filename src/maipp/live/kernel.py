"""The kernel as the engine's numbers: a mission under one that was found, its values standardised by that."""

import dataclasses
from typing import Any

import jax.numpy as jnp

from maipp.belief.refit import Hyperparameters
from maipp.engine import Mission
from maipp.scenario import Scenario
from maipp.surveys.standardise import EVERYTHING, interest_beta


def guess_of(scenario: Scenario) -> Hyperparameters:
    """The kernel of a scenario."""
    return Hyperparameters(0.0, scenario.signal_variance**0.5, scenario.length_scale, scenario.noise)


def interest_under(scenario: Scenario, level: float, scale: float, beta_follows: bool) -> tuple[float, float]:
    """Threshold and confidence where values are less `level`, in units of `scale`; without a threshold the scenario's.

    `beta_follows` says that the confidence follows from the threshold.
    """
    if scenario.threshold <= EVERYTHING:
        return scenario.threshold, scenario.beta
    threshold = (scenario.threshold - level) / scale
    return threshold, interest_beta(threshold) if beta_follows else scenario.beta


def under(mission: Mission, guess: Hyperparameters, kernel: Hyperparameters) -> Mission:
    """The mission with another kernel than its `guess`: values are less its mean, in units of its deviation.

    Threshold and confidence are the mission's still.
    """
    scale, real = kernel.std / guess.std, mission.grid.dtype
    values = {"length_scale": kernel.length_scale, "noise": kernel.noise / scale**2, "warp": kernel.warp}
    params = dataclasses.replace(mission.params, **{key: jnp.asarray(value, real) for key, value in values.items()})
    changed: dict[str, Any] = {"params": params}
    if mission.prior_y is not None:
        changed["prior_y"] = (mission.prior_y - kernel.mean) / scale
    if mission.prior_noise is not None:
        changed["prior_noise"] = mission.prior_noise * (kernel.noise / guess.noise / scale**2)
    return dataclasses.replace(mission, **changed)
