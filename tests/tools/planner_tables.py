"""The tables of all planners and of their options, for docs/planners.md.

`python -m tests.tools.planner_tables` writes them between the page's markers.
"""

from pathlib import Path

from maipp.bench.evaluate import message_bytes
from maipp.engine.options import parts_of
from maipp.files import write_atomic
from maipp.markdown import filled, markdown_table, typed
from maipp.planners import make_planner, planner_class, planner_names, planner_options
from maipp.records import Field
from maipp.scenario import Scenario

PAGE = Path(__file__).parents[2] / "docs" / "planners.md"
# Planners that share most of their options, by the marker of their table.
FAMILIES = {
    "plane options": ("receding-horizon", "foresight", "intent-search"),
    "path options": ("sga-catnipp", "di", "ti", "ti-star", "intent-paths"),
    "other options": ("greedy", "shared-greedy", "lawnmower", "sga-rrt"),
}


def in_the_plane(name: str) -> bool:
    """Whether a planner goes anywhere, in place of from node to node."""
    kind = planner_class(name)
    return any(hasattr(holder, "zones") for holder in (kind, *(part.kind for part in parts_of(kind).values())))


def overview() -> str:
    """Every planner, where it moves, and the size of its message in the default scenario."""
    rows = []
    for name in planner_names():
        # The size does not depend on the weights.
        options = {option.name: "untrained" for option in planner_options(name) if option.name == "weights"}
        size = message_bytes(make_planner(name, Scenario(), options))
        rows.append([f"[`{name}`](#{name})", "plane" if in_the_plane(name) else "roadmap", str(size)])
    return markdown_table(["Planner", "Moves in", "Message, bytes"], rows, left=2)


def options_table(names: tuple[str, ...]) -> str:
    """All options of these planners, the default of each planner that has them, and what they mean."""
    defaults = {name: {option.name: option for option in planner_options(name)} for name in names}
    meanings: dict[str, Field] = {}
    for options in defaults.values():
        for option in options.values():
            meanings.setdefault(option.name, option)
    rows = [
        [f"`{key}`", *(f"`{typed(has[key].default)}`" if key in has else "" for has in defaults.values()), said.meaning]
        for key, said in meanings.items()
    ]
    return markdown_table(["Option", *(f"`{name}`" for name in names), "Meaning"], rows, left=len(names) + 2)


def with_tables(page: str) -> str:
    """The page with all its tables. Raises `InputError` for a page without their markers."""
    tables = {"planners": overview(), **{marker: options_table(names) for marker, names in FAMILIES.items()}}
    for marker, table in tables.items():
        page = filled(page, f"<!-- {marker} -->", f"<!-- /{marker} -->", table)
    return page


if __name__ == "__main__":
    write_atomic(PAGE, with_tables(PAGE.read_text(encoding="utf-8")))
