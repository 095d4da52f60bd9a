"""A small certificate authority: makes certificates of the curve P-256, and reads those that it has made."""

import secrets
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from maipp.errors import InputError
from maipp.fleet.certificates import (
    AUTHORITY,
    check_time,
    is_signed_by,
    load_cryptography,
    name_of,
    read_certificate,
    read_key,
)

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

# In the folder of the authority.
AUTHORITY_KEY, ISSUED = "ca.key", "certificates"
MOST_DAYS = 3650
_AUTHORITY_DAYS = 2 * MOST_DAYS
_EARLIER = timedelta(days=1)  # computers without a battery for their clock start up behind


def _new_key() -> Any:
    from cryptography.hazmat.primitives.asymmetric.ec import SECP256R1, generate_private_key

    return generate_private_key(SECP256R1())


def new_authority(now: datetime) -> "tuple[Certificate, Any]":
    """The certificate and key of a new one."""
    x509, key = load_cryptography(), _new_key()
    subject = _subject(f"maipp fleet {secrets.token_hex(4)}", "authority")
    usage = x509.KeyUsage(False, False, False, False, False, True, True, False, False)
    certificate = (
        _builder(subject, subject, key, now, _AUTHORITY_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )
    return _signed(certificate, key), key


def issue(
    name: str, role: str, hosts: list[Any], days: int, now: datetime, authority: "Certificate", authority_key: Any
) -> "tuple[Certificate, Any]":
    """A new certificate and its key, for somebody who is found at these alternative names."""
    x509, key = load_cryptography(), _new_key()
    purposes = [x509.ExtendedKeyUsageOID.SERVER_AUTH, x509.ExtendedKeyUsageOID.CLIENT_AUTH]
    issuer_id = x509.AuthorityKeyIdentifier.from_issuer_public_key(authority.public_key())  # pyright: ignore
    usage = x509.KeyUsage(True, False, False, False, False, False, False, False, False)
    certificate = (
        _builder(_subject(name, role), authority.subject, key, now, days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
        .add_extension(issuer_id, critical=False)
    )
    if hosts:
        certificate = certificate.add_extension(x509.SubjectAlternativeName(hosts), critical=False)
    return _signed(certificate, authority_key), key


def _subject(name: str, role: str) -> Any:
    from cryptography.x509.oid import NameOID

    x509 = load_cryptography()
    parts = [
        (NameOID.ORGANIZATION_NAME, "maipp"),
        (NameOID.ORGANIZATIONAL_UNIT_NAME, role),
        (NameOID.COMMON_NAME, name),
    ]
    return x509.Name([x509.NameAttribute(kind, value) for kind, value in parts])


def _builder(subject: Any, issuer: Any, key: Any, now: datetime, days: int) -> Any:
    x509 = load_cryptography()
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _EARLIER)
        .not_valid_after(now + timedelta(days=days))
    )


def _signed(certificate: Any, key: Any) -> "Certificate":
    from cryptography.hazmat.primitives.hashes import SHA256

    return certificate.sign(key, SHA256())


def read_authority(home: Path) -> "tuple[Certificate, Any]":
    """The authority that is there. Raises `InputError` where its key is elsewhere, or it holds no more."""
    if not (home / AUTHORITY_KEY).exists():
        raise InputError(f"{home / AUTHORITY_KEY} is missing; put it back for as long as keys are made")
    authority, key = read_certificate(home / AUTHORITY), read_key(home / AUTHORITY_KEY)
    check_time(authority, home / AUTHORITY)
    if key.public_key() != authority.public_key():
        raise InputError(f"{home / AUTHORITY_KEY}: not the key of {home / AUTHORITY}; give a new folder")
    return authority, key


def read_issued(home: Path, authority: "Certificate") -> "dict[str, Certificate]":
    """The certificates that it has made, by name. Raises `InputError` where one is another's."""
    issued = {}
    for path in sorted((home / ISSUED).glob("*.pem")):
        certificate = read_certificate(path)
        if not is_signed_by(certificate, authority) or name_of(certificate) != path.stem:
            raise InputError(f"{path}: not the certificate of {path.stem} by this authority; put back the right one")
        issued[path.stem] = certificate
    return issued
