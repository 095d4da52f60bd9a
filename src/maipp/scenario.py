"""The typed, validated description of one survey problem: world, team, belief, objective."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, no_type_check

from maipp import scenario_checks as checks
from maipp.errors import InputError, one_line
from maipp.scenario_checks import CheckError, nearest, show
from maipp.scenario_fields import FieldDescription, Quantity, described, option

Pair = tuple[float, float]
Polygon = tuple[Pair, ...]

# Travelled distances are float32 sums of leg lengths; this absorbs their rounding (about 20 ulp at budget 5).
DISTANCE_TOLERANCE = 1e-5

# More measurement points than this along one path lie closer together than float32 distances can tell.
_MOST_MEASUREMENTS = 1_000_000

_PAPER = "Yang et al. 2023"


class ScenarioError(InputError):
    """One wrong field: `key` names it (`budget[1]` with an index), `problem` is what is wrong and right."""

    def __init__(self, key: str, problem: str, where: str | None = None) -> None:
        super().__init__(key, problem, where)  # all three, so that the error survives pickling
        self.key, self.problem, self.where = key, problem, where

    def __str__(self) -> str:
        return one_line(f"{f'{self.where}: ' if self.where else 'scenario.'}{self.key}: {self.problem}")


@dataclass(frozen=True)
class Scenario:
    """One survey problem. Immutable and hashable, so that compiled functions are keyed on it.

    Lengths are in domain units (the paper's domain is the unit square), values in the field's own units.
    Defaults are the paper's (Yang et al. 2023, Sec. IV-E and V) as calibrated in `docs/protocol.md`.
    Lists and arrays become tuples, whole numbers become floats where a float is meant.

    Raises `ScenarioError`, an `InputError`, for the first field that is wrong.
    """

    agents: int = option(
        3,
        checks.whole(1),
        Quantity("a number of agents", "robots", "a whole number >= 1"),
        meaning="number of robots in the team",
        source=f"{_PAPER}, Sec. IV-E (m)",
    )
    budget: float | tuple[float, ...] = option(
        3.0,
        checks.one_or_many(checks.real(above=0.0)),
        Quantity("a budget", "domain units", "a length > 0 (domain units), or one per agent"),
        meaning="length of path each agent may travel",
        source=f"{_PAPER}, Sec. IV-E (B)",
    )
    speed: float | tuple[float, ...] = option(
        1.0,
        checks.one_or_many(checks.real(above=0.0)),
        Quantity("a speed", "domain units per unit of time", "a speed > 0, or one per agent"),
        meaning="constant speed at which each agent travels",
        source=f"{_PAPER}, Sec. IV-A (constant); the value sets the unit of time",
    )
    start: Pair | tuple[Pair, ...] | None = option(
        None,
        checks.optional(checks.one_or_many(checks.sequence(checks.real(), 2, 2), depth=1)),
        Quantity("a start", "domain units", "[x, y] inside the extent, one [x, y] per agent, or null (None)"),
        meaning="where the agents set out; one position is shared by all, null draws a shared one uniformly",
        source=f"{_PAPER}, Sec. IV-E (drawn), Sec. V (shared)",
    )
    comm_range: float | None = option(
        None,
        checks.optional(checks.real(above=0.0)),
        Quantity("a communication range", "domain units", "a length > 0, or null (None) for global"),
        meaning="farthest distance at which a deciding agent hears another; null hears everyone",
        source=f"{_PAPER}, Sec. V-A (global, 0.3, 0.6)",
    )
    measurement_interval: float = option(
        0.2,
        checks.real(above=0.0),
        Quantity("a measurement interval", "domain units", "a length > 0, at most the largest budget"),
        meaning="distance travelled between two measurements",
        source=f"{_PAPER}, Sec. IV-E",
    )
    extent: Pair = option(
        (1.0, 1.0),
        checks.sequence(checks.real(above=0.0, most=20.0), 2, 2),  # float32 distances keep 1e-5 up to some 100
        Quantity("an extent", "domain units", "[width, height], both > 0 and <= 20 (scale so that sides are about 1)"),
        meaning="width and height of the domain, whose lower left corner is (0, 0)",
        source=f"{_PAPER}, Sec. IV-E (unit square)",
    )
    grid: int = option(
        30,
        checks.whole(2),
        Quantity("a grid size", "points", "a whole number >= 2"),
        meaning="points per side of the evaluation grid, both ends included",
        source=f"{_PAPER}, Sec. IV-E",
    )
    obstacles: tuple[Polygon, ...] = option(
        (),
        checks.sequence(checks.polygon),
        Quantity("an obstacle", "domain units", "a list of polygons, each of at least 3 distinct [x, y]"),
        meaning="no-go zones, polygons that no route enters",
        source=f"{_PAPER}, Sec. IV-A (named as an extension; none there)",
    )
    field: str | None = option(
        None,
        checks.optional(checks.path),
        Quantity("a path", "path", "the path of a field file, or null (None)"),
        meaning="file of the ground truth; null draws a Gaussian mixture",
        source="maipp",
    )
    mixture_components: tuple[int, int] = option(
        (8, 12),
        checks.low_high(checks.whole(1)),
        Quantity("a range of bump counts", "bumps", "[low, high], whole numbers with 1 <= low <= high"),
        meaning="fewest and most Gaussian bumps in a drawn ground truth, both included",
        source=f"{_PAPER}, Sec. IV-E",
    )
    mixture_variance: Pair = option(
        (5e-5, 2e-4),
        checks.low_high(checks.real(above=0.0)),
        Quantity("a range of squared variances", "domain units^4", "[low, high] with 0 < low <= high"),
        meaning="range that the square of a bump's variance along an axis is drawn from",
        source="the public code family of the paper",
    )
    length_scale: float = option(
        0.45,
        checks.real(above=0.0),
        Quantity("a length scale", "domain units", "a length > 0 (domain units)"),
        meaning="length scale of the Matern 3/2 kernel (0.25 in the ten-agent tables)",
        source="calibrated on the paper's tables",
    )
    signal_variance: float = option(
        1.0,
        checks.real(above=0.0),
        Quantity("a signal variance", "field units squared", "a variance > 0"),
        meaning="prior variance of the field at any point",
        source=f"{_PAPER}, Sec. IV-E (initial trace 900 on 30 x 30)",
    )
    noise: float = option(
        1e-6,
        checks.real(least=0.0),
        Quantity("a noise variance", "field units squared", "a variance >= 0"),
        meaning="variance of the measurement noise, on the diagonal of the kernel matrix",
        source="measured: up to 1e-6 gives the table of 1e-10 in float64",
    )
    belief_capacity: int = option(
        512,
        checks.whole(1),
        Quantity("a belief capacity", "measurements", "a whole number >= 1"),
        meaning="most measurements that a decision's look-ahead is conditioned on; up to it beliefs are exact",
        source="maipp, docs/architecture.md; no table of the paper has more than 200",
    )
    threshold: float = option(
        0.4,
        checks.real(),
        Quantity("a threshold", "field units", "a finite number"),
        meaning="value from which a point counts as high-interest",
        source=f"{_PAPER}, Sec. III-B (symbol); value from the public code family",
    )
    beta: float = option(
        1.0,
        checks.real(least=0.0),
        Quantity("a confidence weight", "no unit; 1 / field units under variance", "a number >= 0"),
        meaning="weight of the uncertainty in the upper confidence bound that is held against the threshold",
        source=f"{_PAPER}, Sec. III-B (symbol); calibrated",
    )
    interest_rule: str = option(
        "std",
        checks.choice("std", "variance"),
        Quantity("an interest rule", "no unit", "std or variance"),
        meaning="uncertainty in the upper confidence bound: posterior standard deviation or variance",
        source=f"calibrated; {_PAPER}, Sec. III-B writes the variance",
    )
    virtual_value: str = option(
        "mean",
        checks.choice("mean", "zero"),
        Quantity("a virtual value", "no unit", "mean or zero"),
        meaning="value of a measurement that is only planned: the predicted mean, or zero",
        source=f"{_PAPER}, Sec. IV-B; zero is the public code family's",
    )
    nodes: int = option(
        200,
        checks.whole(2),
        Quantity("a number of nodes", "nodes", "a whole number >= 2"),
        meaning="nodes of each agent's roadmap, the start included",
        source=f"{_PAPER}, Sec. IV-E (n)",
    )
    neighbours: int = option(
        20,
        checks.whole(1),
        Quantity("a number of neighbours", "nodes", "a whole number >= 1, below nodes"),
        meaning="nearest other nodes each roadmap node is joined to",
        source=f"{_PAPER}, Sec. IV-E (k)",
    )
    last_leg: str = option(
        "cut",
        checks.choice("cut", "stop"),
        Quantity("a last-leg rule", "no unit", "cut or stop"),
        meaning="what a roadmap agent does whose budget reaches no neighbour: travel until it is spent, or stop",
        source="cut gives the measured baseline rows (docs/protocol.md)",
    )

    def __post_init__(self) -> None:
        try:
            for each in dataclasses.fields(self):
                value = each.metadata["check"](each.name, getattr(self, each.name))
                object.__setattr__(self, each.name, value)
            self._check_together()
        except CheckError as wrong:
            about = self.__dataclass_fields__[wrong.key.partition("[")[0]].metadata
            wrongness = wrong.problem or f"is not {about['noun']}"
            problem = f"{show(wrong.value)} {wrongness}; give {about['allowed']}"
            raise ScenarioError(wrong.key, problem) from None

    def _check_together(self) -> None:
        """Raises `CheckError` where fields that are right by themselves contradict each other."""
        shared = self.start is not None and not isinstance(self.start[0], tuple)
        for key in ("budget", "speed") if shared else ("budget", "speed", "start"):
            values = getattr(self, key)
            if isinstance(values, tuple) and len(values) != self.agents:
                raise CheckError(key, values, f"holds {len(values)} for {self.agents} agents")
        positions: Any = (self.start,) if shared else self.start or ()
        for index, (x, y) in enumerate(positions):
            if not (0 <= x <= self.extent[0] and 0 <= y <= self.extent[1]):
                key = "start" if shared else f"start[{index}]"
                raise CheckError(key, (x, y), f"is outside the domain of extent {self.extent}")
        longest, interval = self._longest_budget, self.measurement_interval
        if longest / interval > _MOST_MEASUREMENTS:
            problem = f"means {longest / interval:.2g} measurements per agent, too many to tell apart"
            raise CheckError("measurement_interval", interval, problem)
        if self.measurements_per_agent < 1:
            problem = f"is longer than the largest budget ({longest}), so nothing would ever be measured"
            raise CheckError("measurement_interval", interval, problem)
        if self.neighbours >= self.nodes:
            raise CheckError("neighbours", self.neighbours, f"is not below nodes ({self.nodes})")

    @classmethod
    def create(cls, **values: Any) -> "Scenario":
        """The scenario with these fields, the rest at their defaults; `ScenarioError` for unknown names."""
        return cls.from_dict(values)

    @classmethod
    def from_dict(cls, values: Any, *, source: str | None = None) -> "Scenario":
        """The scenario with the fields in this mapping, the rest at their defaults; errors name `source`."""
        if not isinstance(values, Mapping):
            raise InputError(f"{source or 'scenario'}: {show(values)} is not a mapping of fields to values")
        for key in values:
            if key not in cls.__dataclass_fields__:
                raise ScenarioError(str(key), nearest(str(key), list(cls.__dataclass_fields__)), source)
        try:
            return cls(**values)
        except ScenarioError as error:
            raise ScenarioError(error.key, error.problem, source) from None

    def to_dict(self) -> dict[str, Any]:
        """Every field as plain numbers, strings, lists and None, ready for YAML or JSON."""
        return {each.name: _listed(getattr(self, each.name)) for each in dataclasses.fields(self)}

    def replace(self, **changes: Any) -> "Scenario":
        """The same scenario with these fields changed, validated anew."""
        return self.from_dict(self.to_dict() | changes)

    @property
    def budgets(self) -> tuple[float, ...]:
        """Budget of every agent, length m, domain units."""
        return self.budget if isinstance(self.budget, tuple) else (self.budget,) * self.agents

    @property
    def speeds(self) -> tuple[float, ...]:
        """Speed of every agent, length m, domain units per unit of time."""
        return self.speed if isinstance(self.speed, tuple) else (self.speed,) * self.agents

    @property
    def starts(self) -> tuple[Pair, ...] | None:
        """Start of every agent, length m, domain units; None where it is drawn."""
        if self.start is None or isinstance(self.start[0], tuple):
            return self.start  # type: ignore[return-value]  # the first element tells one position from several
        return (self.start,) * self.agents  # type: ignore[return-value]

    @property
    def _longest_budget(self) -> float:
        return max(self.budget) if isinstance(self.budget, tuple) else self.budget

    @property
    def measurements_per_agent(self) -> int:
        """S: the most measurements any agent can take; the one at exactly its budget counts."""
        return math.floor(self._longest_budget / self.measurement_interval + 1e-6)

    @property
    def measurements(self) -> int:
        """m * S: measurement slots of the team."""
        return self.agents * self.measurements_per_agent

    @property
    def grid_points(self) -> int:
        """Points of the evaluation grid."""
        return self.grid * self.grid

    @property
    def limited(self) -> bool:
        """Whether agents hear each other only within a range."""
        return self.comm_range is not None

    @property
    def has_zones(self) -> bool:
        """Whether there are no-go zones."""
        return bool(self.obstacles)

    @property
    def finest_interval(self) -> float:
        """The measurement interval: look-aheads have room for one measurement each."""
        return self.measurement_interval

    @property
    def usual_edge(self) -> float:
        """Length that few edges of a roadmap exceed: the radius of a disc that holds as many nodes as neighbours."""
        return math.sqrt(self.neighbours * self.extent[0] * self.extent[1] / (math.pi * self.nodes))


def describe_fields() -> tuple[FieldDescription, ...]:
    """One row per scenario field, in order: what docs, docstring and YAML comments are made from."""
    return described(Scenario)


def _listed(value: Any) -> Any:
    return [_listed(item) for item in value] if isinstance(value, tuple) else value


# The constructor takes more than its annotations say (lists, whole numbers for floats) and itself says what
# is wrong with the rest: runtime type checkers must let it.
no_type_check(Scenario.__init__)

if Scenario.__doc__:  # python -OO drops docstrings
    Scenario.__doc__ += "\n    Fields:\n" + "\n".join(
        f"    - {row.name}: {row.meaning} [{row.unit}]; {row.allowed}; default {row.default!r}. {row.source}"
        for row in describe_fields()
    )
