"""Training configurations as YAML files, by name, and with single values overridden."""

import dataclasses
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from maipp.errors import InputError
from maipp.files import read_text
from maipp.records import Value, assignments, dump_yaml, read_yaml
from maipp.training.config import NAMED, TrainConfig

_KEYS = tuple(TrainConfig.__dataclass_fields__)


def find_config(name: str) -> TrainConfig:
    """The configuration of that name, or the one in that YAML file.

    Raises InputError where there is neither, and with file, line and key for what is wrong in a file.
    """
    if name in NAMED:
        return NAMED[name]
    if Path(name).suffix in (".yaml", ".yml") or os.path.exists(name):
        return load_config(name)
    raise InputError(f"--config {name}: no such configuration; there are {', '.join(NAMED)}, or give a .yaml file")


def load_config(path: str | os.PathLike[str]) -> TrainConfig:
    """The configuration in a YAML file; keys left out are as in `default`.

    Raises InputError with the file, the line and the key of what is wrong.
    """
    return parse_config(read_text(path, "configuration", "a YAML file"), source=str(path))


def parse_config(text: str, *, source: str = "training") -> TrainConfig:
    """The configuration in YAML text; errors name `source`."""
    root = read_yaml(text, source, empty="docs/training.md lists the keys")
    return root.make(NAMED["default"].replace, root.mapping(_KEYS))


def override(config: TrainConfig, settings: Iterable[str]) -> TrainConfig:
    """The configuration with `key=value` texts applied. Raises InputError for the first that does not fit."""
    typed = Value(assignments([settings]), "--set")
    return typed.make(config.replace, typed.mapping(_KEYS))


def config_to_dict(config: TrainConfig) -> dict[str, Any]:
    """Every key as plain numbers, strings and lists, ready for YAML or JSON."""
    values = dataclasses.asdict(config)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}


def dump_config(config: TrainConfig) -> str:
    """The full configuration as YAML."""
    return "".join(dump_yaml({key: value}) for key, value in config_to_dict(config).items())
