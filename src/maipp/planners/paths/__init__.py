"""The policy on a roadmap: `PathSampler` shows a network where an agent is, and samples paths from it.

A planner holds a `PathSampler` as a part. Its `situation` is where an agent is, `look` what the network makes of it,
`choose` the next node, `sample` whole paths, and `outcomes` what these would leave.
"""

from maipp.planners.paths.path_sampler import Choice, Insight, PathSampler
from maipp.planners.paths.paths import Paths, Situation

__all__ = ["Choice", "Insight", "PathSampler", "Paths", "Situation"]
