"""Signatures of logs, by the keys of the robots' certificates.

A signature is checked against its robot's certificate whatever the date: an expired certificate ends its robot's links,
but what the robot wrote before stays written. When a line was written, nobody can prove.
"""

from collections.abc import Mapping
from typing import Any

from maipp.fleet.log import Head, Origin
from maipp.fleet.seal import signed_bytes

_LONGEST = 80  # bytes; ECDSA over P-256 takes 70 to 72


class Signatures:
    """A `Seal` of ECDSA signatures (SHA-256)."""

    def __init__(self, name: str, key: Any, public: Mapping[str, Any]) -> None:
        """`key` is that of the robot of this name; `public` are those of all robots, this one included."""
        self._name, self._key, self._public = name, key, dict(public)

    def sign(self, origin: Origin, head: Head) -> bytes:
        """As the protocol has it."""
        from cryptography.hazmat.primitives.asymmetric.ec import ECDSA
        from cryptography.hazmat.primitives.hashes import SHA256

        assert origin.robot == self._name
        return self._key.sign(signed_bytes(origin, head), ECDSA(SHA256()))

    def check(self, origin: Origin, head: Head) -> bool:
        """As the protocol has it; False for robots whose certificates are not known."""
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.ec import ECDSA
        from cryptography.hazmat.primitives.hashes import SHA256

        key = self._public.get(origin.robot)
        if key is None or not 0 < len(head.signature) <= _LONGEST:
            return False
        try:
            key.verify(head.signature, signed_bytes(origin, head), ECDSA(SHA256()))
        except InvalidSignature:
            return False
        return True
