"""The server of a dashboard: a thread of its own, loopback unless there is a token and TLS."""

import contextlib
import secrets
import socket
import ssl
import struct
import threading
import time
from pathlib import Path
from typing import Any
from urllib.parse import quote

from maipp.errors import InputError
from maipp.fleet.dashboard.app import make_app
from maipp.fleet.dashboard.board import Board
from maipp.fleet.security import is_loopback

_START, _STOP = 5.0, 1.5  # s
_LEAST_TOKEN = 16  # characters


def new_token() -> str:
    """One that nobody guesses."""
    return secrets.token_urlsafe(24)


class Dashboard:
    """A running server. Close it, or use it in a `with` block: within two seconds thread and sockets are gone."""

    def __init__(self, board: Board, server: Any, listener: socket.socket, url: str) -> None:
        self.board, self.url, self._server = board, url, server
        self._thread = threading.Thread(target=server.run, args=([listener],), name="dashboard", daemon=True)
        self._thread.start()
        until = time.monotonic() + _START
        while not server.started:
            if not self._thread.is_alive() or time.monotonic() > until:
                self.close()
                raise InputError(f"{url.partition('?')[0]}: the dashboard cannot be started")
            time.sleep(0.005)

    def close(self) -> None:
        """Stop serving; pages that are open say so, and come back by themselves. Does nothing the second time."""
        self.board.close()
        self._server.should_exit = True
        self._thread.join(_STOP)
        if self._thread.is_alive():
            self._server.force_exit = True
            self._thread.join(0.5)

    def __enter__(self) -> "Dashboard":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def serve(
    board: Board,
    host: str = "127.0.0.1",
    port: int = 0,
    *,
    token: str | None = None,
    certificate: Path | None = None,
    key: Path | None = None,
    stall: float = 20.0,
) -> Dashboard:
    """Serve a board; with port 0 at one that is free. `url` of what is returned is the address to open, token and all.

    `certificate` and `key` are PEM files. A client that takes nothing for `stall` seconds is dropped. Raises
    `InputError` for an address beyond this computer without both token and TLS, and where the server cannot be.
    """
    local = is_loopback(host)
    if (certificate is None) != (key is None):
        raise InputError("dashboard: a certificate needs its key, and a key its certificate; give both")
    if not local and (token is None or certificate is None):
        raise InputError(
            f"dashboard: {host} is open to others; give a token, a certificate and its key, or 127.0.0.1 for this "
            "computer alone"
        )
    if token is not None and not (len(token) >= _LEAST_TOKEN and token.isascii() and token.isprintable()):
        raise InputError(
            f"dashboard: a token has {_LEAST_TOKEN} or more plain characters; leave it out to have one drawn"
        )
    uvicorn = _load()
    if certificate is not None and key is not None:
        _check_pair(certificate, key)

    def drop(client: tuple[str, int]) -> None:
        # Closing would wait until it has taken what is under way.
        for connection in [*server.server_state.connections]:
            if connection.client == client:
                line = connection.transport.get_extra_info("socket")
                with contextlib.suppress(OSError):  # nor is what the system still has to be sent
                    line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                connection.transport.abort()

    config = uvicorn.Config(
        make_app(board, token, local=local, stall=stall, drop=drop),
        http="h11",
        ws="none",
        loop="asyncio",
        lifespan="off",
        log_config=None,
        log_level="critical",
        access_log=False,
        server_header=False,
        date_header=False,
        proxy_headers=False,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=1,
        ssl_certfile=certificate,
        ssl_keyfile=key,
    )
    server = uvicorn.Server(config)
    listener = _listen(host, port)
    try:
        address = socket.gethostname() if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
        scheme = "http" if certificate is None else "https"
        question = "" if token is None else f"?token={quote(token, safe='')}"
        url = f"{scheme}://{address}:{listener.getsockname()[1]}/{question}"
        return Dashboard(board, server, listener, url)
    except BaseException:
        listener.close()
        raise


def _load() -> Any:
    try:
        import starlette
        import uvicorn
    except ImportError:
        raise InputError("the dashboard needs starlette and uvicorn; pip install 'maipp[fleet]'") from None
    assert starlette
    return uvicorn


def _check_pair(certificate: Path, key: Path) -> None:
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key, lambda: "")
    except (OSError, ValueError) as error:
        told = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise InputError(f"dashboard: {certificate} and {key} cannot be used: {told}") from None


def _listen(host: str, port: int) -> socket.socket:
    if not 0 <= port <= 65535:
        raise InputError(f"dashboard: {port} is no port; give 0 to 65535")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(64)
    except OSError as error:
        listener.close()
        raise InputError(f"dashboard: cannot listen at {host}:{port}: {error.strerror or error}") from None
    return listener
