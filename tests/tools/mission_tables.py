"""`python -m tests.tools.mission_tables` writes the tables of all keys of a mission file into docs/mission.md."""

from collections.abc import Iterable
from pathlib import Path

from maipp.files import write_atomic
from maipp.markdown import filled, markdown_table
from maipp.records import fields_of
from maipp.surveys.mission_file import KernelSpec, MissionFile, RobotKeys, SampleFile
from maipp.surveys.survey_io import KEYS, SAMPLE_KEYS

PAGE = Path(__file__).parents[2] / "docs" / "mission.md"


def with_tables(page: str) -> str:
    """The page with the keys of a mission, and of its old samples, between their markers."""
    keys = markdown_table(["Key", "Left out", "Meaning"], _keys(), left=3)
    samples = [[f"`{each.name}`", each.meaning] for each in fields_of(SampleFile) if each.name in SAMPLE_KEYS]
    page = filled(page, "<!-- keys -->", "<!-- /keys -->", keys)
    return filled(page, "<!-- samples -->", "<!-- /samples -->", markdown_table(["Key", "Meaning"], samples, left=2))


def _keys() -> Iterable[list[str]]:
    for each in fields_of(MissionFile):
        if each.name == "kernel":
            yield from _rows(KernelSpec, "kernel.")
        elif each.name in KEYS:
            yield [f"`{each.name}`", each.about["otherwise"], each.meaning]
        if each.name == "robots":
            yield from _rows(RobotKeys, "robots[].")


def _rows(kind: type, before: str) -> Iterable[list[str]]:
    for each in fields_of(kind):
        yield [f"`{before}{each.name}`", each.about["otherwise"], each.meaning]


if __name__ == "__main__":
    write_atomic(PAGE, with_tables(PAGE.read_text(encoding="utf-8")))
