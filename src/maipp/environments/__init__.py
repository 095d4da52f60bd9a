"""Surveys as pure JAX environments: `Environment`, with `reset`, `step`, action masks and automatic resets."""

from maipp.environments.environment import Environment, EnvObservation, EnvState, Info, Specs, see
from maipp.environments.form import CANDIDATE, OWN, TEAM, split_view

__all__ = [
    "CANDIDATE",
    "OWN",
    "TEAM",
    "EnvObservation",
    "EnvState",
    "Environment",
    "Info",
    "Specs",
    "see",
    "split_view",
]
