"""What a result was made by: two results with the same fingerprint are the same numbers, on the same machine."""

import ast
import hashlib
import importlib.util
import inspect
from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.benchmarks.machine import versions
from maipp.engine import Planner

# What every survey runs through, whoever plans it.
_SIMULATION = ("maipp.engine.mission", "maipp.engine.rollout", "maipp.engine.score", "maipp.benchmarks.evaluate")


def planner_fingerprint(planner: Planner) -> dict[str, Any]:
    """The versions, the precision, the code and the weights that decide what a planner's surveys come to."""
    kind = type(planner)
    return {
        "versions": versions(),
        "backend": jax.default_backend(),
        "precision": str(jnp.result_type(float)),
        "code": code_digest((*_SIMULATION, kind.__module__)),
        "file": "" if kind.__module__.startswith("maipp.") else _digest([Path(inspect.getfile(kind)).read_bytes()]),
        "weights": weights_digest(planner),
    }


def weights_digest(planner: Planner) -> str:
    """A digest of the planner's arrays; empty where it has none."""
    leaves = jax.tree.leaves(eqx.filter(planner, eqx.is_array))
    return _digest(np.asarray(leaf).tobytes() for leaf in leaves) if leaves else ""


@lru_cache(maxsize=64)
def code_digest(modules: tuple[str, ...]) -> str:
    """A digest of what these modules and all modules of maipp that they import do, comments and docstrings aside."""
    todo, seen = list(modules), set()
    while todo:
        name = todo.pop()
        path = _source(name)
        if path is not None and name not in seen:
            seen.add(name)
            todo += _imported(name, path)
    return _digest(text for name in sorted(seen) for text in (name.encode(), _bare(_source(name))))


def _digest(parts: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:16]


@lru_cache(maxsize=1024)
def _source(name: str) -> Path | None:
    """The file of a module of maipp; None for anything else, such as a class in a module."""
    if name.split(".")[0] != "maipp":
        return None
    try:
        found = importlib.util.find_spec(name)
    except ModuleNotFoundError:  # its parent is no package
        return None
    return Path(found.origin) if found is not None and found.origin else None


def _imported(name: str, path: Path) -> Iterator[str]:
    """What a module imports, inside functions too; of the re-exports above a module nothing."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                module = f"{node.module}.{alias.name}"
                yield module if _source(module) else node.module


def _bare(path: Path | None) -> bytes:
    """The module's syntax tree without docstrings."""
    assert path is not None  # only modules that have a source are asked for
    tree = ast.parse(path.read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node, clean=False):
            node.body = node.body[1:]
    return ast.dump(tree).encode()
