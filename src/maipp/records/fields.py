"""Fields that say what they hold: one description feeds checks, errors, docs and comments in files."""

import dataclasses
import functools
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from maipp.records.complaints import FieldError, show
from maipp.records.fit import Misfit, expected, fit


@dataclass(frozen=True)
class Field:
    """What there is to know of one field of a record, or of one option of a planner."""

    name: str
    annotation: Any
    default: Any  # `dataclasses.MISSING` where a value must be given
    meaning: str = ""  # on one line
    about: Mapping[str, Any] = dataclasses.field(default_factory=dict)  # the rest of its metadata

    @property
    def allowed(self) -> str:
        """What may be given, in words."""
        return self.about.get("allowed") or expected(self.annotation)

    def fit(self, value: Any, where: str = "", *, typed: bool = False) -> Any:
        """The value as the annotation has it (`maipp.records.fit`). Raises `FieldError`, which begins with `where`."""
        return fitted(self.annotation, value, self.name, self.allowed, where, typed=typed)


def fitted(annotation: Any, value: Any, key: str, allowed: str, where: str, *, typed: bool = False) -> Any:
    """The value as the annotation has it. Raises `FieldError` with the key, and what is `allowed` there."""
    try:
        return fit(annotation, value, typed=typed)
    except Misfit as wrong:
        key += "".join(f"[{index}]" for index in wrong.path)
        problem = wrong.problem or ("does not fit" if wrong.path else "")  # what is allowed is said of the whole list
        raise FieldError(key, complaint(wrong.value, problem, allowed or expected(annotation)), where) from None


def complaint(value: Any, problem: str, allowed: str) -> str:
    """What to say of a value: its problem and what to give, or where that is plain to see, what it is not."""
    return f"{show(value)} {problem}; give {allowed}" if problem else f"{show(value)} is not {allowed}"


def described(default: Any = dataclasses.MISSING, meaning: str = "", *, allowed: str = "", **about: Any) -> Any:
    """A dataclass field with its meaning on one line, and in words what may be given where the annotation is not plain.

    Everything else that is said `about` it goes to its metadata.
    """
    return dataclasses.field(default=default, metadata={"meaning": meaning, "allowed": allowed, **about})


@functools.cache
def fields_of(kind: type) -> tuple[Field, ...]:
    """One row per field of a dataclass, in order."""
    annotations = typing.get_type_hints(kind, include_extras=True)
    rows = []
    for each in dataclasses.fields(kind):
        default = each.default if each.default_factory is dataclasses.MISSING else each.default_factory()
        rows.append(Field(each.name, annotations[each.name], default, each.metadata.get("meaning", ""), each.metadata))
    return tuple(rows)


def settle(record: Any, where: str, *, typed: bool = False) -> None:
    """Make each value of a frozen dataclass what its annotation says, texts as typed too if `typed`.

    Raises `FieldError`, which begins with `where`, for the first that is wrong.
    """
    for each in fields_of(type(record)):
        object.__setattr__(record, each.name, each.fit(getattr(record, each.name), where, typed=typed))


def refusal(record: Any, where: str, key: str, value: Any, problem: str) -> FieldError:
    """The error for a value that is right by itself and contradicts another one of the record."""
    name = key.partition("[")[0]
    (allowed,) = (each.allowed for each in fields_of(type(record)) if each.name == name)
    return FieldError(key, complaint(value, problem, allowed), where)
