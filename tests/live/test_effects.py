"""An event's effect is worked out before it is in the journal: the process and its restart never disagree."""

import json
import os

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.live.measurements import MeasurementSet
from maipp.live.robot_state import RobotState
from maipp.live.serve import answer_line
from tests.live.events import arrived, measured, text


def broken(*_, **__):
    raise ZeroDivisionError("injected")


@pytest.mark.parametrize("name", ["note_measurement", "arrive", "leave", "grant"])
def test_an_effect_that_fails_changes_nothing(make, tmp_path, monkeypatch, name):
    event = {
        "note_measurement": measured("e"),
        "arrive": arrived("e"),
        "leave": {"event": "gone", "id": "e", "robot": "robot1", "time": 0.5},
        "grant": {"event": "budget", "id": "e", "robot": "robot1", "time": 0.5, "budget": 1.0},
    }[name]
    with make(tmp_path / "j") as survey:
        survey.handle(arrived("first"))
        before = text(survey.state()), text(survey.belief()), (tmp_path / "j").read_bytes()
        with monkeypatch.context() as patch:
            patch.setattr(RobotState, name, broken)
            answer = answer_line(survey, json.dumps(event).encode(), 1)
        assert answer["problem"] == "internal error, nothing was changed: ZeroDivisionError: injected"
        assert before == (text(survey.state()), text(survey.belief()), (tmp_path / "j").read_bytes())
        survey.handle(event)
        after = text(survey.state()), text(survey.belief())
    with make(tmp_path / "j") as again:
        assert (text(again.state()), text(again.belief())) == after


@pytest.mark.parametrize("kept", [True, False])
def test_after_an_event_that_is_only_in_the_journal_nothing_is_answered(make, tmp_path, monkeypatch, kept):
    with make(tmp_path / "j" if kept else None) as survey:
        survey.handle(arrived("first"))
        with monkeypatch.context() as patch:
            patch.setattr(MeasurementSet, "add", broken)
            problem = answer_line(survey, json.dumps(measured("m")).encode(), 1)["problem"]
        told = "the event is in the journal, start again on it" if kept else "start anew"
        assert problem == f"internal error, {told}: ZeroDivisionError: injected"
        told = f"event 'm' was accepted, .*start this survey {'again on its journal' if kept else 'anew'}$"
        for request in (measured("m"), arrived("a", time=2.0), {"query": "state"}, {"query": "belief"}):
            with pytest.raises(InputError, match=told):
                survey.handle(request)
    if kept:
        with make(tmp_path / "j") as again:
            assert again.state()["measurements"] == 1


def test_an_interrupt_while_the_journal_is_written_is_as_if_nothing_was_sent(make, tmp_path, monkeypatch):
    with make(tmp_path / "j") as survey:
        before = (tmp_path / "j").read_bytes()
        calls, sync = [], os.fsync

        def interrupted(file):
            calls.append(file)
            if len(calls) == 1:
                raise KeyboardInterrupt
            sync(file)

        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", interrupted)
            with pytest.raises(KeyboardInterrupt):
                survey.handle(measured("m"))
        assert (tmp_path / "j").read_bytes() == before and survey.state()["measurements"] == 0
        survey.handle(measured("n"))
        after = text(survey.state())
    with make(tmp_path / "j") as again:
        assert text(again.state()) == after


def test_an_answer_that_is_not_a_number_is_refused_and_changes_nothing(make, monkeypatch, tmp_path):
    from maipp.live import live_survey as module
    from maipp.live import queries

    with make(journal=tmp_path / "journal") as survey:
        real = queries.believe
        monkeypatch.setattr(queries, "believe", lambda *known: tuple(np.full_like(a, np.nan) for a in real(*known)))
        with pytest.raises(InputError, match=r"^mean\[0\]: the answer would be nan"):
            survey.handle({"query": "belief"})
        decide = module.decide_arrival
        monkeypatch.setattr(module, "decide_arrival", lambda *all: decide(*all)._replace(arrival=np.inf))
        before, kept = text(survey.state()), (tmp_path / "journal").read_bytes()
        with pytest.raises(InputError, match="^arrival: the answer would be inf"):
            survey.handle(arrived("a"))
        assert text(survey.state()) == before and (tmp_path / "journal").read_bytes() == kept
