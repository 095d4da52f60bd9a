"""Evaluating planners: quality over held-out missions, and the time of a decision."""
