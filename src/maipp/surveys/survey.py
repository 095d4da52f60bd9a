"""What a mission file says, typed and checked by itself; `prepare` turns it into a problem to plan."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from maipp.geo import Crs
from maipp.missions.vehicle import Vehicle
from maipp.surveys.geojson import Rings

Pair = tuple[float, float]


@dataclass(frozen=True)
class Robot:
    """One robot of the team."""

    name: str
    start: Pair  # in the mission's coordinates
    budget_m: float  # longest path it may travel, metres
    speed: float  # metres per second
    where: str = "robots"  # file, line and key, for errors


@dataclass(frozen=True)
class RasterArea:
    """The area as the cells of a gridded map that hold values, or values on one side of a level."""

    raster: Path
    value: str | None  # array or column of the file
    level: float | None  # None: wherever the map has values
    below: bool  # values below the level are in the area; else those above
    where: str
    crs: Crs | None = None  # of its coordinates, in place of what the file says


@dataclass(frozen=True)
class Kernel:
    """What is known of the quantity beforehand; None is fitted from samples, or assumed."""

    length_scale_m: float | None = None  # metres over which values stay alike
    mean: float | None = None  # in the unit
    std: float | None = None  # in the unit


@dataclass(frozen=True)
class SampleFile:
    """Old measurements: a CSV file and which of its columns hold what."""

    path: Path
    columns: Mapping[str, str] = field(default_factory=dict)  # "x", "y", "value" -> name of the column
    where: str = "samples"
    crs: Crs | None = None  # of its positions; None: degrees where the columns' names say so, else the mission's


@dataclass(frozen=True)
class Rehearsal:
    """What a rehearsal runs on: the user's raster, or fields drawn from the prior."""

    raster: Path | None = None
    value: str | None = None
    fields: int = 30
    crs: Crs | None = None  # of the raster's coordinates, in place of what the file says


@dataclass(frozen=True)
class Survey:
    """One mission file. Coordinates are as written, lengths metres, values in the quantity's unit."""

    source: str  # the file, for errors
    name: str
    area: tuple[Rings, ...] | RasterArea
    no_go: tuple[tuple[Rings, ...], ...]  # one entry for each zone of the file
    metres: bool  # coordinates are metres, not degrees
    crs: Crs | None  # of the positions in the file; None: WGS84, or with `metres` that of the area's file, if any
    clearance_m: float
    robots: tuple[Robot, ...]
    measurement_spacing_m: float
    quantity: str | None
    unit: str | None
    threshold: float | None  # None: every place matters alike
    below: bool  # values below the threshold matter
    samples: SampleFile | None
    noise: float | None  # standard deviation of a measurement, in the unit
    kernel: Kernel
    communication_range_m: float | None  # None: at any distance
    vehicle: Vehicle  # whom the mission files are for
    planner: str
    planner_options: Mapping[str, Any]
    scenario: Mapping[str, Any]  # settings of the scenario that the file changes
    rehearsal: Rehearsal
    seed: int
    lines: Mapping[str, int] = field(default_factory=dict, repr=False)  # line of every key, for errors

    def where(self, key: str) -> str:
        """File, line and key, to begin an error with."""
        line = self.lines.get(key)
        return f"{self.source}:{line}: {key}" if line else f"{self.source}: {key}"
