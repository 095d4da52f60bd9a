"""The learned foresight's weights that come with the package, and files of others."""

from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated

from maipp.errors import InputError
from maipp.foresight.model import FieldModel
from maipp.policy.weights import StrPath, WeightsKind, load_weights
from maipp.records import Within

SHIPPED = "foresight"
FINAL = "final.safetensors"  # in the folder of a training run


@dataclass(frozen=True)
class _FieldModelArguments:
    """The arguments of `FieldModel` that a card names."""

    width: Annotated[int, Within(2, most=512)]
    depth: Annotated[int, Within(1, most=32)]


FORESIGHT = WeightsKind("maipp.foresight/1", _FieldModelArguments, FieldModel)


def shipped_file() -> Path:
    """Where the package keeps the weights, whether they are there or not."""
    return Path(str(files("maipp") / "foresight" / "trained" / f"{SHIPPED}.safetensors"))


def model_named(weights: StrPath | None = None) -> FieldModel:
    """The model that ships, or that of a .safetensors file or of a folder of `maipp train foresight`.

    Raises InputError where there is none.
    """
    if weights is not None:
        folder = Path(weights)
        return load_weights(folder / FINAL if (folder / FINAL).is_file() else folder, FORESIGHT)[0]
    path = shipped_file()
    if not path.exists():
        raise InputError(
            "foresight learned: this copy of maipp has no weights of it; `maipp train foresight` makes some"
        )
    return _shipped(str(path))


@lru_cache(maxsize=1)
def _shipped(path: str) -> FieldModel:
    return load_weights(path, FORESIGHT)[0]
