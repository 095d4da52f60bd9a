"""A raw value together with where it stands, so that each complaint about it names file, line and key."""

import dataclasses
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, NoReturn, TypeVar

from maipp.records.complaints import FieldError, nearest, show
from maipp.records.fields import Field, complaint, fields_of, fitted

Record = TypeVar("Record")


class Value:
    """A value, its key (`robots[1].start`, empty for the whole), the file's name, and the line of every key known.

    What is not as asked for raises `FieldError`.
    """

    def __init__(self, value: Any, source: str = "", key: str = "", lines: Mapping[str, int] | None = None) -> None:
        self.value, self.source, self.key, self.lines = value, source, key, lines or {}

    def at(self, key: str, value: Any = None) -> "Value":
        """The value below this one at a key, such as `start`, `start[1]` or `[1]`; for a complaint, none is needed."""
        below = f"{self.key}.{key}" if self.key and not key.startswith("[") else f"{self.key}{key}"
        return Value(value, self.source, below, self.lines)

    @property
    def where(self) -> str:
        """What errors begin with: the file and the line of the nearest key that has one."""
        key = self.key
        while key and key not in self.lines:
            key = key[: max(key.rfind("."), key.rfind("["), 0)]
        place = f"{self.source}:{self.lines[key]}" if key in self.lines else self.source
        return f"{place}: " if place else ""

    @property
    def place(self) -> str:
        """File, line and key, to begin an error with."""
        return f"{self.where}{self.key}"

    def wrong(self, problem: str) -> NoReturn:
        """Raises the error that this key has this problem."""
        raise FieldError(self.key, problem, self.where)

    def unfit(self, allowed: str) -> NoReturn:
        """Raises the error that the value is not what is allowed."""
        self.wrong(complaint(self.value, "", allowed))

    def __contains__(self, key: str) -> bool:
        """Whether the value under this key is there and not null."""
        return self.mapping().get(key) is not None

    def __getitem__(self, key: str) -> "Value":
        """The value under this key, which must be there."""
        return self.at(key, self.mapping()[key]) if key in self.mapping() else self.at(key).wrong("missing")

    def mapping(self, known: Collection[str] | None = None) -> dict[str, Any]:
        """The mapping. Of a key that is none of those `known`, the nearest one is told."""
        if not isinstance(self.value, dict):
            self.unfit("a mapping of keys to values" + (f", of {', '.join(known)}" if known else ""))
        for key in self.value:
            if known is not None and key not in known:
                self.at(key if len(key) <= 60 else show(key)).wrong(nearest(key, known))
        return self.value

    def items(self, least: int = 0, allowed: str = "a list", *, count: int | None = None) -> Iterator["Value"]:
        """The entries of the list: `least` of them or more, or exactly `count`."""
        if not isinstance(self.value, list) or len(self.value) < least:
            self.unfit(allowed)
        if count is not None and len(self.value) != count:
            self.wrong(f"has {len(self.value)} entries; give {count}")
        return (self.at(f"[{index}]", item) for index, item in enumerate(self.value))

    def fit(self, annotation: Any, allowed: str = "") -> Any:
        """The value as the annotation has it (`maipp.records.fit`); `allowed` says in words what may be given."""
        return fitted(annotation, self.value, self.key, allowed, self.where)

    def part(self, kind: type, name: str) -> Any:
        """The value under a key, which must be there, as the field of that name of this dataclass has it."""
        (field,) = (each for each in fields_of(kind) if each.name == name)
        return self[name].fit(field.annotation, field.allowed)

    def record(
        self,
        kind: Callable[..., Record],
        readers: Mapping[str, Callable[["Value"], Any]] | None = None,
        *,
        beside: Collection[str] = (),
        **known: Any,
    ) -> Record:
        """The record of this kind, a dataclass, that the mapping holds; keys that are null count as left out.

        A field that is itself a dataclass is read alike, one with a reader by that, and one that is `known` is no key.
        The keys `beside` are allowed too.
        """
        rows = [each for each in fields_of(kind) if each.name not in known]  # type: ignore[arg-type]  # a class
        self.mapping([*beside, *(each.name for each in rows)])
        values = {each.name: self._field(each, readers or {}) for each in rows}
        return self.make(
            kind, {key: value for key, value in values.items() if value is not dataclasses.MISSING} | known
        )

    def make(self, kind: Callable[..., Record], values: Mapping[str, Any]) -> Record:
        """`kind(**values)`, whose errors get the place of the key that they name below this one."""
        try:
            return kind(**values)
        except FieldError as error:
            self.at(error.key).wrong(error.problem)

    def _field(self, field: Field, readers: Mapping[str, Callable[["Value"], Any]]) -> Any:
        """The value of a field; `MISSING` where it is left out and has a default."""
        if field.name not in self:
            has_default = field.default is not dataclasses.MISSING
            return dataclasses.MISSING if has_default else self.at(field.name).wrong(f"missing; give {field.allowed}")
        value = self[field.name]
        if field.name in readers:
            return readers[field.name](value)
        if dataclasses.is_dataclass(field.annotation):
            return value.record(field.annotation, readers)  # type: ignore[arg-type]  # a class
        return value.fit(field.annotation, field.allowed)
