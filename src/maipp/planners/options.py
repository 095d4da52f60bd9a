"""Options of a planner: the static fields of its class and of its parts, read from text by their annotations."""

import dataclasses
import typing
from collections.abc import Mapping
from typing import Any

from maipp.records import Field, FieldError, unknown


def options_of(planner: type, presets: Mapping[str, Any] | None = None) -> tuple[Field, ...]:
    """The options of a class, with the presets in place of its own defaults.

    They are its static fields, whether made by `maipp.engine.option` or by `eqx.field(static=True)`, and those of its
    parts; arrays and what holds them never are. `metadata={"option": False}` makes a field none.
    """
    presets = presets or {}
    try:
        annotations = typing.get_type_hints(planner, include_extras=True)
    except (NameError, TypeError):  # a name that only a type checker knows: fall back on what the fields hold
        annotations = {}
    options: dict[str, Field] = {}
    for field in dataclasses.fields(planner):  # type: ignore[arg-type]  # equinox modules are dataclasses
        meaning = field.metadata.get("option", "")
        if "part" in field.metadata:
            part = field.metadata["part"]
            options |= {each.name: each for each in options_of(part.kind, part.presets | presets)}
        elif field.init and meaning is not False and field.metadata.get("static", False):
            default = field.default
            if default is dataclasses.MISSING and field.default_factory is not dataclasses.MISSING:
                default = field.default_factory()
            annotation = annotations.get(field.name, field.type)
            options[field.name] = Field(field.name, annotation, presets.get(field.name, default), meaning)
    return tuple(options.values())


def values_of(planner: Any) -> dict[str, Any]:
    """The value of every option of a planner."""
    holders = [planner, *(getattr(planner, name) for name in parts_in(type(planner)))]
    return {
        option.name: next(getattr(holder, option.name) for holder in holders if hasattr(holder, option.name))
        for option in options_of(type(planner))
    }


def parts_in(planner: type) -> tuple[str, ...]:
    """The names of the fields that hold parts."""
    return tuple(field.name for field in dataclasses.fields(planner) if "part" in field.metadata)  # type: ignore[arg-type]


def read_options(
    planner: type, given: Mapping[str, object], presets: Mapping[str, Any] | None = None, *, where: str
) -> dict[str, Any]:
    """Every option of the class with its value: as given, else preset, else the default.

    Text is read by the option's annotation: `true`, `3`, `0.3`, `0.3,0.4`, `none`. Raises `FieldError`, which begins
    with `where`, for an unknown option and for a value that does not fit.
    """
    options = {option.name: option for option in options_of(planner, presets)}
    for name in given:
        if name not in options:
            raise FieldError("", unknown("option", name, list(options)), f"{where}: ")
    values = {}
    for option in options.values():
        if option.name in given:
            values[option.name] = option.fit(given[option.name], f"{where}: ", typed=True)
        elif option.default is dataclasses.MISSING:
            raise FieldError(option.name, f"has no default; give {option.allowed}", f"{where}: ")
        else:
            values[option.name] = option.default
    return values
