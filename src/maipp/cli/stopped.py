"""What to say of agents that the engine stopped with budget left."""


def stopped_warning(who: str, *, agents: int, not_finite: int, record_full: int, unspent: str) -> str | None:
    """One line, or None where the engine stopped nobody; `unspent` is a mean over all `agents`, in words."""
    reasons = [
        f"{count} {reason}"
        for count, reason in (
            (not_finite, "at a waypoint that is not a finite number"),
            (record_full, "because the record of the route was full (very many small steps)"),
        )
        if count
    ]
    if not reasons:
        return None
    return f"warning: {who}: of {agents} agents the engine stopped {' and '.join(reasons)}; unspent budget {unspent}"
