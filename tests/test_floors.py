"""The floors: which module may import which, and what from outside (docs/architecture.md).

Only the source is read, nothing is imported: an import inside a function or under `TYPE_CHECKING` counts too.
"""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]

FLOORS = (
    ("typing", "errors", "extensions", "cgroup", "devices", "files", "kept", "markdown", "records", "renamed", "seeds"),
    ("geo", "per_agent", "scenario", "scenario_io", "problem"),
    ("fields", "belief", "roadmap", "team"),
    ("engine",),
    ("foresight", "policy", "viz", "route_files", "environments", "adapters"),
    ("planners",),
    ("training",),
    ("bench", "surveys", "live", "results", "fleet"),
    ("cli", "__main__"),
)
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}

# Where the name to import is not the name to install.
IMPORT_NAMES = {
    "eclipse-zenoh": "zenoh",
    "pyyaml": "yaml",
    "pillow": "PIL",
    "scikit-learn": "sklearn",
    "tensorboardx": "tensorboardX",
}

IMPORT_CALLS = ("importlib.import_module", "import_module", "__import__")


class Import(NamedTuple):
    """One import: `importer` is a module of maipp, `imported` a module of maipp or an outside package."""

    importer: str
    imported: str
    where: str  # path:line
    at_import_time: bool  # False inside a function or under TYPE_CHECKING


def modules(package: Path) -> dict[str, Path]:
    """Dotted name of every module below `package`, with its file; a package goes by its own name."""
    names = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package.parent).with_suffix("").parts
        names[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return names


def nodes(tree: ast.AST, at_import_time: bool = True) -> Iterator[tuple[ast.AST, bool]]:
    """Every node below `tree`, and whether it runs when the module is imported."""
    for child in ast.iter_child_nodes(tree):
        lazy = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) or (
            isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)
        )
        yield child, at_import_time
        yield from nodes(child, at_import_time and not lazy)


def targets(node: ast.AST, name: str, is_package: bool) -> list[tuple[str, str | None]]:
    """What an import names, as (module, name in it or None), with relative imports made absolute."""
    if isinstance(node, ast.Import):
        return [(alias.name, None) for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        base = node.module or ""
        if node.level:
            parts = name.split(".")
            parents = parts[: len(parts) - node.level + is_package]
            base = ".".join([*parents, base] if base else parents)
        return [(base, alias.name) for alias in node.names]
    if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
        argument = node.args[0].value
        if ast.unparse(node.func) in IMPORT_CALLS and isinstance(argument, str):
            return [(argument, None)]
    return []


def imports(package: Path) -> list[Import]:
    """Every import made below `package`, in the order of files and lines."""
    known = modules(package)
    found = []
    for importer, path in known.items():
        for node, at_import_time in nodes(ast.parse(path.read_text(encoding="utf-8"))):
            for module, member in targets(node, importer, path.name == "__init__.py"):
                submodule = f"{module}.{member}"
                where = f"{path.relative_to(package.parent)}:{getattr(node, 'lineno', 0)}"
                found.append(Import(importer, submodule if submodule in known else module, where, at_import_time))
    return found


def room(module: str) -> str:
    """The second part of a dotted name: `maipp.belief.kernel` lives in `belief`; the root has none."""
    return (module.split(".") + [""])[1]


def inside(package: Path) -> list[Import]:
    """The imports of one module of `package` by another."""
    return [i for i in imports(package) if i.imported.split(".")[0] == package.name]


def floor(module: str) -> int:
    """The floor a module lives on. The root re-exports everything: only the highest floor may import it."""
    return FLOOR.get(room(module), len(FLOORS) - 1)


def climbing(package: Path) -> list[str]:
    """A line for every import from a floor above."""
    return [
        f"{i.where}: floor {floor(i.importer)} imports {i.imported} from floor {floor(i.imported)}"
        for i in inside(package)
        if floor(i.imported) > floor(i.importer)
    ]


def circle(package: Path) -> list[str]:
    """The modules of one import circle, the first repeated at the end; empty if there is none."""
    edges: dict[str, list[str]] = {}
    for i in inside(package):
        edges.setdefault(i.importer, []).append(i.imported)
    done: set[str] = set()

    def walk(module: str, path: list[str]) -> list[str]:
        if module in path:
            return [*path[path.index(module) :], module]
        if module not in done:
            for imported in edges.get(module, []):
                if found := walk(imported, [*path, module]):
                    return found
            done.add(module)
        return []

    return next((found for module in sorted(edges) if (found := walk(module, []))), [])


def undeclared(package: Path, core: set[str], extras: set[str]) -> list[str]:
    """A line for every outside package that a plain installation would miss.

    Core dependencies may be imported anywhere; extras inside functions, and at the top of a module only in
    adapters/, whose modules exist to join maipp to that package; the rest (development tools too) nowhere.
    """
    found = []
    for i in imports(package):
        top = i.imported.split(".")[0]
        if top == package.name or top in core or top in sys.stdlib_module_names:
            continue
        if top not in extras:
            found.append(
                f"{i.where}: {top} is no dependency, nor in the extras geo, gis, rl, fleet, mavlink, cluster, train"
            )
        elif i.at_import_time and (room(i.importer) != "adapters" or i.importer.count(".") == 1):
            found.append(f"{i.where}: {top} is an extra: import it in the function that needs it")
    return found


def import_names(requirements: list[str]) -> set[str]:
    """The names that the requirements are imported by."""
    names = (re.split(r"[^\w.-]", requirement)[0].lower() for requirement in requirements)
    return {IMPORT_NAMES.get(name, name) for name in names}


PACKAGE = ROOT / "src" / "maipp"


def test_every_room_has_a_floor():
    rooms = {room(module) for module in modules(PACKAGE)} - {""}
    assert rooms, "no modules found"
    assert rooms <= FLOOR.keys(), f"give {sorted(rooms - FLOOR.keys())} a floor here and in docs/architecture.md"


def test_imports_name_modules_that_exist():
    known = modules(PACKAGE)
    assert [f"{i.where}: no module {i.imported}" for i in inside(PACKAGE) if i.imported not in known] == []


def test_no_import_climbs():
    assert climbing(PACKAGE) == []


def test_no_import_circle():
    assert circle(PACKAGE) == []


def test_a_plain_installation_is_enough_to_import():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [
        line
        for extra in ("geo", "gis", "rl", "fleet", "mavlink", "cluster", "train")
        for line in project["optional-dependencies"][extra]
    ]
    assert undeclared(PACKAGE, import_names(project["dependencies"]), import_names(extras)) == []


# The rules must be able to fail: each is tried on a small package that breaks it, and on one that does not.


def build(folder: Path, files: dict[str, str]) -> Path:
    """A package maipp in `folder` with these files."""
    for name, text in files.items():
        path = folder / "maipp" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder / "maipp"


ROOMS = {
    "__init__.py": "",
    "belief/__init__.py": "",
    "cli/__init__.py": "",
    "planners/__init__.py": "",
    "errors.py": "",
}


@pytest.mark.parametrize(
    "line",
    [
        "from maipp.planners import greedy",
        "from ..planners.greedy import Greedy",
        "from .. import planners",
        "import maipp.cli",
        "import maipp",
        "from maipp import Scenario",
        "def later():\n    from maipp.cli import main",
        "if TYPE_CHECKING:\n    import maipp.planners",
        "importlib.import_module('maipp.planners')",
    ],
)
def test_an_import_from_above_is_found(tmp_path, line):
    package = build(tmp_path, ROOMS | {"belief/kernel.py": line})
    assert len(climbing(package)) == 1


@pytest.mark.parametrize(
    "line",
    [
        "from maipp.errors import InputError",
        "from ..errors import InputError",
        "from . import kernel",
        "import jax",
    ],
)
def test_an_import_from_below_is_allowed(tmp_path, line):
    package = build(tmp_path, ROOMS | {"belief/posterior.py": line, "belief/kernel.py": ""})
    assert climbing(package) == [] and circle(package) == []


def test_a_package_may_reexport_its_modules(tmp_path):
    files = {
        "__init__.py": "from maipp.belief import Posterior",
        "belief/__init__.py": "from .posterior import Posterior",
        "belief/posterior.py": "from maipp.belief.kernel import matern",
        "belief/kernel.py": "",
    }
    package = build(tmp_path, files)
    assert climbing(package) == [] and circle(package) == []


def test_a_circle_is_found(tmp_path):
    files = {
        "fields/raster.py": "from maipp.belief import kernel",
        "belief/kernel.py": "import maipp.roadmap.prm",
        "roadmap/prm.py": "def later():\n    from maipp.fields.raster import Raster",
    }
    found = circle(build(tmp_path, files))
    assert found[0] == found[-1] and set(found) == {
        "maipp.fields.raster",
        "maipp.belief.kernel",
        "maipp.roadmap.prm",
    }


@pytest.mark.parametrize(
    ("file", "line", "allowed"),
    [
        ("fields/raster.py", "import rasterio", False),
        ("fields/raster.py", "def read(path):\n    import rasterio.io", True),
        ("fields/raster.py", "class Reader:\n    import rasterio", False),
        ("adapters/gym.py", "import rasterio", True),
        ("adapters/__init__.py", "import rasterio", False),
        ("fields/raster.py", "import numpy.linalg, os", True),
        ("fields/raster.py", "def read(path):\n    import pytest", False),
        ("adapters/gym.py", "from sklearn import cluster", False),
    ],
)
def test_only_declared_packages_are_imported(tmp_path, file, line, allowed):
    found = undeclared(build(tmp_path, {file: line}), core={"numpy"}, extras={"rasterio"})
    assert len(found) == (0 if allowed else 1)
