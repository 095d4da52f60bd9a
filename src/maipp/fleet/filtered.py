"""A simulated radio: over any transport, what comes from too far away is not heard, and some of the rest is lost."""

import random
import struct
from collections.abc import Callable, Collection

from maipp.fleet.transport import Answer, Hint, Transport

_PLACE = struct.Struct("<dd")

Position = tuple[float, float]


class Filtered:
    """A `Transport` through which robots hear each other within a range, as they are now.

    Every message carries its sender's place; it is the receiver who does not hear it.
    """

    def __init__(
        self,
        inner: Transport,
        where: Callable[[], Position | None],
        reach: float | None,
        loss: float = 0.0,
        seed: int | None = None,
    ) -> None:
        """`where` gives the robot's place, called from its own thread; None: it hears and is heard anywhere.

        `reach` is in the units of places, None for any distance; `loss` the chance that a message is not heard.
        """
        self.inner, self.name, self._where, self._reach, self._loss = inner, inner.name, where, reach, loss
        self._random, self._place = random.Random(seed), where()

    def publish(self, topic: str, payload: bytes) -> None:
        """As the protocol has it."""
        self._place = self._where()
        self.inner.publish(topic, self._sent(payload))

    def receive(self) -> list[Hint]:
        """As the protocol has it."""
        self._place = self._where()
        heard = [(hint, self._heard(hint.payload)) for hint in self.inner.receive()]
        return [Hint(hint.sender, hint.topic, payload) for hint, payload in heard if payload is not None]

    def ask(self, topic: str, payload: bytes, timeout: float, to: str | None = None) -> dict[str, bytes]:
        """As the protocol has it; who does not hear a question answers that it has not."""
        self._place = self._where()
        answers = self.inner.ask(topic, self._sent(payload), timeout, to).items()
        heard = {name: self._heard(answer) for name, answer in answers if answer}
        return {name: answer for name, answer in heard.items() if answer is not None}

    def serve(self, topic: str, answer: Answer) -> None:
        """As the protocol has it."""

        def within(payload: bytes) -> bytes | None:
            question = self._heard(payload)
            told = None if question is None else answer(question)
            return b"" if told is None else self._sent(told)

        self.inner.serve(topic, within)

    def peers(self) -> Collection[str]:
        """As the protocol has it: of the transport below, whoever may be out of range."""
        return self.inner.peers()

    def close(self) -> None:
        """As the protocol has it."""
        self.inner.close()

    def _sent(self, payload: bytes) -> bytes:
        place = self._place or (float("nan"), float("nan"))
        return _PLACE.pack(*place) + payload

    def _heard(self, payload: bytes) -> bytes | None:
        if len(payload) < _PLACE.size or self._random.random() < self._loss:
            return None
        (x, y), own = _PLACE.unpack_from(payload), self._place
        if self._reach is not None and own is not None and x == x and y == y:
            if (x - own[0]) ** 2 + (y - own[1]) ** 2 > self._reach**2:
                return None
        return payload[_PLACE.size :]
