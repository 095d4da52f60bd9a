"""The survey of a fleet, from the file that all of its robots have."""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from maipp.errors import InputError
from maipp.fleet.log import check_name
from maipp.live.team import TeamSurvey
from maipp.scenario_io import load_scenario
from maipp.surveys.standardise import PreparedSurvey, prepare
from maipp.surveys.survey_io import is_mission, load_survey


class FleetSurvey(NamedTuple):
    """A survey, and its mission where that is a real place."""

    survey: TeamSurvey
    prepared: PreparedSurvey | None


def open_team(
    path: Path,
    planner: str | None,
    options: Mapping[str, str],
    seed: int | None,
    epoch: float,
    reach: float | None,
    tell: Callable[[str], None],
) -> FleetSurvey:
    """The survey of a mission or scenario file; `reach` takes the place of its range of communication.

    Raises `InputError` for what cannot be surveyed, and for robots whose names cannot be those of a fleet.
    """
    if is_mission(path):
        told = load_survey(path)
        told = told if reach is None else dataclasses.replace(told, communication_range_m=reach)
        prepared = prepare(told, planner=planner, planner_options=options)
        for warning in prepared.warnings:
            tell(f"warning: {warning}")
        survey = TeamSurvey.from_prepared(prepared, seed=seed, epoch=epoch)
        assert isinstance(survey, TeamSurvey)
        return FleetSurvey(survey, prepared)
    scenario = load_scenario(path)
    scenario = scenario if reach is None else scenario.replace(comm_range=reach)
    survey = TeamSurvey.from_scenario(scenario, planner or "receding-horizon", options, seed=seed or 0, epoch=epoch)
    assert isinstance(survey, TeamSurvey)
    return FleetSurvey(survey, None)


def check_team(survey: TeamSurvey, name: str | None) -> None:
    """Raise `InputError` for names that cannot be sent, and for one that is none of the robots'."""
    for robot in survey.names:
        check_name(robot, "robots")
    if name is not None and name not in survey.names:
        raise InputError(f"--name: {name!r:.60} is no robot of the mission; there is {', '.join(survey.names)}")
