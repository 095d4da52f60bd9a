"""Pictures of a survey: the overview and the animation."""

from maipp.viz.animation import save_animation
from maipp.viz.overview import draw_overview, save_overview

__all__ = ["draw_overview", "save_animation", "save_overview"]
