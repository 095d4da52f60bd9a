"""One line from the caller, read strictly: what is not a right request is told in one line and changes nothing."""

import json
import math
from collections.abc import Iterable
from typing import Any, NoReturn

from maipp.errors import InputError
from maipp.scenario_checks import nearest, show

PROTOCOL = "maipp.live/1"

# Longest line read, bytes: `belief` at 10,000 points takes some 500,000.
LONGEST_LINE = 1 << 20

# Longest id of an event, characters.
LONGEST_ID = 200


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
    try:
        value = json.loads(text, object_pairs_hook=_unique, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        raise InputError(f"not JSON: {error.msg} (character {error.pos})") from None
    except RecursionError:
        raise InputError("nested too deeply; a request needs three levels at most") from None
    except ValueError as error:  # a number of 5000 digits, and InputErrors of the hooks
        raise InputError(str(error) if isinstance(error, InputError) else "a number has too many digits") from None
    if not isinstance(value, dict):
        raise InputError(f"{show(value)} is not a JSON object; send {{...}} with an event or a query")
    return value


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for key, value in pairs:
        if key in values:
            raise InputError(f"{show(key)}: given twice; keep one")
        values[key] = value
    return values


def _no_constant(name: str) -> NoReturn:
    raise InputError(f"{name} is not JSON; send finite numbers only")


class Fields:
    """The keys of one request, each taken once; what is missing, wrong or left over raises an `InputError`."""

    def __init__(self, values: dict[str, Any], kind: str) -> None:
        self._values, self._kind, self._known = values, kind, [kind]

    def wrong(self, key: str, problem: str) -> NoReturn:
        """Raises the `InputError` that this key has this problem."""
        raise InputError(f"{key}: {problem}")

    def has(self, key: str) -> bool:
        """Whether the key is given and not null."""
        self._known.append(key)
        return self._values.get(key) is not None

    def _take(self, key: str, allowed: str) -> Any:
        if not self.has(key):
            self.wrong(key, f"missing; give {allowed}")
        return self._values[key]

    def text(self, key: str, allowed: str, longest: int = LONGEST_ID, *, empty: bool = False) -> str:
        """The text: not empty unless that is allowed, and not too long."""
        value = self._take(key, allowed)
        if not isinstance(value, str) or not (value.strip() or empty) or len(value) > longest:
            self.wrong(key, f"{show(value)} is not {allowed}")
        return value

    def one_of(self, key: str, names: Iterable[str], noun: str) -> str:
        """The text, which must be one of the names."""
        names = list(names)
        value = self.text(key, f"{noun}, one of {', '.join(names)}")
        if value not in names:
            self.wrong(key, f"there is no {noun} {show(value)}; give one of {', '.join(names)}")
        return value

    def number(self, key: str, allowed: str, least: float = -math.inf) -> float:
        """The finite number, at least `least`."""
        return self._number(key, self._take(key, allowed), allowed, least)

    def optional_number(self, key: str, allowed: str, least: float = -math.inf) -> float | None:
        """The same, or None where it is not given."""
        return self.number(key, allowed, least) if self.has(key) else None

    def point(self, key: str) -> tuple[float, float]:
        """The pair of finite numbers."""
        return self._pair(key, self._take(key, "[x, y]"))

    def points(self, key: str, most: int) -> list[tuple[float, float]]:
        """The list of pairs, of which there may be at most `most`."""
        value = self._take(key, "a list of [x, y]")
        if not isinstance(value, list) or not 1 <= len(value) <= most:
            self.wrong(key, f"{show(value)} is not a list of 1 to {most} pairs [x, y]")
        return [self._pair(f"{key}[{i}]", item) for i, item in enumerate(value)]

    def done(self) -> None:
        """Raises `InputError` for a key that nobody asked for."""
        for key in self._values:
            if key not in self._known:
                self.wrong(show(key), nearest(key[:40], self._known).replace("field", "key"))

    def _pair(self, key: str, value: Any) -> tuple[float, float]:
        if not isinstance(value, list) or len(value) != 2:
            self.wrong(key, f"{show(value)} is not a pair [x, y]")
        x, y = (self._number(f"{key}[{i}]", item, "a finite number", -math.inf) for i, item in enumerate(value))
        return x, y

    def _number(self, key: str, value: Any, allowed: str, least: float) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.wrong(key, f"{show(value)} is not {allowed}")
        try:
            number = float(value)
        except OverflowError:  # a whole number of 400 digits
            number = math.inf
        if not math.isfinite(number) or number < least:
            self.wrong(key, f"{show(value)} is not {allowed}")
        return number + 0.0  # -0.0 becomes 0.0: both mean the same
