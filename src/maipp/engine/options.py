"""Options of planners, and the parts that planners are composed of."""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx


def option(default: Any = dataclasses.MISSING, *, meaning: str = "") -> Any:
    """A static field of a planner that users may set by its name, with what it means on one line.

    Text is read by the field's annotation: `bool`, `int`, `float`, `str`, a tuple of these, a `Literal`, or one of them
    `| None`. Without a default the option must be given, by keyword.
    """
    required = default is dataclasses.MISSING
    return eqx.field(static=True, default=default, kw_only=required, metadata={"option": meaning})


class Part(NamedTuple):
    """A module that planners hold: its class, and options that differ from the class's defaults."""

    kind: Any
    presets: dict[str, Any]

    def made(self, scenario: Any, values: Mapping[str, Any]) -> Any:
        """The module for a scenario; of the values it takes those that name fields of its own."""
        return self.kind(scenario, **self.presets | taken(self.kind, values))


def part(kind: type, **presets: Any) -> Any:
    """A field of a planner that holds a module made of the scenario, such as `PlanSearch` or `PathSampler`.

    The module's options are the planner's too, by the same names, with the presets in place of the defaults; parts that
    have an option of one name share it.
    """
    return eqx.field(default=None, kw_only=True, metadata={"part": Part(kind, presets)})


def parts_of(planner: type) -> dict[str, Part]:
    """The parts of a planner's class by the names of their fields."""
    fields = dataclasses.fields(planner)  # type: ignore[arg-type]  # equinox modules are dataclasses
    return {field.name: field.metadata["part"] for field in fields if "part" in field.metadata}


def taken(kind: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Of the values those that name fields of the class itself."""
    names = {field.name for field in dataclasses.fields(kind) if field.init}  # type: ignore[arg-type]
    return {name: value for name, value in values.items() if name in names}
