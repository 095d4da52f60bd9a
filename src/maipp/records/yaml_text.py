"""The house's one way of reading and writing YAML: the scalars of YAML 1.2, no tags, errors that name file and line."""

import re
from typing import Any, NoReturn

import yaml

from maipp.records.complaints import FieldError
from maipp.records.value import Value

# Plain scalars as YAML 1.2 reads them, for loader and dumper alike: PyYAML's own YAML 1.1 rules take 1e-6 for
# a string, 010 for 8, 1:30 for 90 and `no` for false.
_NUMBER_STARTS = list("-+.0123456789")
_SCALARS = (
    ("tag:yaml.org,2002:null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("tag:yaml.org,2002:bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("tag:yaml.org,2002:int", r"[-+]?[0-9]+", _NUMBER_STARTS),
    (
        "tag:yaml.org,2002:float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        _NUMBER_STARTS,
    ),
)

# Lists and mappings in each other that are read; a GeoJSON MultiPolygon in a FeatureCollection has nine.
_DEEPEST = 40
_MAP, _SEQ = "tag:yaml.org,2002:map", "tag:yaml.org,2002:seq"
_UNFINISHED = object()


class _Loader(yaml.SafeLoader):
    """Reads plain values; every tag of another kind is refused."""

    yaml_implicit_resolvers: dict[str, Any] = {}
    # No dates, sets or binary data: no field holds any. The entry None rejects every other tag.
    yaml_constructors: dict[str | None, Any] = {
        tag: yaml.SafeLoader.yaml_constructors[tag]
        for tag in (
            None,
            *(f"tag:yaml.org,2002:{kind}" for kind in "null bool int float str seq map".split()),
        )
    }

    def fetch_flow_collection_start(self, TokenClass: type[yaml.Token]) -> None:  # noqa: N803 - as PyYAML calls it
        """Raises RecursionError beyond any depth that is meant: each level makes each token dearer to read."""
        if self.flow_level >= _DEEPEST:
            raise RecursionError
        super().fetch_flow_collection_start(TokenClass)


class _Dumper(yaml.SafeDumper):
    yaml_implicit_resolvers: dict[str, Any] = {}

    def ignore_aliases(self, data: Any) -> bool:
        return True  # two equal vertices are two vertices, not an anchor and an alias


def _block(dumper: yaml.SafeDumper, mapping: dict[str, Any]) -> yaml.MappingNode:
    return dumper.represent_mapping("tag:yaml.org,2002:map", mapping, flow_style=False)


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    # Unicode's own line breaks: in single quotes PyYAML writes them as they are, and reads a space.
    breaks = any(c in "\x85\u2028\u2029" for c in text)
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"' if breaks else None)


def _decimal(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
    return int(str(loader.construct_scalar(node)))  # PyYAML's own reads a leading zero as octal


_Dumper.add_representer(dict, _block)
_Dumper.add_representer(str, _text)
_Loader.add_constructor("tag:yaml.org,2002:int", _decimal)
for _tag, _pattern, _first in _SCALARS:
    for _class in (_Loader, _Dumper):
        _class.add_implicit_resolver(_tag, re.compile(rf"^(?:{_pattern})$"), _first)


def dump_yaml(value: Any) -> str:
    """The value as YAML: mappings in lines, lists of scalars in brackets."""
    return yaml.dump(value, Dumper=_Dumper, default_flow_style=None, allow_unicode=True, sort_keys=False, width=10**9)


def read_yaml(text: str, source: str, *, empty: str) -> Value:
    """The mapping that the text holds, with the line of every key; keys are texts. `empty` says where to find one.

    Raises `FieldError` with `source` and line for what is not YAML or no mapping, and for a key given twice.
    """
    where = f"{source}: "
    try:
        loader = _Loader(text)
        root = loader.get_single_node()
        if root is None or (isinstance(root, yaml.ScalarNode) and not root.value):
            raise FieldError("", f"empty file; {empty}", where)
        if not isinstance(root, yaml.MappingNode):
            raise FieldError("", "not a mapping; give lines of `key: value`", f"{source}:{root.start_mark.line + 1}: ")
        lines: dict[str, int] = {}
        return Value(_ValueTree(loader, source, lines).value(root, ""), source, "", lines)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"{source}:{mark.line + 1}: " if mark else where
        raise FieldError(
            "", f"not valid YAML: {' '.join(str(error.problem or error.context).split())}", where
        ) from None
    except yaml.reader.ReaderError as error:
        number = text.count("\n", 0, error.position) + 1
        raise FieldError("", f"not valid YAML: {error.reason}", f"{source}:{number}: ") from None
    except RecursionError:
        raise FieldError("", "nested too deeply; give plain lists and mappings", where) from None


class _ValueTree:
    """Makes values of nodes and notes the line of every key and item, under its path such as `robots[1].start`.

    A node that aliases repeat is read once: they cannot make this slow.
    """

    def __init__(self, loader: _Loader, source: str, lines: dict[str, int]) -> None:
        self.loader, self.source, self.lines = loader, source, lines
        self.made: dict[int, Any] = {}

    def value(self, node: yaml.Node, path: str, depth: int = 0) -> Any:
        """The value of the node at this path."""
        if depth > _DEEPEST:
            raise RecursionError
        if id(node) not in self.made:
            self.made[id(node)] = _UNFINISHED
            self.made[id(node)] = self._make(node, path, depth)
        if self.made[id(node)] is _UNFINISHED:
            raise yaml.constructor.ConstructorError(None, None, "found a list or mapping in itself", node.start_mark)
        return self.made[id(node)]

    def _make(self, node: yaml.Node, path: str, depth: int) -> Any:
        if isinstance(node, yaml.MappingNode) and node.tag == _MAP:
            return self._mapping(node, path, depth)
        if isinstance(node, yaml.SequenceNode) and node.tag == _SEQ:
            values = []
            for index, item in enumerate(node.value):
                if not isinstance(item, yaml.ScalarNode):  # those are many, and told by the line of their list
                    self.lines[f"{path}[{index}]"] = item.start_mark.line + 1
                values.append(self.value(item, f"{path}[{index}]", depth + 1))
            return values
        try:
            return self.loader.construct_object(node, deep=True)
        except (ValueError, LookupError, TypeError, OverflowError):  # `!!int three`, a number of 5000 digits
            self._wrong(node, path, "cannot be read; give a plain number, word or list")

    def _mapping(self, node: yaml.MappingNode, path: str, depth: int) -> dict[str, Any]:
        values, first = {}, {}
        for name, content in node.value:
            if not isinstance(name, yaml.ScalarNode):
                self._wrong(name, path, "the key is not a plain word; give lines of `key: value`")
            key = f"{path}.{name.value}" if path else str(name.value)
            if name.value in first:
                self._wrong(name, key, f"given twice, first on line {first[name.value]}; keep one")
            self.lines[key] = first[name.value] = name.start_mark.line + 1
            values[name.value] = self.value(content, key, depth + 1)
        return values

    def _wrong(self, node: yaml.Node, path: str, problem: str) -> NoReturn:
        raise FieldError(path, problem, f"{self.source}:{node.start_mark.line + 1}: ")
