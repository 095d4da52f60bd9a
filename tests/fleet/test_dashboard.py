"""The dashboard's server over real sockets: what it answers, whom, and that nobody holds it up."""

import json
import select
import socket
import threading
import time
from urllib.parse import urlsplit

import pytest

from maipp.errors import InputError

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from maipp.fleet.dashboard import Board, Follower, serve  # noqa: E402
from maipp.fleet.dashboard.app import ASSETS, HEADERS, names_this_computer  # noqa: E402
from maipp.fleet.dashboard.board import Cursor, Shown  # noqa: E402
from maipp.fleet.watch import Watch  # noqa: E402
from tests.fleet.clients import Client, snapshot  # noqa: E402

NOBODY = Shown(None, '{"robot":"ghost","mark":null}')


@pytest.fixture
def board():
    made = Board()
    made.publish(snapshot())
    return made


@pytest.fixture
def served(board):
    with serve(board) as dashboard:
        yield dashboard


def test_every_answer_has_the_headers(served):
    paths = {"/": 200, "/nowhere": 404, "/assets/nothing.js": 404, "/assets/..%2fapp.py": 404}
    for path, status in (paths | {f"/assets/{name}": 200 for name in ASSETS}).items():
        told, headers, body = Client(served.url).ask(path)
        assert told == status
        lower = {name.lower(): value for name, value in headers.items()}
        assert {name.lower(): value for name, value in HEADERS.items()}.items() <= lower.items()
        assert "server" not in lower
        # Nothing comes from elsewhere.
        assert b"://" not in body
    policy = HEADERS["Content-Security-Policy"]
    assert "unsafe" not in policy and "http" not in policy and policy.startswith("default-src 'none'")


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH"])
def test_only_get(served, method):
    for path in ("/", "/events", "/field?robot="):
        status, headers, _ = Client(served.url).ask(path, method)
        assert status == 405 and headers["allow"] == "GET"


def test_a_name_that_was_made_to_mean_this_computer_is_refused(served):
    assert Client(served.url).ask("/", Host="evil.example")[0] == 421
    assert Client(served.url).ask("/", Host="localhost:80")[0] == 200
    assert names_this_computer("[::1]:8000") and names_this_computer("127.0.0.5")
    assert not names_this_computer("") and not names_this_computer("localhost.evil.example:80")


def test_news_come_once_and_whole(served, board):
    client = Client(served.url)
    messages = client.stream()
    first, told = next(messages)
    assert told["instance"] == board.instance and told["from"] == 0 and len(told["rows"]) == 2
    assert told["parts"] == {"place": {"title": "Lake"}, "now": {"time": 1.0}}
    assert HEADERS["Content-Security-Policy"] == client.headers["content-security-policy"]
    board.publish(snapshot(rows=3, now={"time": 2.0}))
    second, told = next(messages)
    assert (told["from"], told["rows"]) == (2, [[0, 2, 0.0, 0.0, 1.0]]) and told["parts"] == {"now": {"time": 2.0}}
    assert not board.publish(snapshot(rows=3, now={"time": 2.0}))  # nothing is new
    # One that comes back hears what it has missed, one from another server everything.
    _, told = next(Client(served.url).stream(Last_Event_ID=first))
    assert told["from"] == 2 and [*told["parts"]] == ["now"]
    for other in ("ffff.1.2", "", "nonsense", f"{board.instance}.9.9", f"{board.instance}.-1.x"):
        _, told = next(Client(served.url).stream(Last_Event_ID=other))
        assert told["from"] == 0 and len(told["rows"]) == 3 and len(told["parts"]) == 2
    assert Cursor.read(second) == Cursor(board.instance, 2, 3)


def test_a_belief_is_worked_out_when_it_is_asked_for(served, board):
    def work_out():
        while not board.wanted():
            time.sleep(0.001)
        board.publish_field("boat/1 ä", {"robot": "boat/1 ä", "mark": "m1"})

    worker = threading.Thread(target=work_out)
    worker.start()
    client = Client(served.url)
    status, _, body = client.ask("/field?robot=boat%2F1%20%C3%A4")
    worker.join()
    assert (status, json.loads(body)["mark"]) == (200, "m1")
    assert client.ask("/field?robot=boat%2F1%20%C3%A4&mark=m1")[0] == 204
    assert client.ask("/field?robot=boat%2F1%20%C3%A4&mark=m0")[0] == 200
    board.publish_field("nobody", {"robot": "nobody", "mark": None})
    assert client.ask("/field?robot=nobody")[0] == 404
    assert client.ask(f"/field?robot={'x' * 201}")[0] == 400
    assert {*board.wanted()} == {"boat/1 ä", "nobody"}


class Fake(Watch):
    """One that watches, whose beliefs are counted."""

    def __init__(self):
        self.marks, self.asked = {None: "a", "boat": "b"}, []

    def work(self):
        pass

    def snapshot(self):
        return snapshot()

    def mark(self, robot=None):
        return self.marks.get(robot, "")

    def field(self, robot=None):
        self.asked.append(robot)
        if robot not in self.marks:
            raise InputError("no such robot")
        return {"robot": robot, "mark": self.marks[robot]}


def test_a_belief_is_worked_out_once_and_only_if_somebody_looks(board):
    watch, now = Fake(), [0.0]
    follower = Follower(watch, board, period=1.0, monotonic=lambda: now[0])
    follower.work()
    assert watch.asked == []
    assert board.ask("boat") is None and board.ask("ghost") is None
    follower.work()  # at once: somebody waits
    assert watch.asked == ["boat", "ghost"]
    assert board.ask("boat") == Shown("b", '{"robot":"boat","mark":"b"}') and board.ask("ghost") == NOBODY
    now[0] = 1.5
    follower.work()
    assert len(watch.asked) == 2
    watch.marks["boat"] = "c"
    follower.work()
    assert len(watch.asked) == 2  # not before the next snapshot
    now[0] = 3.0
    follower.work()
    assert watch.asked == ["boat", "ghost", "boat"] and board.ask("boat") == Shown("c", '{"robot":"boat","mark":"c"}')


def test_who_watches_listens_most_of_the_time(board):
    """Maps that take long to work out are worked out less often."""
    now = [0.0]

    class Slow(Fake):
        def field(self, robot=None):
            now[0] += 2.0
            return super().field(robot)

    watch = Slow()
    follower = Follower(watch, board, period=0.5, monotonic=lambda: now[0])
    for number in range(400):
        board.ask("boat")
        watch.marks["boat"] = str(number)
        now[0] += 0.05
        follower.work()
    # 20 s of the clock's own steps, and no more than a third of that again for maps.
    assert 3 <= len(watch.asked) <= 5


def test_a_client_that_takes_nothing_is_dropped_and_holds_nobody_up(board):
    with serve(board, stall=0.5) as dashboard:
        stuck = socket.socket()
        stuck.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        stuck.connect(("127.0.0.1", urlsplit(dashboard.url).port))
        stuck.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        messages = Client(dashboard.url).stream()
        next(messages)
        gone = select.poll()
        gone.register(stuck, select.POLLERR | select.POLLHUP)
        number = 0
        while not gone.poll(1):  # more than the network's own buffers hold, again and again
            number += 1
            assert number < 1000
            board.publish(snapshot(now={"time": number, "much": "x" * 500_000}))
            _, told = next(messages)
            assert told["parts"]["now"]["time"] <= number
        stuck.close()
        assert dashboard.url and Client(dashboard.url).ask("/")[0] == 200


def test_a_server_stops_at_once_and_another_takes_its_place(board):
    first = serve(board)
    port = urlsplit(first.url).port or 0
    messages = Client(first.url).stream()
    seen, _ = next(messages)
    waiting = Client(first.url)
    waiting.connection.request("GET", "/field?robot=boat")  # never worked out
    stuck = socket.create_connection(("127.0.0.1", port))
    stuck.sendall(b"GET /events HTTP/1.1\r\n")  # never goes on
    begun = time.monotonic()
    first.close()
    assert time.monotonic() - begun < 2.0  # what every process of a fleet has to end
    assert not any(thread.name == "dashboard" and thread.is_alive() for thread in threading.enumerate())
    assert [*messages] == []
    first.close()
    again = Board()
    again.publish(snapshot(rows=1))
    with serve(again, port=port) as second:
        assert second.url == first.url
        _, told = next(Client(second.url).stream(Last_Event_ID=seen))
        assert told["instance"] == again.instance and len(told["rows"]) == 1
    stuck.close()
