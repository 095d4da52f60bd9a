"""JSON whose every complaint names the file and the key, and that a person can read."""

import json
import math
from collections.abc import Iterator
from typing import Any, NoReturn

import numpy as np

from maipp.errors import InputError
from maipp.typing import Float, Int

_WIDTH = 118  # lists of numbers that are shorter stay on one line


class Key:
    """A value in a file together with where it stands; what is not as asked for raises an `InputError` naming it."""

    def __init__(self, source: str, name: str, value: Any) -> None:
        self.source, self.name, self.value = source, name, value

    def wrong(self, problem: str) -> NoReturn:
        """Raises the `InputError` that this key has this problem."""
        raise InputError(f"{self.source}: {self.name + ': ' if self.name else ''}{problem}")

    def __getitem__(self, key: str) -> "Key":
        """The value under a key of this object."""
        child = Key(self.source, f"{self.name}.{key}" if self.name else key, None)
        if key not in self.mapping():
            child.wrong("missing; the file must hold it")
        child.value = self.value[key]
        return child

    def mapping(self) -> dict[str, Any]:
        """The object with this key."""
        return self.value if isinstance(self.value, dict) else self.wrong("must be an object of keys and values")

    def items(self, count: int | None = None) -> Iterator["Key"]:
        """The entries of the list, of which there must be `count`."""
        if not isinstance(self.value, list):
            self.wrong("must be a list")
        if count is not None and len(self.value) != count:
            self.wrong(f"has {len(self.value)} entries; there must be {count}")
        return (Key(self.source, f"{self.name}[{i}]", item) for i, item in enumerate(self.value))

    def text(self) -> str:
        """The text."""
        return self.value if isinstance(self.value, str) else self.wrong("must be a text")

    def number(self) -> float:
        """The finite number."""
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            self.wrong("must be a number")
        try:
            number = float(self.value)
        except OverflowError:  # a whole number of 400 digits
            number = math.inf
        if not math.isfinite(number):
            self.wrong(f"is {number}; it must be a finite number")
        return number

    def whole(self, below: int = 2**63) -> int:
        """The whole number, at least 0 and below `below`."""
        if isinstance(self.value, bool) or not isinstance(self.value, int) or self.value < 0:
            self.wrong("must be a whole number >= 0")
        if self.value >= below:
            self.wrong(f"is {self.value}; it must be below {below}")
        return self.value

    def wholes(self, count: int | None = None, below: int = 2**63) -> Int[np.ndarray, " n"]:
        """The list of whole numbers, of which there must be `count`, each below `below`."""
        return np.array([item.whole(below) for item in self.items(count)], np.int64)

    def numbers(self, real: np.dtype, count: int | None = None) -> Float[np.ndarray, " n"]:
        """The list of finite numbers, of which there must be `count`, at precision `real`."""
        items = list(self.items(count))
        with np.errstate(over="ignore"):  # told below, in words
            array = np.array([item.number() for item in items]).astype(real)
        if not np.isfinite(array).all():
            items[int(np.flatnonzero(~np.isfinite(array))[0])].wrong(f"is too large for {real}")
        return array


def pretty(value: Any, indent: str = "") -> str:
    """JSON with one key per line, and lists of numbers filled up to the line's width."""
    inner = indent + "  "
    if isinstance(value, dict) and value:
        lines = [f"{inner}{json.dumps(key)}: {pretty(item, inner)}" for key, item in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    flat = json.dumps(value, allow_nan=False)
    if not isinstance(value, list | tuple) or not value or len(indent) + len(flat) <= _WIDTH:
        return flat
    if isinstance(value[0], dict | list | tuple):
        return "[\n" + ",\n".join(inner + pretty(item, inner) for item in value) + f"\n{indent}]"
    lines, line = [], ""
    for item in (json.dumps(item) for item in value):
        if line and len(inner) + len(line) + len(item) + 3 > _WIDTH:
            lines.append(f"{line},")
            line = ""
        line = f"{line}, {item}" if line else item
    return "[\n" + "\n".join(inner + line for line in [*lines, line]) + f"\n{indent}]"
