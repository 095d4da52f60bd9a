"""Over a link that brings only so many bytes in time a log still comes, in parts that are small enough."""

import random

import pytest

from maipp.fleet.exchange import LOG, PART, Exchange
from maipp.fleet.hub import Hub, HubLink
from maipp.fleet.logs import Logs

MISSION = "5" * 64


class Slow(HubLink):
    """An end to which an answer comes only if it is not too long."""

    most, now = 0, 0.0

    def ask(self, topic, payload, timeout, to=None):
        answers = super().ask(topic, payload, timeout, to)
        came = {name: answer for name, answer in answers.items() if len(answer) <= self.most}
        self.now += timeout if len(came) < len(answers) else 0.0
        return came


class Everybodys:
    """Signatures that anybody can make: parts of a log then end where one is kept."""

    def sign(self, origin, head):
        return head.chain

    def check(self, origin, head):
        return head.signature == head.chain


@pytest.mark.parametrize("seal", [None, Everybodys()])
def test_a_log_comes_over_a_slow_link(seal):
    hub, told, rng = Hub(), [], random.Random(0)
    logs, others = (Logs(None, name, MISSION, seal=seal, tell=told.append) for name in ("a", "b"))
    assert logs.origin is not None
    for number in range(2000):
        place, name = [rng.random(), rng.random()], f"{logs.origin}.{number + 1}"
        event = {"event": "measurement", "id": name, "robot": "a", "position": place, "value": rng.gauss(0, 1)}
        logs.append({"event": event, "answer": {"answer": "noted", "id": name}})
    size = sum(map(len, logs.known[logs.origin].lines))
    slow = hub.links["b"] = Slow(hub, "b")
    slow.most = 10_000  # bytes; a radio of 10 kB/s, in the second that an answer may take
    Exchange(logs, hub.link("a"), dict, lambda origin, records: None, told.append)
    exchange = Exchange(others, slow, dict, lambda origin, records: None, told.append, lambda: slow.now)
    while others.length(logs.origin) < logs.length(logs.origin):
        exchange.round(1.0)
        slow.now += 1.0
        assert slow.now < 60.0
    assert others.known[logs.origin].lines == logs.known[logs.origin].lines
    assert told == [] and size > PART / 2


class Boaster(HubLink):
    """Says to have more than it brings."""

    asked = 0

    def ask(self, topic, payload, timeout, to=None):
        answers = super().ask(topic, payload, timeout, to)
        if topic == LOG:
            self.asked, self.now, answers = self.asked + 1, self.now + timeout, {}
        return answers

    now = 0.0


def test_who_does_not_bring_what_it_says_to_have_is_asked_less_often():
    hub, told = Hub(), []
    logs, others = (Logs(None, name, MISSION, tell=told.append) for name in ("a", "b"))
    logs.append({"event": {"event": "gone", "id": "1", "robot": "a"}, "answer": {"answer": "noted", "id": "1"}})
    Exchange(logs, hub.link("a"), dict, lambda origin, records: None, told.append)
    link = hub.links["b"] = Boaster(hub, "b")
    exchange = Exchange(others, link, dict, lambda origin, records: None, told.append, lambda: link.now)
    while link.now < 600.0:
        exchange.round(1.0)
        link.now += 1.0
    assert link.asked < 60  # of 600 s a tenth: each costs a second
    assert [line for line in told if "asked less often" in line] == told and len(told) == 1
