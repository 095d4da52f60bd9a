"""Evaluating planners: quality over held-out missions, and the time of a decision.

`evaluate` scores a planner, `comparison` sets two side by side. A table (`tables`; those of the paper are the files in `paper/`) has
rows and columns, whose `cells` a sweep (`sweep/`) fills. What they come to becomes a page, a figure and CSV.
"""
