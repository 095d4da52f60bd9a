"""The page on which `maipp fleet` shows a fleet: one that watches, and a server of what it knows."""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from maipp.cli.fleet_flags import FleetFlags as Flags
from maipp.cli.robot import tell
from maipp.errors import InputError
from maipp.files import read_text

if TYPE_CHECKING:  # they import JAX
    from maipp.fleet.clock import Clock
    from maipp.fleet.security import Security
    from maipp.live.team import TeamSurvey

NONE = "none"


class Page:
    """Watches, and shows what it knows. `work` is to be called often; use it in a `with` block."""

    def __init__(
        self,
        flags: Flags,
        survey: "TeamSurvey",
        clock: "Clock",
        connect: Sequence[str],
        name: str,
        security: "Security | None" = None,
    ) -> None:
        """Connect to a fleet, and serve its page. Raises `InputError` where that cannot be."""
        from maipp.fleet.dashboard.board import Board
        from maipp.fleet.dashboard.follow import Follower
        from maipp.fleet.dashboard.server import serve
        from maipp.fleet.filtered import Filtered
        from maipp.fleet.logs import Logs
        from maipp.fleet.watch import Watch
        from maipp.fleet.zenoh_link import ZenohLink

        host, port = address_of(flags.page)
        token = None if flags.token is None else read_text(flags.token, "token", "a text file").strip()
        digest = survey.setup.digest(survey.world)
        with ExitStack() as stack:
            link = ZenohLink(name, digest, connect=connect, security=security, tell=tell)
            stack.callback(link.close)
            simulated = flags.simulate and (flags.range is not None or flags.loss > 0)
            # It hears everybody, and carries nothing from one robot to another that does not hear it.
            heard = Filtered(link, lambda: None, None) if simulated else link
            seal = None if security is None else security.seal()
            logs = Logs(None, None, digest, seal=seal, tell=tell)
            watch = Watch(survey, logs, heard, clock, monotonic=time.monotonic, tell=tell, carries=not simulated)
            stack.callback(watch.close)
            board = Board()
            certificate, key = flags.certificate, flags.certificate_key
            server = stack.enter_context(serve(board, host, port, token=token, certificate=certificate, key=key))
            self.url, self.watch, self._follower = server.url, watch, Follower(watch, board)
            self._stack = stack.pop_all()

    def work(self) -> None:
        """Whatever is due."""
        self._follower.work()

    def save(self, path: Path) -> None:
        """Write the page as it is now, as a file that needs no server."""
        from maipp.fleet.dashboard.saved import save_page

        save_page(self.watch, path)

    def __enter__(self) -> "Page":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()


def address_of(text: str) -> tuple[str, int]:
    """Host and port. Raises `InputError` for what is no address."""
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isdecimal() and int(port) < 1 << 16):
        raise InputError(f"--page: {text!r:.80} is no address; give one such as 127.0.0.1:8321, or none")
    return host.strip("[]"), int(port)
