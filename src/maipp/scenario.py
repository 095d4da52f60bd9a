"""The typed, validated description of one survey problem: world, team, belief, objective."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, no_type_check

from maipp.errors import InputError
from maipp.per_agent import PerAgent
from maipp.records import FieldError, Within, described, fields_of, nearest, refusal, settle, show
from maipp.records.kinds import Ascending, Count, Each, NotNegative, Positive, Real

# Travelled distances are float32 sums of leg lengths; this absorbs their rounding (about 20 ulp at budget 5).
DISTANCE_TOLERANCE = 1e-5

# More measurement points than this along one path lie closer together than float32 distances can tell.
_MOST_MEASUREMENTS = 1_000_000

_PAPER = "Yang et al. 2023"


# What stands before the key in errors of a scenario that comes from no file.
_WHERE = "scenario."


def _polygon(vertices: tuple[Any, ...]) -> str | None:
    distinct = len(set(vertices))
    return f"has too few distinct vertices for a polygon ({distinct})" if distinct < 3 else None


def _storable(name: str) -> str | None:
    # A surrogate stands for a byte that is not UTF-8, and no file system takes a NUL.
    return "" if not name or any(c == "\0" or "\ud800" <= c <= "\udfff" for c in name) else None


Pair = tuple[Real, Real]
Polygon = Annotated[tuple[Pair, ...], _polygon]
FilePath = Annotated[str, _storable]
_Side = Annotated[float, Within(above=0.0, most=20.0)]  # float32 distances keep 1e-5 up to some 100


@dataclass(frozen=True)
class Scenario(PerAgent):
    """One survey problem. Immutable and hashable, so that compiled functions are keyed on it.

    Lengths are in domain units (the paper's domain is the unit square), values in the field's own units.
    Defaults are the paper's (Yang et al. 2023, Sec. IV-E and V) as calibrated in `docs/protocol.md`.
    Lists and arrays become tuples, whole numbers become floats where a float is meant.

    Raises `FieldError`, an `InputError`, for the first field that is wrong.
    """

    agents: Count = described(
        3,
        "number of robots in the team",
        unit="robots",
        source=f"{_PAPER}, Sec. IV-E (m)",
    )
    budget: Positive | Each[Positive] = described(
        3.0,
        "length of path each agent may travel",
        allowed="a length > 0 (domain units), or one per agent",
        unit="domain units",
        source=f"{_PAPER}, Sec. IV-E (B)",
    )
    speed: Positive | Each[Positive] = described(
        1.0,
        "constant speed at which each agent travels",
        allowed="a speed > 0, or one per agent",
        unit="domain units per unit of time",
        source=f"{_PAPER}, Sec. IV-A (constant); the value sets the unit of time",
    )
    start: Pair | Each[Pair] | None = described(
        None,
        "where the agents set out; one position is shared by all, null draws a shared one uniformly",
        allowed="[x, y] inside the extent, one [x, y] per agent, or null (None)",
        unit="domain units",
        source=f"{_PAPER}, Sec. IV-E (drawn), Sec. V (shared)",
    )
    end: Literal["start"] | Pair | Each[Pair] | Each[tuple[Pair, ...]] | None = described(
        None,
        "where agents end: at any of these places, for all or per agent; start: where it began; null: anywhere",
        allowed="start, [x, y] inside the extent, a list of such, a list of lists per agent, or null (None)",
        unit="domain units",
        source="maipp",
    )
    reserve: NotNegative | Each[NotNegative] = described(
        0.0,
        "part of the budget that is not spent",
        allowed="a length >= 0 below the budget, or one per agent",
        unit="domain units",
        source="maipp",
    )
    comm_range: Positive | None = described(
        None,
        "farthest distance at which a deciding agent hears another; null hears everyone",
        allowed="a length > 0, or null (None) for global",
        unit="domain units",
        source=f"{_PAPER}, Sec. V-A (global, 0.3, 0.6)",
    )
    measurement_interval: Positive = described(
        0.2,
        "distance travelled between two measurements",
        allowed="a length > 0, at most the largest budget",
        unit="domain units",
        source=f"{_PAPER}, Sec. IV-E",
    )
    extent: tuple[_Side, _Side] = described(
        (1.0, 1.0),
        "width and height of the domain, whose lower left corner is (0, 0)",
        allowed="[width, height], both > 0 and <= 20 (scale so that sides are about 1)",
        unit="domain units",
        source=f"{_PAPER}, Sec. IV-E (unit square)",
    )
    grid: Annotated[int, Within(least=2)] = described(
        30,
        "points per side of the evaluation grid, both ends included",
        unit="points",
        source=f"{_PAPER}, Sec. IV-E",
    )
    obstacles: tuple[Polygon, ...] = described(
        (),
        "no-go zones, polygons that no route enters",
        allowed="a list of polygons, each of at least 3 distinct [x, y]",
        unit="domain units",
        source=f"{_PAPER}, Sec. IV-A (named as an extension; none there)",
    )
    field: FilePath | None = described(
        None,
        "file of the ground truth; null draws a Gaussian mixture",
        allowed="the path of a field file, or null (None)",
        unit="path",
        source="maipp",
    )
    mixture_components: Ascending[Count] = described(
        (8, 12),
        "fewest and most Gaussian bumps in a drawn ground truth, both included",
        allowed="[low, high], whole numbers with 1 <= low <= high",
        unit="bumps",
        source=f"{_PAPER}, Sec. IV-E",
    )
    mixture_variance: Ascending[Positive] = described(
        (5e-5, 2e-4),
        "range that the square of a bump's variance along an axis is drawn from",
        allowed="[low, high] with 0 < low <= high",
        unit="domain units^4",
        source="the public code family of the paper",
    )
    field_family: Literal["bumps", "any"] = described(
        "bumps",
        "what a foresight counts on: `bumps`, a field such as is drawn, or `any`; a field from a file is `any`",
        unit="no unit",
        source="maipp",
    )
    length_scale: Positive = described(
        0.45,
        "length scale of the kernel (0.25 in the ten-agent tables)",
        allowed="a length > 0 (domain units)",
        unit="domain units",
        source="calibrated on the paper's tables",
    )
    kernel: Literal["matern12", "matern32", "matern52", "squared-exponential"] = described(
        "matern32",
        "covariance of the beliefs: Matern 1/2, 3/2, 5/2 or squared exponential",
        unit="no unit",
        source=f"{_PAPER}, Sec. III-A",
    )
    signal_variance: Positive = described(
        1.0,
        "prior variance of the field at any point",
        allowed="a variance > 0",
        unit="field units squared",
        source=f"{_PAPER}, Sec. IV-E (initial trace 900 on 30 x 30)",
    )
    noise: NotNegative = described(
        1e-6,
        "variance of the measurement noise, on the diagonal of the kernel matrix",
        allowed="a variance >= 0",
        unit="field units squared",
        source="measured: up to 1e-6 gives the table of 1e-10 in float64",
    )
    belief_capacity: Count = described(
        512,
        "most measurements that a decision's look-ahead is conditioned on; up to it beliefs are exact",
        unit="measurements",
        source="maipp, docs/architecture.md; no table of the paper has more than 200",
    )
    threshold: Real = described(
        0.4,
        "value from which a point counts as high-interest",
        unit="field units",
        source=f"{_PAPER}, Sec. III-B (symbol); value from the public code family",
    )
    beta: NotNegative = described(
        1.0,
        "weight of the uncertainty in the upper confidence bound that is held against the threshold",
        allowed="a number >= 0",
        unit="no unit; 1 / field units under variance",
        source=f"{_PAPER}, Sec. III-B (symbol); calibrated",
    )
    interest_rule: Literal["std", "variance"] = described(
        "std",
        "uncertainty in the upper confidence bound: posterior standard deviation or variance",
        unit="no unit",
        source=f"calibrated; {_PAPER}, Sec. III-B writes the variance",
    )
    virtual_value: Literal["mean", "zero"] = described(
        "mean",
        "value of a measurement that is only planned: the predicted mean, or zero",
        unit="no unit",
        source=f"{_PAPER}, Sec. IV-B; zero is the public code family's",
    )
    nodes: Annotated[int, Within(least=2)] = described(
        200,
        "nodes of each agent's roadmap, the start included",
        unit="nodes",
        source=f"{_PAPER}, Sec. IV-E (n)",
    )
    neighbours: Count = described(
        20,
        "nearest other nodes each roadmap node is joined to",
        allowed="a whole number >= 1, below nodes",
        unit="nodes",
        source=f"{_PAPER}, Sec. IV-E (k)",
    )
    last_leg: Literal["cut", "stop"] = described(
        "cut",
        "what a roadmap agent does whose budget reaches no neighbour: travel until it is spent, or stop",
        unit="no unit",
        source="cut gives the measured baseline rows (docs/protocol.md)",
    )

    def __post_init__(self) -> None:
        settle(self, _WHERE)
        self._check_together()

    def _check_together(self) -> None:
        """Raises `FieldError` where fields that are right by themselves contradict each other."""
        shared = self.start is not None and not isinstance(self.start[0], tuple)
        several = ("budget", "speed", "reserve", *(() if shared else ("start",)))
        for key in (*several, "end") if self.ends_differ else several:
            values = getattr(self, key)
            if isinstance(values, tuple) and len(values) != self.agents:
                raise refusal(self, _WHERE, key, values, f"holds {len(values)} for {self.agents} agents")
        positions: Any = (self.start,) if shared else self.start or ()
        for index, (x, y) in enumerate(positions):
            if not (0 <= x <= self.extent[0] and 0 <= y <= self.extent[1]):
                key = "start" if shared else f"start[{index}]"
                raise refusal(self, _WHERE, key, (x, y), f"is outside the domain of extent {self.extent}")
        for agent, places in enumerate(self.places or ()):
            for index, (x, y) in enumerate(places):
                if not (0 <= x <= self.extent[0] and 0 <= y <= self.extent[1]):
                    key = f"end[{agent}][{index}]" if self.ends_differ else f"end[{index}]"
                    raise refusal(self, _WHERE, key, (x, y), f"is outside the domain of extent {self.extent}")
        for agent, (reserve, budget) in enumerate(zip(self.reserves, self.budgets, strict=True)):
            if reserve >= budget:
                key = f"reserve[{agent}]" if isinstance(self.reserve, tuple) else "reserve"
                raise refusal(self, _WHERE, key, reserve, f"is not below the budget ({budget})")
        longest, interval = self.longest_budget, self.measurement_interval
        if longest / interval > _MOST_MEASUREMENTS:
            problem = f"means {longest / interval:.2g} measurements per agent, too many to tell apart"
            raise refusal(self, _WHERE, "measurement_interval", interval, problem)
        if self.measurements_per_agent < 1:
            problem = f"is longer than the largest budget ({longest}), so nothing would ever be measured"
            raise refusal(self, _WHERE, "measurement_interval", interval, problem)
        if self.neighbours >= self.nodes:
            raise refusal(self, _WHERE, "neighbours", self.neighbours, f"is not below nodes ({self.nodes})")

    @classmethod
    def create(cls, **values: Any) -> "Scenario":
        """The scenario with these fields, the rest at their defaults; `FieldError` for unknown names."""
        return cls.from_dict(values)

    @classmethod
    def from_dict(cls, values: Any, *, source: str | None = None) -> "Scenario":
        """The scenario with the fields in this mapping, the rest at their defaults; errors name `source`."""
        if not isinstance(values, Mapping):
            raise InputError(f"{source or 'scenario'}: {show(values)} is not a mapping of fields to values")
        where = f"{source}: " if source else _WHERE
        for key in values:
            if key not in cls.__dataclass_fields__:
                raise FieldError(str(key), nearest(str(key), cls.__dataclass_fields__), where)
        try:
            return cls(**values)
        except FieldError as error:
            raise FieldError(error.key, error.problem, where) from None

    def to_dict(self) -> dict[str, Any]:
        """Every field as plain numbers, strings, lists and None, ready for YAML or JSON."""
        return {each.name: _listed(getattr(self, each.name)) for each in dataclasses.fields(self)}

    def replace(self, **changes: Any) -> "Scenario":
        """The same scenario with these fields changed, validated anew."""
        return self.from_dict(self.to_dict() | changes)

    @property
    def measurements_per_agent(self) -> int:
        """S: the most measurements any agent can take; the one at exactly its budget counts."""
        return math.floor(self.longest_budget / self.measurement_interval + 1e-6)

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


def _listed(value: Any) -> Any:
    return [_listed(item) for item in value] if isinstance(value, tuple) else value


# The constructor takes more than its annotations say (lists, whole numbers for floats) and itself says what
# is wrong with the rest: runtime type checkers must let it.
no_type_check(Scenario.__init__)

if Scenario.__doc__:  # python -OO drops docstrings
    Scenario.__doc__ += "\n    Fields:\n" + "\n".join(
        f"    - {row.name}: {row.meaning} [{row.about['unit']}]; {row.allowed}; default {row.default!r}. "
        f"{row.about['source']}"
        for row in fields_of(Scenario)
    )
