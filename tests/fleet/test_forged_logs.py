"""Logs that are not as their robots have written them: made up, changed on the way, old, or written twice."""

import itertools
import json

import pytest

from maipp.fleet.exchange import HAVE, LOG
from maipp.fleet.frame import encode, encode_heads, encode_part
from maipp.fleet.hub import Hub
from maipp.fleet.key_folders import make_keys
from maipp.fleet.log import Head, Log, Origin
from maipp.fleet.logs import Logs, LogSegment
from maipp.fleet.robot import Robot
from maipp.fleet.seal import signed_bytes
from maipp.fleet.security import read_security
from maipp.live.chain import link as chained
from maipp.live.team import TeamSurvey
from tests.fleet import schedules

pytest.importorskip("cryptography")

NAMES = ["robot1", "robot2", "robot3"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Keys of three robots and of somebody who watches."""
    home = tmp_path_factory.mktemp("keys")
    make_keys(home, NAMES, ["shore"])
    return home


class Sealed:
    """Two robots with signatures on a network in this process; the third is the intruder, and the fourth is away."""

    def __init__(self, team, folder):
        self.team, self.hub, self.told = team, Hub(), []
        self.seals = {
            name: security.seal()
            for name, security in zip(NAMES, [read_security(folder / name, name) for name in NAMES], strict=True)
        }
        self.robots = []
        for number, name in enumerate(NAMES[:2]):
            logs = Logs(None, name, team.mission, seal=self.seals[name], tell=self.told.append)
            vehicle = schedules.Scripted(team.clock, tuple(team.starts[number].tolist()))
            survey = TeamSurvey(team.world, team.setup)
            robot = Robot(survey, logs, self.hub.link(name), vehicle, team.clock, tell=self.told.append)
            robot.begin()
            for value in range(6):
                vehicle.move()
                vehicle.measures(0.1 * value)
                robot.measure()
            self.robots.append(robot)
        self.victim, self.honest = self.robots
        self.liar = self.hub.link("robot3")

    def log(self, robot, count, incarnation="0" * 8, mission=None, values=0.0):
        """The lines of a log that somebody makes up."""
        origin = Origin(robot, incarnation)
        records = [{"log": "maipp.fleet/1", **origin._asdict(), "mission": mission or self.team.mission}]
        for number in range(1, count):
            event = {"event": "measurement", "id": f"{origin}.{number}", "robot": robot, "position": [0.5, 0.5]}
            event |= {"value": values, "time": 0.0, "travelled": 0.0}
            records.append({"event": event, "answer": {"answer": "noted", "id": f"{origin}.{number}"}})
        chain, log = b"", Log(origin)
        for number, record in enumerate(records):
            line, chain = chained(chain, number, record)
            log.add(number, [line])
        return log

    def offers(self, log, signature):
        """Let the intruder serve a log as the whole of what it has."""
        self.liar.serve(HAVE, lambda question: encode({"heads": encode_heads({log.origin: log.head}), "status": {}}))

        def part(question):
            start = json.loads(question)["from"]
            return encode_part(LogSegment(log.origin, start, log.lines[start:], signature))

        self.liar.serve(LOG, part)
        del self.told[:]
        before, refused = self.state(), self.victim.member.exchange.refused
        self.victim.member.meet("robot3")
        self.refused = self.victim.member.exchange.refused - refused
        return before

    def state(self):
        logs = self.victim.logs
        return {origin: [*log.lines] for origin, log in logs.known.items()}, {*logs.forked}

    def forged(self, log, signer):
        """A signature of the log by somebody else than its robot."""
        key = self.seals[signer]._key
        from cryptography.hazmat.primitives.asymmetric.ec import ECDSA
        from cryptography.hazmat.primitives.hashes import SHA256

        return key.sign(signed_bytes(log.origin, log.head), ECDSA(SHA256()))


@pytest.fixture
def sealed(make_team, folder):
    return Sealed(make_team(schedules.SCENARIO, ("greedy", {})), folder)


def test_signed_logs_are_exchanged(sealed):
    """That what follows is refused says something only if this is not."""
    sealed.victim.member.meet("robot2")
    origin = sealed.honest.origin
    assert sealed.victim.logs.known[origin].lines == sealed.honest.logs.known[origin].lines
    log = sealed.log("robot3", 5)
    sealed.offers(log, sealed.forged(log, "robot3"))
    assert sealed.victim.logs.known[log.origin].lines == log.lines
    assert [line for line in sealed.told if "refused" in line] == []


@pytest.mark.parametrize("robot", ["robot2", "robot1", "robot4", "shore"])
@pytest.mark.parametrize("incarnation", ["new", "its own"])
def test_lines_of_another_robot_are_refused(sealed, robot, incarnation):
    own = {each.name: each.origin.incarnation for each in sealed.robots}
    log = sealed.log(robot, 20, own.get(robot, "1" * 8) if incarnation == "its own" else "0" * 8)
    for signature in (b"", sealed.forged(log, "robot3"), bytes(70)):
        assert sealed.offers(log, signature) == sealed.state()
        assert [line for line in sealed.told if line.startswith("refused from robot3: ")]
        assert not [line for line in sealed.told if "fork" in line]


def test_lines_that_were_changed_on_the_way_are_refused(sealed):
    """Whatever of a real log is changed, its signature is not that of what comes."""
    origin = sealed.honest.origin
    real = sealed.honest.logs.known[origin]
    signature = real.signatures[len(real)]
    for known, number in itertools.product((0, 3, len(real)), (0, 1, 2, len(real) - 1)):
        sealed.victim.logs.known.pop(origin, None)
        if known:
            signed = sealed.honest.logs.seal.sign(origin, real.at(known))
            sealed.victim.logs.extend(LogSegment(origin, 0, real.lines[:known], signed))
        log = Log(origin)
        log.chains, log.lines = [*real.chains], [*real.lines]
        log.lines[number] = log.lines[number].replace(b'"value":0.', b'"value":9.').replace(b"0", b"1")
        before = sealed.offers(log, signature)
        if known <= number:
            assert before == sealed.state(), (known, number)
            assert sealed.refused == 1, (known, number)
        kept = sealed.victim.logs.known.get(origin, Log(origin)).lines
        assert kept == real.lines[: len(kept)]
        rechained = sealed.log("robot2", len(real), origin.incarnation, values=9.0)
        assert sealed.offers(rechained, signature) == sealed.state()
    assert not sealed.victim.logs.forked


def test_what_is_old_is_not_taken_for_new(sealed):
    """A log as it was earlier, served again, and one of another mission that its robot has signed."""
    sealed.victim.member.meet("robot2")
    origin = sealed.honest.origin
    real = sealed.honest.logs.known[origin]
    old, head = Log(origin), real.at(4)
    old.add(0, real.lines[:4])
    signature = sealed.honest.logs.seal.sign(origin, head)
    assert sealed.offers(old, signature) == sealed.state()
    assert sealed.victim.logs.extend(LogSegment(origin, 0, old.lines, signature)) == []
    assert sealed.victim.logs.extend(LogSegment(origin, 2, real.lines[2:4], signature)) == []
    assert sealed.told == []
    elsewhere = sealed.log("robot2", 5, "2" * 8, mission="6" * 64)
    assert sealed.offers(elsewhere, sealed.forged(elsewhere, "robot2")) == sealed.state()
    assert any("a log of another mission" in line for line in sealed.told)


def test_a_fork_counts_only_if_its_robot_has_signed_both(sealed):
    sealed.victim.member.meet("robot2")
    origin = sealed.honest.origin
    real = sealed.honest.logs.known[origin]
    for length in (3, len(real), len(real) + 5):
        other = sealed.log("robot2", length, origin.incarnation, values=9.0)
        assert sealed.offers(other, sealed.forged(other, "robot3")) == sealed.state()
        assert not [line for line in sealed.told if line.startswith("fork")]
        assert any("robot2 has not signed" in line or "not signed by robot2" in line for line in sealed.told)
    other = sealed.log("robot2", len(real), origin.incarnation, values=9.0)
    sealed.offers(other, sealed.forged(other, "robot2"))  # as if its disk had been copied
    assert sealed.victim.logs.forked == {origin}
    assert [line for line in sealed.told if line.startswith(f"fork: robot3 has another log of {origin}")]
    assert sealed.victim.logs.known[origin].lines == real.lines
    own = sealed.victim.origin
    longer = sealed.log("robot1", 30, own.incarnation)
    sealed.offers(longer, sealed.forged(longer, "robot1"))
    assert own in sealed.victim.logs.forked


def test_a_signature_is_of_length_and_chain_and_origin():
    origin = Origin("robot1", "0" * 8)
    told = {signed_bytes(o, h) for o in (origin, Origin("robot1", "1" * 8)) for h in (Head(1, b"2"), Head(12, b""))}
    assert len(told) == 4
