"""Multi-agent adaptive informative path planning with Gaussian-process beliefs, in JAX.

The names below are imported when they are first used: importing maipp itself imports no JAX, so that
`maipp.use_all_cores()` can still come first.
"""

import importlib
from typing import TYPE_CHECKING, Any

from maipp.renamed import renamed, serve_old_modules

if TYPE_CHECKING:
    from maipp.belief.interest import Interest
    from maipp.belief.posterior import Belief, condition, extend
    from maipp.bench.evaluate import evaluate
    from maipp.bench.evaluations import compare
    from maipp.devices import keep_compiled, use_all_cores
    from maipp.engine.decision import Decision, Observation, Planner
    from maipp.engine.episode import Episode
    from maipp.engine.episode_io import read_episode, write_episode
    from maipp.engine.mission import Mission, draw_missions
    from maipp.engine.options import option, part
    from maipp.engine.rollout import run_missions
    from maipp.engine.score import Metrics, score_missions
    from maipp.engine.state import State
    from maipp.engine.surveyed import belief_at, trajectories
    from maipp.environments.environment import Environment
    from maipp.errors import InputError
    from maipp.fields.raster import Raster, read_field
    from maipp.fleet.vehicle import Vehicle
    from maipp.live.live_survey import LiveSurvey
    from maipp.planners.lookahead import predicted_trace, predicted_variance
    from maipp.planners.paths.path_sampler import PathSampler
    from maipp.planners.registry import make_planner, register
    from maipp.planners.roadmap.edges import feasible_edges
    from maipp.planners.search.plan_search import PlanSearch
    from maipp.policy.shipped import load_policy
    from maipp.scenario import Scenario
    from maipp.scenario_io import load_scenario
    from maipp.surveys.standardise import prepare
    from maipp.surveys.survey_io import load_survey

    __version__: str

_MODULES = {
    "Belief": "maipp.belief.posterior",
    "Decision": "maipp.engine.decision",
    "Environment": "maipp.environments.environment",
    "Episode": "maipp.engine.episode",
    "InputError": "maipp.errors",
    "Interest": "maipp.belief.interest",
    "LiveSurvey": "maipp.live.live_survey",
    "Metrics": "maipp.engine.score",
    "Mission": "maipp.engine.mission",
    "Observation": "maipp.engine.decision",
    "PathSampler": "maipp.planners.paths.path_sampler",
    "PlanSearch": "maipp.planners.search.plan_search",
    "Planner": "maipp.engine.decision",
    "Raster": "maipp.fields.raster",
    "Scenario": "maipp.scenario",
    "State": "maipp.engine.state",
    "Vehicle": "maipp.fleet.vehicle",
    "belief_at": "maipp.engine.surveyed",
    "compare": "maipp.bench.evaluations",
    "condition": "maipp.belief.posterior",
    "draw_missions": "maipp.engine.mission",
    "evaluate": "maipp.bench.evaluate",
    "extend": "maipp.belief.posterior",
    "feasible_edges": "maipp.planners.roadmap.edges",
    "keep_compiled": "maipp.devices",
    "load_policy": "maipp.policy.shipped",
    "load_scenario": "maipp.scenario_io",
    "load_survey": "maipp.surveys.survey_io",
    "make_planner": "maipp.planners.registry",
    "option": "maipp.engine.options",
    "part": "maipp.engine.options",
    "predicted_trace": "maipp.planners.lookahead",
    "predicted_variance": "maipp.planners.lookahead",
    "prepare": "maipp.surveys.standardise",
    "read_episode": "maipp.engine.episode_io",
    "read_field": "maipp.fields.raster",
    "register": "maipp.planners.registry",
    "run_missions": "maipp.engine.rollout",
    "score_missions": "maipp.engine.score",
    "trajectories": "maipp.engine.surveyed",
    "use_all_cores": "maipp.devices",
    "write_episode": "maipp.engine.episode_io",
}

__all__ = [
    "Belief",
    "Decision",
    "Environment",
    "Episode",
    "InputError",
    "Interest",
    "LiveSurvey",
    "Metrics",
    "Mission",
    "Observation",
    "PathSampler",
    "PlanSearch",
    "Planner",
    "Raster",
    "Scenario",
    "State",
    "Vehicle",
    "__version__",
    "belief_at",
    "compare",
    "condition",
    "draw_missions",
    "feasible_edges",
    "evaluate",
    "extend",
    "keep_compiled",
    "load_policy",
    "load_scenario",
    "load_survey",
    "make_planner",
    "option",
    "part",
    "predicted_trace",
    "predicted_variance",
    "prepare",
    "read_episode",
    "read_field",
    "register",
    "run_missions",
    "score_missions",
    "trajectories",
    "use_all_cores",
    "write_episode",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("maipp")
        except PackageNotFoundError:  # run from a source tree
            return "unknown"
    if name in _MODULES:
        value = globals()[name] = getattr(importlib.import_module(_MODULES[name]), name)
        return value
    raise AttributeError(f"module 'maipp' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


renamed(__name__, edges_here="feasible_edges")
serve_old_modules()
