"""Fuzzed lines of a bridge, by which it reports of a robot of a fleet."""

import json
from pathlib import Path
from typing import Any

from fuzz_check import Target

from maipp.fleet.line_reports import read_report
from maipp.live.request import parse_line
from maipp.live.units import Units

_UNITS = Units((1.0, 1.0))


def _report(path: Path) -> Any:
    return vars(read_report(parse_line(path.read_bytes()), "boat1", _UNITS, 7.0, gated=False))


def _seeds() -> list[bytes]:
    place = {"position": [0.25, 0.5], "time": 3.5, "travelled": 0.75, "robot": "boat1", "id": "m1"}
    ring = [[0, 0], [0.2, 0], [0.2, 0.2]]
    lines = [
        {"event": "measurement", "value": -1.5} | place,
        {"event": "arrived"} | place,
        {"event": "position"} | place,
        {"event": "zone", "name": "divers", "polygon": ring},
        {"event": "threshold", "threshold": 1.5},
        {"event": "budget", "budget": 2.0},
        {"event": "withdraw", "measurement": "m1"},
    ]
    return [json.dumps(line).encode() for line in lines]


_TOKENS = (b"null", b"1e400", b"NaN", b"[[]]", b"true", b'"polygon": null', b'"robot": "boat2"', b'"event": "joined"')

LINE_TARGETS = {"bridge-line": Target(".json", _report, _seeds, _TOKENS, slice=1000, named=False)}
