"""The survey simulator: missions, the event-driven engine, running planners in batches."""

from maipp.simulator.decision import Decision, Observation, Planner
from maipp.simulator.mission import Mission, draw_missions
from maipp.simulator.run import run_missions
from maipp.simulator.state import State, reset

__all__ = [
    "Decision",
    "Mission",
    "Observation",
    "Planner",
    "State",
    "draw_missions",
    "reset",
    "run_missions",
]
