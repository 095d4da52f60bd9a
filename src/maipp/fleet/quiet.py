"""A transport of one that only asks and hears: it tells nobody anything, and carries nothing from one to another."""

from collections.abc import Collection

from maipp.fleet.transport import Answer, Hint, Transport


class Quiet:
    """A `Transport` through which nothing is said but questions."""

    def __init__(self, inner: Transport) -> None:
        self.inner, self.name = inner, inner.name

    def publish(self, topic: str, payload: bytes) -> None:
        """Nothing."""

    def receive(self) -> list[Hint]:
        """As the protocol has it."""
        return self.inner.receive()

    def ask(self, topic: str, payload: bytes, timeout: float, to: str | None = None) -> dict[str, bytes]:
        """As the protocol has it."""
        return self.inner.ask(topic, payload, timeout, to)

    def serve(self, topic: str, answer: Answer) -> None:
        """Nothing."""

    def peers(self) -> Collection[str]:
        """As the protocol has it."""
        return self.inner.peers()

    def close(self) -> None:
        """As the protocol has it."""
        self.inner.close()
