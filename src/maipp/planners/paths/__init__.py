"""The policy on a roadmap: `PathSampler` shows a network where an agent is, and samples paths from it.

A planner holds a `PathSampler` as a part. Its `agent_state` is where an agent is, `look` what the network makes of it,
`choose` the next node, `sample` whole paths, and `outcomes` what these would leave.
"""

from maipp.planners.paths.path_sampler import Choice, Insight, PathSampler
from maipp.planners.paths.paths import AgentState, Paths
from maipp.renamed import renamed

__all__ = ["AgentState", "Choice", "Insight", "PathSampler", "Paths"]


renamed(__name__, Situation="AgentState")
