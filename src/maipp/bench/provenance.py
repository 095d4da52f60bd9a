"""What a result was made by: machine, versions, code and weights.

Two results with the same fingerprint are the same numbers, on the same machine; without the machine neither times nor
last digits mean much. What code a module runs (its own file, and the files of what it imports) is found without
importing anything.
"""

import ast
import hashlib
import importlib.metadata
import importlib.util
import inspect
import platform
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from importlib.machinery import PathFinder
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.devices import core_count
from maipp.engine import Planner
from maipp.errors import InputError

PACKAGES = ("maipp", "jax", "jaxlib", "equinox", "numpy")


def versions() -> dict[str, str]:
    """Version of Python and of the packages that decide the numbers."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:  # run from a source tree
            found[package] = "unknown"
    return found


def cpu_model() -> str:
    """The processor's name, or its architecture where the system does not tell."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def machine() -> dict[str, Any]:
    """Processor, cores, system, and the devices and precision that JAX uses."""
    devices = jax.local_devices()
    return {
        "cpu": cpu_model(),
        "cores": core_count(),
        "system": platform.platform(),
        "backend": jax.default_backend(),
        "device": devices[0].device_kind,
        "devices": len(devices),
        "precision": str(jnp.result_type(float)),
    }


class Code(NamedTuple):
    """The modules that a result depends on."""

    own: dict[str, Path]  # by their names, those that may change without a new version
    outside: set[str]  # names imported from elsewhere


# What every survey runs through, whoever plans it.
SIMULATION = ("maipp.engine.mission", "maipp.engine.rollout", "maipp.engine.score", "maipp.bench.evaluate")

# Libraries of maipp that tabulate, draw, print, read text and cut areas from maps: no number of a mission comes from
# them.
_NO_NUMBERS = {"pandas", "matplotlib", "contourpy", "rich", "tyro", "pyyaml"}


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


def closure(start: Mapping[str, Path | None], is_own: Callable[[str], bool], *, parents: bool) -> Code:
    """The modules `start` and all those of the same kind that they import, inside functions too.

    `parents` counts the packages that a module lies in as well, which run when it is imported.
    """
    own: dict[str, Path] = {}
    outside, todo = set(), dict(start)
    while todo:
        name, path = todo.popitem()
        if path is None or name in own:
            continue
        own[name] = path
        if parents and "." in name:
            above = name.rpartition(".")[0]
            todo[above] = module_file(above)
        for imported in _imported(name, path):
            if is_own(imported):
                todo[imported] = module_file(imported)
            else:
                outside.add(imported)
    return Code(own, outside)


def user_code(kind: type) -> Code:
    """The files of a class that is not maipp's: of its bases, and of what these import that is no installed library.

    The package that the class lies in counts in full as its own, installed or not. Raises `OSError` or `TypeError`
    where a class has no file.
    """
    packages = {kind.__module__.partition(".")[0]}
    modules = {each.__module__: each for each in kind.__mro__ if _is_local(each.__module__, packages)}
    start = {name: Path(inspect.getfile(each)) for name, each in modules.items()}
    return closure(start, lambda name: _is_local(name, packages), parents=True)


def bare(path: Path) -> bytes:
    """The module's syntax tree without docstrings; of what is no Python source, all of it."""
    content = path.read_bytes()
    try:
        tree = ast.parse(content)
    except (SyntaxError, ValueError):
        return content
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node, clean=False):
            node.body = node.body[1:]
    return ast.dump(tree).encode()


@lru_cache(maxsize=4096)
def module_file(name: str) -> Path | None:
    """The file of a module; None for anything else, such as a class in a module or a folder without `__init__.py`."""
    top, *below = name.split(".")
    try:
        spec = importlib.util.find_spec(top)
    except ValueError:  # of what was not imported from a file
        return None
    path = top
    for part in below:
        path += f".{part}"
        if spec is None or spec.submodule_search_locations is None:
            return None
        spec = PathFinder.find_spec(path, list(spec.submodule_search_locations))
    return Path(spec.origin) if spec is not None and spec.origin and spec.has_location else None


def _is_local(name: str, packages: set[str]) -> bool:
    """Whether a module is neither maipp's, nor Python's, nor a library's; all those of `packages` are."""
    top = name.partition(".")[0]
    return top != "maipp" and (top in packages or not (top in sys.stdlib_module_names or top in _installed()))


@lru_cache(maxsize=1)
def _installed() -> Mapping[str, list[str]]:
    return packages_distributions()


def distributions(names: set[str]) -> set[str]:
    """The installed libraries that these modules belong to."""
    return {library for name in names for library in _installed().get(name.partition(".")[0], ())}


def _imported(name: str, path: Path) -> Iterator[str]:
    """What a module imports, inside functions too; of the re-exports above a module nothing."""
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):  # compiled
        return
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                module = f"{source}.{alias.name}"
                yield module if module_file(module) else source
