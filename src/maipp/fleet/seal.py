"""What proves who has written a log: a signature over its beginning."""

from typing import Protocol, runtime_checkable

from maipp.fleet.log import Head, Origin


@runtime_checkable
class Seal(Protocol):
    """Signs the logs of one robot, and checks those of all."""

    def sign(self, origin: Origin, head: Head) -> bytes:
        """The robot's signature of the lines up to this head."""
        ...

    def check(self, origin: Origin, head: Head) -> bool:
        """Whether the head's signature is the robot's."""
        ...


class Unsealed:
    """No signatures, and every log counts: for robots that only talk within one computer."""

    def sign(self, origin: Origin, head: Head) -> bytes:
        """None."""
        return b""

    def check(self, origin: Origin, head: Head) -> bool:
        """True."""
        return True


def signed_bytes(origin: Origin, head: Head) -> bytes:
    """What is signed."""
    return f"maipp.fleet/1 {origin} {head.length} ".encode("ascii") + head.chain
