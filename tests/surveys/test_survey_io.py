"""Mission files: what they say is read, and each mistake is one line with file, line, key and what would be right."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.surveys.mission_file import RasterArea
from maipp.surveys.projected_area import find_place, starts_of
from maipp.surveys.shapes import Drawing
from maipp.surveys.survey_io import KEYS, ROBOT_KEYS, load_survey, parse_survey
from maipp.surveys.template import TEMPLATE

LEAST = """\
area: [[4, 52], [4.1, 52], [4.1, 52.1]]
robots:
  - {start: [4.05, 52.01], speed: 1.5, budget_m: 2000}
measurement_spacing_m: 100
"""


def wrong(text, folder=Path()):
    with pytest.raises(InputError) as error:
        parse_survey(text, source="m.yaml", folder=folder)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_the_least_mission_has_defaults():
    survey = parse_survey(LEAST, source="lake.yaml")
    assert survey.name == "lake" and survey.planner == "receding-horizon" and survey.seed == 0
    assert survey.robots[0].name == "robot-1" and survey.robots[0].where == "lake.yaml:3: robots[0].start"
    assert survey.threshold is survey.noise is survey.samples is survey.communication_range_m is None
    assert survey.clearance_m == 0 and not survey.metres and not survey.below
    assert survey.where("measurement_spacing_m") == "lake.yaml:4: measurement_spacing_m"


def test_the_template_is_a_mission_that_shows_every_key():
    survey = parse_survey(TEMPLATE, source="new.yaml")
    assert survey.name == "lake" and len(survey.robots) == 2 and survey.threshold == 12
    assert survey.robots[1].budget_m == pytest.approx(40 * 60 * 1.2)
    shown = {line.lstrip("# ").split(":")[0] for line in TEMPLATE.splitlines()}
    assert set(KEYS) <= shown
    assert all(f"{key}:" in TEMPLATE for key in ROBOT_KEYS)


def test_files_are_found_beside_the_mission(tmp_path):
    (tmp_path / "area.geojson").write_text('{"type":"Polygon","coordinates":[[[0,0],[9,0],[9,9]]]}')
    (tmp_path / "map.npz").write_bytes(b"")
    (tmp_path / "old.csv").write_text("x,y,value\n")
    path = tmp_path / "m.yaml"
    text = LEAST.replace("[[4, 52], [4.1, 52], [4.1, 52.1]]", "area.geojson")
    text += "samples: {file: old.csv, value: chl}\nrehearsal: {raster: map.npz, fields: 3}\nno_go: [area.geojson]\n"
    path.write_text(text, encoding="utf-8")
    survey = load_survey(path)
    assert survey.samples is not None and survey.samples.file == tmp_path / "old.csv"
    assert survey.samples.columns == {"value": "chl"}
    assert survey.rehearsal.raster == tmp_path / "map.npz" and survey.rehearsal.fields == 3
    assert len(survey.no_go) == 1 and isinstance(survey.area, Drawing) and len(survey.area.polygons) == 1


PLAN = """{"fileType": "Plan", "version": 1, "geoFence": {"version": 2, "circles": [], "polygons": [
  {"inclusion": true, "version": 1, "polygon": [[52, 4], [52, 4.1], [52.1, 4.1]]}]},
  "mission": {"items": [], "plannedHomePosition": [52.01, 4.05, 0]}}"""


def test_the_home_of_a_plan_is_where_robots_without_a_start_set_out(tmp_path):
    (tmp_path / "lake.plan").write_text(PLAN)
    text = LEAST.replace("[[4, 52], [4.1, 52], [4.1, 52.1]]", "lake.plan").replace("start: [4.05, 52.01], ", "")
    survey = parse_survey(text, source="m.yaml", folder=tmp_path)
    assert survey.robots[0].start is None
    place = find_place(survey)
    (start,) = starts_of(survey, place)
    np.testing.assert_allclose(place.frame.from_plane(np.array(start.place)), [4.05, 52.01])
    message = wrong(LEAST.replace("start: [4.05, 52.01], ", ""))
    assert message.startswith("m.yaml:3: robots[0].start: missing; give [longitude, latitude]")


def test_a_file_of_polygons_takes_more_keys(tmp_path):
    (tmp_path / "area.geojson").write_text('{"type":"Polygon","coordinates":[[[4,52],[4.1,52],[4.1,52.1]]]}')
    text = LEAST.replace("[[4, 52], [4.1, 52], [4.1, 52.1]]", "{file: area.geojson, crs: EPSG:4258}")
    survey = parse_survey(text, source="m.yaml", folder=tmp_path)
    assert isinstance(survey.area, Drawing) and str(survey.area.polygons[0].crs) == "EPSG:4258 (degrees)"
    assert "area.layers: no such key; did you mean layer?" in wrong(
        text.replace("crs: EPSG:4258", "layers: a"), tmp_path
    )


def test_an_entry_of_a_map_with_times_is_chosen(tmp_path):
    (tmp_path / "map.nc").write_bytes(b"")
    area = "area: {raster: map.nc, below: 0, at: {time: 0}}"
    survey = parse_survey(LEAST.replace("area: [[4, 52], [4.1, 52], [4.1, 52.1]]", area), folder=tmp_path)
    assert isinstance(survey.area, RasterArea) and survey.area.at == {"time": 0}
    for at in ("{time: 0.5}", "{}", "3", "{time: true}"):
        message = wrong(f"{area.replace('{time: 0}', at)}\n" + LEAST.partition("\n")[2], tmp_path)
        assert "area.at: " in message and "such as {time: 0}" in message


def test_an_area_may_be_the_cells_of_a_map(tmp_path):
    (tmp_path / "map.npz").write_bytes(b"")
    text = LEAST.replace("[[4, 52], [4.1, 52], [4.1, 52.1]]", "{raster: map.npz, below: 0}")
    area = parse_survey(text, folder=tmp_path).area
    assert isinstance(area, RasterArea) and area.below and area.level == 0
    assert "give one of below and above" in wrong(text.replace(", below: 0", ", below: 0, above: 2"), tmp_path)
    everywhere = parse_survey(text.replace(", below: 0", ""), folder=tmp_path).area
    assert isinstance(everywhere, RasterArea) and everywhere.level is None


@pytest.mark.parametrize(
    ("area", "count"),
    [
        ("[[0,0],[1,0],[1,1]]", 1),
        ("[[[0,0],[1,0],[1,1]], [[2,2],[3,2],[3,3]]]", 2),
        ("{type: Polygon, coordinates: [[[0,0],[1,0],[1,1]]]}", 1),
        ("[{type: Polygon, coordinates: [[[0,0],[1,0],[1,1]]]}, [[2,2],[3,2],[3,3]]]", 2),
        ("[]", 0),
    ],
)
def test_zones_come_in_every_form(area, count):
    assert len(parse_survey(f"{LEAST}no_go: {area}\n").no_go) == count


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (("", "treshold: 3\n"), "m.yaml:5: treshold: no such key; did you mean threshold?"),
        (("budget_m: 2000", "budget: 2000"), "m.yaml:3: robots[0].budget: no such key; did you mean budget_m?"),
        (("budget_m: 2000", "budget_m: 2000, budget_minutes: 3"), "robots[0]: give one of budget_m and budget_minutes"),
        ((", budget_m: 2000", ""), "robots[0]: give one of budget_m and budget_minutes"),
        (("budget_m: 2000", "budget_m: 50"), "robots[0].budget_m: 50 allows 50 m, less than measurement_spacing_m"),
        (("budget_m: 2000", "budget_minutes: 1"), "robots[0].budget_minutes: 1 allows 90 m, less than"),
        (("speed: 1.5", "speed: fast"), "m.yaml:3: robots[0].speed: 'fast' is not a speed in m/s"),
        (("speed: 1.5, ", ""), "robots[0].speed: missing; give a speed in m/s"),
        (("[4.05, 52.01]", "[4.05]"), "robots[0].start: [4.05] is not a start; give [longitude, latitude] in degrees"),
        (("measurement_spacing_m: 100", "measurement_spacing_m: 0"), "m.yaml:4: measurement_spacing_m: 0 is not a len"),
        (("measurement_spacing_m: 100\n", ""), "m.yaml: measurement_spacing_m: missing"),
        (("[[4, 52], [4.1, 52], [4.1, 52.1]]", "nowhere.geojson"), "m.yaml:1: area: no file nowhere.geojson"),
        (("[[4, 52], [4.1, 52], [4.1, 52.1]]", "3"), "m.yaml:1: area: 3 is not a file (GeoJSON, KML, KMZ"),
        (("", "seed: -1\n"), "m.yaml:5: seed: -1 is not a whole number from 0 to 4294967295"),
        (("", "below: true\n"), "m.yaml:5: below: says on which side"),
        (
            ("", "kernel: {lenght_scale: 3}\n"),
            "m.yaml:5: kernel.lenght_scale: no such key; did you mean",
        ),
        (("", "kernel: {std: 0}\n"), "m.yaml:5: kernel.std: 0 is not a standard deviation > 0"),
        (("", "noise: .nan\n"), "m.yaml:5: noise: nan is not a standard deviation >= 0"),
        (("", "threshold: 1e400\n"), "m.yaml:5: threshold: inf is not a number in the unit"),
        (("", "samples: {x: a}\n"), "m.yaml:5: samples.file: missing; give the path of a CSV file"),
        (("", "scenario: {budget: 3}\n"), "m.yaml:5: scenario.budget: no such key"),
        (("", "rehearsal: 0\n"), "m.yaml:5: rehearsal: 0 is not a raster, or a number of fields"),
        (("", "vehicle: submarine\n"), "m.yaml:5: vehicle: vehicle 'submarine' is not known"),
        (("", "vehicle: {kind: copter}\n"), "m.yaml:5: vehicle: a copter needs an altitude"),
        (("", "planner_options: [1]\n"), "m.yaml:5: planner_options: [1] is not a mapping"),
        (("", "metres: yes\n"), "m.yaml:5: metres: 'yes' is not true or false"),
        (("", "seed: 1\nseed: 2\n"), "m.yaml:6: seed: given twice, first on line 5"),
        (("", "name: [1\n"), "m.yaml:6: not valid YAML"),
        (("", 'noise: !!float ""\n'), "m.yaml:5: noise: cannot be read"),
        (("", "name: &a [*a]\n"), "m.yaml:5: not valid YAML"),
        (("robots:\n  - {start: [4.05, 52.01], speed: 1.5, budget_m: 2000}", "robots: []"), "robots: [] is not a list"),
    ],
)
def test_every_mistake_is_told_with_its_line_and_what_would_be_right(change, problem):
    before, after = change
    text = LEAST.replace(before, after) if before else LEAST + after
    assert problem in wrong(text)


def test_two_robots_of_one_name_are_refused():
    line = "  - {name: a, start: [4.05, 52.01], speed: 1.5, budget_m: 2000}\n"
    assert "is the name of an earlier robot" in wrong(f"area: [[4, 52], [4.1, 52], [4.1, 52.1]]\nrobots:\n{line}{line}"
                                                      "measurement_spacing_m: 100\n")  # fmt: skip


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"- 1\n", b"\x00", b"? [1]\n: 2\n", b"a: !!int three\n"])
def test_files_that_are_no_mission_are_told(content, tmp_path):
    path = tmp_path / "m.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match="m.yaml"):
        load_survey(path)


def test_anchors_that_multiply_do_not_make_it_slow():
    text = "a: &a [x, x, x, x, x, x, x, x, x]\n"
    text += "".join(f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True))
    assert "a: no such key" in wrong(text)


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*KEYS, *ROBOT_KEYS]), inner, max_size=4)
    ),
    max_leaves=12,
)


@given(changes=st.dictionaries(st.sampled_from(KEYS), values, min_size=1, max_size=4))
def test_any_values_give_a_survey_or_one_line(changes):
    text = yaml.safe_dump(yaml.safe_load(LEAST) | changes, allow_unicode=True)
    try:
        survey = parse_survey(text, source="m.yaml")
    except InputError as error:
        assert "\n" not in str(error) and str(error).startswith("m.yaml")
    else:
        assert survey.robots


@given(cut=st.integers(0, len(TEMPLATE)), junk=st.text(max_size=6))
def test_any_text_gives_a_survey_or_one_line(cut, junk):
    try:
        parse_survey(TEMPLATE[:cut] + junk + TEMPLATE[cut:], source="m.yaml")
    except InputError as error:
        assert "\n" not in str(error)
