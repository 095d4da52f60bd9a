"""What the pages in docs/ say of the code is so: floors, planners, options, message sizes."""

import ast
import re
from pathlib import Path

from maipp.planners import planner_class, planner_names, planner_options
from tests.tools.planner_tables import FAMILIES, with_tables

ROOT = Path(__file__).parents[1]
ARCHITECTURE, PLANNERS = (
    (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8") for page in ("architecture", "planners")
)


def section(page: str, title: str) -> str:
    """The text below a heading of the second level."""
    found = re.search(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", page, flags=re.DOTALL | re.MULTILINE)
    assert found is not None, f"no section {title}"
    return found[1]


def rows(text: str) -> list[list[str]]:
    """The cells of all table rows that begin with a name in backquotes."""
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| `")]


def test_the_floors_are_those_that_the_tests_enforce():
    tree = ast.parse((ROOT / "tests" / "test_floors.py").read_text(encoding="utf-8"))
    (enforced,) = (
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "FLOORS"
    )
    drawn = re.findall(r"^(\d)  ([\w ]+)$", section(ARCHITECTURE, "Floors"), flags=re.MULTILINE)
    assert [(int(floor), set(rooms.split())) for floor, rooms in reversed(drawn)] == [
        (floor, set(rooms)) for floor, rooms in enumerate(enforced)
    ]


def test_every_planner_has_its_section():
    assert re.findall(r"^## `([^`]+)`$", PLANNERS, flags=re.MULTILINE) == list(planner_names())


def test_all_planners_keep_out_of_zones_as_the_page_says():
    assert all(planner_class(name).avoids_obstacles for name in planner_names())


def test_the_tables_of_planners_and_options_are_the_code_s():
    assert with_tables(PLANNERS) == PLANNERS, "run: python -m tests.tools.planner_tables"


def test_every_option_of_every_planner_is_in_a_table():
    told = {name for names in FAMILIES.values() for name in names}
    assert told == {name for name in planner_names() if planner_options(name)}
    assert all(option.meaning for name in told for option in planner_options(name))
    for marker, names in FAMILIES.items():
        table = PLANNERS.partition(f"<!-- {marker} -->")[2].partition(f"<!-- /{marker} -->")[0]
        assert {cells[0].strip("`") for cells in rows(table)} == {
            option.name for name in names for option in planner_options(name)
        }
