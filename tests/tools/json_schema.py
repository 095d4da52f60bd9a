"""JSON Schema (draft 7, which editors complete from) of what an annotation of a record takes.

A schema takes whatever the record's reader takes: what it has no words for, such as a check of one key against
another, it leaves to the reader.
"""

import dataclasses
import json
import math
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Union

from maipp.records import Field, Length, Within, fields_of

Schema = dict[str, Any]

_PLAIN: dict[Any, Schema] = {
    bool: {"type": "boolean"},
    int: {"type": "integer"},
    float: {"type": "number"},
    str: {"type": "string"},
    Path: {"type": "string"},
    dict: {"type": "object"},
    type(None): {"type": "null"},
    Any: {},
}
_BOUNDS = {
    "string": ("minLength", "maxLength"),
    "array": ("minItems", "maxItems"),
}


@dataclasses.dataclass(frozen=True)
class Writer:
    """Makes schemas of annotations.

    `special` has those of types, and of fields as (record, name), that have readers of their own.
    """

    special: Mapping[Any, Schema] = dataclasses.field(default_factory=dict)
    nulls: bool = True  # whether a key that is null counts as left out

    def of(self, annotation: Any) -> Schema:
        """The schema of an annotation that `maipp.records.fit` knows, or of a dataclass."""
        origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
        if _hashable(annotation) and annotation in self.special:
            return self.special[annotation]
        if origin is Annotated:
            return self._checked(self.of(arguments[0]), arguments[1:])
        if origin in (Union, types.UnionType):
            return any_of([self.of(argument) for argument in arguments])
        if origin is Literal:
            return {"enum": list(arguments)}
        if origin is tuple:
            return self._list(arguments)
        if dataclasses.is_dataclass(annotation):
            return self.record(annotation)  # type: ignore[arg-type]  # a class
        return _PLAIN[origin or annotation]

    def record(
        self, kind: type, *, only: Iterable[str] | None = None, first: Mapping[str, Schema] | None = None, closed=True
    ) -> Schema:
        """The schema of a mapping that makes a record, or `only` some keys of it; keys that come `first` are required.

        One that is not `closed` may have further keys.
        """
        rows = [row for row in fields_of(kind) if only is None or row.name in only]
        keys = {**(first or {}), **{row.name: self._key(kind, row) for row in rows}}
        required = [*(first or {}), *(row.name for row in rows if row.default is dataclasses.MISSING)]
        schema: Schema = {"type": "object", "properties": keys}
        return (
            schema | ({"required": required} if required else {}) | ({"additionalProperties": False} if closed else {})
        )

    def _key(self, kind: type, row: Field) -> Schema:
        """The schema of one key, with its meaning, what may be given, and its default."""
        schema = self.special.get((kind, row.name)) or self.of(row.annotation)
        has_default = row.default is not dataclasses.MISSING
        if has_default and self.nulls:
            schema = any_of([schema, _PLAIN[type(None)]])
        words = [f"{row.meaning[:1].upper()}{row.meaning[1:]}."] if row.meaning else []
        words += [] if "from Python" in row.allowed else [f"Give {row.allowed}."]
        told = {"description": " ".join(words)} if words else {}
        default = {"default": row.default} if has_default and isinstance(row.default, bool | int | float | str) else {}
        return told | schema | default

    def _checked(self, schema: Schema, checks: Sequence[Any]) -> Schema:
        for check in checks:
            if isinstance(check, Within):
                bounds = {"minimum": check.least, "exclusiveMinimum": check.above, "maximum": check.most}
                schema = schema | {key: bound for key, bound in bounds.items() if math.isfinite(bound)}
            elif isinstance(check, Length):
                least, most = _BOUNDS[schema["type"]]
                schema = schema | ({least: check.least} if check.least else {})
                schema |= {most: check.most} if check.most < 2**31 else {}
        return schema

    def _list(self, arguments: Sequence[Any]) -> Schema:
        if arguments[-1:] == (Ellipsis,):
            return {"type": "array", "items": self.of(arguments[0])}
        items = [self.of(argument) for argument in arguments]
        alike = all(item == items[0] for item in items)
        return {
            "type": "array",
            "items": items[0] if alike else items,
            "minItems": len(items),
            "maxItems": len(items),
        }


def any_of(schemas: Iterable[Schema]) -> Schema:
    """What any of these takes."""
    flat: list[Schema] = []
    for schema in schemas:
        for each in schema["anyOf"] if set(schema) == {"anyOf"} else [schema]:
            taken = each in flat or (each == _PLAIN[type(None)] and any("null" in one.get("type", ()) for one in flat))
            flat += [] if taken else [each]
    kinds = [each.get("type") for each in flat]
    if len(flat) == 2 and kinds[1] == "null" and isinstance(kinds[0], str) and kinds[0] != "null":
        return flat[0] | {"type": [kinds[0], "null"]}
    return flat[0] if len(flat) == 1 else {"anyOf": flat}


def whole(title: str, schema: Schema) -> str:
    """A schema as the text of its file."""
    head = {"$schema": "http://json-schema.org/draft-07/schema#", "title": title}
    return json.dumps(head | schema, indent=1, ensure_ascii=False) + "\n"


def _hashable(annotation: Any) -> bool:
    try:
        hash(annotation)
    except TypeError:
        return False
    return True
