"""Brings what is known to the board, no more often than people can follow."""

import time
from collections.abc import Callable

from maipp.errors import InputError
from maipp.fleet.dashboard.board import Board
from maipp.fleet.dashboard.look import look
from maipp.fleet.watch import Watch

PERIOD = 0.5  # s from one snapshot to the next
_REST = 3.0  # times that what is shown took to work out, until it is worked out again


class Follower:
    """Used from the thread of the one who watches."""

    def __init__(
        self, watch: Watch, board: Board, *, period: float = PERIOD, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self.watch, self.board, self._period, self._monotonic = watch, board, period, monotonic
        self._next = self._next_fields = monotonic()
        self._shown: dict[str | None, str] = {}  # marks of the beliefs on the board

    def work(self) -> None:
        """Whatever is due: call it often."""
        self.watch.work()
        begun = self._monotonic()
        if begun >= self._next:
            # Fields first: whoever reads in a snapshot that there is a new one asks for it.
            self._show_fields(all_of_them=begun >= self._next_fields)
            self._show_snapshot()
            now = self._monotonic()
            self._next = max(begun + self._period, now + _REST * (now - begun))
        elif any(robot not in self._shown for robot in self.board.wanted()):  # somebody waits for it
            self._show_fields(all_of_them=False)

    def show(self) -> None:
        """Bring all to the board as it is now."""
        self._show_fields(all_of_them=True)
        self._show_snapshot()

    def _show_snapshot(self) -> None:
        self.board.publish(self.watch.snapshot() | {"look": look()})

    def _show_fields(self, all_of_them: bool) -> None:
        """Those that somebody looks at and that have changed, or only those that are not there yet."""
        wanted, begun = self.board.wanted(), self._monotonic()
        self._shown = {robot: mark for robot, mark in self._shown.items() if robot in wanted}
        for robot in wanted:
            mark = self.watch.mark(robot)
            if self._shown.get(robot) == mark or (robot in self._shown and not all_of_them):
                continue
            try:
                self.board.publish_field(robot, self.watch.field(robot))
            except InputError:  # no such robot, or one that has not joined as far as is known here
                self.board.publish_field(robot, {"robot": robot, "mark": None})
            self._shown[robot] = mark
        now = self._monotonic()
        self._next_fields = now + _REST * (now - begun)
