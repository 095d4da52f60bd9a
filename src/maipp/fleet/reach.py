"""Why an address is not reached: Zenoh goes on trying without a word."""

import contextlib
import socket
import ssl
import threading
from collections.abc import Mapping, Sequence
from typing import Any

_PATIENCE = 10.0  # s without a link, after which a reason is looked for
_SHORT = 1.0  # s, in which the other side says that it does not take a certificate


def why_not(endpoint: str, tls: Mapping[str, Any] | None, seconds: float = 3.0) -> str:
    """Why nobody answers at an address, as far as a connection of its own tells; empty where somebody does.

    `tls` is Zenoh's configuration of certificates; None: without.
    """
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    host = host.strip("[]")
    try:
        with socket.create_connection((host, int(port)), seconds) as connection:
            return "" if tls is None else _handshake(connection, host, tls)
    except TimeoutError:
        return "no answer"
    except socket.gaierror:
        return "no computer of this name is known"
    except OSError as error:
        return (error.strerror or str(error)).lower()


def _handshake(connection: socket.socket, host: str, tls: Mapping[str, Any]) -> str:
    """Why the other side and this one do not take each other's certificates; empty where they do."""
    try:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.load_verify_locations(tls["root_ca_certificate"])
        context.load_cert_chain(tls["connect_certificate"], tls["connect_private_key"])
        with context.wrap_socket(connection, server_hostname=host) as secured:
            secured.settimeout(_SHORT)
            with contextlib.suppress(TimeoutError):
                secured.recv(1)  # what is wrong with our certificate is told after the handshake
    except ssl.SSLCertVerificationError as error:
        return f"its certificate is refused here: {error.verify_message}"
    except ssl.SSLError as error:
        return f"the certificates do not fit: {(error.reason or str(error)).replace('_', ' ').lower()}"
    return ""


class Scout:
    """Looks now and then why no address is reached, beside everything else."""

    def __init__(self, endpoints: Sequence[str], tls: Mapping[str, Any] | None, patience: float = _PATIENCE) -> None:
        self._endpoints, self._tls, self._patience = endpoints, tls, patience
        self._at: float | None = None  # when to look next
        self._found: dict[str, str] = {}
        self._told: dict[str, str] = {}
        self._thread: threading.Thread | None = None

    def look(self, linked: bool, now: float) -> list[str]:
        """Lines to tell, each once until the reason is another."""
        if linked:
            self._at = None
            self._found, self._told = {}, {}
        elif self._at is None:
            self._at = now + self._patience
        elif now >= self._at and (self._thread is None or not self._thread.is_alive()):
            self._at = now + 2 * self._patience
            self._thread = threading.Thread(target=self._ask, name="scout", daemon=True)
            self._thread.start()
        new = {endpoint: why for endpoint, why in [*self._found.items()] if why and self._told.get(endpoint) != why}
        self._told |= new
        return [f"not connected to {endpoint}: {why}" for endpoint, why in new.items()]

    def _ask(self) -> None:
        for endpoint in self._endpoints:
            self._found[endpoint] = why_not(endpoint, self._tls)
