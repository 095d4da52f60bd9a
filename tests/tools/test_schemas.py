"""The published schemas are the code's, are right by JSON Schema's own rules, and take all that the readers take."""

import copy
import json
from typing import Any

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.geo import METRES, WGS84
from maipp.live.events import read_event
from maipp.live.request import read_query
from maipp.records import dump_yaml, read_yaml
from maipp.scenario import Scenario
from maipp.scenario_io import dump_scenario, parse_scenario
from maipp.surveys.shapes import Drawing
from maipp.surveys.shapes.rings import to_polygon
from maipp.surveys.survey_io import parse_survey
from maipp.surveys.template import TEMPLATE
from tests.tools.schemas import FOLDER, texts

TEXTS = texts()
SCHEMAS = {name: jsonschema.Draft7Validator(json.loads(text)) for name, text in TEXTS.items()}
EXAMPLES = FOLDER.parent / "examples"
STRAIT = EXAMPLES / "strait"
ROBOTS = ("a", "b")


def mission(content: Any) -> None:
    survey = parse_survey(dump_yaml(content), folder=STRAIT)
    # What is looked at later.
    Scenario.create(**survey.scenario)
    for drawing in (*([survey.area] if isinstance(survey.area, Drawing) else []), *survey.no_go):
        for rings in drawing.polygons:
            to_polygon(rings, WGS84 if survey.crs is None and not survey.metres else METRES)


def line(content: Any) -> None:
    read_query(content) if "query" in content else read_event(content, ROBOTS)


READERS = {
    "mission.json": mission,
    "scenario.json": lambda content: parse_scenario(dump_yaml(content)),
    "live.json": line,
}


def plain(text: str) -> Any:
    return read_yaml(text, "example", empty="").value


def of_missions() -> list[Any]:
    paths = [STRAIT / "mission.yaml", STRAIT / "mission-metres.yaml", EXAMPLES / "live" / "mission.yaml"]
    return [plain(path.read_text(encoding="utf-8")) for path in paths] + [plain(TEMPLATE), MORE]


MORE: dict[str, Any] = {
    "area": {"raster": "relief.npz", "below": -3.0, "value": "depth"},
    "no_go": [{"file": "land-metres.geojson"}, [[4.0, 52.0], [4.1, 52.0], [4.1, 52.1]]],
    "robots": [{"start": [4.0, 52.0], "speed": 1.5, "budget_m": 2500, "reserve": "20 %", "end": [[4.0, 52.0]]}],
    "measurement_spacing_m": 100,
    "vehicle": {"kind": "copter", "altitude_m": 20, "fence": False},
    "kernel": {"length_scale_m": 400, "adapt": True},
    "scenario": {"nodes": 100, "interest_rule": "variance"},
    "rehearsal": {"raster": "relief.npz", "fields": 3},
    "samples": {"file": "soundings.csv", "value": "depth", "offset_s": 3},
    "planner_options": {"horizon": 4},
}
SCENARIOS = [
    plain(dump_scenario(Scenario())),
    {"agents": 2, "start": [[0.1, 0.2], [0.3, 0.4]], "end": [[[0.1, 0.1]], []], "budget": [2, 1.5]},
    {"end": "start", "obstacles": [[[0.4, 0.4], [0.6, 0.4], [0.6, 0.6]]], "comm_range": 0.3},
]
LINES: list[Any] = [
    {"event": "measurement", "id": "1", "robot": "a", "position": [1, 2], "value": 0.3, "time": 4.0},
    {"event": "arrived", "id": "2", "robot": "b", "position": [1, 2], "time": 4, "travelled": 3.0},
    {"event": "zone", "id": "3", "name": "buoy", "polygon": [[0, 0], [1, 0], [1, 1]], "time": 5.0},
    {
        "event": "joined",
        "id": "4",
        "robot": "c",
        "position": [0, 0],
        "budget": 3,
        "speed": 1,
        "time": 5,
        "end": "start",
    },
    {"event": "threshold", "id": "5", "threshold": 3.5, "time": 6},
    {"query": "belief", "points": [[0.1, 0.2]], "id": "q"},
    {"query": "hello", "protocol": "maipp.live/1"},
]
CASES = {"mission.json": of_missions(), "scenario.json": SCENARIOS, "live.json": LINES}


def test_the_files_are_the_code_s():
    kept = {path.name: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.json")}
    assert kept == TEXTS, "run: python -m tests.tools.schemas"


@pytest.mark.parametrize("name", TEXTS)
def test_they_are_schemas(name):
    jsonschema.Draft7Validator.check_schema(json.loads(TEXTS[name]))


@pytest.mark.parametrize("name", CASES)
def test_examples_pass(name):
    for example in CASES[name]:
        SCHEMAS[name].validate(example)


def places(value: Any, at: tuple = ()) -> list[tuple]:
    """Of everything in a nested value, but the whole."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [*([at] if at else []), *(place for key, item in items for place in places(item, (*at, key)))]


scalars = (
    st.none() | st.booleans() | st.integers(-2, 40) | st.floats(-1, 50) | st.sampled_from(["", "start", "x", "5 %"])
)
anything = scalars | st.lists(scalars, max_size=3) | st.just({}) | st.just([[0.1, 0.2]]) | st.just({"type": "Polygon"})


@pytest.mark.parametrize("name", CASES)
@given(data=st.data())
def test_what_a_reader_takes_passes(name, data):
    """A value put in place of another, left out, or added: were a schema stricter, editors would mark what is right."""
    record = copy.deepcopy(data.draw(st.sampled_from(CASES[name])))
    *parents, last = data.draw(st.sampled_from(places(record)))
    inner: Any = record
    for part in parents:
        inner = inner[part]
    if isinstance(inner, dict) and data.draw(st.booleans()):
        del inner[last]
    else:
        inner[last] = data.draw(anything)
    try:
        READERS[name](record)
    except InputError:
        return
    SCHEMAS[name].validate(record)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("mission.json", {"threshhold": 3}),
        ("mission.json", {"robots": []}),
        ("mission.json", {"robots": [{"speed": 0, "budget_m": 3}]}),
        ("mission.json", {"robots": [{"budget_m": 3}]}),
        ("mission.json", {"measurement_spacing_m": "far"}),
        ("mission.json", {"vehicle": "submarine"}),
        ("mission.json", {"kernel": {"length_scale": 3}}),
        ("scenario.json", {"agents": 0}),
        ("scenario.json", {"budget": True}),
        ("scenario.json", {"kernel": "linear"}),
        ("scenario.json", {"extent": [1, 2, 3]}),
        ("live.json", {"time": -1}),
        ("live.json", {"position": [1]}),
        ("live.json", {"event": "lost"}),
        ("live.json", {"speed": 3}),
    ],
)
def test_what_is_wrong_by_itself_does_not(name, wrong):
    assert not SCHEMAS[name].is_valid(CASES[name][0] | wrong)
    with pytest.raises(InputError):
        READERS[name](CASES[name][0] | wrong)


def test_an_editor_is_told_what_a_key_means_and_its_default():
    keys = json.loads(TEXTS["mission.json"])["properties"]
    assert keys["gate"]["default"] == 5.0 and "surprise" in keys["gate"]["description"]
    assert all("description" in key for key in keys.values())
    robot = keys["robots"]["items"]["properties"]
    assert robot["speed"] == {
        "description": "Its speed, m/s. Give a speed in m/s, from 0.001 to 60.",
        "type": "number",
        "minimum": 0.001,
        "maximum": 60.0,
    }
