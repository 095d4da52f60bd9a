"""What a run tells along the way: one JSON line per update and evaluation, and TensorBoard's scalars if installed."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from maipp.errors import InputError
from maipp.files import write_atomic

LOG = "log.jsonl"


class TrainingLog:
    """Writes OUT/log.jsonl, and OUT/tensorboard where tensorboardX is installed."""

    def __init__(self, out: Path, *, updates: int, evaluated: int) -> None:
        """Go on after `updates` updates and the evaluation at `evaluated` (-1: none): later lines are dropped."""
        path = out / LOG
        kept = [line for line in read_log(out) if line["update"] <= (evaluated if "evaluation" in line else updates)]
        write_atomic(path, "".join(_line(line) for line in kept))
        try:
            self._file = open(path, "a", encoding="utf-8")  # noqa: SIM115  # open as long as the run
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error
        self._board = _board(out / "tensorboard", updates)

    def write(self, row: Mapping[str, Any]) -> None:
        """Add one line; NaN and infinite numbers become null, which JSON has."""
        self._file.write(_line(row))
        self._file.flush()
        if self._board is not None:
            evaluation = row.get("evaluation")
            scalars = {f"evaluation/{k}": v for k, v in evaluation.items()} if evaluation else row
            for name, value in scalars.items():
                if isinstance(value, int | float) and name != "update":
                    self._board.add_scalar(name, value, row["update"])

    def close(self) -> None:
        """Close the files."""
        self._file.close()
        if self._board is not None:
            self._board.close()


def read_log(out: Path) -> list[dict[str, Any]]:
    """The lines of a run's log, oldest first; the last one is left out if a kill cut it short."""
    try:
        lines = (out / LOG).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return []
    rows = []
    for line in lines:
        try:
            rows.append(json.loads(line))
        except ValueError:
            continue
    return rows


def _line(row: Mapping[str, Any]) -> str:
    return json.dumps(_finite(row), allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _board(folder: Path, updates: int) -> Any:
    """TensorBoard's writer, which hides what an earlier life of the run wrote after `updates`; None without it."""
    try:
        from tensorboardX import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter(str(folder), purge_step=updates + 1)
