"""The Gymnasium spaces of an environment, and the arrays in them."""

import math
from typing import Any

import numpy as np
from gymnasium import spaces

from maipp.adapters.form import MEAN_LIMIT, Form, blocks, local_bounds
from maipp.adapters.view import View
from maipp.scenario import Scenario


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


def observation_space(scenario: Scenario, form: Form, moves: int) -> spaces.Space:
    """What an agent is given: a vector or the graph, and but for waypoints the mask of its `moves` actions."""
    bounds = local_bounds(scenario)
    inner = _graph_space(scenario) if form.view == "graph" else _box(bounds.low, bounds.high)
    if form.actions == "waypoint":
        return inner
    return spaces.Dict({"observation": inner, "action_mask": spaces.Box(0, 1, (moves,), np.int8)})


def action_space(scenario: Scenario, form: Form, moves: int) -> spaces.Space:
    """What an agent may answer: the index of a neighbour, or a position in the domain, domain units."""
    if form.actions == "waypoint":
        return _box((0.0, 0.0), scenario.extent)
    return spaces.Discrete(moves)


def as_observation(form: Form, view: View, mask: np.ndarray | None) -> Any:
    """The view as a member of the observation space; `view` holds NumPy arrays."""
    if form.view == "graph" and view.graph is not None:
        inner: Any = {
            "nodes": view.graph.nodes,
            "neighbours": view.graph.neighbours,
            "reachable": np.asarray(view.graph.reachable).astype(np.int8),
            "node": np.array([view.graph.node], np.int32),
            "own": view.own,
            "team": view.team,
            "candidates": view.candidates,
        }
    else:
        inner = np.concatenate([np.ravel(part) for part in (view.own, view.team, view.candidates)])
    return inner if mask is None else {"observation": inner, "action_mask": mask}
