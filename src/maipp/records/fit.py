"""Raw values made into what an annotation says: numbers, words, flags, lists of these, choices, nothing.

A bool is no number, NaN is none, a number never becomes a text. `Annotated` adds checks and may say in words what fits:
`Annotated[float, Within(above=0), "a length > 0"]`.
"""

import functools
import itertools
import math
import os
import types
import typing
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, NamedTuple, Union

from maipp.records.complaints import plain

# The simulator computes in float32 and int32; beyond these a value would silently become inf, 0 or negative.
FLOAT32_MAX = 3.4028234663852886e38
FLOAT32_TINY = 1.1754943508222875e-38
INT32_MAX = 2**31 - 1
# More than 64 bits count nothing, and overflow where floats are computed from them.
_INT64_MAX = 2**63 - 1

# What is wrong with a value of the right type: None for nothing, "" for what is plain to see.
Check = Callable[[Any], str | None]

_TRUE, _FALSE, _NONE = ("true", "yes", "on", "1"), ("false", "no", "off", "0"), ("none", "null")
_WORDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
_EXAMPLES = {bool: ("true", "false"), int: ("3", "4"), float: ("0.3", "0.4"), str: ("a", "b")}


class Misfit(Exception):  # noqa: N818 - is made into a `FieldError`, which names the key
    """The value, found at these places in the lists of the one that was given, is not what it should be."""

    def __init__(self, path: tuple[int, ...], value: Any, problem: str = "") -> None:
        super().__init__(path, value, problem)
        self.path, self.value, self.problem = path, value, problem


class Within(NamedTuple):
    """Check that a number is finite and within bounds; those of single precision as well, unless it is `wide`."""

    least: float = -math.inf
    above: float = -math.inf
    most: float = math.inf
    wide: bool = False

    def __call__(self, number: int | float) -> str | None:
        """What is wrong with the number."""
        if not (self.least <= number <= self.most and number > self.above and abs(number) != math.inf):
            return ""
        if not self.wide and abs(number) > (INT32_MAX if isinstance(number, int) else FLOAT32_MAX):
            return "is too large" if isinstance(number, int) else "is too large for single precision"
        if not self.wide and self.above == 0.0 and number < FLOAT32_TINY:
            return "is too small for single precision"
        return None

    def __str__(self) -> str:
        bounds = (self.least, self.above, self.most)
        least, above, most = (f"{bound:g}" if isinstance(bound, float) else str(bound) for bound in bounds)
        if self.most < math.inf:
            return f" from {least} to {most}" if self.above == -math.inf else f" > {above} and <= {most}"
        if self.above > -math.inf:
            return f" > {above}"
        return f" >= {least}" if self.least > -math.inf else ""


class Length(NamedTuple):
    """Check that a list or a text has at least `least` and at most `most` entries."""

    least: int = 0
    most: int = _INT64_MAX

    def __call__(self, value: Sequence[Any]) -> str | None:
        """What is wrong with the length."""
        return None if self.least <= len(value) <= self.most else ""


def fit(annotation: Any, value: Any, *, typed: bool = False) -> Any:
    """The value as the annotation has it; lists and arrays become tuples, array scalars Python numbers.

    With `typed`, a text may stand for any of it, as people type it: `true`, `3`, `0.3`, `0.3,0.4`, `none`.
    Raises `Misfit` where it does not fit.
    """
    return _maker(annotation, typed)(value, ())


@functools.cache
def _maker(annotation: Any, typed: bool) -> Callable[[Any, tuple[int, ...]], Any]:
    """What makes a value at a path fit, or raises `Misfit`; made once, for annotations are slow to read."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        return _checked(_maker(arguments[0], typed), [check for check in arguments[1:] if callable(check)])
    if origin in (Union, types.UnionType):
        # None first: in `str | None` the text "none" means None.
        kinds = sorted(arguments, key=lambda kind: kind is not type(None))
        return _first_that_fits([_maker(kind, typed) for kind in kinds])
    if origin is tuple:
        makers = [_maker(kind, typed) for kind in arguments if kind is not Ellipsis]
        return _all_of(makers, arguments[-1:] == (Ellipsis,), typed)

    def make(value: Any, path: tuple[int, ...]) -> Any:
        word = value.lower() if typed and isinstance(value, str) else None
        if annotation in (int, float):
            number = _number(annotation, plain(value), typed)
            if number is not None:
                return number
        elif origin is Literal:
            for name in arguments:
                if type(value) is type(name) and value == name or isinstance(value, str) and value == str(name):
                    return name
        elif annotation is type(None):
            if value is None or word in _NONE:
                return None
        elif annotation is bool:
            if isinstance(value, bool) or (word is not None and word in _TRUE + _FALSE):
                return value if isinstance(value, bool) else word in _TRUE
        elif annotation is str:
            text = os.fspath(value) if isinstance(value, os.PathLike) else value
            if isinstance(text, str):
                return str(text)
        elif annotation is Any or (isinstance(kind := origin or annotation, type) and isinstance(value, kind)):
            return value
        raise Misfit(path, value)

    return make


def _checked(maker: Callable[..., Any], checks: list[Any]) -> Callable[..., Any]:
    def make(value: Any, path: tuple[int, ...]) -> Any:
        made = maker(value, path)
        for check in checks:
            if (problem := check(made)) is not None:
                raise Misfit(path, value, problem)
        return made

    return make


def _first_that_fits(makers: list[Callable[..., Any]]) -> Callable[..., Any]:
    """Raises what the one says that comes furthest into the value."""

    def make(value: Any, path: tuple[int, ...]) -> Any:
        furthest = Misfit(path, value)
        for maker in makers:
            try:
                return maker(value, path)
            except Misfit as wrong:
                if wrong.path > furthest.path or (wrong.path == furthest.path and wrong.problem):
                    furthest = wrong
        raise furthest

    return make


def _all_of(makers: list[Callable[..., Any]], open_ended: bool, typed: bool) -> Callable[..., Any]:
    def make(value: Any, path: tuple[int, ...]) -> tuple[Any, ...]:
        items = _items(value, typed)
        if items is None or not (open_ended or len(items) == len(makers)):
            raise Misfit(path, value)
        each = itertools.repeat(makers[0]) if open_ended else makers
        return tuple(maker(item, (*path, at)) for at, (maker, item) in enumerate(zip(each, items, strict=False)))

    return make


def _items(value: Any, typed: bool) -> Sequence[Any] | None:
    if typed and isinstance(value, str):
        inner = value.strip().removeprefix("(").removesuffix(")").removeprefix("[").removesuffix("]").strip()
        return [item.strip() for item in inner.removesuffix(",").split(",")] if inner else []
    value = plain(value)
    return value if isinstance(value, Sequence) and not isinstance(value, str | bytes) else None


def _number(kind: type, value: Any, typed: bool) -> int | float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float, str) if typed else (int, float)):
        return None
    if kind is int and isinstance(value, float):
        return None
    try:
        number = kind(value)
    except (ValueError, OverflowError):
        return None
    # A NaN never equals itself, so nothing compiled for it would ever be found again.
    return None if number != number or (isinstance(number, int) and abs(number) > _INT64_MAX) else number


def expected(annotation: Any) -> str:
    """What fits an annotation, in words."""
    if annotation in _WORDS:
        return _WORDS[annotation]
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        words = [word for word in arguments[1:] if isinstance(word, str)]
        bounds = [str(check) for check in arguments[1:] if isinstance(check, Within)]
        return words[-1] if words else expected(arguments[0]) + "".join(bounds)
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
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (Union, types.UnionType) and type(None) in arguments:
        return "none"
    if origin in (Union, types.UnionType, Annotated):
        return _example(arguments[0], which)
    return _EXAMPLES.get(annotation, (str(annotation),) * 2)[which]
