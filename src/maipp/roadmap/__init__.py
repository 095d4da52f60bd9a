"""Probabilistic roadmaps: the waypoint graph on which an agent decides, and its spectral node encoding."""

from maipp.roadmap.encoding import flip_signs, laplacian_encoding, normalised_laplacian
from maipp.roadmap.obstacles import Obstacles
from maipp.roadmap.prm import Roadmap, build_roadmap, sample_roadmap, sample_roadmaps, shortest_distances

__all__ = [
    "Obstacles",
    "Roadmap",
    "build_roadmap",
    "flip_signs",
    "laplacian_encoding",
    "normalised_laplacian",
    "sample_roadmap",
    "sample_roadmaps",
    "shortest_distances",
]
