"""Probabilistic roadmaps: the waypoint graph on which an agent decides, and its spectral node encoding."""

from maipp.roadmap.encoding import flip_signs, laplacian_encoding, normalised_laplacian
from maipp.roadmap.obstacles import Obstacles
from maipp.roadmap.prm import Roadmap, build_roadmap, check_starts, sample_roadmap, sample_roadmaps, shortest_distances
from maipp.roadmap.zones import FreeSpace, Zones, free_space, zones_of

__all__ = [
    "FreeSpace",
    "Obstacles",
    "Roadmap",
    "Zones",
    "build_roadmap",
    "check_starts",
    "flip_signs",
    "free_space",
    "laplacian_encoding",
    "normalised_laplacian",
    "sample_roadmap",
    "sample_roadmaps",
    "shortest_distances",
    "zones_of",
]
