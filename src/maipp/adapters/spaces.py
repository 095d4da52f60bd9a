"""The Gymnasium spaces of an environment, and the arrays in them."""

import math
from typing import Any

import numpy as np
from gymnasium import spaces

from maipp.adapters.compiled import Sight
from maipp.environments.form import MEAN_LIMIT, Form, blocks, local_bounds, split_view
from maipp.scenario import Scenario

OBSERVATIONS = ("dict", "box")


def _box(low: Any, high: Any) -> spaces.Box:
    return spaces.Box(np.asarray(low, np.float32), np.asarray(high, np.float32), dtype=np.float32)


def _graph_space(scenario: Scenario) -> spaces.Space:
    """The agent's roadmap; its own, team and candidate blocks stay apart."""
    n, k = scenario.nodes, scenario.neighbours
    std = math.sqrt(scenario.signal_variance)
    own, team, candidates = blocks(scenario)
    return spaces.Dict(
        {
            "nodes": _box(np.tile([-1, -1, -MEAN_LIMIT, 0, 0], (n, 1)), np.tile([1, 1, MEAN_LIMIT, std, 1], (n, 1))),
            "neighbours": spaces.Box(0, n - 1, (n, k), np.int32),
            "reachable": spaces.Box(0, 1, (n, k), np.int8),
            "node": spaces.Box(0, n - 1, (1,), np.int32),
            "own": _box(own.low, own.high),
            "team": _box(team.low, team.high),
            "candidates": _box(candidates.low, candidates.high),
        }
    )


def masked(form: Form, observations: str) -> bool:
    """Whether an observation holds the mask of the actions; else `info` does, where there is one."""
    return form.actions == "neighbour" and observations == "dict"


def observation_space(scenario: Scenario, form: Form, moves: int, observations: str = "dict") -> spaces.Space:
    """What an agent is given: a vector or the graph, and in a dictionary the mask of its `moves` actions."""
    bounds = local_bounds(scenario)
    inner = _graph_space(scenario) if form.view == "graph" else _box(bounds.low, bounds.high)
    if not masked(form, observations):
        return inner
    return spaces.Dict({"observation": inner, "action_mask": spaces.Box(0, 1, (moves,), np.int8)})


def action_space(scenario: Scenario, form: Form, moves: int) -> spaces.Space:
    """What an agent may answer: the index of a neighbour, or a position in the domain, domain units."""
    if form.actions == "waypoint":
        return _box((0.0, 0.0), scenario.extent)
    return spaces.Discrete(moves)


def as_observation(scenario: Scenario, sight: Sight, mask: np.ndarray | None) -> Any:
    """The sight as a member of the observation space, which holds the mask unless it is None."""
    inner: Any = sight.vector
    if sight.graph is not None:
        inner = {
            "nodes": sight.graph.nodes,
            "neighbours": sight.graph.neighbours,
            "reachable": np.asarray(sight.graph.reachable).astype(np.int8),
            "node": np.array([sight.graph.node], np.int32),
            **split_view(scenario, sight.vector)._asdict(),
        }
    return inner if mask is None else {"observation": inner, "action_mask": mask}
