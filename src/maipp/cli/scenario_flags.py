"""The flags that commands share: which survey to run, and with which options of the planner."""

import ast
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import numpy as np
import tyro

from maipp.errors import InputError
from maipp.planners import planner_names, planner_options
from maipp.records import FieldError, assignments, unknown
from maipp.scenario import Scenario
from maipp.scenario_io import load_scenario

if TYPE_CHECKING:  # they import JAX, which `--help` can do without
    from maipp.fields.raster import Raster
    from maipp.foresight import ForesightName
    from maipp.geo import GeoReference

_SCENARIO_KEY = "scenario."


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
        except FieldError as error:
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


@dataclass(frozen=True)
class FieldFlags(PlannerFlags):
    """The survey, its planners, and how to read the field's file: alike for every command that reads one."""

    start: Annotated[tuple[float, float] | None, tyro.conf.arg(metavar="X Y", help_behavior_hint="")] = None
    """where all agents set out, in coordinates of the field's file (domain units without one)"""

    threshold: Annotated[float | None, tyro.conf.arg(metavar="VALUE", help_behavior_hint="")] = None
    """value from which a point is of high interest, in units of the field's file"""

    value: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")] = None
    """array, column, band or variable of the field's file that holds the values, where there are several"""

    low: Annotated[float | None, tyro.conf.arg(metavar="VALUE", help_behavior_hint="(default: the smallest)")] = None
    """value in the field's file that becomes 0"""

    high: Annotated[float | None, tyro.conf.arg(metavar="VALUE", help_behavior_hint="(default: the largest)")] = None
    """value in the field's file that becomes 1"""

    invert: bool = False
    """low values are the interesting ones"""

    geographic: bool = False
    """the coordinates are degrees of longitude and latitude, though the file does not say so; short for --crs WGS84"""

    crs: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(default: the file's)")] = None
    """coordinate reference system of the file, such as EPSG:25833, in place of its own; none: a plain plane"""

    corners: Annotated[
        tuple[float, float, float, float] | None, tyro.conf.arg(metavar="X0 X1 Y0 Y1", help_behavior_hint="")
    ] = None
    """coordinates of the first and last column and of the first and last row, for a file without any"""

    def read_field(self, scenario: Scenario) -> "Raster | None":
        """The field of the scenario's file; None without one. Raises `InputError` for flags that contradict."""
        given = {
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "invert": self.invert or None,
            "geographic": self.geographic or None,
            "crs": self.crs,
            "corners": self.corners,
        }
        given = {name: value for name, value in given.items() if value is not None}
        if scenario.field is None:
            if given:
                name = next(iter(given))
                raise InputError(f"--{name}: says how to read a field's file, but there is none; give --field FILE")
            return None
        from maipp.fields.raster import read_field
        from maipp.geo import read_crs

        if given.pop("geographic", None):
            if self.crs is not None and not read_crs(self.crs, "--crs").geographic:
                raise InputError(f"--geographic: says degrees, --crs {self.crs} does not; give one of them")
            given.setdefault("crs", "WGS84")
        return read_field(scenario.field, **given)

    def in_field(self, scenario: Scenario, field: "Raster | None") -> Scenario:
        """The scenario with the field's shape, and --start and --threshold from its coordinates and unit."""
        there = None if field is None else field.reference
        changes: dict[str, Any] = {} if there is None else {"extent": there.domain}
        if self.start is not None:
            changes["start"] = self.start if there is None else _start_in(there, self.start)
        if self.threshold is not None:
            own = there is None
            changes["threshold"] = self.threshold if own else float(there.to_domain_values(self.threshold))
        return scenario.replace(**changes)


def _start_in(there: "GeoReference", start: tuple[float, float]) -> tuple[float, float]:
    """The domain position of a start in file coordinates; raises an `InputError` in these where it lies outside."""
    (west, south), (width, height) = there.origin, there.size
    if not (west <= start[0] <= west + width and south <= start[1] <= south + height):
        raise InputError(
            f"--start: {start[0]:g} {start[1]:g} is outside the field; give x from {west:g} to {west + width:g} "
            f"and y from {south:g} to {south + height:g}"
        )
    x, y = there.to_domain(np.array(start)).tolist()
    return min(x, there.domain[0]), min(y, there.domain[1])  # rounding may carry the far border across


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


def foresight_named(name: str | None) -> "ForesightName | None":
    """The foresight of a `--foresight` flag. Raises `InputError` for one that there is not."""
    from maipp.foresight import FORESIGHTS

    if name is not None and name not in FORESIGHTS:
        raise InputError(f"--foresight: {unknown('foresight', name, list(FORESIGHTS))}")
    return cast("ForesightName | None", name)
