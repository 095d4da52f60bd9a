"""Addresses of a cluster's scheduler, and the certificates by which its parts know each other."""

import importlib.util
import ipaddress
import os
import re
from pathlib import Path
from typing import Any, NamedTuple

from maipp.errors import InputError

PORT = 8786
# Certificate and key in the folder of --tls: as one makes them oneself, or as `maipp fleet keys` does.
_AUTHORITY, _PAIRS = "ca.pem", (("cert.pem", "key.pem"), ("robot.pem", "robot.key"))
_GIVE = f"give a folder with {_AUTHORITY}, {' and '.join(_PAIRS[0])}"
_ADDRESS = re.compile(r"(?P<scheme>tcp|tls)://(?P<host>\[[0-9a-fA-F:]+\]|[^\s:/\[\]]+):(?P<port>\d{1,5})")

UNPROTECTED = (
    "warning: {} is no loopback address and has no TLS: whoever reaches its port can run code on the client, the "
    "scheduler and every worker; give tls:// and --tls DIR unless all of this network is yours"
)


class Address(NamedTuple):
    """Where a scheduler is."""

    scheme: str  # tcp or tls
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.scheme}://{self.host}:{self.port}"

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach it."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host.strip("[]")).is_loopback
        except ValueError:  # a name
            return False

    @property
    def protected(self) -> bool:
        """Whether strangers cannot talk to it."""
        return self.scheme == "tls" or self.loopback


def read_address(text: str, flag: str) -> Address:
    """The address that a flag gives. Raises `InputError` where it is none."""
    found = _ADDRESS.fullmatch(text)
    if found is None or not 0 < int(found["port"]) < 65536:
        raise InputError(
            f"{flag}: {text!r:.80} is no address of a scheduler; give tcp://HOST:{PORT} or tls://HOST:{PORT}"
        )
    return Address(found["scheme"], found["host"], int(found["port"]))


def security(scheme: str, folder: Path | None) -> Any:
    """The certificates in a folder, as `distributed` takes them; None for tcp.

    Raises `InputError` where there are none for tls, where tcp is given some, and where the extra is not installed.
    """
    needs_distributed()
    if scheme == "tcp":
        if folder is not None:
            raise InputError("--tls: tcp:// is not encrypted; give an address with tls://, or leave --tls out")
        return None
    if folder is None:
        raise InputError(
            f"--tls: tls:// needs certificates; give a folder with {_AUTHORITY}, {' and '.join(_PAIRS[0])}"
        )
    pair = next((pair for pair in _PAIRS if (folder / pair[0]).is_file()), _PAIRS[0])
    for name in (_AUTHORITY, *pair):
        if not (folder / name).is_file():
            raise InputError(
                f"--tls: {folder} has no {name}; give a folder with {_AUTHORITY}, {' and '.join(_PAIRS[0])}"
            )
    from distributed.security import Security

    certificate, key = (str(folder / name) for name in pair)
    roles = {f"tls_{role}_{what}": path for role in ("client", "scheduler", "worker")
             for what, path in (("cert", certificate), ("key", key))}  # fmt: skip
    return Security(require_encryption=True, tls_ca_file=str(folder / _AUTHORITY), **roles)


def needs_distributed() -> None:
    """Raise `InputError` where the extra is not installed."""
    if importlib.util.find_spec("distributed") is None:
        raise InputError("a cluster needs distributed; install it with: pip install 'maipp[cluster]'")


def quiet() -> None:
    """Have `distributed` log nothing, here and in the processes that are started from here.

    What concerns the user is told in lines of our own. Must run before it is imported.
    """
    os.environ.setdefault("DASK_LOGGING__DISTRIBUTED", "critical")
