"""The page of the command line is what the commands have, and no option goes unexplained."""

import subprocess
import sys

import pytest

from maipp.cli.main import COMMANDS
from tests.tools import cli_reference
from tests.tools.cli_reference import PAGE, Option, Section, page, sections, usage

SECTIONS = sections()


def test_every_command_has_its_section():
    assert set(COMMANDS) <= {section.name for section in SECTIONS}
    assert "benchmark table1" in {section.name for section in SECTIONS}  # names below a command are found


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.name)
def test_every_command_and_option_says_what_it_does(section):
    assert section.description
    assert [option.names for option in section.options if not option.meaning] == []


def test_the_page_is_what_the_commands_have():
    assert PAGE.read_text(encoding="utf-8") == page(), f"run: {cli_reference.MAKE}"


def test_the_page_does_not_depend_on_the_terminal():
    code = "from tests.tools.cli_reference import page; import sys; sys.stdout.buffer.write(page().encode())"
    narrow = subprocess.run(
        [sys.executable, "-c", code], env={"COLUMNS": "40", "PYTHONPATH": "src:."}, capture_output=True, check=True
    )
    assert narrow.stdout.decode() == page()


def test_a_stale_page_is_told_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cli_reference, "PAGE", tmp_path / "cli.md")
    assert cli_reference.main(["--check"]) == 1  # missing
    assert cli_reference.main([]) == 0 and cli_reference.main(["--check"]) == 0
    (tmp_path / "cli.md").write_text(page() + "more\n", encoding="utf-8")
    assert cli_reference.main(["--check"]) == 1
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2 and told[0] == told[1] and cli_reference.MAKE in told[0]


def test_usage_has_what_is_required_first():
    options = (
        Option("--out DIR", "", "", required=True, positional=False),
        Option("--seed INT", "0", "", required=False, positional=False),
        Option("MISSION", "", "", required=True, positional=True),
    )
    assert usage(Section("try", (), options)) == "maipp try MISSION --out DIR [OPTIONS]"
