"""Planners and their registry. The classes live in their own modules, so that importing this imports no JAX."""

from maipp.planners.registry import (
    find_planner,
    make_planner,
    planner_class,
    planner_names,
    planner_note,
    planner_options,
    planner_summary,
    register,
)

__all__ = [
    "find_planner",
    "make_planner",
    "planner_class",
    "planner_note",
    "planner_names",
    "planner_options",
    "planner_summary",
    "register",
]
