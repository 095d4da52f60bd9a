"""Whose turn it is, of robots that arrive at the same moment: each decides knowing what the ones before it announced.

A robot says that it asks before it asks the others what they do. So of two that ask at once at least one sees
the other, and the first in the order of the mission goes first; whoever has seen nobody says that it decides, and is
waited for. Nobody waits for long: a robot that is lost, or slow, loses its turn.
"""

from collections.abc import Callable, Mapping, Sequence

ASKS, WAITS, DECIDES = "asks", "waits", "decides"


class DecisionOrder:
    """One robot's part of it. `phase` is what it tells the others; empty while it travels."""

    def __init__(self, name: str, names: Sequence[str], longest: float, monotonic: Callable[[], float]) -> None:
        """`names` are in the order in which robots go; one waits `longest` at most, in the seconds of `monotonic`."""
        self.phase = ""
        self._name, self._before = name, {*names[: names.index(name)]}
        self._longest, self._monotonic = longest, monotonic
        self._until: float | None = None

    def ask(self) -> None:
        """It is about to ask the others."""
        self.phase = self.phase or ASKS
        if self._until is None:
            self._until = self._monotonic() + self._longest

    def is_due(self, phases: Mapping[str, str]) -> bool:
        """Whether it may decide, after others have told their phases; else it asks again a moment later."""
        if self._until is None or self._monotonic() < self._until:
            if any(phase == DECIDES or (phase == ASKS and name in self._before) for name, phase in phases.items()):
                self.phase = WAITS
                return False
            if self.phase == WAITS:  # nobody is before it any more: it says so, and makes sure
                self.phase = ASKS
                return False
            if ASKS in phases.values():  # has that one seen us? then it waits, else it decides
                return False
        self.phase = DECIDES
        return True

    def end(self) -> None:
        """It has decided."""
        self.phase, self._until = "", None
