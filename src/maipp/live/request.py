"""One line from the caller, read strictly: what is not a right request is told in one line and changes nothing."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from maipp.errors import InputError
from maipp.foresight import ForesightName
from maipp.records import Length, Value, read_json
from maipp.records.kinds import Finite

PROTOCOL = "maipp.live/1"

# Longest line read, bytes: `belief` at 10,000 points takes some 500,000.
LONGEST_LINE = 1 << 20

# Longest id of an event, characters.
LONGEST_ID = 200

# Most points of one question for the belief.
MOST_POINTS = 10_000


def _not_blank(text: str) -> str | None:
    return None if text.strip() else ""


def _spoken(protocol: str) -> str | None:
    return None if protocol == PROTOCOL else ""


Id = Annotated[str, Length(most=LONGEST_ID), _not_blank, f"a text of 1 to {LONGEST_ID} characters"]
Position = Annotated[tuple[Finite, Finite], "[x, y]"]
_Points = Annotated[tuple[Position, ...], Length(1, MOST_POINTS), f"a list of 1 to {MOST_POINTS} pairs [x, y]"]
_Protocol = Annotated[str, _spoken, f"{PROTOCOL}, which is spoken here"]


@dataclass(frozen=True)
class StateQuery:
    """What is known of the robots?"""

    id: Id | None = None


@dataclass(frozen=True)
class HelloQuery(StateQuery):
    """Who answers here?"""

    protocol: _Protocol | None = None


@dataclass(frozen=True)
class BeliefQuery(StateQuery):
    """What is believed of the field, at these points or on the evaluation grid?"""

    points: _Points | None = None
    foresight: ForesightName | None = None


Query = HelloQuery | StateQuery | BeliefQuery

QUERIES: dict[str, type[Query]] = {"hello": HelloQuery, "state": StateQuery, "belief": BeliefQuery}


def parse_line(line: bytes) -> dict[str, Any]:
    """The object that a line of JSON holds. Raises `InputError` for anything else."""
    if len(line) > LONGEST_LINE:
        raise InputError(f"the line is longer than {LONGEST_LINE} bytes; send one request a line")
    if line.startswith(b"\xef\xbb\xbf"):
        raise InputError("the line starts with a byte order mark; send UTF-8 without one")
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"not UTF-8 text (byte {error.start} of the line)") from None
    if not text.strip():
        raise InputError("an empty line; send one JSON object a line")
    return read_json(text, strict=True).mapping()


def read_query(values: dict[str, Any]) -> Query:
    """The query that a request holds. Raises `InputError` for a key that is unknown or wrong."""
    request = Value(values)
    kind = QUERIES[request["query"].fit(Literal[tuple(QUERIES)])]  # type: ignore[valid-type]
    return request.record(kind, beside=["query"])
