import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.live.events import KINDS, fingerprint, read_event, write_event
from maipp.live.request import parse_line

FULL = {
    "measurement": {"position": [0.1, 2], "value": -3, "time": 4, "travelled": 0.5},
    "arrived": {"position": [0.1, 2], "time": 4, "travelled": None},
    "gone": {"time": 0},
    "budget": {"time": 1, "budget": 7},
    "heard": {"position": [0, 0], "time": 1, "packed": "AAAA"},
    "withdraw": {"measurement": "m", "time": 1},
    "keep": {"measurement": "m", "time": 1},
    "speed": {"speed": 0.5, "time": 1},
    "joined": {"position": [0.1, 2], "budget": 7, "speed": 1, "time": 1, "end": "start"},
    "zone": {"name": "z", "polygon": [[0, 0], [1, 0], [0, 1]], "time": 1},
    "threshold": {"threshold": 0.5, "time": 1},
}
OF_ALL = ("zone", "threshold")  # they name no robot
OPTIONAL = ("travelled", "end")


def event(kind, **changes):
    head = {"event": kind, "id": "e"} | ({} if kind in OF_ALL else {"robot": "a"})
    return head | FULL[kind] | changes


@pytest.mark.parametrize("kind", KINDS)
def test_events_are_written_as_they_are_read(kind):
    read = read_event(event(kind), ["a", "b"])
    assert type(read) is KINDS[kind]
    assert read_event(json.loads(json.dumps(write_event(read))), ["a"]) == read


def test_spelling_does_not_matter_content_does():
    spelled = [
        b'{"event":"arrived","id":"e","robot":"a","position":[1,2],"time":3}',
        b'{ "time":3.0, "travelled":null,"position":[1.0,0.2e1],"robot":"\\u0061","id":"e","event":"arrived"}\r',
    ]
    one, other = (fingerprint(read_event(parse_line(line), ["a"])) for line in spelled)
    assert one == other != fingerprint(read_event(event("arrived", time=5), ["a"]))


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_is_needed_and_no_other_allowed(kind):
    for key in event(kind):
        without = {k: v for k, v in event(kind).items() if k != key}
        if key in OPTIONAL:
            assert read_event(without, ["a"])
        else:
            with pytest.raises(InputError, match=f"^{key}: missing"):
                read_event(without, ["a"])
    with pytest.raises(InputError, match=r"^postion: no such key; did you mean"):
        read_event(event("arrived", postion=[1, 2]), ["a"])


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"event": "arrive"}, "event: 'arrive' is not one of measurement, arrived"),
        ({"event": 3}, "event: 3 is not one of"),
        ({"robot": "c"}, "robot: 'c' is not one of a, b"),
        ({"id": ""}, "id: '' is not a text"),
        ({"id": 7}, "id: 7 is not a text"),
        ({"id": "x" * 201}, "id: 'xxx"),
        ({"position": [1]}, "position: "),
        ({"position": [1, 2, 3]}, "position: "),
        ({"position": {"x": 1}}, "position: "),
        ({"position": [1, "2"]}, "position[1]: '2' does not fit; give [x, y]"),
        ({"position": [True, 2]}, "position[0]: True does not fit"),
        ({"value": None}, "value: missing"),
        ({"value": 10**400}, "value: 1000"),
        ({"value": [1]}, "value: [1] is not a finite number"),
        ({"time": -1}, "time: -1 is not a time >= 0"),
        ({"travelled": -0.1}, "travelled: -0.1 is not"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(changes, told):
    with pytest.raises(InputError) as error:
        read_event(event("measurement", **changes), ["a", "b"])
    assert str(error.value).startswith(told) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (b"", "an empty line"),
        (b"  \t ", "an empty line"),
        (b"arrived", "not JSON"),
        (b"[1, 2]", "not a mapping of keys"),
        (b"3", "not a mapping of keys"),
        (b'{"a": 1} {"b": 2}', "not JSON"),
        (b'{"a": NaN}', "NaN is not JSON"),
        (b'{"a": [1, -Infinity]}', "-Infinity is not JSON"),
        (b'{"a": 1, "a": 2}', "'a': given twice"),
        (b'{"a": ' + b"9" * 5000 + b"}", "too many digits"),
        (b"[" * 100_000, "nested too deeply"),
        (b'\xef\xbb\xbf{"a": 1}', "byte order mark"),
        (b'{"a": "\xff"}', "not UTF-8"),
        (b'{"a"\x00: 1}', "not JSON"),
        (b" " * (1 << 21), "longer than 1048576 bytes"),
    ],
)
def test_lines_that_are_no_request(line, told):
    with pytest.raises(InputError, match=told) as error:
        parse_line(line)
    assert "\n" not in str(error.value) and len(str(error.value)) < 200


@given(st.binary(max_size=60))
def test_any_bytes_are_an_object_or_an_error(line):
    try:
        assert isinstance(parse_line(line), dict)
    except InputError:
        pass
