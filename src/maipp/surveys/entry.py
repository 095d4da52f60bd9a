"""Values of a mission file together with where they stand; each complaint is one line that names file, line and key."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NoReturn

import yaml

from maipp.errors import InputError
from maipp.scenario_checks import nearest, show
from maipp.yaml_text import read_mapping

_DEEPEST = 40  # levels of lists; a GeoJSON MultiPolygon in a FeatureCollection has nine


class Entry:
    """A value, its key (`robots[1].start`) and its line; what is not as asked for raises an `InputError`."""

    def __init__(self, source: str, key: str, value: Any, lines: Mapping[str, int]) -> None:
        self.source, self.key, self.value, self.lines = source, key, value, lines

    def wrong(self, problem: str) -> NoReturn:
        """Raises the `InputError` that this key has this problem."""
        raise InputError(f"{self.where}: {self.key + ': ' if self.key else ''}{problem}")

    @property
    def where(self) -> str:
        """File and line of the nearest key that has one."""
        key = self.key
        while key and key not in self.lines:
            key = key[: max(key.rfind("."), key.rfind("["), 0)]
        return f"{self.source}:{self.lines[key]}" if key in self.lines else self.source

    def child(self, key: str) -> "Entry":
        """The value under a key of this mapping; None where there is none."""
        return Entry(self.source, f"{self.key}.{key}" if self.key else key, self.value.get(key), self.lines)

    def children(self, allowed: tuple[str, ...]) -> dict[str, "Entry"]:
        """The entries of the mapping that are not null; unknown keys are told the nearest of those allowed."""
        if not isinstance(self.value, dict):
            self.wrong(f"{show(self.value)} is not a mapping; give lines of `key: value` with {', '.join(allowed)}")
        for key in self.value:
            if key not in allowed:
                name = key if isinstance(key, str) else show(key)
                Entry(self.source, f"{self.key}.{name}" if self.key else name, None, self.lines).wrong(
                    nearest(name, list(allowed)).replace("field", "key")
                )
        return {key: self.child(key) for key in self.value if self.value[key] is not None}

    def items(self, least: int, allowed: str) -> Iterator["Entry"]:
        """The entries of the list, of which there must be `least`."""
        if not isinstance(self.value, list) or len(self.value) < least:
            self.wrong(f"{show(self.value)} is not {allowed}")
        return (Entry(self.source, f"{self.key}[{i}]", item, self.lines) for i, item in enumerate(self.value))

    def text(self, allowed: str) -> str:
        """The text, not empty and without control characters."""
        value = self.value
        if not isinstance(value, str) or not value.strip() or any(c < " " or "\ud800" <= c <= "\udfff" for c in value):
            self.wrong(f"{show(value)} is not {allowed}")
        return value

    def flag(self) -> bool:
        """The truth value."""
        return self.value if isinstance(self.value, bool) else self.wrong(f"{show(self.value)}: give true or false")

    def number(self, allowed: str, right: Callable[[float], bool] = lambda number: True) -> float:
        """The finite number that is `right`."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e30 or value != value:
            self.wrong(f"{show(value)} is not {allowed}")
        if not right(float(value)):
            self.wrong(f"{show(value)} is not {allowed}")
        return float(value)

    def positive(self, allowed: str) -> float:
        """The finite number above 0."""
        return self.number(allowed, lambda number: number > 1e-30)

    def whole(self, allowed: str, least: int, most: int = 2**63 - 1) -> int:
        """The whole number from `least` to `most`."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            self.wrong(f"{show(value)} is not {allowed}")
        return value

    def point(self, allowed: str) -> tuple[float, float]:
        """The pair of finite numbers."""
        if not is_point(self.value):
            self.wrong(f"{show(self.value)} is not {allowed}")
        return float(self.value[0]), float(self.value[1])


def is_point(value: object) -> bool:
    """Whether a value is a list of two finite numbers."""
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(c, int | float) and not isinstance(c, bool) and abs(c) < 1e30 for c in value)
    )


def read_yaml(text: str, source: str) -> Entry:
    """The mapping that the text holds. Raises `InputError` for what is not YAML and for keys given twice."""
    lines: dict[str, int] = {}
    empty, deep = "`maipp survey --new` prints one to start from", "give plain lists and mappings"
    with read_mapping(text, source, empty=empty, line="key: value", deep=deep) as (loader, root):
        _note_lines(root, "", source, lines, set(), 0)
        try:
            return Entry(source, "", loader.construct_object(root, deep=True), lines)
        # `!!int three`, `!!float ""`, a number of 5000 digits, a list as key
        except (ValueError, LookupError, TypeError, OverflowError):
            problem = "holds a value that cannot be read; give plain numbers, words and lists"
            raise InputError(f"{source}: {problem}") from None


def _note_lines(node: yaml.Node, key: str, source: str, lines: dict[str, int], seen: set[int], depth: int) -> None:
    """Note the line of every key and item. A node that aliases repeat is noted once: they cannot make this slow."""
    if depth > _DEEPEST:
        raise RecursionError
    if id(node) in seen:
        return
    seen.add(id(node))
    if isinstance(node, yaml.MappingNode):
        names: dict[str, int] = {}
        for name, content in node.value:
            line = name.start_mark.line + 1
            if not isinstance(name, yaml.ScalarNode):
                raise InputError(f"{source}:{line}: the key is not a plain word; give lines of `key: value`")
            path = f"{key}.{name.value}" if key else str(name.value)
            if name.value in names:
                raise InputError(f"{source}:{line}: {path}: given twice, first on line {names[name.value]}; keep one")
            names[name.value] = lines[path] = line
            _note_lines(content, path, source, lines, seen, depth + 1)
    elif isinstance(node, yaml.SequenceNode):
        # Coordinates of polygons are many and told by the line of their list.
        if node.value and isinstance(node.value[0], yaml.ScalarNode):
            return
        for index, item in enumerate(node.value):
            lines[f"{key}[{index}]"] = item.start_mark.line + 1
            _note_lines(item, f"{key}[{index}]", source, lines, seen, depth + 1)
