"""Scenarios as YAML files, read with line numbers in every error, written with a comment above every key."""

import os
import textwrap
from pathlib import Path
from typing import Any

from maipp.errors import InputError
from maipp.files import read_text, write_atomic
from maipp.scenario import Scenario, ScenarioError, describe_fields
from maipp.yaml_text import dump_yaml, read_pairs


def load_scenario(path: str | os.PathLike[str]) -> Scenario:
    """The scenario in a YAML file; keys left out keep their defaults.

    A relative `field` is taken from the file's folder.
    Raises `InputError` with the file, the line and the key of what is wrong.
    """
    return parse_scenario(read_text(path, "scenario", "a YAML file"), source=str(path), folder=os.path.dirname(path))


def parse_scenario(text: str, *, source: str = "scenario", folder: str | None = None) -> Scenario:
    """The scenario in YAML text; errors name `source`, a relative `field` is taken from `folder` if given."""
    values: dict[str, Any] = {}
    lines: dict[str, int] = {}
    for key, value, line in read_pairs(text, source, empty="`maipp scenario` prints a full one to start from"):
        if key in lines:
            raise ScenarioError(key, f"given twice, first on line {lines[key]}; keep one", f"{source}:{line}")
        values[key], lines[key] = value, line
    try:
        scenario = Scenario.from_dict(values)
    except ScenarioError as error:
        line = lines.get(error.key) or lines.get(error.key.partition("[")[0])
        raise ScenarioError(error.key, error.problem, f"{source}:{line}" if line else source) from None
    if scenario.field is None or folder is None or os.path.isabs(scenario.field):
        return scenario
    return scenario.replace(field=os.path.normpath(os.path.join(folder, scenario.field)))


def dump_scenario(scenario: Scenario, *, comments: bool = True) -> str:
    """The full scenario as YAML, every key below a comment with its meaning, unit and allowed values."""
    blocks = []
    for row in describe_fields():
        about = f"{row.meaning[:1].upper()}{row.meaning[1:]} [{row.unit}]. Give {row.allowed}."
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
    rows = [("Field", "Default", "Unit", "Meaning", "Allowed", "Source"), ("---",) * 6]
    for row in describe_fields():
        default = dump_yaml({row.name: Scenario().to_dict()[row.name]}).partition(": ")[2].strip()
        rows.append((f"`{row.name}`", f"`{default}`", row.unit, row.meaning, row.allowed, row.source))
    table = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)
    before, begin, rest = page.partition("<!-- fields -->\n")
    _, end, after = rest.partition("<!-- /fields -->")
    if not end:
        raise InputError("the page has no place for the table; give <!-- fields --> and <!-- /fields --> lines")
    return f"{before}{begin}\n{table}\n\n{end}{after}"
