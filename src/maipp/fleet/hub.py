"""A network within one process: no sockets, and every fault of a real one, drawn from a seed."""

import heapq
import itertools
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

import numpy as np

from maipp.fleet.transport import Answer, Hint


@dataclass
class Faults:
    """What goes wrong on the way; chances are of each message and each receiver."""

    loss: float = 0.0  # of a hint, of a question, and of its answer
    duplicates: float = 0.0  # a hint that comes comes twice
    delay: float = 0.0  # a hint comes up to so many seconds later, so that later ones may overtake it


@dataclass
class Hub:
    """Connects its `HubLink`s. Deterministic: given the seed and the calls, the same messages are lost."""

    faults: Faults = field(default_factory=Faults)
    seed: int = 0
    # Whether two robots are within reach of each other now; None: all are
    reach: Callable[[str, str], bool] | None = None

    def __post_init__(self) -> None:
        self.time = 0.0  # s; moves when somebody sets it
        self.links: dict[str, HubLink] = {}
        self.sent, self.asked = 0, 0  # bytes, of hints and of answers
        self._rng = np.random.default_rng(self.seed)
        self._parts: dict[str, int] = {}
        self._number = itertools.count()

    def link(self, name: str) -> "HubLink":
        """The end of a robot; one of the same name is there no more."""
        self.links[name] = HubLink(self, name)
        return self.links[name]

    def part(self, groups: Collection[Collection[str]]) -> None:
        """Let robots of different groups not hear each other; those in no group hear nobody."""
        self._parts = {name: number for number, group in enumerate(groups) for name in group}

    def heal(self) -> None:
        """Let everybody hear everybody."""
        self._parts = {}

    def connects(self, one: str, other: str) -> bool:
        """Whether two robots hear each other now."""
        if self._parts and (one not in self._parts or self._parts.get(one) != self._parts.get(other)):
            return False
        return self.reach is None or self.reach(one, other)

    def lost(self) -> bool:
        """Whether the next message is."""
        return self.faults.loss > 0 and self._rng.random() < self.faults.loss

    def publish(self, hint: Hint) -> None:
        """Bring a hint to all that are within reach, unless it is lost."""
        for link in [*self.links.values()]:
            if link.name == hint.sender or not self.connects(hint.sender, link.name) or self.lost():
                continue
            copies = 1 + (self.faults.duplicates > 0 and self._rng.random() < self.faults.duplicates)
            for _ in range(copies):
                late = self.faults.delay * self._rng.random() if self.faults.delay else 0.0
                self.sent += len(hint.payload)
                heapq.heappush(link.inbox, (self.time + late, next(self._number), hint))


class HubLink:
    """One robot's end of a hub: a `Transport`."""

    def __init__(self, hub: Hub, name: str) -> None:
        self.hub, self.name = hub, name
        self.inbox: list[tuple[float, int, Hint]] = []
        self.answers: dict[str, Answer] = {}

    def publish(self, topic: str, payload: bytes) -> None:
        """As the protocol has it."""
        if self.hub.links.get(self.name) is self:
            self.hub.publish(Hint(self.name, topic, payload))

    def receive(self) -> list[Hint]:
        """As the protocol has it."""
        hints = []
        while self.inbox and self.inbox[0][0] <= self.hub.time:
            hints.append(heapq.heappop(self.inbox)[2])
        return hints

    def ask(self, topic: str, payload: bytes, timeout: float, to: str | None = None) -> dict[str, bytes]:
        """As the protocol has it; takes no time, whatever the `timeout`."""
        answers = {}
        for name in sorted(self.peers() if to is None else {to} & {*self.peers()}):
            answer = self.hub.links[name].answers.get(topic)
            if answer is None or self.hub.lost():
                continue
            told = answer(payload)
            if told is not None and not self.hub.lost():
                self.hub.asked += len(payload) + len(told)
                answers[name] = told
        return answers

    def serve(self, topic: str, answer: Answer) -> None:
        """As the protocol has it."""
        self.answers[topic] = answer

    def peers(self) -> Collection[str]:
        """As the protocol has it."""
        if self.hub.links.get(self.name) is not self:
            return []
        return [name for name in self.hub.links if name != self.name and self.hub.connects(self.name, name)]

    def close(self) -> None:
        """As the protocol has it."""
        if self.hub.links.get(self.name) is self:
            del self.hub.links[self.name]
