"""`maipp live`: a survey under way; robots' reports on standard input, where to go next on standard output."""

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from maipp.cli.team_flags import TeamFlags
from maipp.errors import InputError
from maipp.records import assignments
from maipp.seeds import check_seed

if TYPE_CHECKING:  # it imports JAX, which `maipp live --help` can do without
    from maipp.live import LiveSurvey


@dataclass(frozen=True, kw_only=True)
class LiveFlags(TeamFlags):
    """Read one JSON request a line, answer each with one JSON line (protocol maipp.live/1, docs/live.md).

    Every event is in the journal before it is answered. Started again on its journal, the survey goes on.
    """

    journal: Path
    """file that every event is added to; made if it is not there"""

    epoch: float = 0.0
    """time of the survey's start, seconds; with Unix time as `time`, the Unix time of the start"""

    adapt: tyro.conf.FlagCreatePairsOff[bool] = False
    """refit the kernel to what is measured, with a scenario file; a mission file says so itself (kernel.adapt)"""


def run(flags: LiveFlags) -> int:
    """Answer requests until standard input ends."""
    from maipp.live.serve import encode, serve

    if flags.seed is not None:
        check_seed(flags.seed, "--seed")
    if not math.isfinite(flags.epoch):
        raise InputError(f"--epoch: {flags.epoch} is not a time; give seconds, such as the start's Unix time")
    with _open(flags) as survey:
        survey.warm_up()
        _write(encode(survey.hello() | {"answer": "ready", "cut": survey.cut}))
        serve(survey, sys.stdin.buffer.readline, _write)
    return 0


def _write(line: bytes) -> None:
    sys.stdout.buffer.write(line)
    sys.stdout.buffer.flush()


def _open(flags: LiveFlags) -> "LiveSurvey":
    from maipp.live import LiveSurvey
    from maipp.scenario_io import load_scenario
    from maipp.surveys.standardise import prepare
    from maipp.surveys.survey_io import is_mission, load_survey

    options = assignments(flags.settings)
    if is_mission(flags.mission):
        if flags.adapt:
            raise InputError(f"--adapt: {flags.mission} is a mission file; give kernel: {{adapt: true}} in it")
        prepared = prepare(load_survey(flags.mission), planner=flags.planner, planner_options=options)
        for warning in prepared.warnings:
            print(f"warning: {warning}", file=sys.stderr)
        return LiveSurvey.from_prepared(prepared, seed=flags.seed, journal=flags.journal, epoch=flags.epoch)
    return LiveSurvey.from_scenario(
        load_scenario(flags.mission),
        flags.planner or "receding-horizon",
        options,
        seed=flags.seed or 0,
        journal=flags.journal,
        epoch=flags.epoch,
        adapt=flags.adapt,
    )
