"""docs/mission.md names every key of a mission file, and no other; its tables are made from the records."""

import re
from pathlib import Path

from maipp.surveys import survey_io as keys
from tests.tools.mission_tables import with_tables

PAGE = (Path(__file__).parents[2] / "docs" / "mission.md").read_text(encoding="utf-8")


def test_the_tables_are_what_the_records_say():
    assert with_tables(PAGE) == PAGE, "run: python -m tests.tools.mission_tables"


def told(section: str) -> set[str]:
    """The names in the first cells of a section's table."""
    text = PAGE.partition(f"## {section}\n")[2].partition("\n## ")[0]
    cells = re.findall(r"^\| (`[^|]+`) \|", text, flags=re.MULTILINE)
    return {name for cell in cells for name in re.findall(r"`([^`]+)`", cell)}


def test_every_key_of_a_mission_is_told():
    nested = {f"robots[].{key}" for key in keys.ROBOT_KEYS} | {f"kernel.{key}" for key in keys.KERNEL_KEYS}
    assert told("Keys") == (set(keys.KEYS) - {"kernel"}) | nested


def test_every_key_of_old_samples_is_told():
    assert told("Old samples") == set(keys.SAMPLE_KEYS)


def test_what_a_vehicle_a_rehearsal_and_the_scenario_take_is_told():
    rows = {line.split("`")[1]: line for line in PAGE.splitlines() if line.startswith("| `")}
    for key, names in (
        ("vehicle", keys.VEHICLE_KEYS),
        ("rehearsal", keys.REHEARSAL_KEYS),
        ("scenario", keys.SCENARIO_KEYS),
    ):
        assert {name for name in names if f"`{name}`" not in rows[key]} == set(), key


def test_the_mission_on_the_page_is_one(tmp_path):
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    ring = "[[4.73,52.24],[4.746,52.24],[4.746,52.25]]"
    for name in ("lake", "reeds"):
        content = f'{{"type": "Polygon", "coordinates": [{ring}]}}'
        (tmp_path / f"{name}.geojson").write_text(content, encoding="utf-8")
    (tmp_path / "last-year.csv").write_text("lon,lat,value\n", encoding="utf-8")
    survey = keys.parse_survey(block, folder=tmp_path)
    assert len(survey.no_go) == 2 and survey.samples is not None
