"""What the policy is shown at a decision, and the belief it is taken from."""

from typing import NamedTuple

import jax.numpy as jnp

from maipp.belief import Belief
from maipp.policy import node_features
from maipp.problem import ScenarioLike, longest_side
from maipp.roadmap import Edges, Roadmap
from maipp.typing import Array, Bool, Float, Index, Int, Point, Vector


class PolicyView(NamedTuple):
    """The inputs of the network for one decision of one agent; together with its memory, all that it sees."""

    features: Float[Array, "n 5"]  # `node_features`
    encoding: Float[Array, "n e"]  # `laplacian_encoding` of the roadmap
    node: Index  # where the agent is
    neighbours: Int[Array, " k"]  # nodes it may go to
    allowed: Bool[Array, " k"]  # of them, those in sight and within budget
    neighbour_std: Float[Array, " k"]  # standard deviation of the belief there
    remaining: Float[Array, ""]  # budget left, longest sides of the extent
    threshold: Float[Array, ""]  # of the high-interest area, normalised field units


def policy_view(
    scenario: ScenarioLike,
    roadmap: Roadmap,
    nodes: Belief,
    here: Edges,
    position: Point,
    remaining: Float[Array, ""],
    intent: Vector,
    std: Vector | None = None,
) -> PolicyView:
    """The view of an agent that may leave its node by `here`, is at `position`, has `remaining` budget (domain units).

    `nodes` is its belief, predicted at the roadmap's nodes; `std` takes the place of the belief's own there, as on a
    virtual step. `intent` is the others' fused intent at the nodes. Raises ValueError where the roadmap carries no
    encoding.
    """
    if roadmap.encoding is None:
        raise ValueError("the policy reads spectral encodings: draw the missions with encodings=32")
    std = nodes.std if std is None else std
    return PolicyView(
        features=node_features(jnp.asarray(roadmap.nodes), position, nodes.mean, std, intent, scenario.extent),
        encoding=jnp.asarray(roadmap.encoding),
        node=here.node,
        neighbours=here.target_nodes,
        allowed=here.allowed,
        neighbour_std=std[here.target_nodes],
        remaining=remaining / longest_side(scenario.extent),
        threshold=jnp.asarray(scenario.threshold, std.dtype),
    )
