"""Surveys of real places: mission files, areas, the standardised problem, routes and rehearsals."""
