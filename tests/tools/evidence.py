"""The pages of measurements, written from the data beside them.

`python -m tests.tools.evidence` fills, between their markers, docs/evidence/NAME.md from NAME.csv and decisions.csv,
docs/evidence/choices.md from decisions.csv, and the tables of docs/results.md and docs/paper-and-we.md from the worlds
of the benchmark's tables. `tests/test_evidence.py` demands that pages and data agree.
"""

import csv
import gzip
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from statistics import fmean, stdev
from typing import TypeVar

import yaml

from maipp.errors import InputError
from maipp.files import read_text, write_atomic
from maipp.markdown import filled, markdown_table

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
EVIDENCE = DOCS / "evidence"
PAPER = ROOT / "src" / "maipp" / "bench" / "paper"
NOT_OF_A_PAGE = {"decisions.csv"}  # tables that no page of its own shows
_RUN = ("n", "seed", "machine", "commit", "date")  # what is said of how a number was made


@dataclass(frozen=True)
class Measured:
    """One number: what was measured, where, and what made it. Empty where that is not known."""

    section: str
    what: str
    measure: str
    at: str  # the column of its table
    value: str  # as it is quoted
    se: str  # standard error, in the same unit
    n: str  # worlds x trials, unless said
    seed: str
    machine: str
    commit: str
    date: str
    command: str  # one a line


@dataclass(frozen=True)
class Decision:
    """What was tried, what it did, what was chosen, and the seeds of the worlds that the choice has seen."""

    page: str
    section: str
    tried: str
    effect: str
    decision: str
    seeds: str


Record = TypeVar("Record", Measured, Decision)


def _rows(kind: type[Record], path: Path) -> list[Record]:
    """The rows of a CSV file. Raises `InputError` for other columns than the record's, and for a short or long row."""
    reader = csv.reader(io.StringIO(read_text(path, "measurements", "a CSV file")))
    names = [field.name for field in fields(kind)]
    if next(reader, None) != names:
        raise InputError(f"{path}: its columns are not {','.join(names)}")
    rows = []
    for row in reader:
        if len(row) != len(names):
            raise InputError(f"{path}:{reader.line_num}: {len(row)} cells; give {len(names)}")
        rows.append(kind(*row))
    return rows


def measurements(name: str, folder: Path = EVIDENCE) -> list[Measured]:
    """The numbers of a page. Raises `InputError` for one that is not finite, and for an error below 0."""
    path = folder / f"{name}.csv"
    rows = _rows(Measured, path)
    for line, row in enumerate(rows, 2):
        try:
            value, error = float(row.value), float(row.se or 0)
        except ValueError:
            raise InputError(f"{path}: row {line}: value {row.value!r} and se {row.se!r}; give numbers") from None
        if not (math.isfinite(value) and math.isfinite(error) and error >= 0 and row.section and row.what and row.at):
            raise InputError(f"{path}: row {line}: a finite value, an se >= 0, a section, what and at have to be there")
    return rows


def decisions(folder: Path = EVIDENCE) -> list[Decision]:
    """All choices, in the order of the pages."""
    return _rows(Decision, folder / "decisions.csv")


def names(folder: Path = EVIDENCE) -> list[str]:
    """The pages that have numbers of their own."""
    return sorted(path.stem for path in folder.glob("*.csv") if path.name not in NOT_OF_A_PAGE)


def page_body(name: str, folder: Path = EVIDENCE) -> str:
    """What stands between the markers of docs/evidence/NAME.md."""
    rows, chosen = measurements(name, folder), [row for row in decisions(folder) if row.page == name]
    sections = dict.fromkeys([row.section for row in rows] + [row.section for row in chosen])
    return "\n\n".join(
        _section(
            section, [row for row in rows if row.section == section], [row for row in chosen if row.section == section]
        )
        for section in sections
    )


def _section(title: str, rows: Sequence[Measured], chosen: Sequence[Decision]) -> str:
    """A heading, what was tried, one table for each measure, and the commands."""
    parts = [f"## {title}"]
    parts += [f"*Tried*: {d.tried}. *Effect*: {d.effect}. *Decision*: {d.decision}." for d in chosen]
    for measure in dict.fromkeys(row.measure for row in rows):
        of_measure = [row for row in rows if row.measure == measure]
        parts += [f"**{measure}**", _table(of_measure)]
        if told := _told(of_measure):
            parts.append(told)
    commands = dict.fromkeys(line for row in rows for line in row.command.splitlines())
    if commands:
        parts.append("\n".join(["```sh", *commands, "```"]))
    return "\n\n".join(parts)


def _shared(rows: Sequence[Measured], name: str) -> str | None:
    """What all rows have in a field; None where they differ."""
    values = {getattr(row, name) for row in rows}
    return values.pop() if len(values) == 1 else None


def _table(rows: Sequence[Measured]) -> str:
    """One line for each thing measured, one column for each place; further ones for what the rows do not share."""
    apart = [name for name in _RUN if _shared(rows, name) is None]
    places = list(dict.fromkeys(row.at for row in rows))
    if all(place.startswith("B = ") for place in places):
        places.sort(key=lambda place: float(place.removeprefix("B = ")))
    lines: dict[tuple[str, ...], dict[str, str]] = {}
    for row in rows:
        key = (row.what, *(getattr(row, name) for name in apart))
        if row.at in lines.setdefault(key, {}):
            raise InputError(f"{row.section}: {row.what} at {row.at} stands there twice")
        lines[key][row.at] = _number(row)
    cells = [[key[0], *(line.get(at, "") for at in places), *key[1:]] for key, line in lines.items()]
    return markdown_table(["", *places, *apart], cells)


def _number(row: Measured) -> str:
    """A value and in brackets its standard error; differences have a sign."""
    sign = "+" if row.measure.startswith(("difference", "change")) and float(row.value) > 0 else ""
    whole = f"{int(row.value):,}" if row.value.isdigit() and len(row.value) > 4 else row.value
    return f"{sign}{whole}" + (f" ({row.se})" if row.se else "")


def _told(rows: Sequence[Measured]) -> str:
    """How the numbers were made, as far as all of them share it."""
    shared = {name: value for name in _RUN if (value := _shared(rows, name))}
    words = {"n": "{}", "seed": "seed {}", "machine": "{}", "commit": "commit {}", "date": "{}"}
    line = ", ".join(words[name].format(value) for name, value in shared.items())
    return f"*{line}.*" if line else ""


def choices_body(folder: Path = EVIDENCE) -> str:
    """Every choice with the seeds that it has seen, a line each."""
    rows = [
        [f"[{row.section}]({row.page}.md#{anchor(row.section)})", row.decision, row.seeds] for row in decisions(folder)
    ]
    return markdown_table(["What was tried", "Choice", "Seeds seen"], rows, left=3)


def anchor(title: str) -> str:
    """The anchor of a heading, as mkdocs and forges make it."""
    kept = "".join(letter for letter in title.lower() if letter.isalnum() or letter in " -_")
    return "-".join(kept.split())


# The tables of the benchmark.


@dataclass(frozen=True)
class Mean:
    """The mean over worlds and trials, and its standard error over worlds."""

    mean: float
    se: float

    def __str__(self) -> str:
        digits = max(0, 1 - math.floor(math.log10(self.se))) if self.se > 0 else 2
        return f"{self.mean:.{digits}f} ± {self.se:.{digits}f}"


def table_means(table: str, metric: str = "trace") -> dict[tuple[str, str, str], Mean]:
    """The means of a table, by row, range (empty: global) and budget."""
    with gzip.open(EVIDENCE / "tables" / f"{table}.csv.gz", "rt", encoding="utf-8") as file:
        trials: dict[tuple[str, str, str], dict[str, list[float]]] = {}
        for row in csv.DictReader(file):
            worlds = trials.setdefault((row["row"], row["range"], row["budget"]), {})
            worlds.setdefault(row["instance"], []).append(float(row[metric]))
    return {
        key: Mean(fmean(means), stdev(means) / math.sqrt(len(means)))
        for key, worlds in trials.items()
        if (means := [fmean(values) for values in worlds.values()])
    }


# Rows of the overview, and what the paper prints them as.
HEADLINE = {
    "random": "",
    "lawnmower": "",
    "shared-greedy": "",
    "sga-rrt-0.3": "SGA+RRT(0.3, 0.4)",
    "sga-catnipp": "SGA+CAtNIPP",
    "di-3": "DI(8, 3)",
    "ti-5-star": "TI(8, 5)*",
    "untrained": "",
    "intent-paths": "",
    "receding-horizon": "",
    "intent-search": "",
}


def headline_body() -> str:
    """Tr(P) at a budget of 3 in three of the tables, the paper's number beside ours."""
    ours = (table_means("table1"), table_means("table2"), table_means("table4", "own_trace"))
    ranges = ("", "", "0.3")
    paper = (_printed("table1")[""], _printed("table2")[""], _printed("table4")["0.3"])
    rows = []
    for name, printed in HEADLINE.items():
        cells = [f"`{name}`"]
        for means, limit, block in zip(ours, ranges, paper, strict=True):
            cells += [f"{block[printed]['3'][0]:.2f}" if printed in block else "", str(means[name, limit, "3"])]
        rows.append(cells)
    tables = ("3 agents", "10 agents", "range 0.3")
    return markdown_table(["", *(head for table in tables for head in (f"{table}, paper", "ours"))], rows)


def _printed(table: str) -> dict[str, dict[str, dict[str, tuple[float, float]]]]:
    """What the paper prints, by range (empty: global), row and budget: mean and standard deviation over trials."""
    spec = yaml.safe_load((PAPER / f"{table}.yaml").read_text(encoding="utf-8"))
    budgets = [str(budget) for budget in spec["columns"]["budget"]]
    parts = spec.get("parts") or [{"printed": spec["printed"]}]
    return {
        str((part.get("scenario") or {}).get("comm_range") or ""): {
            row: {budget: (pair[0], pair[1]) for budget, pair in zip(budgets, pairs, strict=True)}
            for row, pairs in part["printed"].items()
        }
        for part in parts
    }


CALIBRATED = {
    "sga-rrt-0.3": "SGA+RRT(0.3, 0.4)",
    "sga-rrt-0.6": "SGA+RRT(0.6, 0.7)",
    "sga-rrt-0.9": "SGA+RRT(0.9, 1.0)",
}


def calibration_body() -> str:
    """The twelve cells that the protocol was fitted to: the paper, the independent implementation, maipp."""
    means, printed = table_means("table1"), _printed("table1")[""]
    reference = {
        (row.what, row.at): row.value for row in measurements("calibration") if row.section == "Reference rows"
    }
    rows = []
    for name, row in CALIBRATED.items():
        for budget, (mean, std) in printed[row].items():
            ours = means[name, "", budget]
            off = (ours.mean - mean) / std
            rows.append(
                [row, budget, f"{mean:.2f} ({std:.2f})", reference[row, f"B = {budget}"], str(ours), f"{off:+.1f}"]
            )
    return markdown_table(["", "B", "paper (std)", "reference", "maipp", "in stds"], rows)


def pages() -> dict[Path, str]:
    """Every page that has a generated part, as it should be. Raises `InputError` for one without the markers."""
    bodies: Iterable[tuple[Path, str, str]] = [
        *((EVIDENCE / f"{name}.md", "evidence", page_body(name)) for name in names()),
        (EVIDENCE / "choices.md", "evidence", choices_body()),
        (DOCS / "results.md", "headline", headline_body()),
        (DOCS / "paper-and-we.md", "calibration", calibration_body()),
    ]
    return {
        path: filled(
            path.read_text(encoding="utf-8"), f"<!-- {marker} -->", f"<!-- /{marker} -->", body, path.relative_to(ROOT)
        )
        for path, marker, body in bodies
    }


if __name__ == "__main__":
    for written, text in pages().items():
        write_atomic(written, text)
        print(f"wrote {written.relative_to(ROOT)}")
