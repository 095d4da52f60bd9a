"""Fuzzed journals of live surveys: their lines are mutated and get the sums that fit them, as no damage would."""

import hashlib
import json
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from fuzz_check import Target

from maipp.live import LiveSurvey
from maipp.live.journal import read_journal
from maipp.live.recorded_survey import read_record
from maipp.scenario import Scenario


@cache
def _seeds() -> list[bytes]:
    """The lines of a small survey, without their sums; what a decision would leave is made by hand."""
    scenario = Scenario(agents=1, budget=1.0, start=(0.5, 0.5), grid=4, nodes=6, neighbours=3)
    measured = {"event": "measurement", "robot": "robot1", "position": [0.4, 0.6], "value": 1.0}
    events: list[dict[str, Any]] = [
        {**measured, "id": "a", "time": 0.1},
        {**measured, "id": "b", "time": 0.2, "value": 900.0, "travelled": 0.3},
        {"event": "withdraw", "id": "w", "robot": "robot1", "measurement": "a", "time": 1},
        {"event": "budget", "id": "x", "robot": "robot1", "budget": 2.0, "time": 1},
        {"event": "gone", "id": "g", "robot": "robot1", "time": 2},
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "journal"
        with LiveSurvey.from_scenario(scenario, "random", journal=path) as survey:
            for event in events:
                survey.handle(event)
        lines = read_journal(path).records
    arrived = {"event": "arrived", "id": "c", "robot": "robot1", "position": [0.5, 0.5], "time": 0.0}
    state = {"odometer": 0.0, "planned": 0.1, "leg": [[0.5, 0.5], [0.9, 0.5]], "message": "", "memory": ""}
    go = {"answer": "go", "id": "c", "robot": "robot1"}
    lines.insert(1, {"seq": 1, "event": arrived, "answer": go, "state": state})
    return ["".join(json.dumps(line) + "\n" for line in lines).encode()]


def _summed(data: bytes) -> bytes:
    """The lines with the sums that belong to them."""
    lines, chain = [], b""
    for line in data.split(b"\n")[:-1]:
        chain = hashlib.sha256(chain + line[1:]).hexdigest()[:16].encode()
        lines.append(b'{"sum":"' + chain + b'",' + line[1:] + b"\n")
    return b"".join(lines)


def _record(path: Path) -> Any:
    record = read_record(path)
    return record.fixes, record.measurements.everything, [robot.budget for robot in record.robots]


_TOKENS = (
    b'"late": null',
    b'"state": {}',
    b'"leg": []',
    b"[[0, 0]]",
    b"null",
    b"1e400",
    b"-1",
    b'"heard"',
    b'"arrived"',
)
JOURNAL_TARGETS = {"journal": Target(".journal", _record, _seeds, _TOKENS, pack=_summed, slice=150)}
