"""The keys of `episode.json` and what each holds (docs/episode.md); `episode_io` reads them by these declarations."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from maipp.engine.state import REASONS
from maipp.records import Within
from maipp.records.kinds import Finite
from maipp.scenario import Scenario
from maipp.seeds import LARGEST_SEED

SCHEMA = "maipp.episode/1"

Above0 = Annotated[float, Within(above=0.0, wide=True)]
Whole = Annotated[int, Within(0, wide=True)]
Numbers = Annotated[tuple[Finite, ...], "finite numbers"]
Wholes = tuple[Whole, ...]
Pair = tuple[Finite, Finite]
Sides = tuple[Above0, Above0]


@dataclass(frozen=True)
class SystemKeys:
    """A coordinate reference system."""

    crs: str | None
    geographic: bool
    metres: Above0 | None


@dataclass(frozen=True)
class MappingKeys:
    """From domain units to a file or a place."""

    origin: Pair
    size: Sides
    domain: Sides
    value_at_zero: Finite
    value_at_one: Finite
    x_name: str | None
    y_name: str | None
    value_name: str | None
    metres_per_unit: Above0 | None = None
    plane: SystemKeys | None = None
    user: SystemKeys | None = None


@dataclass(frozen=True)
class PlannerKeys:
    """Who planned."""

    name: str
    options: dict[str, Any]


@dataclass(frozen=True)
class CurveKeys:
    """Tr(P) of the pooled belief over time."""

    time: Numbers
    trace: Numbers


@dataclass(frozen=True)
class MetricKeys:
    """What follows from the measurements."""

    trace: Finite
    own_trace: Numbers
    true_trace: Finite
    rmse: Finite
    mutual_information: Finite
    curve: CurveKeys


@dataclass(frozen=True)
class PriorKeys:
    """Samples from before the survey."""

    x: Numbers
    y: Numbers
    value: Numbers
    noise: Numbers | None


@dataclass(frozen=True)
class RouteKeys:
    """Vertices of a route."""

    x: Numbers
    y: Numbers
    time: Numbers


@dataclass(frozen=True)
class MeasurementKeys:
    """Measurements in order of time."""

    x: Numbers
    y: Numbers
    value: Numbers
    time: Numbers


@dataclass(frozen=True)
class AgentKeys:
    """What one agent did."""

    start: Numbers
    budget: Above0
    speed: Above0
    distance: Finite
    decisions: Whole
    route: RouteKeys
    measurements: MeasurementKeys
    known: Wholes
    stopped_by: Literal[tuple(filter(None, REASONS))] = ""  # type: ignore[valid-type]  # not there in older files


@dataclass(frozen=True)
class EpisodeKeys:
    """The whole record."""

    schema: Annotated[Literal[SCHEMA], f"{SCHEMA!r}, the one that this version reads"]  # type: ignore[valid-type]
    precision: Literal["float32", "float64"]
    planner: PlannerKeys
    seed: Annotated[int, Within(0, most=LARGEST_SEED, wide=True)]
    index: Whole
    scenario: Scenario
    mapping: MappingKeys | None
    metrics: MetricKeys
    message_bytes: Whole
    agents: tuple[AgentKeys, ...]
    truth: tuple[Numbers, ...]
    outside: Wholes
    prior: PriorKeys | None = None
    expected: bool = False
