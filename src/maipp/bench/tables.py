"""Tables as data: which rows, on which missions, beside which printed numbers. The paper's are files like any other."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from maipp.engine import Mission, Planner, draw_missions
from maipp.engine.score import Metrics
from maipp.errors import InputError
from maipp.files import read_text
from maipp.markdown import typed
from maipp.planners import make_planner, planner_names
from maipp.problem import Shape, shape_of
from maipp.records import Value, Within, fields_of, nearest, read_yaml, unknown
from maipp.records.kinds import Count, Finite
from maipp.renamed import renamed
from maipp.scenario import Scenario

PAPER = Path(__file__).with_name("paper")  # folder of the paper's tables, and of the rows that any table can name


@dataclass(frozen=True)
class Row:
    """One line of a table."""

    name: str  # unique, a word that can be typed and be a part of a file's name
    planner: str  # its name, or path/to/file.py:ClassName
    options: Mapping[str, Any] = field(default_factory=dict)  # that differ from the planner's defaults
    paper: str | None = None  # the paper's name of the method; None: not in the paper
    trials: Count | None = None  # the most, where a trial is dear; the table says so
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
    named = {} if "name" in value else {"name": value["planner"].fit(str).rpartition(":")[2]}
    row = value.record(Row, {"options": _options}, beside=["name"], **named)
    if not row.name or not all(letter.isalnum() or letter in "-_." for letter in row.name):
        value.at("name").wrong(f"{row.name!r} is no word that can be typed; give letters, digits, -, _ and .")
    return row


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


def _options(value: Value) -> dict[str, Any]:
    """Options, lists among them as tuples."""
    return {str(key): _tuples(value.at(str(key), option)) for key, option in value.mapping().items()}


def _tuples(value: Value) -> Any:
    if isinstance(value.value, list):
        return tuple(map(_tuples, value.items()))
    return value.fit(Finite) if isinstance(value.value, float) else value.value


WORLDS = ("mixture", "prior")  # ground truths: the paper's mixtures, or draws of the scenario's own prior

_KEYS = (
    *("title", "scenario", "columns", "rows", "parts", "printed", "left_out"),
    *("metric", "beside", "reference", "instances", "trials", "seed", "worlds"),
)


class Printed(NamedTuple):
    """One cell of a table of the paper."""

    mean: float
    std: float


Block = Mapping[str, Mapping[float, Printed]]  # by the paper's name of the method and the column


class SampleSize(NamedTuple):
    """How many missions each cell has."""

    instances: int = 30
    trials: int = 10
    seed: int = 0


@dataclass(frozen=True)
class TablePart:
    """The missions of a table that differ in their column only, and what the paper prints for them."""

    scenario: Scenario
    printed: Block


@dataclass(frozen=True)
class TableSpec:
    """One table."""

    name: str
    title: str
    rows: tuple[Row, ...]
    parts: tuple[TablePart, ...]
    columns: tuple[float, ...]  # values of the scenario's key that changes from column to column
    column: str = "budget"  # that key
    metric: str = "trace"  # that the paper prints, a field of `Metrics`
    beside: tuple[str, ...] = ("true_trace", "rmse")  # further ones that are tabulated
    reference: str = "ti-5-star"  # the row that the others are paired with
    left_out: Mapping[str, str] = field(default_factory=dict)  # rows of other tables that this one lacks, and why
    worlds: str = "mixture"  # one of `WORLDS`
    sample: SampleSize = SampleSize()
    typed: str = ""  # what one types for it after `maipp benchmark`; empty: its name

    @property
    def quick_sample(self) -> SampleSize:
        """How many missions each cell has in a quick look."""
        return self.sample._replace(trials=1)

    def scenario(self, part: TablePart, column: float) -> Scenario:
        """The missions of a part in a column."""
        return part.scenario.replace(**{self.column: column})

    def shape(self, part: TablePart) -> Shape:
        """That all cells over areas like the part's fit: each row is compiled once for them."""
        like = [other for other in self.parts if other.scenario.extent == part.scenario.extent]
        return shape_of([self.scenario(other, column) for other in like for column in self.columns])

    def heading(self, column: float) -> str:
        """The heading of a column."""
        return f"{'B' if self.column == 'budget' else self.column} = {column:g}"

    def chosen(self, names: Sequence[str]) -> tuple[Row, ...]:
        """The rows of these names or, where no row has the name, of the planner of that name.

        For no names all rows but those computed by name only. Raises `InputError` for a name that no row has.
        """
        for name in names:
            if not any(name in (row.name, row.planner) for row in self.rows):
                raise InputError(f"--planners: {unknown('row', name, [row.name for row in self.rows])}")
        if not names:
            return tuple(row for row in self.rows if not row.by_name)
        planners = set(names) - {row.name for row in self.rows}
        return tuple(row for row in self.rows if row.name in names or row.planner in planners)


def best(block: Block, column: float) -> float:
    """The lowest mean that the paper prints in this column."""
    return min(line[column].mean for line in block.values())


def read_table(path: Path, *, check: bool = True) -> TableSpec:
    """The table in a YAML file (docs/benchmark.md). Raises `InputError` with the file, line and key of what is wrong.

    Without a `check` its planners are not tried.
    """
    text = read_text(path, "table", "a YAML file such as docs/benchmark.md has")
    root = read_yaml(text, str(path), empty="docs/benchmark.md has one to start from")
    root.mapping(_KEYS)
    base = _scenario(root["scenario"], Scenario()) if "scenario" in root else Scenario()
    column, columns = _columns(root["columns"])
    parts = _parts(root, base, columns)
    rows = _rows(root, parts[0].scenario if check else None)
    names = [row.name for row in rows]
    given: dict[str, Any] = {"reference": names[0]}
    for key, allowed in (("metric", _METRICS), ("reference", names), ("worlds", WORLDS)):
        if key in root:
            given[key] = _one_of(root[key], allowed)
    if "beside" in root:
        given["beside"] = tuple(_one_of(each, _METRICS) for each in root["beside"].items())
    if "left_out" in root:
        given["left_out"] = {name: root["left_out"][name].fit(str) for name in root["left_out"].mapping()}
    title = root["title"].fit(str) if "title" in root else path.stem
    sample = SampleSize(**{key: root[key].fit(_COUNTS[key]) for key in SampleSize._fields if key in root})
    spec = TableSpec(path.stem, title, rows, parts, columns, column, **given, sample=sample, typed=str(path))
    for part in parts:
        for value in columns:
            root["columns"].make(spec.scenario, {"part": part, "column": value})
    return spec


_COUNTS = {"instances": Count, "trials": Count, "seed": Annotated[int, Within(least=0, wide=True)]}
_NUMBERS = ("budget", "comm_range")  # numbers whose default is none
_METRICS = [each.name for each in dataclasses.fields(Metrics)]


def _rows(root: Value, scenario: Scenario | None) -> tuple[Row, ...]:
    """The rows of a table, their planners tried on a scenario if one is given."""
    rows: list[Row] = []
    for each in root["rows"].items(1, "a list of rows, one or more"):
        row = read_row(each)
        if any(row.name == other.name for other in rows):
            each.wrong(f"there is a row {row.name!r} already; give it a name of its own")
        if scenario is not None:
            check_row(each, row, scenario)
        rows.append(row)
    return tuple(rows)


def _one_of(value: Value, names: Sequence[str]) -> str:
    name = value.fit(str)
    if name not in names:
        value.wrong(f"{name!r:.60}: {nearest(name, names)}")
    return name


def _scenario(value: Value, base: Scenario) -> Scenario:
    """The scenario with what the mapping changes."""
    names = [each.name for each in fields_of(Scenario)]
    return value.make(base.replace, value.mapping(names))


def _columns(value: Value) -> tuple[str, tuple[float, ...]]:
    """The key of the scenario that the columns vary, and its values."""
    given = value.mapping()
    numbers = [each.name for each in fields_of(Scenario) if isinstance(each.default, float) or each.name in _NUMBERS]
    if len(given) != 1:
        value.unfit("one key with a list of numbers, such as budget: [2, 3]")
    (name,) = given
    if name not in numbers:
        value.at(str(name)).wrong(nearest(str(name), numbers))
    columns = tuple(each.fit(float) for each in value[name].items(1, "a list of numbers, one or more"))
    if len(set(columns)) < len(columns):
        value[name].wrong("the same number twice")
    return name, columns


def _parts(root: Value, base: Scenario, columns: Sequence[float]) -> tuple[TablePart, ...]:
    """The parts of a table; one where it names none."""
    if "parts" not in root:
        return (TablePart(base, _printed(root, columns)),)
    if "printed" in root:
        root["printed"].wrong("there are parts; give it in each of them")
    parts = []
    for each in root["parts"].items(1, "a list of parts, one or more"):
        each.mapping(("scenario", "printed"))
        scenario = _scenario(each["scenario"], base) if "scenario" in each else base
        parts.append(TablePart(scenario, _printed(each, columns)))
    return tuple(parts)


def _printed(value: Value, columns: Sequence[float]) -> Block:
    """What the paper prints, mean and standard deviation for each column."""
    if "printed" not in value:
        return {}
    block = {}
    for name in value["printed"].mapping():
        pairs = zip(columns, value["printed"][name].items(count=len(columns)), strict=True)
        block[name] = {
            column: Printed(*(number.fit(Finite) for number in pair.items(count=2))) for column, pair in pairs
        }
    return block


def _paper(name: str) -> TableSpec:
    """A table of the paper."""
    return replace(read_table(PAPER / f"{name}.yaml", check=False), typed=name)


TABLES = {name: _paper(name) for name in ("table1", "table2", "table3", "table4")}


renamed(__name__, Sample="SampleSize", Part="TablePart")
