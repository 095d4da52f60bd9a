"""`python -m tests.tools.scenario_table` writes the table of all fields of a scenario into docs/scenario.md."""

from pathlib import Path

from maipp.files import write_atomic
from maipp.scenario_io import with_field_table

PAGE = Path(__file__).parents[2] / "docs" / "scenario.md"

if __name__ == "__main__":
    write_atomic(PAGE, with_field_table(PAGE.read_text(encoding="utf-8")))
