"""The learned policy: an attention network over roadmap nodes, its inputs, and its weights as files."""

from maipp.policy.features import node_features
from maipp.policy.network import Memory, PolicyNetwork, Prepared
from maipp.policy.shipped import load_policy, network_named
from maipp.policy.weights import load_weights, save_weights

__all__ = [
    "Memory",
    "PolicyNetwork",
    "Prepared",
    "load_policy",
    "load_weights",
    "network_named",
    "node_features",
    "save_weights",
]
