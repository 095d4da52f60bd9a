"""What a result was made by: two results with the same fingerprint are the same numbers, on the same machine."""

import hashlib
import importlib.metadata
import re
from collections.abc import Iterable
from contextlib import suppress
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.bench.machine import versions
from maipp.bench.source_code import Code, bare, closure, distributions, module_file, user_code
from maipp.engine import Planner
from maipp.errors import InputError

# What every survey runs through, whoever plans it.
SIMULATION = ("maipp.engine.mission", "maipp.engine.rollout", "maipp.engine.score", "maipp.bench.evaluate")

# Libraries of maipp that draw, print, read text and cut areas from maps: no number of a result comes from them.
_NO_NUMBERS = {"matplotlib", "contourpy", "rich", "tyro", "pyyaml"}


def planner_fingerprint(planner: Planner) -> dict[str, Any]:
    """The versions, the precision, the code and the weights that decide what a planner's surveys come to.

    Raises `InputError` for a planner of one's own whose code has no file.
    """
    kind = type(planner)
    try:
        theirs = user_code(kind)
    except (OSError, TypeError):  # typed into a prompt
        raise InputError(
            f"{kind.__name__}: its code has no file, so results of it and of its next form look alike; put it in one"
        ) from None
    ours = {name for name in (*theirs.outside, kind.__module__) if _is_ours(name)}
    return {
        "versions": versions() | library_versions() | _versions_of(distributions(theirs.outside)),
        "backend": jax.default_backend(),
        "precision": str(jnp.result_type(float)),
        "code": code_digest((*SIMULATION, *sorted(ours))),
        "file": _files_digest(theirs) if theirs.own else "",
        "weights": weights_digest(planner),
    }


def library_versions() -> dict[str, str]:
    """Versions of all libraries that maipp computes with."""
    try:
        required = importlib.metadata.requires("maipp") or []
    except importlib.metadata.PackageNotFoundError:  # run from a source tree
        return {}
    names = {re.split(r"[^\w.-]", each)[0].lower() for each in required if "extra ==" not in each}
    return _versions_of(names - _NO_NUMBERS)


def _versions_of(libraries: Iterable[str]) -> dict[str, str]:
    found = {}
    for name in sorted(libraries):
        with suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


def weights_digest(planner: Planner) -> str:
    """A digest of the planner's arrays; empty where it has none."""
    leaves = jax.tree.leaves(eqx.filter(planner, eqx.is_array))
    return _digest(np.asarray(leaf).tobytes() for leaf in leaves) if leaves else ""


@lru_cache(maxsize=64)
def code_digest(modules: tuple[str, ...]) -> str:
    """A digest of what these modules and all modules of maipp that they import do, comments and docstrings aside."""
    start = {name: module_file(name) for name in modules if _is_ours(name)}
    return _files_digest(closure(start, _is_ours, parents=False))


def _is_ours(name: str) -> bool:
    return name.partition(".")[0] == "maipp"


def _files_digest(code: Code) -> str:
    return _digest(text for name, path in sorted(code.own.items()) for text in (name.encode(), bare(path)))


def _digest(parts: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:16]
