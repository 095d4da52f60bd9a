"""What agents tell each other and count on: next nodes, planned measurements, intents, and where a team meets.

Planners send an `Announcement`, a `TeamPlan`, an intent or a position, and count what they hear as measured.
"""

from maipp.planners.announced.announcement import Announcement, TeamPlan

__all__ = ["Announcement", "TeamPlan"]
