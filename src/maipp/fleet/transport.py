"""What a robot needs of a network: hints that may be lost, and questions that may stay without an answer."""

from collections.abc import Callable, Collection
from typing import NamedTuple, Protocol, runtime_checkable


class Hint(NamedTuple):
    """What somebody has published."""

    sender: str  # name of the robot, as the transport has checked it
    topic: str
    payload: bytes


# Answers a question of somebody; None: no answer. Called from any thread.
Answer = Callable[[bytes], bytes | None]


@runtime_checkable
class Transport(Protocol):
    """A robot's end of a network. Nothing that is sent is certain to arrive, once, or in order."""

    name: str  # of the robot

    def publish(self, topic: str, payload: bytes) -> None:
        """Send to whoever is within reach now."""
        ...

    def receive(self) -> list[Hint]:
        """What has come since the last call; does not wait."""
        ...

    def ask(self, topic: str, payload: bytes, timeout: float, to: str | None = None) -> dict[str, bytes]:
        """The answers of all that are within reach, or of one robot, that came within so many seconds."""
        ...

    def serve(self, topic: str, answer: Answer) -> None:
        """Answer such questions from now on."""
        ...

    def peers(self) -> Collection[str]:
        """Names of those that the network takes for being there; some may not answer."""
        ...

    def close(self) -> None:
        """End all that was begun; does nothing the second time."""
        ...
