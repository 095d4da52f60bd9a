"""Evaluating planners: quality over held-out missions, and the time of a decision.

`evaluate` scores a planner, `paired` compares two. A table (`tables`; the paper's are the files in `paper/`) has rows and
columns, whose `cells` a sweep (`sweep/`) fills, each kept in a file; what they came to becomes a page, a figure and CSV.
"""
