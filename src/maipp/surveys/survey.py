"""What a mission file says, typed and checked by itself; `prepare` turns it into a problem to plan."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from maipp.geo import Crs
from maipp.missions.vehicle import Vehicle
from maipp.records import Within, described
from maipp.records.kinds import Each
from maipp.seeds import LARGEST_SEED
from maipp.surveys.shapes import FORMATS, Drawing

DEFAULT_PLANNER = "receding-horizon"
AREA = f"a file ({FORMATS}), GeoJSON, or a list of positions around the border"


def _one_line(text: str) -> str | None:
    return "" if not text.strip() or any(c < " " or "\ud800" <= c <= "\udfff" for c in text) else None


def _entries(at: dict[Any, Any]) -> str | None:
    right = at and all(isinstance(key, str) and type(index) is int for key, index in at.items())
    return None if right else ""


Text = Annotated[str, _one_line]
Number = Annotated[float, Within(-1e30, most=1e30), "a number in the unit"]
Pair = tuple[Number, Number]
_Above0 = Annotated[float, Within(above=1e-30, most=1e30)]
Metres = Annotated[_Above0, "a length > 0, in metres"]
_NotNegative = Annotated[float, Within(0, most=1e30)]
Column = Annotated[Text, "the name of an array or column"]
Share = Annotated[float, Within(0, most=0.95), "a share of the budget from 0 to 0.95, such as 0.2 or 20 %"]
At = Annotated[dict[str, Any], _entries, "the entry along each further dimension of a NetCDF file, such as {time: 0}"]
Fields = Annotated[int, Within(1, most=10_000), "a raster, or a number of fields from 1 to 10000"]


@dataclass(frozen=True)
class Robot:
    """One robot of the team."""

    name: str
    start: Pair | None  # in the mission's coordinates; None: the home that the area's file has
    budget_m: float  # longest path it may travel, metres
    speed: float  # metres per second
    end: tuple[Pair, ...] | Literal["start"] | None = None  # any of these places; None: anywhere
    reserve_m: float = 0.0  # of the budget, what is not to be spent, metres
    where: str = "robots"  # file, line and key, for errors
    end_where: str = "robots"


@dataclass(frozen=True)
class RobotKeys:
    """One robot as the file has it."""

    speed: Annotated[float, Within(1e-3, most=60.0), "a speed in m/s, from 0.001 to 60"]
    start: Pair | None = None  # in the mission's coordinates; None: the home that the area's file has
    name: Annotated[Text, "a name"] | None = None
    budget_m: Metres | None = None
    budget_minutes: Annotated[_Above0, "a time > 0, in minutes"] | None = None
    end: Literal["start"] | Pair | Each[Pair] | None = None
    reserve: Share | None = None  # of the budget
    reserve_m: Annotated[_NotNegative, "a length >= 0, in metres"] | None = None
    reserve_minutes: Annotated[_NotNegative, "a time >= 0, in minutes"] | None = None


@dataclass(frozen=True)
class RasterArea:
    """The area as the cells of a gridded map that hold values, or values on one side of a level."""

    raster: Path
    value: str | None  # array or column of the file
    level: float | None  # None: wherever the map has values
    below: bool  # values below the level are in the area; else those above
    where: str
    crs: Crs | None = None  # of its coordinates, in place of what the file says
    at: Mapping[str, int] | None = None  # the entry along further dimensions, such as the time


@dataclass(frozen=True)
class ShapeKeys:
    """A file of polygons with more to say of it."""

    file: Path = described(allowed="the path of a file of polygons")
    layer: Annotated[Text, "the name of a layer"] | None = None
    crs: Crs | None = None  # of its positions, in place of what the file says


@dataclass(frozen=True)
class RasterAreaKeys:
    """The same as the file has it."""

    raster: Path = described(allowed="the path of a raster")
    value: Column | None = None
    below: Annotated[Number, "a level in the raster's unit"] | None = None
    above: Annotated[Number, "a level in the raster's unit"] | None = None
    crs: Crs | None = None
    at: At | None = None


@dataclass(frozen=True)
class Kernel:
    """What is known of the quantity beforehand; None is fitted from samples, or assumed."""

    length_scale_m: Metres | None = None  # over which values stay alike
    mean: Number | None = None  # in the unit
    std: Annotated[_Above0, "a standard deviation > 0, in the unit"] | None = None
    adapt: bool | None = None  # whether it is refitted under way; None: where nothing is given and there are no samples


@dataclass(frozen=True)
class SampleFile:
    """Old measurements: a CSV file and which of its columns hold what."""

    file: Path = described(allowed="the path of a CSV file")
    x: Column | None = None
    y: Column | None = None
    value: Column | None = None
    crs: Crs | None = None  # of its positions; None: degrees where the columns' names say so, else the mission's
    track: Annotated[Path, "the path of a CSV or GPX file"] | None = (
        None  # where the sensor was, for values without places
    )
    time: Column | None = None  # in the file itself
    track_time: Column | None = None
    offset_s: Annotated[float, Within(-1e10, most=1e10, wide=True), "a number of seconds"] = (
        0.0  # the track's clock less the file's
    )
    lag_s: Annotated[float, Within(-1e6, most=1e6), "a number of seconds"] = 0.0  # from where water is to its value
    check: bool = True  # leave out what cannot belong to the field
    where: str = "samples"

    @property
    def columns(self) -> Mapping[str, str]:
        """The names of the columns that are told, under "x", "y" and "value"."""
        return {key: name for key in ("x", "y", "value") if (name := getattr(self, key)) is not None}


@dataclass(frozen=True)
class Rehearsal:
    """What a rehearsal runs on: the user's raster, or fields drawn from the prior."""

    raster: Path | None = described(None, allowed="the path of a raster")
    value: Column | None = None
    fields: Fields = 30
    crs: Crs | None = None  # of the raster's coordinates, in place of what the file says
    at: At | None = None


@dataclass(frozen=True, kw_only=True)
class Survey:
    """One mission file. Coordinates are as written, lengths metres, values in the quantity's unit."""

    source: str  # the file, for errors
    lines: Mapping[str, int] = field(default_factory=dict, repr=False)  # line of every key, for errors
    name: Annotated[Text, "a name"] = "survey"
    area: Drawing | RasterArea = described(allowed=AREA)
    no_go: tuple[Drawing, ...] = ()  # one entry for each zone of the file
    metres: bool = False  # coordinates are metres, not degrees
    crs: Crs | None = (
        None  # of the positions in the file; None: WGS84, or with `metres` that of the area's file, if any
    )
    clearance_m: Annotated[_NotNegative, "a length >= 0, in metres"] = 0.0
    # How far outside the free area starts and ends may lie, as a pier does: they are moved to the nearest free place.
    ashore_m: Annotated[float, Within(0, most=1000), "a length from 0 to 1000, in metres"] = 5.0
    robots: tuple[Robot, ...] = described(allowed="a list of robots, one at least")
    measurement_spacing_m: Metres
    quantity: Annotated[Text, "the name of what is measured"] | None = None
    unit: Annotated[Text, "a unit, such as ug/L"] | None = None
    threshold: Number | None = None  # None: every place matters alike
    below: bool = False  # values below the threshold matter
    samples: SampleFile | None = None
    noise: Annotated[_NotNegative, "a standard deviation >= 0, in the unit"] | None = None  # of a measurement
    kernel: Kernel = Kernel()
    # Surprise of a measurement, in standard deviations, beyond which a live survey keeps it out; 0: none.
    gate: Annotated[float, Within(0, most=1000), "standard deviations from 0 (no gate) to 1000"] = 5.0
    communication_range_m: Annotated[Metres, "a length > 0, in metres, or null for any distance"] | None = None
    vehicle: Vehicle = Vehicle()  # whom the mission files are for
    return_home: bool = False  # robots without an end return to their start
    planner: Annotated[Text, "the name of a planner"] = DEFAULT_PLANNER
    planner_options: Annotated[dict[str, Any], "a mapping of options to values"] = field(default_factory=dict)
    scenario: Mapping[str, Any] = field(default_factory=dict)  # settings of the scenario that the file changes
    rehearsal: Rehearsal = Rehearsal()
    seed: Annotated[int, Within(0, most=LARGEST_SEED, wide=True)] = 0

    def where(self, key: str) -> str:
        """File, line and key, to begin an error with."""
        line = self.lines.get(key)
        return f"{self.source}:{line}: {key}" if line else f"{self.source}: {key}"
