"""What docs/live.md says of the protocol is so: the example session, the tables, the example."""

import dataclasses
import json
import re
from pathlib import Path

import pytest

from maipp.errors import InputError
from maipp.live import LiveSurvey
from maipp.live.events import KINDS
from maipp.live.serve import answer_line
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "live.md").read_text(encoding="utf-8")
MISSION, SESSION = (
    (DOCS / "examples/live" / name).read_text(encoding="utf-8") for name in ("mission.yaml", "session.txt")
)


def blocks(language):
    fenced = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, flags=re.DOTALL | re.MULTILINE)
    return [block for name, block in fenced if name == language]


def same(found, told):
    """Equal but for the rounding of numbers; `packed`, their bits, only in kind."""
    if isinstance(told, dict):
        assert list(found) == list(told)
        for key in told:
            assert key in ("packed", "maipp") or same(found[key], told[key]), key
        return True
    if isinstance(told, list):
        return len(found) == len(told) and all(map(same, found, told))
    return found == (pytest.approx(told, rel=1e-3, abs=1e-3) if isinstance(told, float) else told)


def test_the_session_goes_as_told(tmp_path):
    lines = SESSION.splitlines()
    journal = tmp_path / "lake.journal"
    with LiveSurvey.from_prepared(prepare(parse_survey(MISSION)), journal=journal) as survey:
        assert same(survey.hello() | {"answer": "ready", "cut": 0}, json.loads(lines[0][2:]))
        for number, (sent, answered) in enumerate(zip(lines[1::2], lines[2::2], strict=True), start=1):
            assert sent.startswith("> ") and answered.startswith("< ")
            assert same(answer_line(survey, sent[2:].encode(), number), json.loads(answered[2:]))


def test_a_mission_that_was_edited_is_told_as_shown(tmp_path):
    (shown,) = blocks("text")
    journal, edited = (
        tmp_path / "lake.journal",
        MISSION.replace("budget_m: 600", "budget_m: 500", 1) + "clearance_m: 5\n",
    )
    LiveSurvey.from_prepared(prepare(parse_survey(MISSION)), journal=journal).close()
    with pytest.raises(InputError) as error:
        LiveSurvey.from_prepared(prepare(parse_survey(edited)), journal=journal)
    assert f"error: {error.value}\n".replace(str(journal), journal.name) == shown


def test_every_event_is_in_the_table_with_its_keys():
    rows = dict(re.findall(r"^\| `(\w+)` \| (`id`.*?`(?: \(optional\))?) \|", PAGE, flags=re.MULTILINE))
    for name, kind in KINDS.items():
        told = {key: bool(optional) for key, optional in re.findall(r"`(\w+)`( \(optional\))?", rows[name])}
        fields = dataclasses.fields(kind)
        assert told == {field.name: field.default is not dataclasses.MISSING for field in fields}


def test_the_example_runs(capsys):
    (example,) = blocks("python")
    exec(compile(example.replace("agents=2", "agents=2, grid=8, nodes=16, neighbours=5"), "live.md", "exec"), {})
    assert capsys.readouterr().out == "go [1.0]\n"
