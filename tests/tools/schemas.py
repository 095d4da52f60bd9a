"""`python -m tests.tools.schemas` writes docs/schemas: what files and lines from outside may hold, as JSON Schema.

They are made from the declarations that the readers read by. With `--check` nothing is written; the exit code is
1 where a file would change.
"""

import sys
from pathlib import Path

from maipp.engine.episode_keys import EpisodeKeys
from maipp.files import write_atomic
from maipp.geo import Crs
from maipp.live.events import KINDS
from maipp.live.request import QUERIES
from maipp.route_files.vehicle_settings import AUTOPILOTS, VehicleSettings
from maipp.route_files.vehicle_settings import KINDS as VEHICLES
from maipp.scenario import Scenario
from maipp.surveys import mission_file as mission
from maipp.surveys import survey_io
from tests.tools.json_schema import Schema, Writer, any_of, whole

FOLDER = Path(__file__).parents[2] / "docs" / "schemas"

_PATH: Schema = {"type": "string"}
_CRS: Schema = {"type": "string", "description": "A coordinate reference system, such as EPSG:25833."}
_PERCENT: Schema = {"type": "string", "pattern": "%\\s*$"}
_GEOJSON: Schema = {"type": "object", "properties": {"type": {"type": "string"}}, "required": ["type"]}
_POSITIONS: Schema = {"type": "array", "items": {"type": "array", "items": {"type": "number"}}}


def scenario() -> Schema:
    """Of a scenario's YAML file."""
    return Writer(nulls=False).of(Scenario)


def episode() -> Schema:
    """Of `episode.json`; further keys are skipped by its reader."""
    return _opened(Writer({Scenario: scenario()}).of(EpisodeKeys))


def live() -> Schema:
    """Of one line that `maipp live` reads: an event or a query."""
    writer = Writer()
    lines = [writer.record(kind, first={"event": {"const": name}}) for name, kind in KINDS.items()]
    for line, kind in zip(lines, KINDS.values(), strict=True):
        line["description"] = kind.__doc__ or ""
    queries = [
        writer.record(kind, first={"query": {"const": name}}) | {"description": kind.__doc__ or ""}
        for name, kind in QUERIES.items()
    ]
    return any_of(lines + queries)


def mission_file() -> Schema:
    """Of a mission's YAML file: keys with readers of their own as docs/mission.md says, the rest as declared."""
    plain = Writer({Crs: _CRS})
    shape = any_of([_PATH, _GEOJSON, _POSITIONS, plain.of(mission.ShapeKeys)])
    robot = Writer({(mission.RobotKeys, "reserve"): any_of([plain.of(mission.Share), _PERCENT])})
    vehicle = Writer(
        {
            (mission.VehicleKeys, "kind"): {"enum": list(VEHICLES)},
            (mission.VehicleKeys, "autopilot"): {"enum": list(AUTOPILOTS)},
        }
    )
    robots = {"type": "array", "minItems": 1, "items": robot.of(mission.RobotKeys)}
    samples = plain.record(mission.SampleFile, only=survey_io.SAMPLE_KEYS)
    writer = Writer(
        {
            Crs: _CRS,
            VehicleSettings: any_of([{"enum": list(VEHICLES)}, vehicle.of(mission.VehicleKeys)]),
            (mission.MissionFile, "area"): any_of([shape, plain.of(mission.RasterAreaKeys)]),
            (mission.MissionFile, "no_go"): any_of([shape, {"type": "array", "items": shape}]),
            (mission.MissionFile, "robots"): robots,
            (mission.MissionFile, "samples"): any_of([_PATH, samples]),
            (mission.MissionFile, "scenario"): Writer().record(Scenario, only=survey_io.SCENARIO_KEYS),
            (mission.MissionFile, "rehearsal"): any_of(
                [plain.of(mission.Fields), _PATH, plain.of(mission.Rehearsal)],
            ),
        }
    )
    return writer.record(mission.MissionFile, only=survey_io.KEYS)


def _opened(schema: Schema) -> Schema:
    """The schema without its refusals of further keys; the scenario inside keeps its own."""
    keep = {key: value for key, value in schema.items() if key != "additionalProperties"}
    if "properties" in keep:
        keep["properties"] = {
            name: each if name == "scenario" else _opened(each) for name, each in keep["properties"].items()
        }
    if "anyOf" in keep:
        keep["anyOf"] = [_opened(each) for each in keep["anyOf"]]
    if isinstance(keep.get("items"), dict):
        keep["items"] = _opened(keep["items"])
    return keep


FILES = {
    "mission.json": ("A mission file of maipp", mission_file),
    "scenario.json": ("A scenario of maipp", scenario),
    "live.json": ("A line that `maipp live` reads", live),
    "episode.json": ("A recorded survey of maipp", episode),
}


def texts() -> dict[str, str]:
    """Each file's text by its name."""
    return {name: whole(title, make()) for name, (title, make) in FILES.items()}


def main(arguments: list[str]) -> int:
    """The exit code."""
    stale = 0
    for name, text in texts().items():
        path = FOLDER / name
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            continue
        if "--check" in arguments:
            print(f"{path}: not what the code says; run: python -m tests.tools.schemas", file=sys.stderr)
            stale = 1
        else:
            FOLDER.mkdir(exist_ok=True)
            write_atomic(path, text)
    return stale


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
