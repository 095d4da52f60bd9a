"""Who may take part: certificates of a small authority of the fleet's own, and what each of them may say."""

import ipaddress
import os
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maipp.errors import InputError
from maipp.fleet.access import access_control
from maipp.fleet.certificates import (
    AUTHORITY,
    CERTIFICATE,
    KEY,
    PEERS,
    ROBOT,
    WATCHER,
    check_time,
    is_signed_by,
    name_of,
    read_certificate,
    read_key,
    role_of,
)
from maipp.fleet.log import is_name
from maipp.fleet.signing import Signatures

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

_SOON = timedelta(days=14)


@dataclass(frozen=True)
class Security:
    """What a robot or a watcher shows and trusts."""

    folder: Path
    name: str
    roles: dict[str, str]  # of all that have a certificate in the folder, its own included
    public: dict[str, Any]  # key of each robot

    @property
    def known(self) -> frozenset[str]:
        """Whose certificates are in the folder."""
        return frozenset(self.roles)

    def zenoh(self) -> dict[str, Any]:
        """What of Zenoh's configuration follows from it."""
        authority, certificate, key = (str((self.folder / name).resolve()) for name in (AUTHORITY, CERTIFICATE, KEY))
        tls = {
            "root_ca_certificate": authority,
            "enable_mtls": True,
            "listen_certificate": certificate,
            "listen_private_key": key,
            "connect_certificate": certificate,
            "connect_private_key": key,
            "verify_name_on_connect": True,
            "close_link_on_expiration": True,
        }
        return {"transport/link/tls": tls, "access_control": access_control(self.name, self.roles)}

    def seal(self) -> Signatures:
        """Signs this robot's logs, and checks those of all."""
        return Signatures(self.name, read_key(self.folder / KEY), self.public)


def security_of(folder: Path | None, name: str, tell: Callable[[str], None] = print) -> Security | None:
    """What is in a folder, as `read_security` has it; None without one."""
    return None if folder is None else read_security(folder, name, tell)


def read_security(folder: Path, name: str, tell: Callable[[str], None] = print) -> Security:
    """What is in a folder that `maipp fleet keys` has made for somebody of this name.

    Raises `InputError` for a folder that lacks something, that is another one's, or whose certificate does not hold.
    """
    for path in (folder, *(folder / file for file in (AUTHORITY, CERTIFICATE, KEY, PEERS))):
        if not path.exists():
            raise InputError(f"--keys: {path} is missing; give the folder that maipp fleet keys made for {name}")
    authority, own = read_certificate(folder / AUTHORITY), read_certificate(folder / CERTIFICATE)
    check_time(authority, folder / AUTHORITY)
    roles, public = {}, {}
    certificates = [folder / CERTIFICATE, *sorted((folder / PEERS).glob("*.pem"))]
    for path in certificates:
        certificate = own if path == certificates[0] else read_certificate(path)
        owner = _owner(certificate, path, authority, name if path == certificates[0] else path.stem)
        if owner in roles:
            raise InputError(f"{path}: a second certificate of {owner}; leave one of them")
        roles[owner] = role_of(certificate)
        if roles[owner] == ROBOT:
            public[owner] = certificate.public_key()
        _check_end(certificate, path, path == certificates[0], tell)
    if read_key(folder / KEY).public_key() != own.public_key():
        raise InputError(f"{folder / KEY}: not the key of {folder / CERTIFICATE}; copy the folder anew")
    if os.name == "posix" and (folder / KEY).stat().st_mode & 0o077:
        tell(f"warning: {folder / KEY} can be read by other users of this computer; chmod 600 it")
    return Security(folder, name, roles, public)


def _owner(certificate: "Certificate", path: Path, authority: "Certificate", expected: str) -> str:
    """Whose certificate it is. Raises `InputError` where that is not as expected."""
    if not is_signed_by(certificate, authority):
        raise InputError(f"{path}: not signed by {AUTHORITY} beside it; all robots need keys of one authority")
    name = name_of(certificate)
    if name != expected or not is_name(name):
        raise InputError(f"{path}: the certificate of {name!r:.60}, not of {expected!r:.60}")
    if role_of(certificate) not in (ROBOT, WATCHER):
        raise InputError(f"{path}: a certificate of neither a robot nor a watcher; maipp fleet keys makes such")
    return name


def _check_end(certificate: "Certificate", path: Path, own: bool, tell: Callable[[str], None]) -> None:
    """Raise `InputError` where one's own does not hold today; tell where another's does not, or will not soon."""
    if own:
        check_time(certificate, path)
    end, now = certificate.not_valid_after_utc, datetime.now(UTC)
    if now > end:
        tell(f"warning: {path} expired on {end:%Y-%m-%d}; {name_of(certificate)} cannot connect")
    elif now > end - _SOON:
        tell(f"warning: {path} expires on {end:%Y-%m-%d}")


def is_loopback(host: str) -> bool:
    """Whether a host can be reached from this computer only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
