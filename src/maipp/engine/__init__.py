"""The one way from an arrival to the next leg: missions, events, batches of them, scores and records."""

from maipp.engine.decision import Decision, Observation, Planner
from maipp.engine.mission import Mission, draw_missions
from maipp.engine.options import option, part
from maipp.engine.rollout import run_missions
from maipp.engine.state import State, reset

__all__ = [
    "Decision",
    "Mission",
    "Observation",
    "Planner",
    "State",
    "draw_missions",
    "option",
    "part",
    "reset",
    "run_missions",
]
