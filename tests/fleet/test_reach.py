"""Why an address is not reached, in words."""

import socket
import time
from datetime import UTC, datetime, timedelta

import pytest

from maipp.fleet.key_folders import make_keys
from maipp.fleet.launch import free_ports
from maipp.fleet.reach import Scout, why_not
from maipp.fleet.security import read_security

pytest.importorskip("zenoh")
pytest.importorskip("cryptography")
from maipp.fleet.zenoh_link import ZenohLink  # noqa: E402

HERE = "127.0.0.1"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Keys of two fleets, one of them with a member whose certificate has expired."""
    home = tmp_path_factory.mktemp("keys")
    make_keys(home / "one", ["a", "b"], [], {"a": [HERE], "b": [HERE]})
    make_keys(home / "one", ["old"], [], {"old": [HERE]}, days=1, now=datetime.now(UTC) - timedelta(days=3))
    make_keys(home / "two", ["b"], [], {"b": [HERE]})
    return home


def tls_of(folder):
    """What Zenoh is told of a folder, whose certificate may have expired."""
    files = {"root_ca_certificate": "ca.pem", "connect_certificate": "robot.pem", "connect_private_key": "robot.key"}
    return {key: str(folder / file) for key, file in files.items()}


def test_reasons(folder):
    (port, nobody) = free_ports(2)
    address, security = f"tls/{HERE}:{port}", read_security(folder / "one" / "a", "a", lambda text: None)
    right = tls_of(folder / "one" / "b")
    with ZenohLink("a", "0" * 64, listen=[address], security=security):
        assert why_not(address, right) == ""
        assert why_not(address, tls_of(folder / "two" / "b")).startswith("its certificate is refused here: unable to")
        assert "is not valid for 'localhost'" in why_not(address.replace(HERE, "localhost"), right)
        assert why_not(address, tls_of(folder / "one" / "old")).startswith("the certificates do not fit: ")
        assert "expired" in why_not(address, tls_of(folder / "one" / "old"))
    assert why_not(f"tls/{HERE}:{nobody}", right) == "connection refused"
    assert why_not(f"tcp/{HERE}:{nobody}", None) == "connection refused"
    assert why_not("tls/boat-1.invalid:7447", right) == "no computer of this name is known"
    with socket.create_server((HERE, 0)) as silent:
        address = f"{HERE}:{silent.getsockname()[1]}"
        assert why_not(f"tls/{address}", right, 0.2) == "no answer"
        assert why_not(f"tcp/{address}", None) == ""


def test_a_reason_is_told_once_and_nothing_while_somebody_is_there():
    (nobody,) = free_ports(1)
    scout, told, now = Scout([f"tcp/{HERE}:{nobody}"], None, patience=1.0), [], 0.0
    for linked in (True, False, False):
        assert scout.look(linked, now) == []
    end = time.monotonic() + 20
    while not told and time.monotonic() < end:
        now += 1.0
        told += scout.look(False, now)
        time.sleep(0.01)
    for _ in range(20):
        now += 1.0
        told += scout.look(False, now)
        time.sleep(0.01)
    assert told == [f"not connected to tcp/{HERE}:{nobody}: connection refused"]
    assert scout.look(True, now) == []
