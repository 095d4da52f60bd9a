"""Planners by name: one line each, imported only when used."""

import dataclasses
import hashlib
import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from maipp.errors import InputError
from maipp.extensions import PLANNERS, extension, extensions
from maipp.planners.options import options_of, read_options
from maipp.records import Field, unknown
from maipp.scenario import Scenario

if TYPE_CHECKING:
    import maipp.engine.decision


class Registered(NamedTuple):
    """A planner that has a name."""

    name: str
    target: "str | type"  # `package.module:Class`, `path/to/file.py:Class`, or the class itself
    summary: str
    presets: Mapping[str, Any]  # options that differ from the class's defaults


_REGISTERED: dict[str, Registered] = {}


def register(name: str, target: "str | type", *, summary: str = "", **presets: Any) -> None:
    """Give a planner class a name, with some of its options preset; a name that exists is replaced.

    `target` is the class or, so that it is imported only when used, `package.module:Class` or `path/to/file.py:Class`.
    Raises `InputError` for a name that the command line could not tell from a target.
    """
    if not name or ":" in name or any(c.isspace() for c in name):
        raise InputError(f"planner name {name!r}: give a word without colons and spaces, such as my-planner")
    _REGISTERED[name] = Registered(name, target, summary, presets)


register("random", "maipp.planners.random_walk:RandomWalk", summary="uniform random walk on the roadmap")
register("greedy", "maipp.planners.greedy:Greedy", summary="roadmap step that lowers Tr(P) most, others ignored")
register(
    "shared-greedy", "maipp.planners.greedy:Greedy", summary="greedy, counting the others' next nodes", shared=True
)
register("lawnmower", "maipp.planners.lawnmower:Lawnmower", summary="parallel rows, one strip per agent")
register("sga-rrt", "maipp.planners.sga_rrt:SgaRrt", summary="best branch of a random tree, agents in sequence")
register(
    "receding-horizon",
    "maipp.planners.receding_horizon:RecedingHorizon",
    summary="next legs by gradient in the plane; joint=true: all agents together",
)
register(
    "foresight",
    "maipp.planners.receding_horizon:RecedingHorizon",
    summary="receding-horizon that foresees the field, and goes to what is likely of interest",
    foresight="learned",
)

register("sga-catnipp", "maipp.planners.sga_catnipp:SgaCatnipp", summary="policy without intents, agents in sequence")
_INTENT = "maipp.planners.intent:IntentPlanner"
register("di", _INTENT, summary="policy; intent over where sampled paths end", intent="destination", steps=3)
register("ti", _INTENT, summary="policy; intent over all nodes of sampled paths")
_STAR = {"choose": "best", "rank": "expected", "share": "best", "distinct": True, "keep": True}
register("ti-star", _INTENT, summary="as ti, and goes along the best of the sampled paths", **_STAR)
register(
    "intent-search",
    "maipp.planners.intent_search:IntentSearch",
    summary="paths of the policy and random plans, the best refined by gradient in the plane",
)


def planner_names() -> tuple[str, ...]:
    """The names of all planners: those registered, in that order, then those of other installed packages."""
    return (*_REGISTERED, *(name for name in extensions(PLANNERS) if name not in _REGISTERED))


def find_planner(name: str | type) -> Registered:
    """The planner of that name, or the unnamed one that `path/to/file.py:Class` or `package.module:Class` points to.

    A class stands for itself; a name is one that was registered, or that an installed package brings as an entry point
    of `maipp.planners`.

    Raises `InputError` for an unknown name; that a target exists is only known once it is imported.
    """
    if isinstance(name, type):
        return Registered(name.__name__, name, "", {})
    if name in _REGISTERED:
        return _REGISTERED[name]
    if ":" in name:
        return Registered(name, name, "", {})
    brought = extension(PLANNERS, name, f"planner {name}")
    if brought is not None:
        return Registered(name, brought.thing, "", {})
    raise InputError(f"{unknown('planner', name, list(planner_names()))}, or path/to/file.py:ClassName")


def planner_class(name: str | type) -> "type[maipp.engine.decision.Planner]":
    """The class behind a planner's name. Raises `InputError` where it cannot be imported or is no planner."""
    from maipp.engine.decision import Planner

    name, target = find_planner(name)[:2]
    found = _import_target(name, target) if isinstance(target, str) else target
    if not (isinstance(found, type) and issubclass(found, Planner)):
        raise InputError(f"planner {name}: it is no planner; give a subclass of maipp.engine.Planner")
    return found


def planner_options(name: str) -> tuple[Field, ...]:
    """The options of a planner, with what its name presets as their defaults."""
    return options_of(planner_class(name), find_planner(name).presets)


def planner_summary(name: str) -> str:
    """What a planner does, on one line: as registered, else the first line of its class's docstring."""
    return find_planner(name).summary or (inspect.getdoc(planner_class(name)) or "").partition("\n")[0]


def make_planner(
    name: str | type, scenario: Scenario, options: Mapping[str, object] | None = None
) -> "maipp.engine.decision.Planner":
    """The planner of that name for a scenario.

    `name` is a registered one, `path/to/file.py:Class`, `package.module:Class`, or the class itself. Options are given
    as values or as text (`{"lengths": "0.3,0.4"}`). Raises `InputError` for an unknown name or option and for a value
    that does not fit or that the planner's own `check` refuses.
    """
    kind = planner_class(name)
    found = find_planner(name)
    where = f"planner {found.name}"
    values = read_options(kind, options or {}, found.presets, where=where)
    own = {field.name for field in dataclasses.fields(kind)}
    try:
        inspect.signature(kind).bind(scenario, **{key: value for key, value in values.items() if key in own})
    except TypeError as error:  # fields that are no options, without defaults
        raise InputError(f"{where}: {error}; give the field a default, or make it an option") from None
    try:
        planner = kind.of(scenario, **values)
        for each in (*planner.parts, planner):
            getattr(each, "check", bool)()
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    return planner


def _import_target(name: str, target: str) -> object:
    """What a target points to."""
    module_name, _, class_name = target.rpartition(":")
    if module_name.endswith(".py"):
        module = _import_file(name, Path(module_name))
    else:
        try:
            module = importlib.import_module(module_name)
        except ImportError as error:
            raise InputError(f"planner {name}: cannot import {module_name}: {error}") from error
        except ValueError:  # an empty module name
            raise InputError(f"planner {name}: no module before the colon; give path/to/file.py:ClassName") from None
    if not hasattr(module, class_name):
        classes = [key for key, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__]
        raise InputError(f"planner {name}: {unknown('class', class_name, classes)}")
    return getattr(module, class_name)


def _import_file(name: str, path: Path) -> Any:
    """The module in a file, run once: a class made twice would be compiled twice."""
    if not path.is_file():
        raise InputError(f"planner {name}: no file {path}")
    path = path.resolve()
    module_name = f"maipp_planner_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    if module_name in sys.modules:
        return sys.modules[module_name]
    spec = importlib.util.spec_from_file_location(module_name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"planner {name}: {path} is not a Python file")
    module = sys.modules[module_name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[module_name]
        if not isinstance(error, Exception):
            raise
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
        line = lines[-1] if lines else getattr(error, "lineno", None)
        message = f"{type(error).__name__}: {getattr(error, 'msg', None) or error}".partition("\n")[0]
        raise InputError(f"planner {name}: {path}:{line or 1}: {message}") from error
    return module
