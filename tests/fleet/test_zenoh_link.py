"""Robots over Zenoh on loopback: what arrives, what is refused, and what heals."""

import threading
import time

import pytest

from maipp.errors import InputError
from maipp.fleet.launch import free_ports
from maipp.fleet.zenoh_config import LARGEST_HINT, configuration
from tests.fleet.proxy import Proxy

pytest.importorskip("zenoh")
from maipp.fleet.zenoh_link import ZenohLink  # noqa: E402

MISSION = "5" * 64
LEASE = 2.0
PATIENCE = 20.0  # s; nothing here takes a tenth of that on an idle machine


def until(condition, seconds=PATIENCE):
    """Wait until something is so; fails after a while."""
    end = time.monotonic() + seconds
    while not (told := condition()):
        assert time.monotonic() < end, "it has not come to that"
        time.sleep(0.01)
    return told


@pytest.fixture
def links():
    """Makes links, and closes them."""
    made = []

    def make(name, **more):
        made.append(ZenohLink(name, **{"mission": MISSION, "lease": LEASE, "tell": lambda text: None} | more))
        return made[-1]

    yield make
    for link in made:
        link.close()


@pytest.fixture
def trio(links):
    """Three that hear each other."""
    ports = free_ports(3)
    addresses = [f"tcp/127.0.0.1:{port}" for port in ports]
    three = [links(name, listen=addresses[i : i + 1], connect=addresses[:i]) for i, name in enumerate("abc")]
    until(lambda: all(len(link.peers()) == 2 for link in three))
    return three


def received(link, count):
    hints = []
    until(lambda: hints.extend(link.receive()) or len(hints) >= count)
    return hints


def test_all_hear_what_one_publishes_and_it_does_not(trio):
    a, b, c = trio
    for number in range(20):
        a.publish("line", b"%d" % number)
    for link in (b, c):
        assert [hint.payload for hint in received(link, 20)] == [b"%d" % number for number in range(20)]
    a.publish("have", b"")
    assert received(b, 1) == [("a", "have", b"")]
    assert a.receive() == []


def test_questions_are_answered_by_all_or_by_one(trio):
    a, b, c = trio
    for link in trio:
        link.serve("have", lambda question, name=link.name: name.encode() + question)
    b.serve("none", lambda question: None)
    until(lambda: a.ask("have", b"?", 1.0) == {"b": b"b?", "c": b"c?"})
    until(lambda: c.ask("have", b"?", 1.0) == {"a": b"a?", "b": b"b?"})
    begun = time.monotonic()
    for _ in range(20):
        assert a.ask("have", b"!", 5.0, to="c") == {"c": b"c!"}
        assert a.ask("have", b"!", 5.0, to="d") == {}
        assert a.ask("none", b"!", 5.0) == {}
    assert time.monotonic() - begun < 5.0  # not one of the sixty has waited for those that do not answer
    large = bytes(1 << 20)
    b.serve("log", lambda question: large)
    assert until(lambda: a.ask("log", b"", 5.0, to="b")) == {"b": large}
    assert threading.active_count() < 50


def test_missions_do_not_hear_each_other(links):
    (port,) = free_ports(1)
    address = f"tcp/127.0.0.1:{port}"
    a, b = links("a", listen=[address]), links("b", connect=[address], mission="6" * 64)
    until(lambda: a._session.info.peers_zid())
    b.publish("line", b"x")
    assert (a.peers(), b.peers(), a.receive(), a.ask("have", b"", 0.1)) == (set(), set(), [], {})


def test_who_is_gone_is_no_peer_and_who_comes_back_is(links, trio):
    a, b, c = trio
    c.close()
    until(lambda: a.peers() == {"b"} and b.peers() == {"a"})
    assert c.receive() == [] and c.ask("have", b"", 1.0) == {} and c.peers() <= {"a", "b"}
    c.publish("line", b"")
    c.close()


@pytest.mark.parametrize("cut", ["reset", "swallow"])
def test_a_link_heals(links, cut):
    (port,) = free_ports(1)
    a = links("a", listen=[f"tcp/127.0.0.1:{port}"])
    with Proxy(port) as proxy:
        b = links("b", connect=[proxy.address])
        a.serve("have", lambda question: b"A")
        b.serve("have", lambda question: b"B")
        until(lambda: a.ask("have", b"", 1.0) and b.ask("have", b"", 1.0))
        getattr(proxy, cut)()
        begun = time.monotonic()
        assert a.ask("have", b"", 0.5) == {}
        b.publish("line", b"lost")
        assert time.monotonic() - begun < 1.5  # neither waits for the network
        until(lambda: not a.peers() and not b.peers(), 2 * LEASE + 2)
        proxy.heal()
        until(lambda: a.ask("have", b"", 1.0) and b.ask("have", b"", 1.0))
        assert a.receive() == []
        b.publish("line", b"heard")
        assert received(a, 1) == [("b", "line", b"heard")]


def test_it_starts_without_the_others_and_finds_them_when_they_come(links):
    pa, pb, nobody = free_ports(3)
    begun = time.monotonic()
    connect = [f"tcp/127.0.0.1:{pb}", f"tcp/127.0.0.1:{nobody}", "tcp/localhost:9"]
    a = links("a", listen=[f"tcp/127.0.0.1:{pa}"], connect=connect)
    assert time.monotonic() - begun < 1.0
    assert a.ask("have", b"", 1.0) == {}
    time.sleep(1.0)  # it has tried, and in vain
    links("b", listen=[f"tcp/127.0.0.1:{pb}"])
    until(lambda: a.peers() == {"b"})


def test_a_flood_is_not_read(links):
    """100,000 hints: a bounded number is read, whoever sends the rest is named, and others are still heard."""
    (port,) = free_ports(1)
    told = []
    a = links("a", listen=[f"tcp/127.0.0.1:{port}"], tell=told.append)
    b, c = (links(name, connect=[f"tcp/127.0.0.1:{port}"]) for name in "bc")
    until(lambda: a.peers() == {"b", "c"})
    read, begun = 0, time.monotonic()
    for number in range(100_000):
        b.publish("line", bytes(100))
        if number % 10_000 == 0:
            read += len(a.receive())
    time.sleep(0.1)
    while hints := a.receive():
        read += len(hints)
    assert read <= 1000 + 500 * (time.monotonic() - begun) + 1  # as the bounds of a robot have it
    assert told == ["b sends more than 500 messages a second; the rest is not read"]
    c.publish("line", b"c")
    assert ("c", "line", b"c") in received(a, 1)
    for kind, size in (("say/line", LARGEST_HINT + 1), ("say/line", 1 << 21)):
        b._session.put(f"{b._base}/b/{kind}", bytes(size))
    b.publish("line", bytes(LARGEST_HINT + 1))
    b._session.put(f"{b._base}/*/say/line", b"of all")
    b._session.put(f"{b._base}/a/say/line", b"of the one who hears it")
    b._session.put(f"{b._base}/no name/say/line", b"of nobody")
    b._session.delete(f"{b._base}/b/say/line")
    c.publish("line", b"after")
    hints = received(a, 1)
    time.sleep(0.2)
    assert [hint for hint in hints + a.receive() if hint.sender != "b"] == [("c", "line", b"after")]
    assert not [hint for hint in hints if len(hint.payload) > LARGEST_HINT]


def test_closing_takes_no_second_even_where_the_network_is_silent(links):
    (port,) = free_ports(1)
    a = links("a", listen=[f"tcp/127.0.0.1:{port}"])
    with Proxy(port) as proxy:
        b = links("b", connect=[proxy.address, f"tcp/127.0.0.1:{proxy.port}"])
        b.serve("have", lambda question: b"")
        until(lambda: a.peers() and b.peers())
        proxy.swallow()
        for link in (a, b):
            begun = time.monotonic()
            link.close()
            assert time.monotonic() - begun < 1.0
    until(lambda: not [thread for thread in threading.enumerate() if thread.name.startswith("serve ")])


def test_an_address_that_is_taken_is_one_clear_line(links):
    (port,) = free_ports(1)
    address = f"tcp/127.0.0.1:{port}"
    links("a", listen=[address])
    with pytest.raises(InputError, match=f"--listen: cannot listen at {address}: .*in use"):
        links("b", listen=[address])


@pytest.mark.parametrize(
    ("endpoint", "problem"),
    [
        ("tcp/192.168.1.12:7447", "open to others"),
        ("tcp/0.0.0.0:7447", "open to others"),
        ("tcp/[::]:7447", "open to others"),
        ("tcp/boat-1.local:7447", "open to others"),
        ("tls/192.168.1.12:7447", "needs --keys"),
        ("udp/127.0.0.1:7447", "no address"),
        ("tcp/127.0.0.1", "no address"),
        ("tcp/127.0.0.1:0", "no address"),
        ("tcp/127.0.0.1:65536", "no address"),
        ("127.0.0.1:7447", "no address"),
        ("tcp/127.0.0.1:7447#iface=eth0", "no address"),
        ("tls/boat:7447#verify_name_on_connect=false", "no address"),
        ("tcp/127.0.0.1:7447?rel=0", "no address"),
        ("tcp/127.0.0.1:7447;tcp/0.0.0.0:1", "no address"),
    ],
)
def test_addresses_that_are_none_or_are_open_to_others_are_refused(endpoint, problem):
    with pytest.raises(InputError, match=f"--connect: .*{problem}"):
        configuration([endpoint], [], None)
    with pytest.raises(InputError, match=f"--listen: .*{problem}"):
        configuration([], [endpoint], None)


@pytest.mark.parametrize("name", ["*", "**", "a/b", "$*", "", "a*", "boat 1", "b" * 41, "@", "boat\n1"])
def test_names_that_could_mean_others_are_refused(name):
    with pytest.raises(InputError, match="no name of a robot"):
        ZenohLink(name, MISSION)
