"""What `maipp fleet keys` makes, what it refuses, and what a robot says of a folder that is not right."""

import os
import shutil
from datetime import UTC, datetime, timedelta

import pytest
import tyro

from maipp.cli.fleet_keys import FleetKeysFlags, run
from maipp.errors import InputError
from maipp.fleet.key_folders import make_keys
from maipp.fleet.log import Head, Origin
from maipp.fleet.security import read_security, security_of

pytest.importorskip("cryptography")
from cryptography import x509  # noqa: E402
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat  # noqa: E402
from cryptography.x509.verification import PolicyBuilder, Store, VerificationError  # noqa: E402

ROBOTS = ["boat-1", "boat-2", "B_3"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Keys of three robots and of somebody who watches."""
    folder = tmp_path_factory.mktemp("keys") / "fleet"
    make_keys(folder, ROBOTS, ["shore"], {"boat-1": ["192.168.1.11", "fe80::1", "boat.example"]})
    return folder


@pytest.fixture
def folder(made, tmp_path):
    """A copy of them."""
    return shutil.copytree(made, tmp_path / "fleet")


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def certificate(path):
    return x509.load_pem_x509_certificate(path.read_bytes())


def test_each_folder_has_what_its_robot_needs_and_nothing_else(made):
    for name in [*ROBOTS, "shore"]:
        peers = [f"peers/{other}.pem" for other in sorted([*ROBOTS, "shore"]) if other != name]
        assert files(made / name) == ["ca.pem", *peers, "robot.key", "robot.pem"]
        for path in (made / name / "peers").iterdir():
            assert path.read_bytes() == (made / path.stem / "robot.pem").read_bytes()
    keys = [path for path in made.rglob("*.key")]
    assert len({path.read_bytes() for path in keys}) == len(keys) == 5
    assert all(path.stat().st_mode & 0o777 == 0o600 for path in keys)
    assert all(path.stat().st_mode & 0o777 == 0o700 for path in made.iterdir())
    assert not [
        path
        for path in made.rglob("*")
        if b"PRIVATE" in (path.read_bytes() if path.is_file() else b"") and path.suffix != ".key"
    ]


def test_an_independent_reader_takes_the_certificates_for_what_they_are(made):
    """The verification of `cryptography` itself: chain, time, purposes and names."""
    builder = PolicyBuilder().store(Store([certificate(made / "authority" / "ca.pem")]))
    for name, host in [
        ("boat-1", "boat-1"),
        ("boat-1", "boat-1.local"),
        ("boat-1", "boat.example"),
        ("boat-2", "boat-2"),
    ]:
        own = certificate(made / name / "robot.pem")
        builder.build_server_verifier(x509.DNSName(host)).verify(own, [])
        builder.build_client_verifier().verify(own, [])
        with pytest.raises(VerificationError):
            builder.build_server_verifier(x509.DNSName("boat-9")).verify(own, [])
    names = certificate(made / "boat-1" / "robot.pem").extensions.get_extension_for_class(x509.SubjectAlternativeName)
    assert [str(address) for address in names.value.get_values_for_type(x509.IPAddress)] == ["192.168.1.11", "fe80::1"]


def test_a_robot_is_added_with_the_same_authority(folder):
    before = {path: (folder / path).read_bytes() for path in files(folder)}
    shutil.move(folder / "boat-2", folder.parent / "boat-2")  # it is on its boat
    made = make_keys(folder, ["boat-4"])
    assert made.authority is None and made.older == ["B_3", "boat-1", "boat-2", "shore"]
    assert (folder / "boat-4" / "ca.pem").read_bytes() == before["authority/ca.pem"]
    assert len(files(folder / "boat-4" / "peers")) == 4
    for name in ("boat-1", "B_3", "shore"):
        assert "boat-4" in read_security(folder / name, name).known
    assert read_security(folder / "boat-4", "boat-4").known == {*ROBOTS, "shore", "boat-4"}
    for path, content in before.items():
        if not path.startswith("boat-2/"):
            assert (folder / path).read_bytes() == content


@pytest.mark.parametrize(
    ("robots", "more", "problem"),
    [
        ([], {}, "no name"),
        (["boat-1"], {}, "is there already"),
        (["BOAT-2"], {}, "has keys already"),
        (["boat-4", "boat-4"], {}, "is taken"),
        (["authority"], {}, "is taken"),
        (["a/b"], {}, "no name of a robot"),
        (["*"], {}, "no name of a robot"),
        (["../up"], {}, "no name of a robot"),
        (["boat-4"], {"watchers": ["boat-4"]}, "is taken"),
        (["boat-4"], {"days": 0}, "not between 1 and 3650"),
        (["boat-4"], {"addresses": {"boat-5": ["10.0.0.1"]}}, "gets no keys now"),
        (["boat-4"], {"addresses": {"boat-4": ["10.0.0.1:7447"]}}, "is no address"),
        (["boat-4"], {"addresses": {"boat-4": ["*.example"]}}, "is no address"),
    ],
)
def test_what_cannot_be_made_is_refused_and_nothing_has_changed(folder, robots, more, problem):
    before = {path: (folder / path).read_bytes() for path in files(folder)}
    with pytest.raises(InputError, match=problem):
        make_keys(folder, robots, **more)
    assert {path: (folder / path).read_bytes() for path in files(folder)} == before


def test_without_the_authoritys_key_nobody_is_added(folder):
    (folder / "authority" / "ca.key").unlink()
    with pytest.raises(InputError, match=r"ca\.key is missing; put it back"):
        make_keys(folder, ["boat-4"])
    assert not (folder / "boat-4").exists()


def test_an_error_halfway_leaves_nothing(folder, monkeypatch):
    before, rename = files(folder), os.rename
    monkeypatch.setattr(os, "rename", lambda a, b: rename(a, b) if b.name == "boat-4" else os.stat("/no/such/file"))
    with pytest.raises(InputError, match="cannot be written to"):
        make_keys(folder, ["boat-4", "boat-5"])
    assert files(folder) == before and sorted(path.name for path in folder.iterdir()) == [
        "B_3",
        "authority",
        "boat-1",
        "boat-2",
        "shore",
    ]


def test_the_command_says_what_goes_where(tmp_path, capsys):
    line = f"{tmp_path / 'k'} --robots boat-1 boat-2 --watchers shore --address boat-1=10.0.0.1 boat-1=boat-1.lan"
    assert run(tyro.cli(FleetKeysFlags, args=line.split())) == 0
    told = capsys.readouterr().out
    assert f"{tmp_path / 'k' / 'boat-2'}: copy it onto boat-2, and onto no other" in told
    assert "whoever has its ca.key can join the fleet: keep it off the boats" in told
    assert run(tyro.cli(FleetKeysFlags, args=f"{tmp_path / 'k'} --robots boat-3".split())) == 0
    assert "boat-1, boat-2, shore: copy peers/ anew onto each; until then nothing of boat-3" in capsys.readouterr().out
    with pytest.raises(InputError, match="not NAME=HOST"):
        run(FleetKeysFlags(tmp_path / "k", robots=("boat-4",), address=("10.0.0.1",)))
    with pytest.raises(InputError, match="is a file|cannot be written to"):
        (tmp_path / "file").write_text("")
        make_keys(tmp_path / "file", ["boat-1"])


# What a robot says of its folder.


def test_a_folder_that_is_right_says_nothing(made):
    told = []
    security = read_security(made / "boat-1", "boat-1", told.append)
    assert told == [] and security.known == {*ROBOTS, "shore"}
    assert security.zenoh()["transport/link/tls"]["enable_mtls"] is True
    assert security_of(None, "boat-1") is None


@pytest.mark.parametrize("missing", ["", "ca.pem", "robot.pem", "robot.key", "peers"])
def test_what_is_missing_is_named(folder, missing):
    path = folder / "boat-1" / missing
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    with pytest.raises(InputError, match=f"--keys: {path} is missing"):
        read_security(folder / "boat-1", "boat-1")


def test_keys_of_another_robot_are_refused(folder):
    with pytest.raises(InputError, match=r"robot\.pem: the certificate of 'boat-1', not of 'boat-2'"):
        read_security(folder / "boat-1", "boat-2")
    shutil.copy(folder / "boat-2" / "robot.key", folder / "boat-1" / "robot.key")
    with pytest.raises(InputError, match=r"robot\.key: not the key of"):
        read_security(folder / "boat-1", "boat-1")


@pytest.mark.parametrize("name", ["ca.pem", "robot.pem", "robot.key", "peers/boat-2.pem"])
@pytest.mark.parametrize("content", [b"", b"no certificate", b"-----BEGIN CERTIFICATE-----\nAAAA\n", bytes(100_000)])
def test_damaged_files_are_named(folder, name, content):
    path = folder / "boat-1" / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=str(path)):
        read_security(folder / "boat-1", "boat-1")


def test_certificates_of_another_authority_are_refused(folder, tmp_path):
    make_keys(tmp_path / "other", ["boat-1", "boat-2"])
    shutil.copy(tmp_path / "other" / "boat-2" / "robot.pem", folder / "boat-1" / "peers" / "boat-2.pem")
    with pytest.raises(InputError, match=r"boat-2\.pem: not signed by ca\.pem beside it"):
        read_security(folder / "boat-1", "boat-1")
    shutil.copy(tmp_path / "other" / "boat-1" / "ca.pem", folder / "boat-2" / "ca.pem")
    with pytest.raises(InputError, match=r"robot\.pem: not signed by ca\.pem beside it"):
        read_security(folder / "boat-2", "boat-2")
    os.rename(folder / "boat-1" / "peers" / "B_3.pem", folder / "boat-1" / "peers" / "boat-2.pem")
    with pytest.raises(InputError, match="the certificate of 'B_3', not of 'boat-2'"):
        read_security(folder / "boat-1", "boat-1")


def test_a_certificate_that_does_not_hold_today_is_refused(folder):
    now, told = datetime.now(UTC), []
    make_keys(folder, ["old"], days=1, now=now - timedelta(days=3))
    make_keys(folder, ["soon"], days=5, now=now)
    make_keys(folder, ["late"], days=5, now=now + timedelta(days=3))
    with pytest.raises(InputError, match=rf"old/robot\.pem: expired on {now - timedelta(days=2):%Y-%m-%d}; make new"):
        read_security(folder / "old", "old")
    with pytest.raises(InputError, match=r"late/robot\.pem: holds from .* on, and this computer's clock says"):
        read_security(folder / "late", "late")
    read_security(folder / "soon", "soon", told.append)
    assert sum("soon/robot.pem expires on" in line for line in told) == 1
    assert sum("peers/old.pem expired on" in line and "old cannot connect" in line for line in told) == 1


def test_a_key_that_others_can_read_is_told(folder):
    told = []
    (folder / "boat-1" / "robot.key").chmod(0o644)
    read_security(folder / "boat-1", "boat-1", told.append)
    assert told == [
        f"warning: {folder / 'boat-1' / 'robot.key'} can be read by other users of this computer; chmod 600 it"
    ]


def test_a_key_with_a_password_or_of_another_kind_is_refused(folder):
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import BestAvailableEncryption

    path, key = folder / "boat-1" / "robot.key", Ed25519PrivateKey.generate()
    path.write_bytes(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    with pytest.raises(InputError, match="no key of an elliptic curve"):
        read_security(folder / "boat-1", "boat-1")
    path.write_bytes(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"secret")))
    with pytest.raises(InputError, match="no key that can be used"):
        read_security(folder / "boat-1", "boat-1")


# Signatures.


def test_a_signature_is_of_one_robot_and_one_head(made):
    one, two, shore = (read_security(made / name, name).seal() for name in ("boat-1", "boat-2", "shore"))
    origin, head = Origin("boat-1", "0" * 8), Head(7, b"0123456789abcdef")
    signature = one.sign(origin, head)
    for seal in (one, two, shore):
        assert seal.check(origin, head._replace(signature=signature))
        for other in (
            (Origin("boat-1", "1" * 8), head),
            (Origin("boat-2", "0" * 8), head),
            (Origin("boat-9", "0" * 8), head),
            (origin, head._replace(length=8)),
            (origin, head._replace(chain=b"0123456789abcdee")),
        ):
            assert not seal.check(other[0], other[1]._replace(signature=signature))
        for wrong in (b"", b"0" * 70, signature[:-1], signature + b"0", bytes(10_000)):
            assert not seal.check(origin, head._replace(signature=wrong))
    watched = Origin("shore", "0" * 8)  # a watcher writes no log, whatever it signs
    assert not one.check(watched, head._replace(signature=shore.sign(watched, head)))


def test_what_was_signed_stays_signed_when_the_certificate_has_expired(folder):
    make_keys(folder, ["old"], days=1, now=datetime.now(UTC) - timedelta(days=3))
    from maipp.fleet.certificates import read_key
    from maipp.fleet.signing import Signatures

    origin, head = Origin("old", "0" * 8), Head(1, b"0" * 16)
    signature = Signatures("old", read_key(folder / "old" / "robot.key"), {}).sign(origin, head)
    seal = read_security(folder / "boat-1", "boat-1", lambda text: None).seal()
    assert seal.check(origin, head._replace(signature=signature))
