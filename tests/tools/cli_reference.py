"""The page of the command line, docs/cli.md, made from the parsers of the commands.

`python -m tests.tools.cli_reference` writes it; with `--check` it writes nothing, and tells in one line where the page
is not what the commands have.
"""

import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import tyro

from maipp.cli.main import COMMANDS, flags_of
from maipp.files import write_atomic
from maipp.markdown import markdown_table

PAGE = Path(__file__).parents[2] / "docs" / "cli.md"
MAKE = "python -m tests.tools.cli_reference"

INTRODUCTION = f"""# Command line

`maipp COMMAND --help` prints the same. `--set` and `--with` may be given again. Exit codes: 0, 2 for bad input, 130
when interrupted. `MAIPP_CACHE` names the folder of compiled programs; empty, none are kept. `maipp --version` prints
the version. This page is made by `{MAKE}`.
"""


class Option(NamedTuple):
    """One option, or one argument without a flag."""

    names: str  # as typed, with what follows: `--out PATH`
    default: str  # empty: none
    meaning: str  # empty where the command tells none
    required: bool
    positional: bool


class Section(NamedTuple):
    """One command, or one name below a command."""

    name: str  # such as `benchmark table1`
    description: tuple[str, ...]  # its paragraphs
    options: tuple[Option, ...]


def parser_of(name: str) -> Any:
    """The parser of a command: argparse's, or tyro's own copy of it, which is the same in every version of Python."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # tyro has no other way to a parser yet
        return tyro.extras.get_parser(flags_of(name), prog=f"maipp {name}")


def sections() -> tuple[Section, ...]:
    """All commands in the order of `maipp --help`, each followed by the names below it."""
    return tuple(section for name in COMMANDS for section in _sections_of(name, parser_of(name)))


def _sections_of(name: str, parser: Any) -> Iterator[Section]:
    paragraphs = tuple(
        " ".join(part.split()) for part in re.split(r"\n\s*\n", parser.description or "") if part.strip()
    )
    actions = [action for action in parser._actions if "--help" not in action.option_strings]
    below = [action for action in actions if isinstance(action.choices, dict)]
    yield Section(name, paragraphs, tuple(_option(action) for action in actions if action not in below))
    for action in below:
        for word, inner in action.choices.items():
            yield from _sections_of(f"{name} {word}", inner)


def _option(action: Any) -> Option:
    text = " ".join((action.help or "").split())
    required = text.endswith("(required)")
    text = text.removesuffix("(required)").removesuffix("(repeatable)").strip()
    default, found = "", re.fullmatch(r"(.*?)\s*\(default:\s*(.*?)\)", text)
    if found:
        text, default = found[1], "" if found[2] == "None" else found[2]
    name = action.option_strings[0] if action.option_strings else ""
    if action.nargs == 0:
        default = {"True": "on", "False": "off"}.get(default, default)
        name = name.replace("--", "--[no-]") if len(action.option_strings) > 1 else name
    value = action.metavar or ""
    if not name and not required and not value.startswith("["):
        value = f"[{value}]"
    return Option(" ".join(filter(None, [name, value])), default, text, required, not name)


def usage(section: Section) -> str:
    """The line that a command is called by: what is required, and that there is more."""
    words = [option.names for option in section.options if option.positional or option.required]
    words = sorted(words, key=lambda word: word.startswith("-"))
    more = ["[OPTIONS]"] if len(words) < len(section.options) else []
    return " ".join(["maipp", section.name, *words, *more])


def page() -> str:
    """The text of docs/cli.md."""
    parts = [INTRODUCTION]
    # Names below a command that take the same options share a section.
    for _, alike in groupby(sections(), key=lambda told: (told.name.split()[:-1] or told.name, told.options)):
        parts.append(_written(tuple(alike)))
    return "\n".join(parts)


def _written(alike: Sequence[Section]) -> str:
    first = alike[0]
    lines = [f"## maipp {first.name}" + "".join(f", {section.name.split()[-1]}" for section in alike[1:]), ""]
    for section in alike:
        lines += [f"`{usage(section)}`", ""] if section.options else []
        lines += [line for paragraph in section.description for line in (_paragraph(paragraph), "")]
    if first.options:
        rows = [[_code(option.names), _default(option), _plain(option.meaning)] for option in first.options]
        lines += [markdown_table(["Option", "Default", "Meaning"], rows, left=3), ""]
    return "\n".join(lines)


def _paragraph(text: str) -> str:
    """A paragraph of a description; one that begins with a command shows it as such."""
    command, found, rest = text.partition(": ")
    return f"`{command}`: {_plain(rest)}" if found and command.startswith("maipp ") else _plain(text)


def _default(option: Option) -> str:
    return "required" if option.required else _code(option.default) if _is_typed(option) else _plain(option.default)


def _is_typed(option: Option) -> bool:
    """Whether the default is something that one types, and no description of it."""
    return bool(option.default) and " " not in option.default and option.default not in ("on", "off")


def _code(text: str) -> str:
    return f"`{text}`".replace("|", "\\|")


def _plain(text: str) -> str:
    """Text as it may stand in a table: pages are named by a link, nothing is taken for markup."""
    outside = re.split(r"(`[^`]*`)", text)
    parts = [part if part.startswith("`") else part.replace("<", "&lt;").replace("*", "\\*") for part in outside]
    return re.sub(r"\bdocs/([\w-]+)\.md", r"[\1](\1.md)", "".join(parts)).replace("|", "\\|")


def main(arguments: Sequence[str]) -> int:
    """Write the page, or with `--check` compare it."""
    made = page()
    if "--check" not in arguments:
        write_atomic(PAGE, made)
        return 0
    if not PAGE.is_file() or PAGE.read_text(encoding="utf-8") != made:
        print(f"docs/cli.md is not what the commands have; run: {MAKE}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
