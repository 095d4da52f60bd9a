"""What agents tell each other about where they are going: the Gaussian intent."""

from maipp.renamed import renamed
from maipp.team.intent import (
    COVARIANCE_FLOOR,
    Intent,
    destination_intent,
    fit_intent,
    fuse_intents,
    intent_density,
    is_announced,
    matrix,
    no_intent,
    symmetric_kl,
    trajectory_intent,
)

__all__ = [
    "COVARIANCE_FLOOR",
    "Intent",
    "destination_intent",
    "fit_intent",
    "fuse_intents",
    "intent_density",
    "is_announced",
    "matrix",
    "no_intent",
    "symmetric_kl",
    "trajectory_intent",
]


renamed(__name__, is_told="is_announced")
