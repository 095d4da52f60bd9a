"""100,000 malformed messages: refused, told, nothing accepted, and the robot goes on (tests/fleet/malformed.py)."""

import pytest

from maipp.fleet.exchange import HAVE
from maipp.fleet.frame import LARGEST_FRAME, LARGEST_PART, decode, decode_part, encode
from maipp.fleet.hub import HubLink
from maipp.fleet.transport import Hint
from tests.fleet import schedules
from tests.fleet.malformed import SENDER, Victim


@pytest.fixture(scope="module")
def victim(make_team):
    return Victim(make_team(schedules.SCENARIO, ("greedy", {})))


def test_readers_of_frames_raise_nothing_but_value_errors(victim):
    taken = victim.readers(50_000)
    assert 0 < taken < 75_000  # of 150,000 readings: some are changed where it does not matter, most are not


def test_a_robot_refuses_what_is_malformed_and_goes_on(victim):
    refused = victim.member.exchange.refused
    victim.hear(40_000)
    refused = victim.member.exchange.refused - refused
    assert refused > 10_000
    assert len([line for line in victim.told if line.startswith(f"refused from {SENDER}: ")]) <= 20 + refused // 1000
    assert victim.works()


def test_a_robot_refuses_records_that_are_malformed_in_a_log_that_is_not(victim):
    refused = victim.member.exchange.refused
    victim.lines(1_500)
    assert victim.member.exchange.refused - refused > 250
    assert len(victim.told) < 100
    assert victim.works()


@pytest.mark.parametrize(
    "frame",
    [
        bytes(LARGEST_FRAME + 1),
        b"[" * (1 << 17),
        b'{"a":' * 20_000,
        b'{"heads": ' + b"9" * 100_000 + b"}",
        b'{"heads": {"robot2.01234567": [1e999, ""]}}',
        b"\xff\xfe{\x00}\x00",
    ],
)
def test_large_and_deep_frames_are_refused(victim, frame):
    refused = victim.member.exchange.refused
    victim.member._hear(Hint(SENDER, HAVE, frame))
    assert victim.member.exchange.refused == refused + 1


def test_a_part_that_unpacks_to_more_than_is_allowed_is_refused():
    import zlib

    bomb = zlib.compress(bytes(LARGEST_PART + 1), 9)
    header = {"origin": "robot2.01234567", "start": 0, "signature": "", "packed": True}
    assert len(bomb) < 1 << 17
    with pytest.raises(ValueError, match="cut short, or too large"):
        decode_part(encode(header, bomb))
    assert decode(encode(header, bomb))[1] == bomb


def test_answers_that_were_not_asked_for_are_refused(victim):
    """Somebody who says that it has much, and then sends other things."""
    robot, hub = victim.robot, victim.member.transport.hub
    heads = {f"robot3.{number:08x}": [10**12, "0" * 16] for number in range(100)}
    liar = HubLink(hub, "liar")
    hub.links["liar"] = liar
    liar.serve("have", lambda question: encode({"heads": heads, "status": {}}))
    for answer in (b"", b"{}", victim.seeds["part"][0], victim.seeds["line"][0], bytes(100_000)):
        liar.serve("log", lambda question, answer=answer: answer)
        known, refused = {origin: len(log) for origin, log in robot.logs.known.items()}, victim.member.exchange.refused
        robot.member.meet()
        assert {origin: len(log) for origin, log in robot.logs.known.items()} == known
        assert victim.member.exchange.refused >= refused + 100
    del hub.links["liar"]
    assert victim.works()
