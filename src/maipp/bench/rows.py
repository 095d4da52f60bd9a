"""The lines of tables: which planner, with which options, under which name in the paper."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from maipp.engine import Mission, Planner, draw_missions
from maipp.errors import InputError
from maipp.files import read_text
from maipp.markdown import typed
from maipp.planners import make_planner, planner_names
from maipp.records import Value, read_yaml, unknown
from maipp.scenario import Scenario

PAPER = Path(__file__).with_name("paper")  # folder of the paper's tables, and of the rows that any table can name


@dataclass(frozen=True)
class Row:
    """One line of a table."""

    name: str  # unique, a word that can be typed and be a part of a file's name
    planner: str  # its name, or path/to/file.py:ClassName
    options: Mapping[str, Any] = field(default_factory=dict)  # that differ from the planner's defaults
    paper: str | None = None  # the paper's name of the method; None: not in the paper
    trials: int | None = None  # the most, where a trial is dear; the table says so
    quick: bool = True  # False: too dear for a quick look, unless it is asked for by name
    by_name: bool = False  # in no table unless it is asked for by name: as dear as many other rows together

    @property
    def label(self) -> str:
        """The planner and its options, as one would type them."""
        return f"`{self.planner}` {self.typed_options}".rstrip()

    @property
    def typed_options(self) -> str:
        """The options as one would type them."""
        return " ".join(f"{key}={typed(value)}" for key, value in self.options.items())

    def drawn(self, scenario: Scenario, *, instances: int, seed: int) -> tuple[Planner, Mission]:
        """The planner made for a scenario, and its missions: one for each instance."""
        planner = make_planner(self.planner, scenario, self.options)
        return planner, draw_missions(scenario, seed=seed, instances=instances, planner=planner)


@cache
def known_rows() -> dict[str, Row]:
    """The rows that a table can name."""
    path = PAPER / "rows.yaml"
    document = read_yaml(read_text(path, "rows", "a YAML file"), path.name, empty="the package is damaged")
    rows = [read_row(each) for each in document["rows"].items()]
    return {row.name: row for row in rows}


def read_row(value: Value) -> Row:
    """A row of a file: the name of a known one or of a planner, or a mapping. Raises `FieldError` with the key."""
    if isinstance(value.value, str):
        return _named(value, value.value)
    given = value.mapping(("name", "planner", "options", "paper", "trials", "quick", "by_name"))
    planner = value["planner"].fit(str)
    given_options = value["options"].mapping() if "options" in value else {}
    options = {str(key): _tuples(value["options"].at(str(key), option)) for key, option in given_options.items()}
    name = value["name"].fit(str) if "name" in given else planner.rpartition(":")[2]
    if not name or not all(letter.isalnum() or letter in "-_." for letter in name):
        value.at("name").wrong(f"{name!r} is no word that can be typed; give letters, digits, -, _ and .")
    trials = value["trials"].fit(int) if "trials" in value else None
    if trials is not None and trials < 1:
        value["trials"].unfit("a whole number >= 1")
    paper = value["paper"].fit(str) if "paper" in value else None
    flags = {key: value[key].fit(bool) for key in ("quick", "by_name") if key in value}
    return Row(name, planner, options, paper, trials, **flags)


def _named(value: Value, name: str) -> Row:
    """The known row of this name, or the planner's with its default options."""
    path = PAPER / "rows.yaml"
    known = {} if value.source == path.name else known_rows()
    if name in known:
        return known[name]
    if ":" in name:
        return Row(name.rpartition(":")[2], name)
    if name not in planner_names():
        value.wrong(unknown("row or planner", name, [*known, *(set(planner_names()) - set(known))]))
    return Row(name, name)


def check_row(value: Value, row: Row, scenario: Scenario) -> None:
    """Raise `FieldError`, which names the key, where the row's planner cannot be made for a scenario."""
    try:
        make_planner(row.planner, scenario, row.options)
    except InputError as error:
        value.wrong(str(error))


def _tuples(value: Value) -> Any:
    """Lists as tuples, which options are."""
    if isinstance(value.value, list):
        return tuple(map(_tuples, value.items()))
    if isinstance(value.value, float) and not math.isfinite(value.value):
        value.unfit("a finite number")
    return value.value
