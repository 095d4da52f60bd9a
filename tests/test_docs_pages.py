"""What the pages in docs/ say of the code is so: floors, state, planners, options, message sizes."""

import ast
import dataclasses
import re
from pathlib import Path

import pytest

from maipp.bench.evaluate import message_bytes
from maipp.engine import State
from maipp.engine.options import parts_of
from maipp.markdown import typed
from maipp.planners import make_planner, planner_class, planner_names, planner_options
from maipp.scenario import Scenario

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


def test_the_state_has_these_fields_in_this_order():
    described = [cells[0].strip("`") for cells in rows(section(ARCHITECTURE, "State"))]
    assert described == [field.name for field in dataclasses.fields(State)]


def test_every_planner_has_its_section_and_its_line():
    assert re.findall(r"^## `([^`]+)`$", PLANNERS, flags=re.MULTILINE) == list(planner_names())
    overview = {cells[0].strip("`"): cells for cells in rows(PLANNERS.partition("\n## ")[0])}
    assert list(overview) == list(planner_names())
    for name, (_, moves, _, keeps_out) in overview.items():
        planner = planner_class(name)
        holders = planner, *(part.kind for part in parts_of(planner).values())
        assert (moves == "in the plane") == any(hasattr(holder, "zones") for holder in holders)
        assert (keeps_out == "yes") == planner.avoids_obstacles


@pytest.mark.parametrize("name", planner_names())
def test_options_and_defaults_are_the_planner_s(name):
    described = [(cells[0].strip("`"), cells[1].strip("`")) for cells in rows(section(PLANNERS, f"`{name}`"))]
    assert described == [(option.name, typed(option.default)) for option in planner_options(name)]


@pytest.mark.parametrize("name", planner_names())
def test_messages_have_the_size_that_is_told(name):
    told = re.search(r"^Message: (\d+) bytes", section(PLANNERS, f"`{name}`"), flags=re.MULTILINE)
    # The size does not depend on the weights.
    options = {option.name: "untrained" for option in planner_options(name) if option.name == "weights"}
    assert told is not None and int(told[1]) == message_bytes(make_planner(name, Scenario(), options))


def test_the_joint_form_s_message_has_the_size_that_is_told():
    told = re.search(r"with `joint=true` (\d+)", section(PLANNERS, "`receding-horizon`"))
    assert told is not None
    assert int(told[1]) == message_bytes(make_planner("receding-horizon", Scenario(), {"joint": True}))
