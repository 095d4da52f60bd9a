import io
import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from maipp.live.serve import answer_line, encode, lines, serve

WRONG = [
    b"",
    b"hello",
    b"null",
    b"[]",
    b'"event"',
    b"{}",
    b'{"event": "arrived"}',
    b'{"event": null, "query": null}',
    b'{"query": "belief", "points": []}',
    b'{"query": "belief", "points": [[0, 0, 0]]}',
    b'{"query": "state", "id": ["x"]}',
    b'{"event": "measurement", "id": "m", "robot": "robot9", "position": [0, 0], "value": 1, "time": 0}',
    b'{"event": "measurement", "id": "m", "robot": "robot1", "position": [0, 0], "value": NaN, "time": 0}',
    b'{"event": "measurement", "id": "m", "robot": "robot1", "position": [0, 0], "value": 1e999, "time": 0}',
    b'{"event": "measurement", "id": "m", "robot": "robot1", "position": [1e300, 0], "value": 1, "time": 0}',
    b'{"event": "measurement", "id": "m", "robot": "robot1", "position": [0, 0], "value": 1, "time": 1e300}',
    b'{"event": "arrived", "id": "\\ud800", "robot": "robot1", "position": [0, -9], "time": 0}',
    b'{"event": "arrived", "id": "a", "robot": "robot1", "position": [0, 0], "time": 0, "' + b"k" * 100_000 + b'": 0}',
    b'\xef\xbb\xbf{"query": "hello"}',
    b'{"query": "hell\xff"}',
    b"\x00\x01\x02",
    b"[" * 500_000,
    b"x" * 3_000_000,
]


@pytest.mark.parametrize("line", WRONG, ids=lambda line: repr(line[:40]))
def test_a_wrong_line_gets_one_error_and_changes_nothing(make, tmp_path, line):
    with make(tmp_path / "j") as survey:
        before = survey.state(), (tmp_path / "j").read_bytes()
        out = io.BytesIO()
        serve(survey, io.BytesIO(line + b'\n{"query": "state"}\n').readline, out.write)
        error, state = map(json.loads, out.getvalue().splitlines())
        assert (state, (tmp_path / "j").read_bytes()) == before
    assert error["answer"] == "error" and error["line"] == 1
    assert "\n" not in error["problem"] and len(error["problem"]) < 400 and "internal" not in error["problem"]


@pytest.fixture(scope="module")
def survey(make):
    with make() as one:
        yield one


NUMBERS = st.one_of(st.floats(), st.integers(-(10**30), 10**30), st.floats(0, 1), st.integers(0, 2))
LEAVES = st.one_of(
    st.none(), st.booleans(), NUMBERS, st.text(max_size=8), st.sampled_from(["robot1", "robot2", "AA=="])
)
VALUES = st.recursive(LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner))
KINDS = st.sampled_from(
    ["measurement", "arrived", "gone", "budget", "heard", "speed", "joined", "zone", "threshold", "withdraw", "keep"]
)
KEYS = ("id", "robot", "position", "value", "time", "travelled", "budget", "packed", "query", "points", "protocol")
KEYS += ("speed", "threshold", "name", "polygon", "end", "measurement")
REQUESTS = st.fixed_dictionaries(
    {}, optional={"event": KINDS | VALUES, **{key: VALUES for key in KEYS}, "position": st.tuples(NUMBERS, NUMBERS)}
)
NEARLY = st.fixed_dictionaries(
    {"event": KINDS, "id": st.text(min_size=1, max_size=3), "robot": st.just("robot1"), "time": NUMBERS},
    optional={"position": st.tuples(NUMBERS, NUMBERS), "value": NUMBERS, "travelled": NUMBERS, "budget": NUMBERS},
)


def only_numbers(value):
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, dict):
        return all(map(only_numbers, value.values()))
    return all(map(only_numbers, value)) if isinstance(value, list) else True


@given(request=REQUESTS | NEARLY)
@settings(max_examples=300)
def test_any_request_gets_one_line_of_json_without_nan(survey, request):
    answer = encode(answer_line(survey, json.dumps(request).encode(), 1))
    assert answer.endswith(b"\n") and answer.count(b"\n") == 1
    answer = json.loads(answer)
    assert only_numbers(answer) and "internal error" not in answer.get("problem", "")


@given(line=st.binary(max_size=80))
def test_any_bytes_get_an_answer(survey, line):
    assert answer_line(survey, line.replace(b"\n", b""), 7)["answer"] == "error"


def test_a_mistake_of_ours_does_not_end_the_survey(make, monkeypatch, capsys):
    with make() as survey:
        monkeypatch.setattr(survey, "handle", lambda request: 1 / 0)
        answer = answer_line(survey, b'{"query": "state", "id": "q"}', 3)
    assert answer["id"] == "q" and answer["problem"].startswith(
        "internal error, nothing was changed: ZeroDivisionError"
    )
    assert "Traceback" in capsys.readouterr().err


def test_lines_are_split_and_cut():
    long = b"x" * (3 << 20)
    found = list(lines(io.BytesIO(b"a\r\n\n" + long + b"\nb\n" + long + b"\nlast").readline))
    assert [found[i] for i in (0, 1, 3, 5)] == [b"a", b"", b"b", b"last"]
    assert len(found) == 6 and len(found[2]) == len(found[4]) == (1 << 20) + 1


def test_queries_answer_with_their_id(survey):
    for name in ("hello", "state", "belief"):
        answer = answer_line(survey, json.dumps({"query": name, "id": "q7"}).encode(), 1)
        assert list(answer.items())[:2] == [("answer", name), ("id", "q7")]
    assert answer_line(survey, b'{"query": "hello", "protocol": "maipp.live/1"}', 1)["protocol"] == "maipp.live/1"
