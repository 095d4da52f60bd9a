"""Training configurations as YAML files, by name, and with single values overridden."""

import dataclasses
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from maipp.errors import InputError
from maipp.files import read_text
from maipp.planners.options import read_options
from maipp.training.config import NAMED, TrainConfig
from maipp.yaml_text import dump_yaml, read_pairs


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
    config, lines = NAMED["default"], {}
    values: dict[str, Any] = {}
    for key, value, line in read_pairs(text, source, empty="docs/training.md lists the keys"):
        if key in lines:
            raise InputError(f"{source}:{line}: {key}: given twice, first on line {lines[key]}; keep one")
        lines[key] = line
        values |= _read({key: value}, f"{source}:{line}")
    try:
        return config.replace(**values)
    except InputError as error:
        raise InputError(f"{source}: {str(error).removeprefix('training: ')}") from None


def override(config: TrainConfig, assignments: Iterable[str]) -> TrainConfig:
    """The configuration with `key=value` texts applied. Raises InputError for the first that does not fit."""
    values: dict[str, Any] = {}
    for item in assignments:
        key, equals, value = item.partition("=")
        key = key.strip().replace("-", "_")
        if not (equals and key):
            raise InputError(f"--set {item}: not an assignment; give KEY=VALUE, such as seed=1")
        if key in values:
            raise InputError(f"--set {key}: given twice; keep one")
        values |= _read({key: value.strip()}, "--set")
    try:
        return config.replace(**values)
    except InputError as error:
        raise InputError(f"--set: {str(error).removeprefix('training: ')}") from None


def _read(given: Mapping[str, object], where: str) -> dict[str, Any]:
    """The values as the configuration has them."""
    try:
        read = read_options(TrainConfig, given, where=where)
    except OverflowError:  # a whole number of 400 digits
        raise InputError(f"{where}: {', '.join(given)}: a number is too large to compute with") from None
    return {key: read[key] for key in given}


def config_to_dict(config: TrainConfig) -> dict[str, Any]:
    """Every key as plain numbers, strings and lists, ready for YAML or JSON."""
    values = dataclasses.asdict(config)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}


def config_from_dict(values: Mapping[str, Any], *, source: str = "training") -> TrainConfig:
    """The configuration with these values; the inverse of `config_to_dict`."""
    return TrainConfig(**_read(values, source))


def dump_config(config: TrainConfig) -> str:
    """The full configuration as YAML."""
    return "".join(dump_yaml({key: value}) for key, value in config_to_dict(config).items())
