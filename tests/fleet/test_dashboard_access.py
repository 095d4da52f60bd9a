"""Who may read a dashboard: beyond this computer only who has the token, over TLS."""

import http.client
import socket
import ssl
from datetime import datetime, timedelta
from urllib.parse import urlsplit

import pytest

from maipp.errors import InputError

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from maipp.fleet.dashboard import Board, serve  # noqa: E402
from maipp.fleet.dashboard.server import new_token  # noqa: E402
from tests.fleet.clients import Client, snapshot  # noqa: E402

TOKEN = new_token()


@pytest.fixture
def board():
    made = Board()
    made.publish(snapshot())
    return made


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A certificate for this computer and its key, as files."""
    x509 = pytest.importorskip("cryptography.x509")
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key, folder = ec.generate_private_key(ec.SECP256R1()), tmp_path_factory.mktemp("tls")
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "localhost")])
    now = datetime(2020, 1, 1)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(now)
        .not_valid_after(now + timedelta(days=36500))
        .sign(key, hashes.SHA256())
    )
    own = serialization.NoEncryption()
    form = serialization.PrivateFormat.PKCS8
    (folder / "c.pem").write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    (folder / "k.pem").write_bytes(key.private_bytes(serialization.Encoding.PEM, form, own))
    return folder / "c.pem", folder / "k.pem"


def test_beyond_this_computer_a_token_and_tls_are_needed(board, pair, tmp_path):
    certificate, key = pair
    for host in ("0.0.0.0", "::", "192.0.2.1", "example.com"):
        with pytest.raises(InputError, match="is open to others"):
            serve(board, host)
        with pytest.raises(InputError, match="is open to others"):
            serve(board, host, token=TOKEN)
        with pytest.raises(InputError, match="is open to others"):
            serve(board, host, certificate=certificate, key=key)
    with pytest.raises(InputError, match="16 or more"):
        serve(board, token="short")
    with pytest.raises(InputError, match="give both"):
        serve(board, certificate=certificate)
    with pytest.raises(InputError, match="cannot be used: No such file"):
        serve(board, certificate=certificate, key=tmp_path / "none")
    (tmp_path / "bad").write_text("no key")
    with pytest.raises(InputError, match="cannot be used"):
        serve(board, certificate=certificate, key=tmp_path / "bad")
    with serve(board) as first, pytest.raises(InputError, match="cannot listen at 127.0.0.1:.*in use"):
        serve(board, port=urlsplit(first.url).port or 0)


def test_nobody_is_let_in_without_the_token(board, pair):
    context = ssl.create_default_context(cafile=str(pair[0]))
    context.check_hostname = False
    with serve(board, "0.0.0.0", token=TOKEN, certificate=pair[0], key=pair[1]) as dashboard:
        assert dashboard.url.startswith("https://") and dashboard.url.endswith(f"/?token={TOKEN}")

        def ask(path, **headers):
            return Client(dashboard.url, context).ask(path, **headers)

        for path in ("/", "/events", "/field?robot=", "/assets/page.js", "/nowhere"):
            for headers in ({}, {"Cookie": "maipp-fleet=wrong"}, {"Authorization": f"Bearer {TOKEN}x"}):
                status, told, _ = ask(path, **headers)
                assert status == 401 and told["x-content-type-options"] == "nosniff"
        assert ask(f"/?token={TOKEN[:-1]}")[0] == 401
        assert ask("/", Authorization=f"Bearer {TOKEN}")[0] == 200
        status, told, _ = ask(f"/?token={TOKEN}")
        assert status == 303 and told["location"] == "/"
        cookie = told["set-cookie"]
        assert {"HttpOnly", "Secure", "SameSite=lax"} <= {part.strip() for part in cookie.split(";")}
        assert ask("/assets/page.js", Cookie=cookie.partition(";")[0])[0] == 200
        _, news = next(Client(dashboard.url, context).stream(Cookie=cookie.partition(";")[0]))
        assert news["instance"] == board.instance
        with pytest.raises((OSError, http.client.HTTPException)):  # no plain text at this port
            Client(dashboard.url.replace("https", "http").replace(socket.gethostname(), "127.0.0.1")).ask("/")
