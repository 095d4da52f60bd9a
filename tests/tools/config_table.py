"""The tables of all keys of training configurations, for docs/training-keys.md.

`python -m tests.tools.config_table PAGE` writes them between the page's markers.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from maipp.files import write_atomic
from maipp.markdown import filled, markdown_table
from maipp.records import fields_of
from maipp.training.config import NAMED
from maipp.training.config_io import config_to_dict
from maipp.training.foresight.config import NAMED as FORESIGHTS


def with_config_tables(page: str) -> str:
    """The page with both tables: of the policy, and of the foresight. Raises `InputError` without their markers."""
    return with_config_table(with_config_table(page), FORESIGHTS, "foresight keys")


def with_config_table(page: str, named: Mapping[str, Any] = NAMED, marker: str = "keys") -> str:
    """The page with every key, its value in each named configuration, and what it means, between its two markers.

    A value left empty is the default's. Raises `InputError` for a page without the markers.
    """
    default, *others = (config_to_dict(config) for config in named.values())
    heading, rows = ["Key", *(f"`{name}`" for name in named), "Meaning"], []
    for row in fields_of(type(named["default"])):
        value = default[row.name]
        apart = [f"`{other[row.name]}`" if other[row.name] != value else "" for other in others]
        rows.append([f"`{row.name}`", f"`{value}`", *apart, row.meaning])
    return filled(page, f"<!-- {marker} -->", f"<!-- /{marker} -->", markdown_table(heading, rows, left=len(heading)))


if __name__ == "__main__":
    path = Path(sys.argv[1])
    write_atomic(path, with_config_tables(path.read_text(encoding="utf-8")))
