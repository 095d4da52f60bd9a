"""Options of a planner: the static fields of its class, read from text by their annotations."""

import dataclasses
import difflib
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple, Union

from maipp.errors import InputError
from maipp.scenario_checks import show

_TRUE, _FALSE, _NONE = ("true", "yes", "on", "1"), ("false", "no", "off", "0"), ("none", "null")

_WORDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}
_EXAMPLES = {bool: ("true", "false"), int: ("3", "4"), float: ("0.3", "0.4"), str: ("a", "b")}


class PlannerOption(NamedTuple):
    """One option of a planner."""

    name: str
    annotation: Any  # the field's type
    default: Any  # `dataclasses.MISSING` where the option must be given
    meaning: str = ""  # on one line

    @property
    def allowed(self) -> str:
        """What may be given, in words."""
        return expected(self.annotation)


class _BadValueError(Exception):
    """The value does not fit the annotation."""


def options_of(planner: type, presets: Mapping[str, Any] | None = None) -> tuple[PlannerOption, ...]:
    """The options of a class, with the presets in place of its own defaults.

    Those of a planner are its static fields, whether made by `maipp.engine.option` or by `eqx.field(static=True)`;
    arrays and what holds them never are. Those of a plain dataclass are all of its fields. `metadata={"option": False}`
    makes a field none.
    """
    import equinox as eqx  # imports JAX, which the registry must not

    presets = presets or {}
    is_plain = not issubclass(planner, eqx.Module)
    try:
        annotations = typing.get_type_hints(planner)
    except (NameError, TypeError):  # a name that only a type checker knows: fall back on what the fields hold
        annotations = {}
    options = []
    for field in dataclasses.fields(planner):  # type: ignore[arg-type]  # equinox modules are dataclasses
        meaning = field.metadata.get("option", "")
        if field.init and meaning is not False and (is_plain or field.metadata.get("static", False)):
            default = field.default
            if default is dataclasses.MISSING and field.default_factory is not dataclasses.MISSING:
                default = field.default_factory()
            annotation = annotations.get(field.name, field.type)
            options.append(PlannerOption(field.name, annotation, presets.get(field.name, default), meaning))
    return tuple(options)


def read_options(
    planner: type, given: Mapping[str, object], presets: Mapping[str, Any] | None = None, *, where: str
) -> dict[str, Any]:
    """Every option of the class with its value: as given, else preset, else the default.

    Text is read by the option's annotation: `true`, `3`, `0.3`, `0.3,0.4`, `none`. Raises `InputError`, which begins
    with `where`, for an unknown option and for a value that does not fit.
    """
    options = {option.name: option for option in options_of(planner, presets)}
    for name in given:
        if name not in options:
            raise InputError(f"{where}: {unknown('option', name, list(options))}")
    values = {}
    for option in options.values():
        if option.name in given:
            try:
                values[option.name] = _convert(option.annotation, given[option.name])
            except _BadValueError:
                value = given[option.name]
                text = repr(value) if isinstance(value, str) else show(value)
                raise InputError(f"{where}: {option.name}: {text} does not fit; give {option.allowed}") from None
        elif option.default is dataclasses.MISSING:
            raise InputError(f"{where}: {option.name} has no default; give {option.allowed}")
        else:
            values[option.name] = option.default
    return values


def unknown(what: str, name: str, names: list[str]) -> str:
    """What to say of a name that is none of `names`: the nearest one, and all of them."""
    if not names:
        return f"no {what} {name!r}; there are none"
    near = difflib.get_close_matches(name.lower(), names, n=1)
    meant = f" (did you mean {near[0]}?)" if near else ""
    return f"no {what} {name!r}{meant}; there are {', '.join(names)}"


def expected(annotation: Any) -> str:
    """What fits an annotation, in words."""
    if annotation in _WORDS:
        return _WORDS[annotation]
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (Union, types.UnionType):
        words = [expected(argument) for argument in arguments if argument is not type(None)]
        return " or ".join([*words, "none"] if type(None) in arguments else words)
    if origin is Literal:
        return "one of " + ", ".join(str(argument) for argument in arguments)
    if origin is tuple:
        open_ended = arguments[-1:] == (Ellipsis,)
        items = (arguments[0],) * 2 if open_ended else arguments
        example = ",".join(_example(item, i % 2) for i, item in enumerate(items))
        return f"a list such as {example}" if open_ended else f"{len(items)} values such as {example}"
    return f"a {getattr(annotation, '__name__', annotation)} (from Python)"


def _example(annotation: Any, which: int) -> str:
    """A value that fits an item of a list."""
    if typing.get_origin(annotation) in (Union, types.UnionType):
        return "none" if type(None) in typing.get_args(annotation) else _example(typing.get_args(annotation)[0], which)
    return _EXAMPLES.get(annotation, (str(annotation),) * 2)[which]


def _convert(annotation: Any, value: object) -> Any:
    """The value as the annotation has it. Raises `_BadValueError` where it does not fit."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (Union, types.UnionType):
        return _first_that_fits(arguments, value)
    if origin is Literal:
        for argument in arguments:
            if value == argument or (isinstance(value, str) and value == str(argument)):
                return argument
        raise _BadValueError
    if origin is tuple:
        return _convert_tuple(arguments, value)
    if annotation is type(None):
        if value is None or (isinstance(value, str) and value.lower() in _NONE):
            return None
        raise _BadValueError
    if annotation is bool:
        return _convert_bool(value)
    if annotation in (int, float):
        return _convert_number(annotation, value)
    if annotation is str or annotation is Any:
        if annotation is str and not isinstance(value, str):
            raise _BadValueError
        return value
    if isinstance(annotation, type) and isinstance(value, annotation):
        return value
    raise _BadValueError


def _first_that_fits(annotations: Sequence[Any], value: object) -> Any:
    # None first: in `str | None` the text "none" means None.
    for annotation in sorted(annotations, key=lambda annotation: annotation is not type(None)):
        try:
            return _convert(annotation, value)
        except _BadValueError:
            continue
    raise _BadValueError


def _convert_tuple(arguments: tuple[Any, ...], value: object) -> tuple[Any, ...]:
    if isinstance(value, str):
        inner = value.strip().removeprefix("(").removesuffix(")").removeprefix("[").removesuffix("]").strip()
        items: Sequence[object] = [item.strip() for item in inner.removesuffix(",").split(",")] if inner else []
    elif isinstance(value, Sequence):
        items = value
    else:
        raise _BadValueError
    if arguments[-1:] == (Ellipsis,):
        return tuple(_convert(arguments[0], item) for item in items)
    if len(items) != len(arguments):
        raise _BadValueError
    return tuple(_convert(argument, item) for argument, item in zip(arguments, items, strict=True))


def _convert_bool(value: object) -> bool:
    if isinstance(value, bool):
        return value
    word = value.lower() if isinstance(value, str) else ""
    if word not in _TRUE + _FALSE:
        raise _BadValueError
    return word in _TRUE


# More than 64 bits count nothing, and overflow where floats are computed from them.
_LARGEST = 2**63 - 1


def _convert_number(kind: type, value: object) -> int | float:
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise _BadValueError
    if kind is int and isinstance(value, float):
        raise _BadValueError
    try:
        number = kind(value)
    except (ValueError, OverflowError):
        raise _BadValueError from None
    # A NaN never equals itself, so nothing compiled for it would ever be found again.
    if number != number or (isinstance(number, int) and abs(number) > _LARGEST):
        raise _BadValueError
    return number
