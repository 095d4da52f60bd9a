"""The flags that commands share: which survey to run, and with which options of the planner."""

import ast
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from maipp.errors import InputError
from maipp.planners import planner_names, planner_options
from maipp.scenario import Scenario, ScenarioError
from maipp.scenario_io import load_scenario

_SCENARIO_KEY = "scenario."


def assignments(settings: tuple[tuple[str, ...], ...]) -> dict[str, str]:
    """The `--set KEY=VALUE` items as a mapping; raises `InputError` for one that is none, and for a key given twice."""
    found: dict[str, str] = {}
    for item in (item for group in settings for item in group):
        key, equals, value = item.partition("=")
        if not (equals and key.strip()):
            raise InputError(f"--set {item}: not an assignment; give KEY=VALUE, such as joint=true")
        key = key.strip().replace("-", "_")
        if key in found:
            raise InputError(f"--set {key}: given twice; keep one")
        found[key] = value.strip()
    return found


@dataclass(frozen=True)
class ScenarioFlags:
    """The survey that a command runs. A flag left out keeps what the scenario file says, or the default."""

    scenario: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: the paper's)")] = None
    """scenario file to start from; `maipp scenario` prints one"""

    agents: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")] = None
    """robots in the team"""

    budget: Annotated[tuple[float, ...], tyro.conf.arg(metavar="LENGTH [LENGTH ...]", help_behavior_hint="")] = ()
    """length of path each agent may travel, domain units"""

    length_scale: Annotated[float | None, tyro.conf.arg(metavar="LENGTH", help_behavior_hint="")] = None
    """length scale of the belief's kernel, domain units"""

    comm_range: Annotated[float | None, tyro.conf.arg(metavar="LENGTH", help_behavior_hint="")] = None
    """farthest distance at which agents hear each other, domain units; left out: at any distance"""

    field: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """file of the ground truth; left out: a random Gaussian mixture"""

    settings: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(name="set", metavar="KEY=VALUE [KEY=VALUE ...]"),
    ] = ()
    """options of the planner (`maipp planners` lists them), or `scenario.KEY=VALUE` for any scenario field"""

    def to_scenario(self, budget: float | tuple[float, ...] | None = None) -> Scenario:
        """The scenario that the flags describe; several budgets are one per agent, `budget` replaces them.

        Raises `InputError` for a bad scenario file or a value out of range.
        """
        if budget is None and self.budget:
            budget = self.budget[0] if len(self.budget) == 1 else self.budget
        flags: dict[str, Any] = {
            "agents": self.agents,
            "budget": budget,
            "length_scale": self.length_scale,
            "comm_range": self.comm_range,
            "field": self.field,
        }
        given = {name: value for name, value in flags.items() if value is not None}
        base = Scenario() if self.scenario is None else load_scenario(self.scenario)
        try:
            return base.replace(**(given | self._scenario_settings()))
        except ScenarioError as error:
            name = error.key.partition("[")[0]
            if name not in given:
                raise
            raise InputError(f"--{name.replace('_', '-')}: {error.problem}") from None

    def planner_options(self) -> dict[str, str]:
        """The `--set` values that are the planner's, as they were typed."""
        return {key: value for key, value in self._assignments().items() if not key.startswith(_SCENARIO_KEY)}

    def _assignments(self) -> dict[str, str]:
        return assignments(self.settings)

    def _scenario_settings(self) -> dict[str, Any]:
        return {
            key.removeprefix(_SCENARIO_KEY): _literal(value)
            for key, value in self._assignments().items()
            if key.startswith(_SCENARIO_KEY)
        }


@dataclass(frozen=True)
class PlannerFlags(ScenarioFlags):
    """The survey, and the weights of the planners that move by a policy."""

    weights: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: those that ship)")] = (
        None
    )
    """weights of planners with a policy: a .safetensors file with its .json card beside it"""

    def planner_options(self) -> dict[str, str]:
        """The `--set` values that are the planner's, and `--weights`, as they were typed."""
        options = super().planner_options()
        if self.weights is None:
            return options
        if "weights" in options:
            raise InputError("--weights: given again as --set weights; keep one")
        return options | {"weights": self.weights}

    def check_weights(self, planners: Iterable[str]) -> None:
        """Raise `InputError` where `--weights` is given and none of the planners has a policy."""
        if self.weights is not None and not any(map(_has_weights, planners)):
            able = ", ".join(filter(_has_weights, planner_names()))
            raise InputError(f"--weights: no planner given has a policy; give --planner, one or more of {able}")


def _has_weights(planner: str) -> bool:
    return any(option.name == "weights" for option in planner_options(planner))


def _literal(text: str) -> Any:
    """The number, list or null that the text spells, else the text itself; the scenario checks what it gets."""
    if text in ("null", "None", ""):
        return None
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text
