"""Checks that turn one raw value into the value a scenario stores, or reject it. They know no scenario.

A check is called with the key of the value (`budget`, `budget[1]`) and the raw value and raises `CheckError`.
Lists and arrays become tuples, array scalars Python numbers; a bool is not a number, a string never is.
"""

import difflib
import math
import os
import reprlib
from collections.abc import Callable
from typing import Any

Check = Callable[[str, Any], Any]

# The simulator computes in float32 and int32; beyond these a value would silently become inf, 0 or negative.
FLOAT32_MAX = 3.4028234663852886e38
FLOAT32_TINY = 1.1754943508222875e-38
INT32_MAX = 2**31 - 1


class CheckError(Exception):
    """The value at `key` is not what it should be; `problem` says why where that is not plain to see."""

    def __init__(self, key: str, value: Any, problem: str | None = None) -> None:
        super().__init__(key, value, problem)
        self.key, self.value, self.problem = key, value, problem


def plain(value: Any) -> Any:
    """Arrays and array scalars as Python lists and numbers, everything else as it is."""
    return value.tolist() if hasattr(value, "tolist") else value


def show(value: object) -> str:
    """The value on one short line, for an error."""
    short = reprlib.Repr()
    short.maxstring = short.maxother = 60
    return " ".join(short.repr(plain(value)).split())


def nearest(name: str, names: list[str]) -> str:
    """What to say of a name that is none of `names`: the one that was probably meant, else all of them."""
    near = difflib.get_close_matches(name.lower(), names, n=1)
    return f"no such field; did you mean {near[0]}?" if near else f"no such field; there are {', '.join(names)}"


def _items(value: Any) -> list[Any] | None:
    value = plain(value)
    return list(value) if isinstance(value, list | tuple) else None


def whole(least: int) -> Check:
    """Check for a whole number of at least `least`."""

    def check(key: str, value: Any) -> int:
        number = plain(value)
        if isinstance(number, bool) or not isinstance(number, int) or number < least:
            raise CheckError(key, value)
        if number > INT32_MAX:
            raise CheckError(key, value, "is too large")
        return int(number)

    return check


def real(*, above: float = -math.inf, least: float = -math.inf, most: float = math.inf) -> Check:
    """Check for a finite number greater than `above`, not less than `least` and not more than `most`."""

    def check(key: str, value: Any) -> float:
        number = plain(value)
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise CheckError(key, value)
        if not (number > above and least <= number <= most and abs(number) != math.inf):  # false for NaN as well
            raise CheckError(key, value)
        if abs(number) > FLOAT32_MAX:
            raise CheckError(key, value, "is too large for single precision")
        if above == 0.0 and number < FLOAT32_TINY:
            raise CheckError(key, value, "is too small for single precision")
        return float(number)

    return check


def optional(check: Check) -> Check:
    """Check for None, or what `check` takes."""
    return lambda key, value: None if value is None else check(key, value)


def sequence(check: Check, least: int = 0, most: int = INT32_MAX) -> Check:
    """Check for a list of `least` to `most` elements that each pass `check`; gives a tuple."""

    def check_all(key: str, value: Any) -> tuple[Any, ...]:
        items = _items(value)
        if items is None or not least <= len(items) <= most:
            raise CheckError(key, value)
        return tuple(check(f"{key}[{index}]", item) for index, item in enumerate(items))

    return check_all


def one_or_many(one: Check, depth: int = 0) -> Check:
    """Check for what `one` takes, or a list of such; `depth` is how many levels of lists `one` takes."""
    many = sequence(one, 1)

    def check(key: str, value: Any) -> Any:
        probe = _items(value)
        for _ in range(depth):
            probe = _items(probe[0]) if probe else None
        return one(key, value) if probe is None else many(key, value)

    return check


def low_high(end: Check) -> Check:
    """Check for [low, high] with low <= high, both passing `end`."""
    pair = sequence(end, 2, 2)

    def check(key: str, value: Any) -> tuple[Any, ...]:
        low, high = pair(key, value)
        if low > high:
            raise CheckError(key, value, "is an empty range, its low end above its high end")
        return low, high

    return check


def polygon(key: str, value: Any) -> tuple[tuple[float, float], ...]:
    """Check for a list of [x, y], at least three of them distinct."""
    vertices = sequence(sequence(real(), 2, 2))(key, value)
    distinct = len(set(vertices))
    if distinct < 3:
        raise CheckError(key, value, f"has too few distinct vertices for a polygon ({distinct})")
    return vertices


def path(key: str, value: Any) -> str:
    """Check for a path; gives a string that any UTF-8 file can hold."""
    name = os.fspath(value) if isinstance(value, os.PathLike) else value
    # A surrogate stands for a byte that is not UTF-8, and no file system takes a NUL.
    if not isinstance(name, str) or not name or any(c == "\0" or "\ud800" <= c <= "\udfff" for c in name):
        raise CheckError(key, value)
    return str(name)


def choice(*names: str) -> Check:
    """Check for one of the names."""

    def check(key: str, value: Any) -> str:
        if not isinstance(value, str) or value not in names:
            raise CheckError(key, value)
        return str(value)

    return check
