"""The PettingZoo environments: `aec_env`, `parallel_env`, and `env`, the first with the customary wrappers."""

from typing import Any

from pettingzoo import AECEnv
from pettingzoo.utils.wrappers import ClipOutOfBoundsWrapper, OrderEnforcingWrapper

from maipp.adapters.aec import SurveyAEC
from maipp.adapters.form import CANDIDATE, OWN, TEAM, Parts, split_view
from maipp.adapters.parallel import SurveyParallel
from maipp.scenario import Scenario

__all__ = [
    "CANDIDATE",
    "OWN",
    "TEAM",
    "Parts",
    "SurveyAEC",
    "SurveyParallel",
    "aec_env",
    "env",
    "parallel_env",
    "split_view",
]


def aec_env(scenario: Scenario | None = None, **options: Any) -> SurveyAEC:
    """A survey in which whoever arrives first decides; the options are those of `SurveyAEC`."""
    return SurveyAEC(scenario, **options)


def parallel_env(scenario: Scenario | None = None, **options: Any) -> SurveyParallel:
    """A survey in which all who have arrived decide together; the options are those of `SurveyParallel`."""
    return SurveyParallel(scenario, **options)


def env(scenario: Scenario | None = None, **options: Any) -> AECEnv:
    """`aec_env` in PettingZoo's wrappers: calls out of order are refused, waypoints outside the domain are cut."""
    made: AECEnv = SurveyAEC(scenario, **options)
    if made.form.actions == "waypoint":
        made = ClipOutOfBoundsWrapper(made)
    return OrderEnforcingWrapper(made)


raw_env = aec_env
