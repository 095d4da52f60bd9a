"""A survey under way: robots report measurements and arrivals, and are told where to go next."""

from maipp.live.live_survey import LiveSurvey

__all__ = ["LiveSurvey"]
