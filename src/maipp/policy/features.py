"""What the policy is told about every roadmap node."""

import jax.numpy as jnp

from maipp.typing import Array, Extent, Float, Point, Points, Vector

NODE_FEATURES = ("x", "y", "mean", "std", "intent")  # the columns of `node_features`


def node_features(
    nodes: Points, position: Point, mean: Vector, std: Vector, intent: Vector, extent: Extent
) -> Float[Array, "n 5"]:
    """The features of every node: v'_j = (x_j, y_j, mu(v_j), P(v_j), f(v_j)) in the paper's symbols.

    x_j, y_j: offset of the node from the agent's `position`, in longest sides of the `extent` (width, height), so that
    the policy sees neither where the domain lies nor how large it is. mu(v_j), P(v_j): posterior mean and standard
    deviation of the agent's belief at the node, in normalised units. f(v_j): fused intent of the other agents there.
    Source: Yang et al. 2023, Sec. IV-C (observation).
    """
    offset = (nodes - position) / jnp.max(jnp.asarray(extent))
    return jnp.concatenate([offset, jnp.stack([mean, std, intent], axis=-1)], axis=-1)
