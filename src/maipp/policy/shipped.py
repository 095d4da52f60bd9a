"""The networks that come with the package, and how a planner's `weights` option names one."""

from functools import lru_cache
from importlib.resources import files
from pathlib import Path

import jax

from maipp.errors import InputError
from maipp.policy.network import PolicyNetwork
from maipp.policy.weights import load_weights

SHIPPED = ("ti", "sga-catnipp")
UNTRAINED = "untrained"


def load_policy(name: str) -> PolicyNetwork:
    """The trained network that ships under this name: `ti` (for `di`, `ti` and `ti-star`) or `sga-catnipp`.

    Raises InputError for another name, and where this copy of the package came without the weights.
    """
    if name not in SHIPPED:
        raise InputError(f"weights {name!r}: none ship under this name; there are {', '.join(SHIPPED)}")
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
