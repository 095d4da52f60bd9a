"""Old names go on working for one release: whoever uses one gets a `DeprecationWarning` that says the new one.

`MODULES` holds the modules and rooms that have another name by now. What has another name within a module stands there:
`renamed(__name__, Old="New")`.
"""

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

# Of a room, what lies below it as well, unless that has a line of its own.
MODULES = {
    "maipp.adapters.survey": "maipp.adapters.base_env",
    "maipp.environments.whole": "maipp.environments.global_state",
    "maipp.live.survey": "maipp.live.live_survey",
    "maipp.missions": "maipp.route_files",
    "maipp.missions.files": "maipp.route_files.writer",
    "maipp.missions.vehicle": "maipp.route_files.vehicle_settings",
    "maipp.results.files": "maipp.results.result_files",
    "maipp.surveys.survey": "maipp.surveys.mission_file",
}


def renamed(module: str, **names: str) -> None:
    """Have a module give what old names stand for; the keywords are old names, their values the new ones."""
    attributes = vars(sys.modules[module])
    otherwise = attributes.get("__getattr__")

    def get(name: str) -> Any:
        if name in names:
            _warn(f"{module}.{name}", f"{module}.{names[name]}")
            return getattr(sys.modules[module], names[name])
        if otherwise is not None:
            return otherwise(name)
        raise AttributeError(f"module {module!r} has no attribute {name!r}")

    attributes["__getattr__"] = get


def _warn(old: str, new: str) -> None:
    """Tell whoever uses an old name: two calls up, the machinery of imports not counted."""
    warnings.warn(f"{old} is now {new}; the next release knows the new name only", DeprecationWarning, stacklevel=3)


class _OldModules:
    """A finder and loader of old modules: each is an empty one that gives what the new one holds."""

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> Any:
        return None if _moved(name) is None else ModuleSpec(name, self, is_package=True)  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> None:
        """An ordinary module."""

    def exec_module(self, module: ModuleType) -> None:
        new = importlib.import_module(_moved(module.__name__) or "")
        _warn(module.__name__, new.__name__)
        vars(module).update(__doc__=new.__doc__, __getattr__=lambda name: getattr(new, name))


def _moved(name: str) -> str | None:
    """Where a module has gone; None where no old name is that of it or of a room above it."""
    old = max((old for old in MODULES if f"{name}.".startswith(f"{old}.")), key=len, default=None)
    return None if old is None else MODULES[old] + name.removeprefix(old)


def serve_old_modules() -> None:
    """Have imports of old modules work, where nothing else finds them."""
    if not any(isinstance(finder, _OldModules) for finder in sys.meta_path):
        sys.meta_path.append(_OldModules())  # type: ignore[arg-type]
