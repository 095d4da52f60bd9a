"""What is wrong with a key of a record, in one line."""

import difflib
import reprlib
from collections.abc import Iterable
from typing import Any

from maipp.errors import InputError, one_line


class FieldError(InputError):
    """One wrong key of a record: `key` names it (`budget[1]` with an index), `problem` says what is wrong and right.

    `where` is what stands before the key in the line: `survey.yaml:3: `, or `scenario.` where there is no file.
    """

    def __init__(self, key: str, problem: str, where: str = "") -> None:
        super().__init__(key, problem, where)  # all three, so that the error survives pickling
        self.key, self.problem, self.where = key, problem, where

    def __str__(self) -> str:
        return one_line(f"{self.where}{f'{self.key}: ' if self.key else ''}{self.problem}")


def plain(value: Any) -> Any:
    """Arrays and array scalars as Python lists and numbers, everything else as it is."""
    return value.tolist() if hasattr(value, "tolist") else value


def show(value: object) -> str:
    """The value on one short line, for an error."""
    short = reprlib.Repr()
    short.maxstring = short.maxother = 60
    return " ".join(short.repr(plain(value)).split())


def nearest(name: str, names: Iterable[str]) -> str:
    """What to say of a key that is none of `names`: the one that was probably meant, else all of them."""
    near = difflib.get_close_matches(name[:40].lower(), names := list(names), n=1)
    return f"no such key; did you mean {near[0]}?" if near else f"no such key; there are {', '.join(names) or 'none'}"


def unknown(what: str, name: str, names: list[str]) -> str:
    """What to say of a name that is none of `names`: the nearest one, and all of them."""
    if not names:
        return f"no {what} {name!r}; there are none"
    near = difflib.get_close_matches(name.lower(), names, n=1)
    meant = f" (did you mean {near[0]}?)" if near else ""
    return f"no {what} {name!r}{meant}; there are {', '.join(names)}"
