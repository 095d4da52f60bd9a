"""What a mission file says, typed and checked by itself; `prepare` turns it into a problem to plan."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from maipp.geo import Crs
from maipp.records import Within, described, expected
from maipp.records.kinds import Each
from maipp.renamed import renamed
from maipp.route_files.vehicle_settings import VehicleSettings
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
class RobotSpec:
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

    speed: Annotated[float, Within(1e-3, most=60.0), "a speed in m/s, from 0.001 to 60"] = described(
        meaning="its speed, m/s", otherwise="required"
    )
    start: Pair | None = described(None, "where it sets out", otherwise="home of the area's `.plan`, or required")
    name: Annotated[Text, "a name"] | None = described(None, "name of its files", otherwise="`robot-1`, ...")
    budget_m: Metres | None = described(None, "metres of path that it may travel", otherwise="this or the next")
    budget_minutes: Annotated[_Above0, "a time > 0, in minutes"] | None = described(
        None, "minutes that it may be under way", otherwise="this or the last"
    )
    end: Literal["start"] | Pair | Each[Pair] | None = described(
        None, "where it ends: `start`, a position, or positions of which any will do", otherwise="anywhere"
    )
    reserve: Share | None = described(
        None, "share of its budget that is not spent, such as `0.2` or `20 %`", otherwise="`0`"
    )
    reserve_m: Annotated[_NotNegative, "a length >= 0, in metres"] | None = described(
        None, "the same in metres", otherwise="`0`"
    )
    reserve_minutes: Annotated[_NotNegative, "a time >= 0, in minutes"] | None = described(
        None, "the same in minutes", otherwise="`0`"
    )


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
class KernelSpec:
    """What is known of the quantity beforehand; None is fitted from samples, or assumed."""

    length_scale_m: Metres | None = described(
        None,
        "metres over which values stay alike",
        otherwise="fitted, or 0.45 of the side of a square as large as the area",
    )
    mean: Number | None = described(
        None, "mean of the area, value unit", otherwise="fitted, or 0.4 `std` from the threshold"
    )
    std: Annotated[_Above0, "a standard deviation > 0, in the unit"] | None = described(
        None, "how far values stray from the mean, value unit", otherwise="fitted, or half the threshold"
    )
    adapt: bool | None = described(
        None, "a live survey refits the kernel", otherwise="`true` without samples and kernel"
    )


@dataclass(frozen=True)
class SampleFile:
    """Old measurements: a CSV file and which of its columns hold what."""

    file: Path = described(
        meaning="CSV with commas, semicolons, tabs or blanks; a preamble above the header is skipped",
        allowed="the path of a CSV file",
    )
    x: Column | None = described(None, "name of the column of x or longitude")
    y: Column | None = described(None, "name of the column of y or latitude")
    value: Column | None = described(None, "name of the column of values")
    crs: Crs | None = described(None, "reference system of the positions, in place of what the file says")
    track: Annotated[Path, "the path of a CSV or GPX file"] | None = described(
        None,
        "CSV or GPX file of the boat, for values without positions; `x`, `y` and `crs` are then the track's",
    )
    time: Column | None = described(None, "name of the column of times")
    track_time: Column | None = described(None, "the same of the track")
    offset_s: Annotated[float, Within(-1e10, most=1e10, wide=True), "a number of seconds"] = described(
        0.0, "seconds from the values' clock to the track's, `0`"
    )
    lag_s: Annotated[float, Within(-1e6, most=1e6), "a number of seconds"] = described(
        0.0, "seconds by which a value comes after its place, `0`"
    )
    check: bool = described(True, "`false` keeps what would be left out as impossible")
    where: str = "samples"

    @property
    def columns(self) -> Mapping[str, str]:
        """The names of the columns that are told, under "x", "y" and "value"."""
        return {key: name for key in ("x", "y", "value") if (name := getattr(self, key)) is not None}


@dataclass(frozen=True)
class VehicleKeys:
    """The vehicle as the file has it; None is as `VehicleSettings` has it."""

    kind: Text | None = described(None, "`boat`, `rover` or `copter`", allowed=expected(Text))
    autopilot: Text | None = described(None, "`ardupilot` or `px4`", allowed=expected(Text))
    altitude_m: Number | None = described(None, "metres above home of every waypoint", allowed=expected(Number))
    return_home: bool | None = described(None, "robots without an end come back to their start", allowed=expected(bool))
    fence: bool | None = described(
        None, "the area and the zones become the autopilot's geofence", allowed=expected(bool)
    )


@dataclass(frozen=True)
class Rehearsal:
    """What a rehearsal runs on: the user's raster, or fields drawn from the prior."""

    raster: Path | None = described(None, allowed="the path of a raster")
    value: Column | None = None
    fields: Fields = 30
    crs: Crs | None = None  # of the raster's coordinates, in place of what the file says
    at: At | None = None


@dataclass(frozen=True, kw_only=True)
class MissionFile:
    """One mission file. Coordinates are as written, lengths metres, values in the quantity's unit."""

    source: str  # the file, for errors
    lines: Mapping[str, int] = field(default_factory=dict, repr=False)  # line of every key, for errors
    name: Annotated[Text, "a name"] = described("survey", "title of files and figures", otherwise="the file's name")
    area: Drawing | RasterArea = described(meaning="where to survey", otherwise="required", allowed=AREA)
    no_go: tuple[Drawing, ...] = described((), "zones that no robot may enter", otherwise="none")
    metres: bool = described(False, "coordinates are metres, x east and y north", otherwise="`false`")
    crs: Crs | None = described(None, "reference system of the positions, such as `EPSG:25833`", otherwise="WGS84")
    clearance_m: Annotated[_NotNegative, "a length >= 0, in metres"] = described(
        0.0, "metres to keep from the area's border and the zones", otherwise="`0`"
    )
    ashore_m: Annotated[float, Within(0, most=1000), "a length from 0 to 1000, in metres"] = described(
        5.0, "metres outside the free area at which starts and ends may lie, as on a pier", otherwise="`5`"
    )
    robots: tuple[RobotSpec, ...] = described(
        meaning="the team", otherwise="required", allowed="a list of robots, one at least"
    )
    measurement_spacing_m: Metres = described(meaning="metres between two measurements", otherwise="required")
    quantity: Annotated[Text, "the name of what is measured"] | None = described(
        None, "what is measured, for headings", otherwise="none"
    )
    unit: Annotated[Text, "a unit, such as ug/L"] | None = described(None, "value unit, for headings", otherwise="none")
    threshold: Number | None = described(
        None, "values above it matter; without one every place matters alike", otherwise="none"
    )
    below: bool = described(False, "values below the threshold matter", otherwise="`false`")
    samples: SampleFile | None = described(None, "CSV of old measurements, or `file` with more keys", otherwise="none")
    noise: Annotated[_NotNegative, "a standard deviation >= 0, in the unit"] | None = described(
        None, "standard deviation of a measurement, value unit", otherwise="fitted, or 5 % of `std`"
    )
    kernel: KernelSpec = described(KernelSpec(), "what is known of the quantity")
    gate: Annotated[float, Within(0, most=1000), "standard deviations from 0 (no gate) to 1000"] = described(
        5.0,
        "standard deviations of surprise beyond which a live survey keeps a measurement out; `0`: none",
        otherwise="`5`",
    )
    communication_range_m: Annotated[Metres, "a length > 0, in metres, or null for any distance"] | None = described(
        None, "metres at which robots hear each other", otherwise="any distance"
    )
    vehicle: VehicleSettings = described(
        VehicleSettings(),
        "`boat`, `rover` or `copter`; or `kind`, `autopilot`, `altitude_m`, `return_home`, `fence`",
        otherwise="`boat`",
    )
    return_home: bool = False  # robots without an end return to their start
    planner: Annotated[Text, "the name of a planner"] = described(
        DEFAULT_PLANNER, "name of a planner", otherwise=f"`{DEFAULT_PLANNER}`"
    )
    planner_options: Annotated[dict[str, Any], "a mapping of options to values"] = field(
        default_factory=dict, metadata={"meaning": "its options", "otherwise": "its defaults"}
    )
    scenario: Mapping[str, Any] = field(
        default_factory=dict,
        metadata={
            "meaning": "`grid`, `nodes`, `neighbours`, `beta`, `interest_rule`, `virtual_value`, `belief_capacity`, "
            "`last_leg` of the scenario",
            "otherwise": "its defaults",
        },
    )
    rehearsal: Rehearsal = described(
        Rehearsal(),
        "number of fields to rehearse on; or `raster` (with `value`, `crs`, `at`) and `fields`",
        otherwise="`30`",
    )
    seed: Annotated[int, Within(0, most=LARGEST_SEED, wide=True)] = described(
        0, f"seed of everything random, 0 to {LARGEST_SEED}", otherwise="`0`"
    )

    def where(self, key: str) -> str:
        """File, line and key, to begin an error with."""
        line = self.lines.get(key)
        return f"{self.source}:{line}: {key}" if line else f"{self.source}: {key}"


renamed(__name__, Survey="MissionFile", Robot="RobotSpec", Kernel="KernelSpec")
