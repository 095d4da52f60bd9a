"""`maipp fleet keys`: a small certificate authority of the fleet's own, and a folder of keys for each that takes part.

    DIR/authority/       ca.pem, ca.key, certificates of all; stays at home
    DIR/boat-1/          ca.pem, robot.pem, robot.key, peers/*.pem; goes onto boat-1, and nothing else does

Keys are of the curve P-256, kept without a password: a robot starts by itself. A certificate says whose it is (common
name), whether of a robot or a watcher (organizational unit), and at which hosts it is found: by its name, by its name
under .local, and at the addresses that are given.
"""

import ipaddress
import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.fleet.authority import AUTHORITY_KEY, ISSUED, MOST_DAYS, issue, new_authority, read_authority, read_issued
from maipp.fleet.certificates import AUTHORITY, CERTIFICATE, KEY, PEERS, ROBOT, WATCHER, load_cryptography
from maipp.fleet.log import check_name

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

HOME = "authority"
_LABEL = "[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
_HOST = re.compile(rf"(?=.{{1,253}}$){_LABEL}(\.{_LABEL})*")


@dataclass(frozen=True)
class KeyFolders:
    """What `make_keys` has made."""

    folders: list[Path]
    authority: Path | None  # None: it was there
    older: list[str]  # names of those that were there, and must get the new certificates


def make_keys(
    folder: Path,
    robots: Sequence[str],
    watchers: Sequence[str] = (),
    addresses: Mapping[str, Sequence[str]] | None = None,
    days: int = 365,
    now: datetime | None = None,
) -> KeyFolders:
    """Make keys for robots and watchers; the authority too, where the folder has none.

    Raises `InputError` for names that are none or are taken, addresses of nobody, and folders that cannot be used;
    nothing has changed then.
    """
    load_cryptography()
    names, now = [*robots, *watchers], now or datetime.now(UTC)
    addresses = dict(addresses or {})
    _check(folder, names, addresses, days)
    home, fresh = folder / HOME, not (folder / HOME).exists()
    authority, key = new_authority(now) if fresh else read_authority(home)
    issued = {} if fresh else read_issued(home, authority)
    for name in names:
        if any(name.lower() == other.lower() for other in issued):
            raise InputError(f"{folder / name}: has keys already; a robot keeps its own; give a new name")
    made = {}
    for name in names:
        role = ROBOT if name in robots else WATCHER
        made[name] = issue(name, role, _hosts(name, addresses.get(name, [])), days, now, authority, key)
    _write(folder, fresh, (authority, key), made, issued)
    return KeyFolders([folder / name for name in names], home if fresh else None, [*issued])


def _check(folder: Path, names: Sequence[str], addresses: Mapping[str, Sequence[str]], days: int) -> None:
    """Raise `InputError` for what cannot be made."""
    if not names:
        raise InputError("--robots: no name; give those of the mission's robots")
    for number, name in enumerate(names):
        check_name(name, "--robots")
        if name.lower() in [other.lower() for other in names[:number]] or name.lower() == HOME:
            raise InputError(f"--robots: {name} is taken; give each a name of its own, and none {HOME!r}")
        if os.path.lexists(folder / name):
            raise InputError(f"{folder / name}: is there already, and is not written over; give a new name or folder")
    if not 1 <= days <= MOST_DAYS:
        raise InputError(f"--days: {days} is not between 1 and {MOST_DAYS}")
    for name, hosts in addresses.items():
        if name not in names:
            raise InputError(f"--address: {name!r:.60} gets no keys now; name it in --robots or --watchers")
        for host in hosts:
            if not _is_address(host) and not _HOST.fullmatch(host):
                raise InputError(f"--address: {host!r:.60} is no address; give NAME=192.168.1.12 or NAME=boat.example")


def _is_address(host: str) -> bool:
    try:
        return bool(ipaddress.ip_address(host))
    except ValueError:
        return False


def _hosts(name: str, given: Sequence[str]) -> list[Any]:
    """Where a certificate's owner is found, as alternative names."""
    x509 = load_cryptography()
    own = [name.lower(), f"{name.lower()}.local"] if _HOST.fullmatch(name) and not _is_address(name) else []
    hosts = dict.fromkeys([*own, *given])
    return [x509.IPAddress(ipaddress.ip_address(h)) if _is_address(h) else x509.DNSName(h) for h in hosts]


def _write(
    folder: Path,
    fresh: bool,
    authority: "tuple[Certificate, Any]",
    made: "Mapping[str, tuple[Certificate, Any]]",
    issued: "Mapping[str, Certificate]",
) -> None:
    """Write the new folders, and the new certificates into those that are there; all or nothing."""
    certificates = {name: certificate for name, (certificate, _) in made.items()}
    ca = _pem(authority[0])
    new: dict[str, dict[str, bytes]] = {}
    if fresh:
        told = {f"{ISSUED}/{name}.pem": _pem(certificate) for name, certificate in certificates.items()}
        new[HOME] = {AUTHORITY: ca, AUTHORITY_KEY: _key_pem(authority[1]), **told}
    for name, (certificate, key) in made.items():
        others = {other: each for other, each in {**issued, **certificates}.items() if other != name}
        peers = {f"{PEERS}/{other}.pem": _pem(each) for other, each in others.items()}
        new[name] = {AUTHORITY: ca, CERTIFICATE: _pem(certificate), KEY: _key_pem(key), **peers}
    older = [] if fresh else [folder / HOME / ISSUED, *(folder / name / PEERS for name in issued)]
    begun: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, files in new.items():
            _write_folder(folder / name, files, begun)
        for place in older:
            if place.is_dir():  # else it is on its robot already, and not here
                for name, certificate in certificates.items():
                    begun.append(place / f"{name}.pem")
                    write_atomic(begun[-1], _pem(certificate))
    except BaseException as error:
        for path in begun:
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise InputError(f"{folder}: cannot be written to: {error.strerror or error}") from None
        raise


def _write_folder(folder: Path, files: Mapping[str, bytes], begun: list[Path]) -> None:
    """Write a new folder that only its owner can read; its path goes into `begun`."""
    stage = Path(tempfile.mkdtemp(prefix=".maipp-", dir=folder.parent))
    begun.append(stage)
    if CERTIFICATE in files:
        (stage / PEERS).mkdir(mode=0o700)
    for name, content in files.items():
        (stage / name).parent.mkdir(mode=0o700, exist_ok=True)
        mode = 0o600 if name.endswith(".key") else 0o644
        with open(os.open(stage / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    os.rename(stage, folder)
    begun[-1] = folder


def _pem(certificate: "Certificate") -> bytes:
    from cryptography.hazmat.primitives.serialization import Encoding

    return certificate.public_bytes(Encoding.PEM)


def _key_pem(key: Any) -> bytes:
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
