"""What the decisions of a recorded run told the others: intents and announced measurements."""

from typing import Any

import jax
import numpy as np

from maipp.engine.decision import Planner
from maipp.engine.rollout import Events
from maipp.planners.announced.announcement import Announcement, TeamPlan
from maipp.team import Intent
from maipp.team.broadcast import Broadcast


def whole_message(message: Any) -> Any:
    """What a run keeps of a message for `broadcasts_of`: all of it."""
    return message


def tells_plans(planner: Planner) -> bool:
    """Whether the planner's messages are intents or announced measurements, so that `broadcasts_of` can read them."""
    return isinstance(jax.eval_shape(planner.empty_message), Intent | Announcement | TeamPlan)


def broadcasts_of(recorded: Events, index: int = 0) -> tuple[Broadcast, ...]:
    """What was told in mission `index`, in the order of the decisions; for a run of which whole messages were kept.

    Whoever stops tells nothing any more: its last entry is empty. Raises TypeError for messages of another kind.
    """
    events = np.flatnonzero(recorded.counts[index])
    return tuple(
        _broadcast(
            int(recorded.agent[index, event]),
            float(recorded.time[index, event]),
            jax.tree.map(lambda row, event=event: row[index, event], recorded.kept),
        )
        for event in events
    )


def _broadcast(agent: int, time: float, message: Any) -> Broadcast:
    """One message as what it tells."""
    nothing = np.full(2, np.nan), np.full(3, np.nan)
    if isinstance(message, Intent):
        return Broadcast(
            agent, time, np.asarray(message.mean), np.asarray(message.covariance), np.empty((0, 2)), np.empty(0)
        )
    legs = message.legs if isinstance(message, TeamPlan) else message
    if isinstance(legs, Announcement):
        return Broadcast(agent, time, *nothing, np.asarray(legs.points), np.asarray(legs.times))
    raise TypeError(f"{type(message).__name__} is neither an intent nor an announced path")
