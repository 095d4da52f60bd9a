"""Intruders: whoever is not of the fleet, and who is but says what is another's, is refused and told of."""

import shutil
import threading
import time
from datetime import UTC, datetime, timedelta

import pytest

from maipp.fleet.exchange import HAVE, LOG
from maipp.fleet.key_folders import make_keys
from maipp.fleet.launch import free_ports
from maipp.fleet.security import read_security
from maipp.fleet.zenoh_config import configuration, zenoh_config
from tests.fleet import schedules
from tests.fleet.malformed import Victim, changed
from tests.fleet.test_zenoh_fleet import Crew
from tests.fleet.test_zenoh_link import PATIENCE, until

zenoh = pytest.importorskip("zenoh")
pytest.importorskip("cryptography")
from maipp.fleet.zenoh_link import ZenohLink  # noqa: E402

MISSION = "5" * 64
BASE = f"maipp/{MISSION[:16]}"
NAMES = ["robot1", "robot2", "robot3"]
HERE = "127.0.0.1"


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Keys of a fleet, of one that is not known to the others, an expired one, and of another authority."""
    home = tmp_path_factory.mktemp("keys")
    fleet, now = home / "fleet", datetime.now(UTC)
    here = dict.fromkeys([*NAMES, "shore", "elsewhere", "unknown", "expired"], [HERE])
    make_keys(fleet, NAMES, ["shore"], {name: here[name] for name in [*NAMES, "shore"]})
    make_keys(fleet, ["elsewhere"], [], {"elsewhere": ["10.9.8.7"]})
    known = shutil.copytree(fleet, home / "known")  # as the robots have it
    make_keys(fleet, ["unknown"], [], {"unknown": [HERE]})
    make_keys(fleet, ["expired"], [], {"expired": [HERE]}, days=1, now=now - timedelta(days=3))
    make_keys(home / "other", NAMES, [], {name: [HERE] for name in NAMES})
    return {name: known / name for name in [*NAMES, "shore", "elsewhere"]} | {
        "unknown": fleet / "unknown",
        "expired": fleet / "expired",
        "other": home / "other" / "robot2",
    }


def secured(folders, *names):
    return [read_security(folders[name], name, lambda text: None) for name in names]


class Intruder:
    """A session of its own making: nothing at its end keeps it from saying anything. Use it in a `with` block."""

    def __init__(self, folders, address, certificate, authority="robot1", **tls):
        (own,) = secured(folders, "robot1")
        told = {"verify_name_on_connect": False, "root_ca_certificate": str(folders[authority] / "ca.pem")}
        if certificate is None:
            told["enable_mtls"] = False
        else:
            for end in ("listen", "connect"):
                told[f"{end}_certificate"] = str(folders[certificate] / "robot.pem")
                told[f"{end}_private_key"] = str(folders[certificate] / "robot.key")
            told["enable_mtls"] = True
        more = {"access_control": {"enabled": False}, "low_pass_filter": [], "transport/link/tls": told | tls}
        if address.startswith("tcp"):
            more["transport/link/protocols"] = ["tcp"]
        values = configuration([], [], own, 2.0) | more | {"connect/endpoints": [address]}
        self.session = zenoh.open(zenoh_config(values))
        ring, remote = zenoh.handlers.RingChannel(100), zenoh.Locality.REMOTE
        self.heard = self.session.declare_subscriber(f"{BASE}/*/say/*", ring, allowed_origin=remote)
        self.kept, self.sent, self.answered = [], 0, 0

    def acts_as(self, name):
        """Say, answer and be there under a name, in every way there is."""
        live = self.session.liveliness()
        self.kept += [live.declare_token(f"{BASE}/{name}/alive"), live.declare_token(f"{BASE}/{name}/say/line")]
        for key in (f"{BASE}/{name}/ask/*", f"{BASE}/*/ask/have", "**"):
            self.kept.append(self.session.declare_queryable(key, zenoh.handlers.RingChannel(10)))

    def says(self, name):
        for key in (f"{BASE}/{name}/say/line", f"{BASE}/*/say/line", f"{BASE}/**", "**"):
            self.session.put(key, b"forged")
            self.session.delete(key)

    def asks(self):
        fifo = zenoh.handlers.FifoChannel(10)
        replies = self.session.get(f"{BASE}/robot1/ask/have", fifo, timeout=0.5, target=zenoh.QueryTarget.ALL)
        return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]

    def babbles(self, base, seeds, over):
        """Send malformed hints, and malformed answers to all questions."""
        queryables = [
            self.session.declare_queryable(f"{base}/robot3/ask/{topic}", zenoh.handlers.RingChannel(10))
            for topic in (HAVE, LOG)
        ]
        while not over.wait(0.002):
            topic = ("line", "have", "intent", "part")[self.sent % 4]
            said, drop = topic.replace("part", "line"), zenoh.CongestionControl.DROP
            for number in range(self.sent, self.sent + 5):
                self.session.put(f"{base}/robot3/say/{said}", changed(seeds[topic], number), congestion_control=drop)
            self.sent += 5
            for queryable, kind in zip(queryables, (HAVE, "part"), strict=True):
                query = queryable.try_recv()
                if query is not None:
                    with query:
                        query.reply(str(queryable.key_expr), changed(seeds[kind], self.sent))
                    self.answered += 1
        for queryable in queryables:
            queryable.undeclare()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.session.close()


@pytest.fixture
def pair(folders):
    """Two robots of the fleet, and what the first has been asked and has told."""
    (port,) = free_ports(1)
    address, asked, told = f"tls/{HERE}:{port}", [], []
    one, two = secured(folders, "robot1", "robot2")
    with (
        ZenohLink("robot1", MISSION, listen=[address], security=one, lease=2.0, tell=told.append) as a,
        ZenohLink("robot2", MISSION, connect=[address], security=two, lease=2.0, tell=told.append) as b,
    ):
        a.serve("have", lambda question: asked.append(question) or b"A")
        b.serve("have", lambda question: b"B")
        until(lambda: a.ask("have", b"", 1.0) == {"robot2": b"B"} and b.ask("have", b"", 1.0) == {"robot1": b"A"})
        asked.clear()
        yield a, b, address, asked, told


def hears_only(a, b):
    """What is heard at the first end while the second says something."""
    b.publish("line", b"honest")
    hints = []
    until(lambda: hints.extend(a.receive()) or [hint for hint in hints if hint.payload == b"honest"])
    time.sleep(0.2)  # for what may come yet
    assert hints + a.receive() == [("robot2", "line", b"honest")]
    assert a.peers() == {"robot2"}
    assert a.ask("have", b"", 1.0) == {"robot2": b"B"}


def test_who_has_no_certificate_of_the_fleet_is_not_let_in(folders, pair):
    a, b, address, asked, told = pair
    kinds = [
        (address, None, "robot1", {}),
        (address, "other", "other", {}),  # trusts its own authority, as it should
        (address, "other", "robot1", {}),  # trusts the fleet's
        (address, "expired", "robot1", {}),
        (address.replace("tls", "tcp"), None, "robot1", {}),
    ]
    intruders = [Intruder(folders, where, own, authority, **tls) for where, own, authority, tls in kinds]
    try:
        for intruder in intruders:
            intruder.acts_as("robot2")
        time.sleep(1.5)  # each has tried to connect twice or three times
        for intruder in intruders:
            intruder.says("robot2")
            assert intruder.asks() == []
            assert [*intruder.session.info.peers_zid()] == []
        hears_only(a, b)
        assert len(a._session.info.peers_zid()) == 1
        assert asked == [] and told == []
        b.ask("have", b"", 1.0)
        assert asked == [b""]  # that it can be asked, the others could see
    finally:
        for intruder in intruders:
            intruder.__exit__()


def test_who_has_a_certificate_that_is_not_known_is_told_of_and_not_heard(folders, pair):
    a, b, address, asked, told = pair
    with Intruder(folders, address, "unknown") as intruder:
        intruder.acts_as("unknown")
        until(lambda: intruder.session.info.peers_zid())
        until(lambda: a.receive() == [] and told)
        for name in ("unknown", "robot2"):
            intruder.says(name)
        a.publish("line", b"secret")
        assert intruder.asks() == [] and asked == []
        hears_only(a, b)
        assert intruder.heard.try_recv() is None
    assert len(told) == 1 and told[0].startswith("refused: 'unknown' (tls/127.0.0.1:")


def test_a_robot_cannot_speak_for_another(folders, pair):
    """It has the right certificate; that what it says under its own name arrives shows that it is connected."""
    a, b, address, asked, _ = pair
    with Intruder(folders, address, "robot3") as intruder:
        for name in ("robot2", "robot1", "shore"):
            intruder.acts_as(name)
        until(lambda: intruder.asks() == [b"A"])
        for name in ("robot2", "robot1", "shore"):
            intruder.says(name)
        hears_only(a, b)
        intruder.session.put(f"{BASE}/robot3/say/line", b"own")
        until(lambda: [hint for hint in a.receive() if hint == ("robot3", "line", b"own")])


def test_a_watcher_reads_and_asks_and_says_nothing(folders, pair):
    a, b, address, asked, told = pair
    with Intruder(folders, address, "shore") as intruder:
        intruder.acts_as("shore")
        until(lambda: intruder.asks() == [b"A"])
        until(lambda: "shore" in a.peers())
        intruder.says("shore")
        begun = time.monotonic()
        assert a.ask("have", b"", 5.0) == {"robot2": b"B"}
        assert time.monotonic() - begun < 2.0  # nobody waits for a watcher's answer
        a.publish("line", b"for all")
        until(lambda: (sample := intruder.heard.try_recv()) and sample.payload.to_bytes() == b"for all")
    until(lambda: a.peers() == {"robot2"})
    hears_only(a, b)
    (watcher,) = secured(folders, "shore")
    with ZenohLink("shore", MISSION, connect=[address], security=watcher, lease=2.0) as shore:
        shore.serve("have", lambda question: b"S")
        until(lambda: shore.ask("have", b"", 1.0) == {"robot1": b"A"})
        shore.publish("line", b"watched")
        time.sleep(0.2)
        assert a.receive() == [] and a.ask("have", b"", 1.0) == {"robot2": b"B"}
    assert told == []


def test_an_address_at_which_another_robot_answers_is_refused(folders):
    """Its certificate is right, but is not for this address."""
    (port,) = free_ports(1)
    address = f"tls/{HERE}:{port}"
    other, one = secured(folders, "elsewhere", "robot1")
    with (
        ZenohLink("elsewhere", MISSION, listen=[address], security=other, lease=2.0) as a,
        ZenohLink("robot1", MISSION, connect=[address], security=one, lease=2.0) as b,
    ):
        time.sleep(1.2)
        assert a.peers() == b.peers() == set() and b._session.info.peers_zid() == []


def test_a_link_ends_when_a_certificate_of_its_ends_expires(tmp_path):
    (port,) = free_ports(1)
    address = f"tls/{HERE}:{port}"
    make_keys(tmp_path, ["robot1"], [], {"robot1": [HERE]})
    end = datetime.now(UTC) + timedelta(seconds=6)  # time enough to connect
    make_keys(tmp_path, ["robot2"], [], {"robot2": [HERE]}, days=1, now=end - timedelta(days=1))
    one, two = (read_security(tmp_path / name, name, lambda text: None) for name in ("robot1", "robot2"))
    with (
        ZenohLink("robot1", MISSION, listen=[address], security=one, lease=2.0) as a,
        ZenohLink("robot2", MISSION, connect=[address], security=two, lease=2.0) as b,
    ):
        until(lambda: a.peers() and b.peers(), 5.0)
        until(lambda: not a.peers() and not b.peers(), 15.0)
        assert datetime.now(UTC) > end - timedelta(seconds=1)  # certificates count whole seconds
        time.sleep(1.2)  # it tries again
        assert not a.peers() and not b.peers()


# All of it together, over sockets.


def test_a_secured_fleet_agrees_while_one_of_it_sends_nothing_but_malformed_messages(make_team, folders):
    team = make_team(schedules.SCENARIO, ("greedy", {}))
    seeds, base = Victim(team).seeds, f"maipp/{team.mission[:16]}"
    (port,) = free_ports(1)
    address = f"tls/{HERE}:{port}"
    security = secured(folders, "robot1", "robot2")
    with (
        Crew(team, [([address], []), ([], [address])], security) as crew,
        Intruder(folders, address, "robot3") as intruder,
    ):
        intruder.kept.append(intruder.session.liveliness().declare_token(f"{base}/robot3/alive"))
        crew.work_until(lambda: crew.links[0].peers() == {"robot2", "robot3"})
        over = threading.Event()
        thread = threading.Thread(target=intruder.babbles, args=(base, seeds, over), daemon=True)
        thread.start()
        try:
            first, end = crew.robots[0].member.exchange, time.monotonic() + PATIENCE
            while (intruder.sent < 3000 or first.refused < 500) and time.monotonic() < end:
                if len(crew.kept) < 40:
                    crew.measure(1)
                for robot in crew.robots:
                    robot.work()
        finally:
            over.set()
            thread.join(5)
        assert intruder.sent >= 3000 and intruder.answered > 20 and first.refused >= 500
        assert len([line for line in crew.told if line.startswith("refused from robot3")]) < 100
        crew.agree()
        assert not [robot for robot in crew.robots if robot.logs.forked]
        assert {origin.robot for origin in crew.robots[0].logs.known} == {"robot1", "robot2"}
