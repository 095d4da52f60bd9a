"""Scenarios as YAML files, read with line numbers in every error, written with a comment above every key."""

import os
import re
import secrets
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from maipp.errors import InputError
from maipp.scenario import Scenario, ScenarioError, describe_fields

# Plain scalars as YAML 1.2 reads them, for loader and dumper alike: PyYAML's own YAML 1.1 rules take 1e-6 for
# a string, 010 for 8, 1:30 for 90 and `no` for false.
_NUMBER_STARTS = list("-+.0123456789")
_SCALARS = (
    ("tag:yaml.org,2002:null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("tag:yaml.org,2002:bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("tag:yaml.org,2002:int", r"[-+]?[0-9]+", _NUMBER_STARTS),
    (
        "tag:yaml.org,2002:float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        _NUMBER_STARTS,
    ),
)


class _Loader(yaml.SafeLoader):
    yaml_implicit_resolvers: dict[str, Any] = {}
    # No dates, sets or binary data: no field holds any. The entry None rejects every other tag.
    yaml_constructors: dict[str | None, Any] = {
        tag: yaml.SafeLoader.yaml_constructors[tag]
        for tag in (
            None,
            *(f"tag:yaml.org,2002:{kind}" for kind in "null bool int float str seq map".split()),
        )
    }


class _Dumper(yaml.SafeDumper):
    yaml_implicit_resolvers: dict[str, Any] = {}

    def ignore_aliases(self, data: Any) -> bool:
        return True  # two equal vertices are two vertices, not an anchor and an alias


def _block(dumper: yaml.SafeDumper, mapping: dict[str, Any]) -> yaml.MappingNode:
    return dumper.represent_mapping("tag:yaml.org,2002:map", mapping, flow_style=False)


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    # Unicode's own line breaks: in single quotes PyYAML writes them as they are, and reads a space.
    breaks = any(c in "\x85\u2028\u2029" for c in text)
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"' if breaks else None)


def _decimal(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
    return int(str(loader.construct_scalar(node)))  # PyYAML's own reads a leading zero as octal


_Dumper.add_representer(dict, _block)
_Dumper.add_representer(str, _text)
_Loader.add_constructor("tag:yaml.org,2002:int", _decimal)
for _tag, _pattern, _first in _SCALARS:
    for _class in (_Loader, _Dumper):
        _class.add_implicit_resolver(_tag, re.compile(rf"^(?:{_pattern})$"), _first)


def load_scenario(path: str | os.PathLike[str]) -> Scenario:
    """The scenario in a YAML file; keys left out keep their defaults.

    A relative `field` is taken from the file's folder.
    Raises `InputError` with the file, the line and the key of what is wrong.
    """
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot read the scenario: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start}); give a YAML file") from None
    return parse_scenario(text, source=str(path), folder=os.path.dirname(path))


def parse_scenario(text: str, *, source: str = "scenario", folder: str | None = None) -> Scenario:
    """The scenario in YAML text; errors name `source`, a relative `field` is taken from `folder` if given."""
    values: dict[str, Any] = {}
    lines: dict[str, int] = {}
    for key, value, line in _pairs(text, source):
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


def _pairs(text: str, source: str) -> Iterator[tuple[str, Any, int]]:
    """Key, value and line number of every pair of the mapping that the text holds, duplicates included."""
    try:
        loader = _Loader(text)
        root = loader.get_single_node()
        if root is None or (isinstance(root, yaml.ScalarNode) and not root.value):
            raise InputError(f"{source}: empty file; `maipp scenario` prints a full one to start from")
        if not isinstance(root, yaml.MappingNode):
            raise InputError(f"{source}:{root.start_mark.line + 1}: not a mapping; give lines of `field: value`")
        for key, content in root.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                raise InputError(f"{source}:{line}: the key is not a plain word; give lines of `field: value`")
            try:
                value = loader.construct_object(content, deep=True)
            except (ValueError, KeyError, IndexError):  # `!!int three`, `!!float ""`, or a number of 5000 digits
                problem = "cannot be read; give a plain number, word or list"
                raise ScenarioError(key.value, problem, f"{source}:{line}") from None
            yield key.value, value, line
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"{source}:{mark.line + 1}" if mark else source
        raise InputError(f"{where}: not valid YAML: {error.problem or error.context}") from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise InputError(f"{source}:{line}: not valid YAML: {error.reason}") from None
    except RecursionError:
        raise InputError(f"{source}: nested too deeply; a scenario needs three levels at most") from None


def dump_scenario(scenario: Scenario, *, comments: bool = True) -> str:
    """The full scenario as YAML, every key below a comment with its meaning, unit and allowed values."""
    blocks = []
    for row in describe_fields():
        about = f"{row.meaning[:1].upper()}{row.meaning[1:]} [{row.unit}]. Give {row.allowed}."
        comment = textwrap.fill(about, 100, initial_indent="# ", subsequent_indent="# ") + "\n"
        pair = _yaml({row.name: scenario.to_dict()[row.name]})
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
    temporary = target.parent / f".{secrets.token_hex(8)}.tmp"
    try:
        try:
            with open(temporary, "x", encoding="utf-8", newline="\n") as file:
                file.write(dump_scenario(scenario))
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot write the scenario: {error.strerror}") from None


def with_field_table(page: str) -> str:
    """The Markdown page with what is between its two `fields` markers replaced by the table of all fields."""
    rows = [("Field", "Default", "Unit", "Meaning", "Allowed", "Source"), ("---",) * 6]
    for row in describe_fields():
        default = _yaml({row.name: Scenario().to_dict()[row.name]}).partition(": ")[2].strip()
        rows.append((f"`{row.name}`", f"`{default}`", row.unit, row.meaning, row.allowed, row.source))
    table = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)
    before, begin, rest = page.partition("<!-- fields -->\n")
    _, end, after = rest.partition("<!-- /fields -->")
    if not end:
        raise InputError("the page has no place for the table; give <!-- fields --> and <!-- /fields --> lines")
    return f"{before}{begin}\n{table}\n\n{end}{after}"


def _yaml(value: Any) -> str:
    return yaml.dump(value, Dumper=_Dumper, default_flow_style=None, allow_unicode=True, sort_keys=False, width=10**9)
