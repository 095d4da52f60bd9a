"""The table of all keys of a training configuration, for docs/training.md.

`python -m tests.tools.config_table PAGE` writes it between the page's two `keys` markers.
"""

import sys
from pathlib import Path

from maipp.files import write_atomic
from maipp.markdown import filled, markdown_table
from maipp.records import fields_of
from maipp.training.config import NAMED, TrainConfig
from maipp.training.config_io import config_to_dict


def with_config_table(page: str) -> str:
    """The page with every key, its value in each named configuration, and what it means, between its two markers.

    A value left empty is the default's. Raises `InputError` for a page without the markers.
    """
    default, *others = (config_to_dict(config) for config in NAMED.values())
    heading, rows = ["Key", *(f"`{name}`" for name in NAMED), "Meaning"], []
    for row in fields_of(TrainConfig):
        value = default[row.name]
        named = [f"`{other[row.name]}`" if other[row.name] != value else "" for other in others]
        rows.append([f"`{row.name}`", f"`{value}`", *named, row.meaning])
    return filled(page, "<!-- keys -->", "<!-- /keys -->", markdown_table(heading, rows, left=len(heading)))


if __name__ == "__main__":
    path = Path(sys.argv[1])
    write_atomic(path, with_config_table(path.read_text(encoding="utf-8")))
