"""What an environment's agents do and see: the options, and the layout of the numbers they are given."""

import math
from collections.abc import Mapping
from typing import NamedTuple, get_args

import jax.numpy as jnp
import numpy as np

from maipp.engine.reward import RewardKind
from maipp.errors import InputError
from maipp.problem import ScenarioLike
from maipp.scenario import Scenario
from maipp.typing import Array, Float

Bounds = tuple[float | Array, float | Array]  # of one column
Columns = Mapping[str, Bounds]

# Columns of the three blocks of an observation. Lengths are in longest sides of the extent.
OWN = ("x", "y", "ahead", "left", "remaining", "to_next", "trace", "area")
TEAM = ("heard", "x", "y", "told", "target_x", "target_y")
CANDIDATE = ("x", "y", "length", "mean", "std", "interest", "around", "announced", "allowed")

# Means are cut to this on either side, normalised field units: fields run from 0 to 1, and spaces need bounds.
MEAN_LIMIT = 10.0

ACTIONS = ("neighbour", "waypoint")
VIEWS = ("local", "graph")
REWARDS = get_args(RewardKind)
MASKED = ("nearest", "raise")


class Form(NamedTuple):
    """What actions are and what agents see; hashable, so that compiled functions are keyed on it."""

    actions: str = "neighbour"  # "neighbour": the index of a roadmap neighbour; "waypoint": a position in the plane
    view: str = "local"  # "local": one vector; "graph": the agent's whole roadmap as well


class Block(NamedTuple):
    """A part of an observation: its shape and the bounds of its numbers."""

    low: Float[np.ndarray, "*shape"]
    high: Float[np.ndarray, "*shape"]


class Parts(NamedTuple):
    """The three blocks of a local observation; the columns are named by `OWN`, `TEAM` and `CANDIDATE`."""

    own: Float[np.ndarray, "*b o"]
    team: Float[np.ndarray, "*b others t"]  # the other agents, from the next index on, round to the one before
    candidates: Float[np.ndarray, "*b k c"]  # what the actions lead to: neighbours, or compass points


def check_option(name: str, value: str, allowed: tuple[str, ...]) -> None:
    """Raises InputError where the option's value is none of those allowed."""
    if value not in allowed:
        raise InputError(f"{name}={value!r}: give one of {', '.join(allowed)}")


def check_form(scenario: Scenario, form: Form) -> None:
    """Raises InputError for options that do not go together or that the scenario does not allow."""
    check_option("actions", form.actions, ACTIONS)
    check_option("view", form.view, VIEWS)
    if form.actions == "waypoint" and form.view == "graph":
        raise InputError("view='graph' shows the roadmap, which waypoints do not need; give actions='neighbour'")
    if form.actions == "waypoint" and scenario.obstacles:
        raise InputError(
            f"actions='waypoint' would lead across the scenario's {len(scenario.obstacles)} no-go zones; "
            "give actions='neighbour', whose edges keep out of them"
        )


def columns(problem: ScenarioLike) -> tuple[Columns, Columns, Columns]:
    """Lowest and highest number of every column of the own, team and candidate blocks."""
    extent = jnp.asarray(problem.extent)
    longest = jnp.max(extent)
    path, diagonal = jnp.max(jnp.asarray(problem.budgets)) / longest, jnp.sqrt(jnp.sum(extent**2)) / longest
    spread = jnp.sqrt(problem.signal_variance)
    unit, offset = (0.0, 1.0), (-1.0, 1.0)
    own = dict.fromkeys(OWN, unit) | {"ahead": (0.0, path), "remaining": (0.0, path)}
    team = dict.fromkeys(TEAM, offset) | {"heard": unit, "told": unit}
    candidate = {
        "x": offset,
        "y": offset,
        "length": (0.0, diagonal),
        "mean": (-MEAN_LIMIT, MEAN_LIMIT),
        "std": (0.0, spread),
        "interest": unit,
        "around": (0.0, problem.signal_variance),
        "announced": unit,
        "allowed": unit,
    }
    return own, team, candidate


def _shapes(problem: ScenarioLike) -> tuple[tuple[int, ...], ...]:
    """Of the own, team and candidate blocks."""
    return (len(OWN),), (problem.agents - 1, len(TEAM)), (problem.neighbours, len(CANDIDATE))


def blocks(scenario: Scenario) -> tuple[Block, Block, Block]:
    """Bounds of the own, team and candidate blocks of a local observation, float32."""

    def block(bounds: Columns, shape: tuple[int, ...]) -> Block:
        low, high = (np.array([float(column[side]) for column in bounds.values()], np.float32) for side in (0, 1))
        return Block(np.broadcast_to(low, shape).copy(), np.broadcast_to(high, shape).copy())

    own, team, candidates = map(block, columns(scenario), _shapes(scenario))
    return own, team, candidates


def local_bounds(scenario: Scenario) -> Block:
    """Bounds of a local observation: own, team and candidate blocks one after the other in one vector, float32."""
    parts = blocks(scenario)
    return Block(*(np.concatenate([getattr(part, side).ravel() for part in parts]) for side in ("low", "high")))


def split_view(scenario: Scenario, observation: Float[np.ndarray, "*b d"]) -> Parts:
    """The three blocks of a local observation, or of a stack of them; views, not copies.

    Raises InputError where the length is not that of the scenario's observations.
    """
    shapes = _shapes(scenario)
    sizes = [math.prod(shape) for shape in shapes]
    if observation.shape[-1] != sum(sizes):
        raise InputError(f"an observation of {observation.shape[-1]} numbers; this scenario's have {sum(sizes)}")
    cut = np.split(observation, np.cumsum(sizes)[:-1], axis=-1)
    own, team, candidates = (
        part.reshape(*observation.shape[:-1], *shape) for part, shape in zip(cut, shapes, strict=True)
    )
    return Parts(own, team, candidates)
