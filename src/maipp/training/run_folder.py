"""The folder of a training run: who may write into it, and what is known of the run so far."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.training.checkpoint import latest_card
from maipp.training.config_io import config_to_dict, dump_config
from maipp.training.training_log import LOG

CHECKPOINTS, CONFIG = "checkpoints", "config.yaml"


class RunProgress(NamedTuple):
    """How far a run is; part of every checkpoint."""

    update: int = 0  # updates done
    transitions: int = 0
    wall_s: float = 0.0  # of all lives of the run, evaluations included
    evaluated: int = -1  # update of the last evaluation; -1 before the first
    best: Mapping[str, Any] | None = None  # the best evaluation, with its update
    last: Mapping[str, Any] | None = None  # the last one

    @classmethod
    def from_card(cls, card: Mapping[str, Any]) -> "RunProgress":
        """The record in a checkpoint's card."""
        return cls(**{name: card[name] for name in cls._fields})


def claim(out: Path, config: Any, *, resume: bool, writes: bool = True) -> None:
    """Make the folder that of this run.

    Raises InputError where it holds a run and `resume` is not set, or a run of another configuration.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; give a folder")
    if not writes:
        return
    card = latest_card(out / CHECKPOINTS)
    if not resume and (card is not None or (out / LOG).exists()):
        at = "" if card is None else f" (update {card['update']} of {card['config']['updates']})"
        raise InputError(f"{out}: holds a training run already{at}; --resume goes on with it, or give another folder")
    if card is not None:
        _check_same(out, card["config"], config_to_dict(config))
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out}: cannot be made: {error.strerror or error}") from error
    write_atomic(out / CONFIG, dump_config(config))


def _check_same(out: Path, before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    for key in dict.fromkeys([*before, *now]):
        if before.get(key) != now.get(key):
            raise InputError(
                f"{out}: the run there has {key} {before.get(key)}, this one {now.get(key)}; resume with the run's own "
                "configuration (leave --config and --set out), or give another folder"
            )
