"""The house's one way of reading and writing YAML: the scalars of YAML 1.2, no tags, errors that name file and line."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import yaml

from maipp.errors import InputError

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

# Brackets within brackets that are read.
_DEEPEST = 100


class Loader(yaml.SafeLoader):
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
Loader.add_constructor("tag:yaml.org,2002:int", _decimal)
for _tag, _pattern, _first in _SCALARS:
    for _class in (Loader, _Dumper):
        _class.add_implicit_resolver(_tag, re.compile(rf"^(?:{_pattern})$"), _first)


def dump_yaml(value: Any) -> str:
    """The value as YAML: mappings in lines, lists of scalars in brackets."""
    return yaml.dump(value, Dumper=_Dumper, default_flow_style=None, allow_unicode=True, sort_keys=False, width=10**9)


@contextmanager
def read_mapping(text: str, source: str, *, empty: str, line: str, deep: str) -> Iterator[tuple[Loader, Any]]:
    """The loader, and the root node of the mapping that the text holds, still to be read.

    Raises `InputError` for what is not YAML, in the block too, and for what is no mapping; `empty`, `line` (such as
    `key: value`) and `deep` say what would be right.
    """
    try:
        loader = Loader(text)
        root = loader.get_single_node()
        if root is None or (isinstance(root, yaml.ScalarNode) and not root.value):
            raise InputError(f"{source}: empty file; {empty}")
        if not isinstance(root, yaml.MappingNode):
            raise InputError(f"{source}:{root.start_mark.line + 1}: not a mapping; give lines of `{line}`")
        yield loader, root
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"{source}:{mark.line + 1}" if mark else source
        raise InputError(f"{where}: not valid YAML: {' '.join(str(error.problem or error.context).split())}") from None
    except yaml.reader.ReaderError as error:
        number = text.count("\n", 0, error.position) + 1
        raise InputError(f"{source}:{number}: not valid YAML: {error.reason}") from None
    except RecursionError:
        raise InputError(f"{source}: nested too deeply; {deep}") from None


def read_pairs(text: str, source: str, *, empty: str) -> list[tuple[str, Any, int]]:
    """Key, value and line number of every pair of the mapping that the text holds, duplicates included.

    Raises `InputError` with `source` and line for what is not YAML or no mapping; `empty` says where to find one.
    """
    pairs = []
    deep = "three levels at most are needed"
    with read_mapping(text, source, empty=empty, line="field: value", deep=deep) as (loader, root):
        for key, content in root.value:
            number = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                raise InputError(f"{source}:{number}: the key is not a plain word; give lines of `field: value`")
            try:
                pairs.append((key.value, loader.construct_object(content, deep=True), number))
            except (ValueError, KeyError, IndexError):  # `!!int three`, `!!float ""`, or a number of 5000 digits
                problem = "cannot be read; give a plain number, word or list"
                raise InputError(f"{source}:{number}: {key.value}: {problem}") from None
    return pairs
