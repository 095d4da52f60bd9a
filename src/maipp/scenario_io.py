"""Scenarios as YAML files, read with line numbers in every error, written with a comment above every key."""

import os
import textwrap
from pathlib import Path

from maipp.files import read_text, write_atomic
from maipp.markdown import filled, markdown_table
from maipp.records import dump_yaml, fields_of, read_yaml
from maipp.scenario import Scenario


def load_scenario(path: str | os.PathLike[str]) -> Scenario:
    """The scenario in a YAML file; keys left out keep their defaults.

    A relative `field` is taken from the file's folder.
    Raises `InputError` with the file, the line and the key of what is wrong.
    """
    return parse_scenario(read_text(path, "scenario", "a YAML file"), source=str(path), folder=os.path.dirname(path))


def parse_scenario(text: str, *, source: str = "scenario", folder: str | None = None) -> Scenario:
    """The scenario in YAML text; errors name `source`, a relative `field` is taken from `folder` if given."""
    root = read_yaml(text, source, empty="`maipp scenario` prints a full one to start from")
    scenario = root.make(Scenario.create, root.mapping())
    if scenario.field is None or folder is None or os.path.isabs(scenario.field):
        return scenario
    return scenario.replace(field=os.path.normpath(os.path.join(folder, scenario.field)))


def dump_scenario(scenario: Scenario, *, comments: bool = True) -> str:
    """The full scenario as YAML, every key below a comment with its meaning, unit and allowed values."""
    blocks = []
    for row in fields_of(Scenario):
        about = f"{row.meaning[:1].upper()}{row.meaning[1:]} [{row.about['unit']}]. Give {row.allowed}."
        comment = textwrap.fill(about, 100, initial_indent="# ", subsequent_indent="# ") + "\n"
        pair = dump_yaml({row.name: scenario.to_dict()[row.name]})
        blocks.append(f"{comment}{pair}" if comments else pair)
    return ("\n" if comments else "").join(blocks)


def save_scenario(scenario: Scenario, path: str | os.PathLike[str]) -> None:
    """Write the commented YAML so that the file is either the whole new one or untouched.

    A relative `field` is written relative to the file's folder, where `load_scenario` starts from.
    Raises `InputError` where the file cannot be written.
    """
    target = Path(path)
    if scenario.field is not None and not os.path.isabs(scenario.field):
        scenario = scenario.replace(field=os.path.relpath(scenario.field, target.parent))
    write_atomic(target, dump_scenario(scenario))


def with_field_table(page: str) -> str:
    """The Markdown page with what is between its two `fields` markers replaced by the table of all fields."""
    heading, rows = ("Field", "Default", "Unit", "Meaning", "Allowed"), []
    for row in fields_of(Scenario):
        default = dump_yaml({row.name: Scenario().to_dict()[row.name]}).partition(": ")[2].strip()
        rows.append((f"`{row.name}`", f"`{default}`", row.about["unit"], row.meaning, row.allowed))
    return filled(page, "<!-- fields -->", "<!-- /fields -->", markdown_table(heading, rows, left=len(heading)))
