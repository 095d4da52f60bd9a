"""Probabilistic roadmaps: the waypoint graph on which an agent decides, and its spectral node encoding."""

from maipp.roadmap.edges import SHORTEST_LEG, Edges, edges_from, nearest_node
from maipp.roadmap.encoding import laplacian_encoding, normalised_laplacian
from maipp.roadmap.home import Ends, Home, home_of, lengths_home
from maipp.roadmap.obstacles import Obstacles
from maipp.roadmap.prm import Roadmap, build_roadmap, check_starts, sample_roadmaps
from maipp.roadmap.zones import FreeSpace, Zones, free_space, zones_of

__all__ = [
    "SHORTEST_LEG",
    "Edges",
    "Ends",
    "FreeSpace",
    "Home",
    "Obstacles",
    "Roadmap",
    "Zones",
    "build_roadmap",
    "check_starts",
    "edges_from",
    "free_space",
    "home_of",
    "laplacian_encoding",
    "lengths_home",
    "nearest_node",
    "normalised_laplacian",
    "sample_roadmaps",
    "zones_of",
]
