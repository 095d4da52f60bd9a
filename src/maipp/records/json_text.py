"""JSON read with every complaint on one line, and written so that a person can read it."""

import json
from typing import Any, NoReturn

from maipp.records.complaints import FieldError, show
from maipp.records.value import Value

_WIDTH = 118  # lists of numbers that are shorter stay on one line


def read_json(text: str | bytes, source: str = "", *, strict: bool = False) -> Value:
    """What the text holds. `strict` refuses what JSON does not know (NaN, Infinity) and a key given twice.

    Raises `FieldError` with `source` and line for what is not JSON, not UTF-8, or deeper or longer than Python reads.
    """
    where = f"{source}: " if source else ""
    hooks: dict[str, Any] = {"object_pairs_hook": _unique, "parse_constant": _no_constant} if strict else {}
    try:
        return Value(json.loads(text, **hooks), source)
    except json.JSONDecodeError as error:
        where = f"{source}:{error.lineno}: " if source else ""
        problem = f"not JSON, or cut short: {error.msg} (character {error.pos})"
    except FieldError as error:
        problem = error.problem
    except UnicodeDecodeError as error:
        problem = f"not JSON, which is UTF-8 text (byte {error.start})"
    except RecursionError:
        problem = "not JSON that can be read: nested too deeply"
    except ValueError:
        problem = "not JSON that can be read: a number has too many digits"
    raise FieldError("", problem, where)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for key, value in pairs:
        if key in values:
            raise FieldError("", f"{show(key)}: given twice; keep one")
        values[key] = value
    return values


def _no_constant(name: str) -> NoReturn:
    raise FieldError("", f"{name} is not JSON; give finite numbers only")


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
