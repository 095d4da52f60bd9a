"""What robots announced and their planners remember, carried over to a survey that was changed."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from maipp.live.robot_state import RobotState

Pair = tuple[Any, Any]  # an empty message and an initial memory, as the planner has them


def carried(
    robots: Sequence[RobotState], before: Pair, after: Pair, agents: tuple[int, int], fresh: bool
) -> tuple[list[RobotState], list[str]]:
    """The robots in a survey whose planner begins with `after` instead of `before`, and what they had to forget.

    `agents` are the robots before and after. Memories with a row for each robot get rows for new ones. What has another
    form by then begins anew, and so does every memory if it is to be `fresh`.
    """
    forgot: set[str] = set()

    def message_of(message: Any) -> Any:
        if _shapes(message) == _shapes(after[0]):
            return message
        forgot.add("messages")
        return after[0]

    def memory_of(memory: Any) -> Any:
        kept = None if fresh else _widened(memory, before[1], after[1], agents)
        if kept is None and jax.tree.leaves(after[1]):
            forgot.add("memories")
        return after[1] if kept is None else kept

    changed = []
    for robot in robots:
        other = robot.copy()
        other.message = message_of(robot.message)
        if robot.arrivals == 0:  # there is nothing to forget
            other.memory = after[1]
        else:
            other.memory, other.earlier = memory_of(robot.memory), memory_of(robot.earlier)
        changed.append(other)
    return changed, sorted(forgot) if any(robot.arrivals for robot in robots) else []


def _shapes(tree: Any) -> list[tuple[int, ...]]:
    return [np.shape(leaf) for leaf in jax.tree.leaves(tree)]


def _widened(memory: Any, before: Any, after: Any, agents: tuple[int, int]) -> Any:
    """The memory with rows of `after` for the robots that are new; None where its form is another one altogether."""
    leaves, structure = jax.tree.flatten(memory)
    rows = []
    for leaf, old, new in zip(leaves, jax.tree.leaves(before), jax.tree.leaves(after), strict=True):
        old, new = np.asarray(old), np.asarray(new)
        if old.shape == new.shape:
            rows.append(leaf)
        elif old.ndim and (old.shape[0], new.shape[0]) == agents and old.shape[1:] == new.shape[1:]:
            rows.append(np.concatenate([np.asarray(leaf), new[agents[0] :]]))
        else:
            return None
    return jax.tree.unflatten(structure, rows)
