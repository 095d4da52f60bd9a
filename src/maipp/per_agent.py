"""What a scenario says of each agent, where one value stands for all of them."""

from typing import Any

Pair = tuple[float, float]


class PerAgent:
    """The base of `Scenario`: the values of every agent, of fields that hold one for all or one for each."""

    agents: int
    budget: Any
    reserve: Any
    speed: Any
    start: Any
    end: Any

    @property
    def budgets(self) -> tuple[float, ...]:
        """Budget of every agent, length m, domain units."""
        return self.budget if isinstance(self.budget, tuple) else (self.budget,) * self.agents

    @property
    def reserves(self) -> tuple[float, ...]:
        """Reserve of every agent, length m, domain units."""
        return self.reserve if isinstance(self.reserve, tuple) else (self.reserve,) * self.agents

    @property
    def speeds(self) -> tuple[float, ...]:
        """Speed of every agent, length m, domain units per unit of time."""
        return self.speed if isinstance(self.speed, tuple) else (self.speed,) * self.agents

    @property
    def starts(self) -> tuple[Pair, ...] | None:
        """Start of every agent, length m, domain units; None where it is drawn."""
        if self.start is None or isinstance(self.start[0], tuple):
            return self.start
        return (self.start,) * self.agents

    @property
    def ends_differ(self) -> bool:
        """Whether each agent has ends of its own."""
        places = self.end if isinstance(self.end, tuple) else ()
        return any(isinstance(each, tuple) and (not each or isinstance(each[0], tuple)) for each in places)

    @property
    def places(self) -> tuple[tuple[Pair, ...], ...] | None:
        """The ends of every agent, length m; None where they are not given as places."""
        if self.end is None or isinstance(self.end, str):
            return None
        if self.ends_differ:
            return self.end
        return (self.end if isinstance(self.end[0], tuple) else (self.end,),) * self.agents

    @property
    def homes(self) -> int:
        """Places of which each agent ends at one; 0 where it may end anywhere."""
        if self.end is None:
            return 0
        return max(map(len, self.places)) if self.places is not None else 1

    def ends_from(self, starts: Any) -> tuple[tuple[Pair, ...], ...]:
        """Where each agent may end that began at `starts` (m, 2), domain units: at any of these; anywhere if none.

        Only where ends are given.
        """
        return self.places or tuple(((float(x), float(y)),) for x, y in starts)

    @property
    def longest_budget(self) -> float:
        """The largest budget, domain units."""
        return max(self.budget) if isinstance(self.budget, tuple) else self.budget
