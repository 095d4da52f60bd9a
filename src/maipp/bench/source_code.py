"""What code a module runs: its own file and the files of what it imports, found without importing anything."""

import ast
import importlib.util
import inspect
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from importlib.machinery import PathFinder
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import NamedTuple


class Code(NamedTuple):
    """The modules that a result depends on."""

    own: dict[str, Path]  # by their names, those that may change without a new version
    outside: set[str]  # names imported from elsewhere


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
