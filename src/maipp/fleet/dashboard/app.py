"""The pages of a dashboard: a Starlette application that only reads."""

import asyncio
import hmac
import ipaddress
from collections.abc import Callable
from importlib.resources import files
from typing import Any

from maipp.fleet.dashboard.board import Board, Cursor, Shown
from maipp.fleet.dashboard.stream import Stream, changes_of

COOKIE = "maipp-fleet"
_PROGRAM = ("page", "format", "link", "maps", "marks", "scale", "tables", "view")
ASSETS = {"page.css": "text/css"} | {f"{name}.js": "text/javascript" for name in _PROGRAM}
# The browser itself refuses whatever would be loaded from elsewhere.
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_PATIENCE = 30.0  # s that a belief may take to be worked out
_MOST_STREAMS = 64


def make_app(
    board: Board, token: str | None, *, local: bool, stall: float, drop: Callable[[tuple[str, int]], object]
) -> Any:
    """The application. `local`: only those who name this computer itself are answered.

    `drop` cuts the line to a client (address and port), as is done to one that takes nothing for `stall` seconds.
    """
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import PlainTextResponse, RedirectResponse, Response
    from starlette.routing import Route

    streams: set[object] = set()

    async def page(request: Request) -> Response:
        if token is not None and "token" in request.query_params:  # out of the address bar
            response = RedirectResponse("/", 303)
            response.set_cookie(COOKIE, token, httponly=True, secure=request.url.scheme == "https", samesite="lax")
            return response
        return Response(asset("page.html"), media_type="text/html")

    async def part(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in ASSETS:
            return PlainTextResponse("not found\n", 404)
        return Response(asset(name), media_type=ASSETS[name])

    async def field(request: Request) -> Response:
        robot = request.query_params.get("robot", "")
        if len(robot) > 200:
            return PlainTextResponse("robot: no such name\n", 400)
        told = await _worked_out(board, robot)
        if told is None:
            return PlainTextResponse("not worked out yet; ask again\n", 503, {"Retry-After": "1"})
        if (mark := told.mark) is None:
            return PlainTextResponse("robot: no such name\n", 404)
        if mark == request.query_params.get("mark"):
            return Response(status_code=204)
        return Response(told.text, media_type="application/json")

    async def events(request: Request) -> Any:
        if len(streams) >= _MOST_STREAMS:
            return PlainTextResponse("too many pages are open; close some\n", 503, {"Retry-After": "5"})
        return Stream(board, Cursor.read(request.headers.get("last-event-id", "")), streams, stall, drop)

    routes = [
        Route("/", page),
        Route("/assets/{name}", part),
        Route("/events", events),
        Route("/field", field),
    ]
    return _Guard(Starlette(routes=routes), token, local)


class _Guard:
    """Around the application: only GET, only who may, and the headers that every answer has."""

    def __init__(self, app: Any, token: str | None, local: bool) -> None:
        self._app, self._token, self._local = app, token, local

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        from starlette.requests import Request
        from starlette.responses import PlainTextResponse

        if scope["type"] != "http":
            return

        async def sent(message: Any) -> None:
            if message["type"] == "http.response.start":
                extra = [(key.lower().encode("ascii"), value.encode("ascii")) for key, value in HEADERS.items()]
                message = message | {"headers": [*message["headers"], *extra]}
            await send(message)

        request = Request(scope)
        refusal = None
        if request.method != "GET":
            refusal = PlainTextResponse("only GET\n", 405, {"Allow": "GET"})
        elif self._local and not names_this_computer(request.headers.get("host", "")):
            # A page of somebody else's, whose name was made to mean this computer, must not read this one.
            refusal = PlainTextResponse("ask for 127.0.0.1 or localhost\n", 421)
        elif self._token is not None and not self._may(request):
            text = "a token is needed; open the address with ?token=... that was told at the start\n"
            refusal = PlainTextResponse(text, 401, {"WWW-Authenticate": "Bearer"})
        await (refusal or self._app)(scope, receive, sent)

    def _may(self, request: Any) -> bool:
        kind, _, bearer = request.headers.get("authorization", "").partition(" ")
        given = [request.cookies.get(COOKIE, ""), request.query_params.get("token", "")]
        given += [bearer.strip()] if kind.lower() == "bearer" else []
        right = (self._token or "").encode("utf-8")
        return any([hmac.compare_digest(each.encode("utf-8", "replace"), right) for each in given])


def names_this_computer(host: str) -> bool:
    """Whether a Host header, with or without a port, says localhost or a loopback address."""
    name = host[1 : host.find("]")] if host.startswith("[") else host.partition(":")[0]
    if name.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def asset(name: str) -> str:
    """The text of a part of the page."""
    return (files("maipp.fleet.dashboard") / "assets" / name).read_text(encoding="utf-8")


async def _worked_out(board: Board, robot: str) -> Shown | None:
    """The maps of a belief, once they are there; None where that takes too long."""
    changed, end = changes_of(board)
    try:
        async with asyncio.timeout(_PATIENCE):
            while (told := board.ask(robot)) is None and not board.closed:
                changed.clear()
                await changed.wait()
            return told
    except TimeoutError:
        return None
    finally:
        end()
