"""A value knows its place: records are read from it, and each complaint begins with file, line and key."""

from dataclasses import dataclass
from typing import Annotated

import pytest

from maipp.records import FieldError, Value, Within, described, read_json, read_yaml
from maipp.records.kinds import Positive

TEXT = """\
name: a
legs:
  - {length: 2}
  - length: 3
    turn: 1
"""


@dataclass(frozen=True)
class Leg:
    length: Positive = described(meaning="of the leg", allowed="a length > 0")
    turn: Annotated[int, Within(-3, most=3)] = 0


@dataclass(frozen=True)
class Trip:
    best: Leg | None = None
    last: Leg = Leg(1.0)
    where: str = ""


def told(call) -> str:
    with pytest.raises(FieldError) as caught:
        call()
    return str(caught.value)


def test_keys_have_their_lines():
    root = read_yaml(TEXT, "t.yaml", empty="")
    second = list(root["legs"].items())[1]
    assert second["turn"].place == "t.yaml:5: legs[1].turn"
    assert second.record(Leg) == Leg(3.0, 1)
    assert told(lambda: second["turn"].wrong("is odd")) == "t.yaml:5: legs[1].turn: is odd"
    assert told(lambda: second["turns"]) == "t.yaml:4: legs[1].turns: missing"
    assert told(lambda: root["name"].mapping()) == "t.yaml:1: name: 'a' is not a mapping of keys to values"


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({}, "length: missing; give a length > 0"),
        ({"length": None}, "length: missing; give a length > 0"),
        ({"length": -1}, "length: -1 is not a length > 0"),
        ({"length": 1, "trun": 2}, "trun: no such key; did you mean turn?"),
        ({"length": 1, "x": 2}, "x: no such key; there are length, turn"),
        ({"length": 1, "turn": 4}, "turn: 4 is not a whole number from -3 to 3"),
        ([1], "[1] is not a mapping of keys to values, of length, turn"),
    ],
)
def test_what_is_wrong_in_a_record_is_told(values, problem):
    assert told(lambda: Value(values).record(Leg)) == problem


def test_records_in_records_readers_and_what_is_known():
    value = Value({"last": {"length": 2}, "kind": "trip"})
    assert value.record(Trip, beside=["kind"], where="here") == Trip(last=Leg(2.0), where="here")
    assert value.record(Trip, {"last": lambda leg: Leg(leg["length"].value * 2.0)}, beside=["kind"]).last.length == 4.0
    assert told(lambda: Value({"last": {"length": 0}}, "f").record(Trip)) == "f: last.length: 0 is not a length > 0"
    assert told(lambda: Value({"where": "x"}).record(Trip, where="y")).startswith("where: no such key")


def test_errors_of_a_maker_get_the_place():
    def make(turn: int) -> None:
        raise FieldError("turn", "is odd", "leg.")

    lines = {"legs": 2, "legs[0].turn": 3}
    assert told(lambda: Value({}, "f", "legs[0]", lines).make(make, {"turn": 1})) == "f:3: legs[0].turn: is odd"


@pytest.mark.parametrize(
    ("text", "strict", "problem"),
    [
        ('{"a": 1,\n', False, "f:2: not JSON, or cut short: "),
        ("[" * 10**5, False, "f: not JSON that can be read: nested too deeply"),
        ("9" * 5000, False, "f: not JSON that can be read: a number has too many digits"),
        (b"\xff", False, "f: not JSON, which is UTF-8 text"),
        ('{"a": 1, "a": 2}', True, "f: 'a': given twice; keep one"),
        ("[NaN]", True, "f: NaN is not JSON"),
    ],
)
def test_what_is_no_json_is_told(text, strict, problem):
    assert told(lambda: read_json(text, "f", strict=strict)).startswith(problem)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "f: empty file; give one"),
        ("a: {b: 1, b: 2}", "f:1: a.b: given twice, first on line 1; keep one"),
        ("a:\n  - {? [1] : 2}", "f:2: a[0]: the key is not a plain word"),
        ("a: &a\n  b: *a", "f:1: not valid YAML: found a list or mapping in itself"),
        ("a: !!map x", "f:1: not valid YAML: "),
        ("a: " + "[" * 41, "f: nested too deeply"),
        ("\n".join(f"{' ' * depth}a:" for depth in range(50)), "f: nested too deeply"),
    ],
)
def test_what_is_no_yaml_is_told(text, problem):
    assert told(lambda: read_yaml(text, "f", empty="give one")).startswith(problem)
