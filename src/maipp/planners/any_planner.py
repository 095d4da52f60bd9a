"""A planner in whichever form somebody has one: a name, a class, a planner, or a function."""

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import jax.numpy as jnp

from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.engine.options import parts_of
from maipp.errors import InputError
from maipp.planners.registry import make_planner
from maipp.scenario import Scenario
from maipp.typing import Key

AnyPlanner = str | type[Planner] | Planner | Callable[..., Any]


class FunctionPlanner(Planner):
    """Decides by a function of key, observation and memory; it tells the others nothing, and remembers nothing.

    The function gives the waypoints, (w, 2) or a single one of (2,), domain units, or a whole `Decision`.
    """

    def function(self, key: Key, observation: Observation, memory: PyTree) -> Any:
        """The function; a planner made of one has it in place of this."""
        raise NotImplementedError

    def decide(self, key: Key, observation: Observation, memory: PyTree) -> Decision:
        """What the function says."""
        told = self.function(key, observation, memory)
        return told if isinstance(told, Decision) else Decision(jnp.reshape(told, (-1, 2)), (), memory)


def given_planner(
    planner: AnyPlanner, scenario: Scenario, options: Mapping[str, object] | None = None
) -> tuple[str, Planner]:
    """The planner for a scenario, and a name for it; `options` as `make_planner` has them.

    A planner that was made for another scenario is made anew with the same options and weights. Raises `InputError`
    for what is no planner, for options that it does not have, and for those of one that is made already.
    """
    if isinstance(planner, str):
        return planner, make_planner(planner, scenario, options)
    if isinstance(planner, type):
        return _name(planner), make_planner(planner, scenario, options)
    if isinstance(planner, Planner):
        name = _name(type(planner))
        if options:
            raise InputError(f"planner {name}: is made already; give its class, or no options ({', '.join(options)})")
        made = planner if planner.scenario == scenario else _made_for(scenario, planner)
        for each in (*made.parts, made):
            getattr(each, "check", bool)()
        return name, made
    if not callable(planner):
        raise InputError(f"planner: {planner!r:.60} is none; give a name, a class, a planner, or a function")
    if _decides(planner):
        return _name(planner), make_planner(_planner_of(planner), scenario, options)
    made = planner(scenario, **(options or {}))
    if not isinstance(made, Planner):
        kind = type(made).__name__
        raise InputError(f"planner {_name(planner)}: gives a {kind}; give a function that makes a planner, or decides")
    return _name(planner), made


def _made_for(scenario: Scenario, planner: Planner) -> Planner:
    """The planner and its parts for another scenario, with the options and arrays that they have."""
    parts = {name: dataclasses.replace(getattr(planner, name), scenario=scenario) for name in parts_of(type(planner))}
    return dataclasses.replace(planner, scenario=scenario, **parts)


def _name(thing: Any) -> str:
    return getattr(thing, "__name__", None) or type(thing).__name__


def _decides(function: Callable[..., Any]) -> bool:
    """Whether it takes key, observation and memory: three places, of which none needs a name."""
    try:
        inspect.signature(function).bind(None, None, None)
    except (TypeError, ValueError):
        return False
    return "scenario" not in inspect.signature(function).parameters


@lru_cache(maxsize=64)  # a class made twice would be compiled twice
def _planner_of(function: Callable[..., Any]) -> type[Planner]:
    """A class of planners that decide by a function; it counts as written where the function is."""
    body = {
        "function": lambda self, *inputs: function(*inputs),
        "__module__": getattr(function, "__module__", None) or "__main__",  # as what is typed into a prompt
        "__doc__": inspect.getdoc(function) or "Decides by a function.",
    }
    return type(_name(function), (FunctionPlanner,), body)
