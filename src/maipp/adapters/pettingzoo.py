"""The PettingZoo environments: `aec_env`, `parallel_env`, and `env`, the first with the customary wrappers."""

from typing import Any

from pettingzoo import AECEnv
from pettingzoo.utils.wrappers import ClipOutOfBoundsWrapper, OrderEnforcingWrapper

from maipp.adapters.aec import SurveyAEC
from maipp.adapters.parallel import SurveyParallel
from maipp.environments.form import CANDIDATE, OWN, TEAM, Parts, split_view
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


aec_env = raw_env = SurveyAEC  # whoever arrives first decides; the names are PettingZoo's customary ones
parallel_env = SurveyParallel  # all who have arrived decide together


def env(scenario: Scenario | None = None, **options: Any) -> AECEnv:
    """`aec_env` in PettingZoo's wrappers: calls out of order are refused, waypoints outside the domain are cut."""
    made: AECEnv = SurveyAEC(scenario, **options)
    if made.form.actions == "waypoint":
        made = ClipOutOfBoundsWrapper(made)
    return OrderEnforcingWrapper(made)
