"""The files that a table leaves in its folder: CSV, figure, Markdown."""

from pathlib import Path

from maipp.benchmarks.table_csv import compressed, table_csv
from maipp.benchmarks.table_figure import save_table_figure
from maipp.benchmarks.table_page import brief_page, table_page
from maipp.benchmarks.table_run import Sample, read
from maipp.benchmarks.tables import TableSpec
from maipp.errors import InputError
from maipp.files import write_atomic

BRIEF = "brief"  # folder of the short forms, for pages that have more to say than results


def write_table(table: TableSpec, folder: Path, sample: Sample, reference: str) -> list[Path]:
    """Write NAME.csv.gz, NAME.png, NAME.md and brief/NAME.md of all rows that the folder has every cell of.

    Gives their paths.
    Raises `InputError` where there is no such row, or a file cannot be written.
    """
    lines = read(table, folder, sample)
    if not lines:
        raise InputError(f"{folder}: no row of {table.name} has all its cells yet; run `maipp benchmark {table.name}`")
    csv, figure, page = (folder / f"{table.name}{suffix}" for suffix in (".csv.gz", ".png", ".md"))
    write_atomic(csv, compressed(table_csv(table, lines)))
    save_table_figure(table, lines, figure)
    text = table_page(table, lines, sample, out=folder.name, reference=reference, files=(figure.name, csv.name))
    write_atomic(page, text)
    brief = folder / BRIEF / f"{table.name}.md"
    brief.parent.mkdir(exist_ok=True)
    write_atomic(brief, brief_page(table, lines, sample, out=folder.name))
    return [csv, figure, page, brief]
