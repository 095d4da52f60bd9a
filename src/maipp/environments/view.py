"""What an agent of an environment sees: its belief, its way and its team in numbers of fixed shape and bounds."""

from typing import NamedTuple

import jax.numpy as jnp

from maipp.belief import Belief
from maipp.engine.decision import Observation
from maipp.engine.score import interest_of
from maipp.environments.form import MEAN_LIMIT, Form, columns
from maipp.policy import node_features
from maipp.problem import ScenarioLike, longest_side
from maipp.roadmap import SHORTEST_LEG, Roadmap, edges_from, nearest_node
from maipp.typing import Array, Bool, Float, Index, Int, Point, Points, Vector


class Graph(NamedTuple):
    """The agent's roadmap and its belief there."""

    nodes: Float[Array, "n 5"]  # `node_features`, the last column what others announced
    neighbours: Int[Array, "n k"]
    reachable: Bool[Array, "n k"]
    node: Index  # where the agent decides


class View(NamedTuple):
    """What one agent sees at a moment. An agent under way sees what it knows now, from where its leg ends."""

    own: Float[Array, " o"]
    team: Float[Array, "others t"]
    candidates: Float[Array, "k c"]
    allowed: Bool[Array, " k"]  # actions that the budget allows
    end: Point  # where its leg ends, domain units
    graph: Graph | None  # under view="graph"
    trace: Float[Array, ""]  # Tr(P) of its own belief
    remaining: Float[Array, ""]  # budget left on arrival, domain units


class RemainingLeg(NamedTuple):
    """Where an agent's leg ends and what of it is left."""

    end: Point  # domain units
    ahead: Float[Array, ""]  # distance still to travel to the end, domain units
    targets: Float[Array, "k 2"]  # where the actions lead to from the end, domain units
    allowed: Bool[Array, " k"]  # those it may take there


def candidates_from(
    problem: ScenarioLike, roadmap: Roadmap | None, end: Point, remaining: Float[Array, ""]
) -> tuple[Float[Array, "k 2"], Bool[Array, " k"]]:
    """Where the actions lead to from the end of a leg, and which of them the remaining budget allows.

    With waypoints any place is allowed while there is budget; shown are compass points one measurement away.
    """
    if roadmap is None:
        angle = jnp.arange(problem.neighbours) * (2 * jnp.pi / problem.neighbours)
        step = problem.measurement_interval * jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)
        points = jnp.clip(end + step.astype(end.dtype), 0.0, jnp.asarray(problem.extent, end.dtype))
        return points, jnp.full(problem.neighbours, remaining > SHORTEST_LEG)
    here = edges_from(roadmap, nearest_node(roadmap, end), remaining, problem.last_leg)
    return here.targets, here.allowed


def announced_near(
    problem: ScenarioLike, targets: Float[Array, "m 2"], told: Bool[Array, " m"], points: Points
) -> Vector:
    """How near each point is to the nearest announced target, in (0, 1], 1 at the target; 0 where none is told.

    A Gaussian whose standard deviation is the measurement interval: within that an agent measures on its way there.
    """
    offset = points[:, None] - jnp.where(told[:, None], targets, 0.0)
    squared = jnp.where(told, jnp.sum(offset * offset, axis=-1), jnp.inf)
    return jnp.exp(-jnp.min(squared, axis=-1) / (2 * problem.measurement_interval**2))


def _around(problem: ScenarioLike, belief: Belief, area: Bool[Array, " q"], points: Points) -> Vector:
    """Variance within the high-interest area around each point: a mean weighted by nearness, half a length scale.

    Nearness is a product over the axes, and so is the grid: exponentials of 2 k g numbers, where there are k g^2 pairs.
    """
    grid = belief.query.reshape(problem.grid, problem.grid, 2)
    offsets = points[:, 0, None] - grid[:, 0, 0], points[:, 1, None] - grid[0, :, 1]
    across, along = (jnp.exp(-(offset**2) / (2 * (problem.length_scale / 2) ** 2)) for offset in offsets)
    variance = jnp.where(area, belief.variance, 0.0).reshape(problem.grid, problem.grid)
    worth = jnp.sum((across @ variance) * along, axis=-1)
    return worth / jnp.maximum(jnp.sum(across, axis=-1) * jnp.sum(along, axis=-1), 1e-12)


def view_of(problem: ScenarioLike, form: Form, observation: Observation, way: RemainingLeg) -> View:
    """What the agent of this observation sees; all numbers lie within the bounds of `columns`."""
    longest, m = longest_side(problem.extent), problem.agents
    interest, belief, end = interest_of(problem), observation.belief, way.end
    area = interest.area(belief.mean, belief.variance, observation.inside)
    trace = interest.trace(belief.mean, belief.variance, observation.inside)
    scale = problem.signal_variance * problem.grid_points
    own = jnp.stack(
        [
            *(end / longest),
            way.ahead / longest,
            observation.remaining / observation.budget,
            observation.remaining / longest,
            observation.to_next_measurement / problem.measurement_interval,
            trace / scale,
            jnp.mean(area),
        ]
    )

    heard = observation.heard
    told = heard & jnp.isfinite(observation.messages).all(axis=-1)
    others = (observation.agent + 1 + jnp.arange(m - 1)) % m
    team = jnp.concatenate(
        [
            heard[:, None],
            jnp.where(heard[:, None], (observation.positions - end) / longest, 0.0),
            told[:, None],
            jnp.where(told[:, None], (observation.messages - end) / longest, 0.0),
        ],
        axis=-1,
    )[others]

    roadmap = observation.roadmap
    points, allowed = way.targets, way.allowed
    there = belief.on(points)
    offset = points - end
    candidates = jnp.stack(
        [
            *(offset.T / longest),
            jnp.sqrt(jnp.sum(offset * offset, axis=-1)) / longest,
            there.mean,
            there.std,
            interest.area(there.mean, there.variance, jnp.ones(len(points), bool)),
            _around(problem, belief, area, points),
            announced_near(problem, observation.messages, told, points),
            allowed,
        ],
        axis=-1,
    )
    graph = None
    if form.view == "graph" and roadmap is not None:
        nodes = jnp.asarray(roadmap.nodes)
        at_nodes = belief.on(nodes)
        near = announced_near(problem, observation.messages, told, nodes)
        mean = jnp.clip(at_nodes.mean, -MEAN_LIMIT, MEAN_LIMIT)
        std = jnp.minimum(at_nodes.std, problem.signal_variance**0.5)
        graph = Graph(
            node_features(nodes, end, mean, std, near, problem.extent).astype(jnp.float32),
            jnp.asarray(roadmap.neighbours).astype(jnp.int32),
            jnp.asarray(roadmap.reachable),
            nearest_node(roadmap, end),
        )
    # Rounding may carry a number past its bound by a digit, and an overshooting mean further.
    own, team, candidates = (
        jnp.clip(part, *(jnp.stack([jnp.asarray(column[side]) for column in bounds.values()]) for side in (0, 1)))
        for part, bounds in zip((own, team, candidates), columns(problem), strict=True)
    )
    own, team, candidates = (part.astype(jnp.float32) for part in (own, team, candidates))
    return View(own, team, candidates, allowed, end, graph, trace, observation.remaining)
