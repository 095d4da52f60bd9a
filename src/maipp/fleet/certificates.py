"""Certificates of a fleet: files, whose they are, and what they allow."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maipp.errors import InputError, first_line
from maipp.files import read_bytes

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

# In the folder of a robot: certificate of the authority, the robot's own with its key, and those of all others.
AUTHORITY, CERTIFICATE, KEY, PEERS = "ca.pem", "robot.pem", "robot.key", "peers"
# What the owner of a certificate may do: a robot writes under its own name, a watcher reads.
ROBOT, WATCHER = "robot", "watcher"

_LARGEST = 1 << 16  # bytes of a file


def load_cryptography() -> Any:
    """The library's part for certificates. Raises `InputError` where it is not installed."""
    try:
        from cryptography import x509
    except ImportError:
        raise InputError("keys of a fleet need cryptography; pip install 'maipp[fleet]'") from None
    return x509


def read_certificate(path: Path) -> "Certificate":
    """The certificate of a PEM file. Raises `InputError` for what is none."""
    x509 = load_cryptography()
    try:
        return x509.load_pem_x509_certificate(read_bytes(path, "certificate", _LARGEST))
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{path}: no certificate: {first_line(error)}") from None


def read_key(path: Path) -> Any:
    """The elliptic-curve key of a PEM file without a password. Raises `InputError` for what is none."""
    load_cryptography()
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        key = load_pem_private_key(read_bytes(path, "key", _LARGEST), None)
    except InputError:
        raise
    except (ValueError, TypeError) as error:  # TypeError: it has a password
        raise InputError(f"{path}: no key that can be used: {first_line(error)}") from None
    if not isinstance(key, EllipticCurvePrivateKey):
        raise InputError(f"{path}: no key of an elliptic curve; maipp fleet keys makes such")
    return key


def name_of(certificate: "Certificate") -> str:
    """Whose it is; empty where that is not said once."""
    from cryptography.x509.oid import NameOID

    return _only(certificate, NameOID.COMMON_NAME)


def role_of(certificate: "Certificate") -> str:
    """`ROBOT`, `WATCHER`, or what else it says."""
    from cryptography.x509.oid import NameOID

    return _only(certificate, NameOID.ORGANIZATIONAL_UNIT_NAME)


def is_signed_by(certificate: "Certificate", authority: "Certificate") -> bool:
    """Whether the authority has made a certificate, whatever the date."""
    from cryptography.exceptions import InvalidSignature

    try:
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError, TypeError):
        return False
    return True


def check_time(certificate: "Certificate", path: Path, now: datetime | None = None) -> None:
    """Raise `InputError` for a certificate that does not hold today, by this computer's clock."""
    now, begin, end = now or datetime.now(UTC), certificate.not_valid_before_utc, certificate.not_valid_after_utc
    if now > end:
        raise InputError(f"{path}: expired on {end:%Y-%m-%d}; make new keys with maipp fleet keys, or set the clock")
    if now < begin:
        raise InputError(f"{path}: holds from {begin:%Y-%m-%d} on, and this computer's clock says {now:%Y-%m-%d}")


def _only(certificate: "Certificate", kind: Any) -> str:
    values = certificate.subject.get_attributes_for_oid(kind)
    return str(values[0].value) if len(values) == 1 else ""
