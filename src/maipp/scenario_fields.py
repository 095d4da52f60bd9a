"""Fields that say what they hold: one description feeds errors, class docstring, docs/scenario.md and YAML comments."""

import dataclasses
from typing import Any, NamedTuple

from maipp.scenario_checks import Check


class Quantity(NamedTuple):
    """What a field holds: completes "-1.0 is not <noun>; give <allowed>"."""

    noun: str
    unit: str
    allowed: str


class FieldDescription(NamedTuple):
    """What there is to know of one field."""

    name: str
    default: Any
    unit: str
    meaning: str
    allowed: str
    source: str


def option(default: Any, check: Check, quantity: Quantity, *, meaning: str, source: str) -> Any:
    """A dataclass field that carries its check and its description."""
    about = {"check": check, **quantity._asdict(), "meaning": meaning, "source": source}
    return dataclasses.field(default=default, metadata=about)


def described(kind: Any) -> tuple[FieldDescription, ...]:
    """One row per field of a dataclass whose fields are `option`s, in order."""
    keys = FieldDescription._fields[2:]
    return tuple(
        FieldDescription(each.name, each.default, *(each.metadata[key] for key in keys))
        for each in dataclasses.fields(kind)
    )
