"""Evaluating planners: quality over held-out missions, and the time of a decision.

`evaluate` scores a planner, `evaluations` keeps and compares many. A table (`tables`; the paper's are the files in
`paper/`) has rows and columns, whose `cells` a sweep (`sweep/`) fills. What runs come to is a frame (`frame`), of which
`page` makes Markdown, `tidy_csv` CSV and `drawings` pictures; `command` says below what made them.
"""
