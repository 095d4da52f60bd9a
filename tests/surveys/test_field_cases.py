"""Files as field teams have them, each the kind that went wrong: what they give, and what is told."""

from pathlib import Path

import pytest

from maipp.errors import InputError
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey

FOLDER = Path(__file__).parents[1] / "data" / "field_cases"
MISSION = """
area: AREA
robots:
  - {name: boat-1, start: [13.3030, 53.4030], speed: 1.2, budget_m: 3000}
measurement_spacing_m: 100
quantity: chlorophyll
unit: ug/L
threshold: 12
planner: shared-greedy
"""
KERNEL = "kernel: {length_scale_m: 300, mean: 9, std: 4}\n"
LAKE, ISLAND = 3.109e6, 0.134e6  # m2


def prepared(area="lake.geojson", more=KERNEL):
    return prepare(parse_survey(MISSION.replace("AREA", area) + more, source="m.yaml", folder=FOLDER))


@pytest.mark.parametrize(
    ("area", "free", "told"),
    [
        ("lake.kml", LAKE - ISLAND, "beside its polygons 1 point, left out"),
        ("lake.gpx", LAKE, ""),
        ("island_feature.geojson", LAKE - ISLAND, "'island' is taken as a no-go zone, as its name says"),
        ("mixed_fc.geojson", LAKE, "beside its polygons 1 point, 1 line, left out"),
        ("{raster: nodata_undeclared.tif, below: 0}", 2.96e6, "1186 cells hold -9999, which looks like no value"),
        ("{raster: time2.nc, below: 0, at: {time: 0}}", 2.96e6, ""),
    ],
)
def test_areas_are_as_large_as_on_the_ground(area, free, told):
    survey = prepared(area)
    assert survey.free_area == pytest.approx(free, rel=0.015)  # half a cell of the maps along the shore
    assert told in "\n".join(survey.warnings) and bool(told) == bool(survey.warnings)


def test_a_map_of_several_times_says_how_to_choose_one():
    with pytest.raises(InputError, match=r"choose an entry with at \{time: 0\} \(0 to 1\)"):
        prepared("{raster: time2.nc, below: 0}")


@pytest.mark.parametrize(
    ("file", "told"),
    [
        ("plain", None),
        ("korexo", None),
        ("deg_min", None),
        ("gnss_repeat", "180 of 240 lines repeat a place; each of the 60 places counts once"),
        ("spike", "1 line (12) with 4500, far off all values nearby; left out"),
        ("sentinel_9999", "3 lines (5, 13, 32) with -9999, which looks like no value; left out"),
        ("below_detection", "1 line (6) below detection; half the limit is taken"),
    ],
)
def test_samples_of_one_field_give_one_kernel(file, told):
    """Of the plain file: standard deviation 4.8 ug/L, length scale 1,507 m, noise 0.232 ug/L."""
    survey = prepared(more=f"samples: {file}.csv\n")
    assert survey.frame.std == pytest.approx(4.81, rel=0.05)
    assert survey.scenario.length_scale * survey.frame.scale == pytest.approx(1507, rel=0.06)
    assert survey.scenario.noise**0.5 * survey.frame.std == pytest.approx(0.232, rel=0.02)
    told_at_all = [warning for warning in survey.warnings if warning.startswith(f"{file}.csv: ")]
    assert (f"{file}.csv: {told}" in told_at_all) if told else not told_at_all
