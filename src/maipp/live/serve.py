"""The protocol over two streams of bytes: a request a line in, an answer a line out, in the same order."""

import json
import sys
import traceback
from collections.abc import Callable, Iterator
from typing import Any

from maipp.errors import InputError
from maipp.live.live_survey import LiveSurvey
from maipp.live.request import LONGEST_LINE, parse_line

_TOO_LONG = b"x" * (LONGEST_LINE + 1)


def serve(survey: LiveSurvey, read_line: Callable[[int], bytes], write: Callable[[bytes], object]) -> None:
    """Answer each line until there are no more. One that is not right gets an `error` and changes nothing.

    `read_line` gives the next line of at most so many bytes, as files' `readline` does; `write` must not keep back what
    it is given.
    """
    for number, line in enumerate(lines(read_line), start=1):
        write(encode(answer_line(survey, line, number)))


def answer_line(survey: LiveSurvey, line: bytes, number: int) -> dict[str, Any]:
    """The answer to one line, the `number`th; never raises."""
    name: Any = None
    try:
        request = parse_line(line)
        name = request.get("id")
        return survey.handle(request)
    except InputError as error:
        problem = str(error)
    except Exception as error:  # a mistake of ours: the robots in the field still need answers
        traceback.print_exc(file=sys.stderr)
        problem = f"internal error, {survey.changed()}: {type(error).__name__}: {error}"
    answer = {"answer": "error", "id": name if isinstance(name, str) else None, "line": number}
    return answer | {"problem": " ".join(problem.split())}


def encode(answer: dict[str, Any]) -> bytes:
    """An answer as its line; the same answer is the same bytes."""
    return json.dumps(answer, allow_nan=False, separators=(", ", ": ")).encode("ascii") + b"\n"


def lines(read_line: Callable[[int], bytes]) -> Iterator[bytes]:
    """The lines without their ends; of one that is too long only as much as tells so is kept."""
    while line := read_line(LONGEST_LINE + 2):
        whole = line.endswith(b"\n")
        if not whole and len(line) > LONGEST_LINE:
            while (rest := read_line(LONGEST_LINE)) and not rest.endswith(b"\n"):
                pass
            line = _TOO_LONG
        yield line.rstrip(b"\r\n")
