"""Fleets: every robot a process of its own, with its own belief, log and decisions.

A `Robot` reports what its `Vehicle` measures and decides where to go, through a `TeamSurvey` of `maipp.live`; what it
reports goes into its own `Log`. A `Member` keeps all `Logs` that it hears of up to date over a `Transport`, so that all
robots that hear of each other, directly or through others, come to know the same.
"""
