"""News of a board as server-sent events, as fast as a client takes them: who is slow gets fewer, and newer ones."""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Callable
from typing import Any

from maipp.fleet.dashboard.board import Board, Cursor

_BEAT = 5.0  # s after which a silent stream says that it is there
_HEADERS = [(b"content-type", b"text/event-stream"), (b"x-accel-buffering", b"no")]


class Stream:
    """An answer of an ASGI application. It holds no more than one message: nothing piles up for a slow client."""

    def __init__(
        self, board: Board, seen: Cursor, streams: set[object], stall: float, drop: Callable[[tuple[str, int]], object]
    ) -> None:
        """Begin where a client is; `streams` holds those that are open.

        `drop` cuts the line to a client, as is done to one that takes nothing for `stall` seconds.
        """
        self._texts, self._streams, self._stall, self._drop = _texts(board, seen), streams, stall, drop

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        self._streams.add(self)
        gone = asyncio.ensure_future(_disconnected(receive))
        try:
            await asyncio.wait_for(
                send({"type": "http.response.start", "status": 200, "headers": _HEADERS}), self._stall
            )
            async for text in self._texts:
                if gone.done():
                    return
                body = {"type": "http.response.body", "body": text.encode("ascii"), "more_body": True}
                await asyncio.wait_for(send(body), self._stall)
            await asyncio.wait_for(send({"type": "http.response.body", "body": b"", "more_body": False}), 1.0)
        except TimeoutError:  # it takes nothing
            self._drop(scope["client"])
        except OSError:  # it is gone
            pass
        finally:
            self._streams.discard(self)
            gone.cancel()
            await self._texts.aclose()


def changes_of(board: Board) -> tuple[asyncio.Event, Callable[[], None]]:
    """An event that is set after each change of a board, and what ends that."""
    loop, changed = asyncio.get_running_loop(), asyncio.Event()

    def tell() -> None:
        with contextlib.suppress(RuntimeError):  # the server has ended meanwhile
            loop.call_soon_threadsafe(changed.set)

    return changed, board.listen(tell)


async def _texts(board: Board, seen: Cursor) -> AsyncGenerator[str, None]:
    """What is news for somebody, again and again; ends with the board."""
    changed, end = changes_of(board)
    try:
        yield "retry: 1000\n\n"
        while not board.closed:
            changed.clear()
            news = board.news(seen)
            if news is not None:
                text, seen = news
                yield f"id: {seen}\ndata: {text}\n\n"
            try:
                await asyncio.wait_for(changed.wait(), _BEAT)
            except TimeoutError:
                yield "event: here\ndata: 1\n\n"  # a comment would say it to the network alone, not to the page
    finally:
        end()


async def _disconnected(receive: Any) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
