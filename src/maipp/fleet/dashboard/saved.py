"""The page as one file that needs no server: a survey as it stood, to look at later and to send to others."""

import re
from base64 import b64encode
from pathlib import Path

from maipp.files import write_atomic
from maipp.fleet.dashboard.app import ASSETS, asset
from maipp.fleet.dashboard.board import Board, Cursor, to_json
from maipp.fleet.dashboard.look import look
from maipp.fleet.watch import Watch

# Nothing is loaded from elsewhere: what it is made of is in it.
_POLICY = "default-src 'none'; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'; img-src data:"


def save_page(watch: Watch, path: Path) -> None:
    """Write the page with all that is known now, and what each robot believes."""
    board = Board()
    board.publish(watch.snapshot() | {"look": look()})
    told = board.news(Cursor())
    assert told is not None
    names = "", *watch.survey.names
    fields = ",".join(f"{to_json(name)}:{to_json(watch.field(name or None))}" for name in names)
    known = f'{{"news":{told[0]},"fields":{{{fields}}}}}'.replace("<", "\\u003c")  # ends no element
    write_atomic(path, _page(known))


def _page(known: str) -> str:
    """The page with its style, its program and what it shows in it.

    A module has no folder here: each is a part of the import map, under a name instead of a path.
    """
    modules = {name.removesuffix(".js"): asset(name) for name in ASSETS if name.endswith(".js")}
    named = {name: re.sub(r'from "\./(\w+)\.js"', r'from "\1"', text) for name, text in modules.items()}
    urls = {name: f"data:text/javascript;base64,{b64encode(text.encode()).decode()}" for name, text in named.items()}
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f"<style>\n{asset('page.css')}</style>\n"
        f'<script type="application/json" id="saved">{known}</script>\n'
        f'<script type="importmap">{to_json({"imports": urls})}</script>\n'
        '<script type="module">import "page";</script>'
    )
    served = re.compile(r'<link rel="stylesheet".*?>\n<script type="module".*?></script>', re.DOTALL)
    page, count = served.subn(lambda _: head, asset("page.html"))
    assert count == 1
    return page
