"""The networks that come with the package, and how a planner's `weights` option names one."""

from functools import lru_cache
from importlib.resources import files
from os import PathLike
from pathlib import Path

import jax

from maipp.errors import InputError
from maipp.policy.network import PolicyNetwork
from maipp.policy.weights import load_weights

SHIPPED = ("ti", "sga-catnipp")
UNTRAINED = "untrained"
BEST = "best.safetensors"  # in the folder of a training run


def load_policy(name: str | PathLike[str]) -> PolicyNetwork:
    """The trained network of this name, or of a file or run folder that `maipp train` wrote.

    There are `ti` (for `di`, `ti`, `ti-star`, `intent-paths`) and `sga-catnipp`; of a run folder the best are taken.
    Raises InputError for another name, where this copy of the package came without the weights, and for what is no
    such file.
    """
    if name not in SHIPPED:
        folder = Path(name)
        return network_named(str(folder / BEST if (folder / BEST).is_file() else name))
    name = str(name)
    path = shipped_file(name)
    if not path.exists():
        raise InputError(f"weights {name!r}: this copy of maipp has none; give a .safetensors file, or {UNTRAINED}")
    return _load(str(path))


def shipped_file(name: str) -> Path:
    """Where the package keeps the weights of this name, whether they are there or not."""
    return Path(str(files("maipp") / "policy" / "trained" / f"{name}.safetensors"))


def network_named(weights: str) -> PolicyNetwork:
    """The network that `weights` means: a shipped name, a .safetensors file, or `untrained` (random, seed 0).

    Raises InputError where there is none.
    """
    if weights == UNTRAINED:
        return _untrained()
    if weights in SHIPPED:
        return load_policy(weights)
    if weights.endswith(".safetensors"):
        return load_weights(Path(weights))[0]
    raise InputError(f"weights {weights!r}: give {', '.join(SHIPPED)}, {UNTRAINED}, or a .safetensors file")


@lru_cache(maxsize=4)
def _load(path: str) -> PolicyNetwork:
    return load_weights(path)[0]


@lru_cache(maxsize=1)
def _untrained() -> PolicyNetwork:
    return PolicyNetwork(jax.random.key(0))
