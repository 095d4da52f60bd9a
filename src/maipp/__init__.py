"""Multi-agent adaptive informative path planning with Gaussian-process beliefs, in JAX.

The names below are imported when they are first used: importing maipp itself imports no JAX, so that
`maipp.use_all_cores()` can still come first.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from maipp.benchmarks.evaluate import evaluate
    from maipp.devices import keep_compiled, use_all_cores
    from maipp.engine.mission import draw_missions
    from maipp.engine.rollout import run_missions
    from maipp.engine.score import score_missions
    from maipp.environments.environment import Environment
    from maipp.live.survey import LiveSurvey
    from maipp.planners.registry import make_planner, register
    from maipp.policy.shipped import load_policy
    from maipp.scenario import Scenario
    from maipp.scenario_io import load_scenario

    __version__: str

_MODULES = {
    "Environment": "maipp.environments.environment",
    "LiveSurvey": "maipp.live.survey",
    "Scenario": "maipp.scenario",
    "draw_missions": "maipp.engine.mission",
    "evaluate": "maipp.benchmarks.evaluate",
    "keep_compiled": "maipp.devices",
    "load_policy": "maipp.policy.shipped",
    "load_scenario": "maipp.scenario_io",
    "make_planner": "maipp.planners.registry",
    "register": "maipp.planners.registry",
    "run_missions": "maipp.engine.rollout",
    "score_missions": "maipp.engine.score",
    "use_all_cores": "maipp.devices",
}

__all__ = [
    "Environment",
    "LiveSurvey",
    "Scenario",
    "__version__",
    "draw_missions",
    "evaluate",
    "keep_compiled",
    "load_policy",
    "load_scenario",
    "make_planner",
    "register",
    "run_missions",
    "score_missions",
    "use_all_cores",
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
