"""Training configurations as YAML files, by name, and with single values overridden."""

import dataclasses
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from maipp.errors import InputError
from maipp.files import read_text
from maipp.records import Value, assignments, dump_yaml, read_yaml
from maipp.training.config import NAMED


class ConfigKind(NamedTuple):
    """A kind of configuration: those with names, `default` among them, and the page that lists the keys."""

    named: Mapping[str, Any]
    page: str

    @property
    def keys(self) -> tuple[str, ...]:
        """Of any of them."""
        return tuple(each.name for each in dataclasses.fields(self.named["default"]))


POLICY = ConfigKind(NAMED, "docs/training-keys.md")


def find_config(name: str, kind: ConfigKind = POLICY) -> Any:
    """The configuration of that name, or the one in that YAML file.

    Raises InputError where there is neither, and with file, line and key for what is wrong in a file.
    """
    if name in kind.named:
        return kind.named[name]
    if Path(name).suffix in (".yaml", ".yml") or os.path.exists(name):
        return load_config(name, kind)
    raise InputError(f"--config {name}: no such configuration; there are {', '.join(kind.named)}, or give a .yaml file")


def load_config(path: str | os.PathLike[str], kind: ConfigKind = POLICY) -> Any:
    """The configuration in a YAML file; keys left out are as in `default`.

    Raises InputError with the file, the line and the key of what is wrong.
    """
    return parse_config(read_text(path, "configuration", "a YAML file"), source=str(path), kind=kind)


def parse_config(text: str, *, source: str = "training", kind: ConfigKind = POLICY) -> Any:
    """The configuration in YAML text; errors name `source`."""
    root = read_yaml(text, source, empty=f"{kind.page} lists the keys")
    return root.make(kind.named["default"].replace, root.mapping(kind.keys))


def override(config: Any, settings: Iterable[str]) -> Any:
    """The configuration with `key=value` texts applied. Raises InputError for the first that does not fit."""
    typed = Value(assignments([settings]), "--set")
    return typed.make(config.replace, typed.mapping(tuple(config.__dataclass_fields__)))


def config_to_dict(config: Any) -> dict[str, Any]:
    """Every key as plain numbers, strings and lists, ready for YAML or JSON."""
    values = dataclasses.asdict(config)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}


def dump_config(config: Any) -> str:
    """The full configuration as YAML."""
    return "".join(dump_yaml({key: value}) for key, value in config_to_dict(config).items())
