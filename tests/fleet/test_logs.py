"""Logs outlast what happens to a disk, take nothing that does not follow, and are the same wherever they are."""

import os
from typing import Any

import pytest

from maipp.errors import InputError
from maipp.fleet.log import Head, Log, Origin, check_name, read_origin
from maipp.fleet.logs import DiskError, Logs, LogSegment

MISSION = "a" * 64


def logs(folder=None, robot=None, notes=None, **more) -> Any:
    return Logs(folder, robot, MISSION, tell=(notes if notes is not None else []).append, **more)


def carried(source, target, most=1 << 20):
    """Carry all that `source` has and `target` lacks over, in parts."""
    new = []
    for origin, head in source.heads().items():
        while target.length(origin) < head.length:
            part = source.part(origin, target.length(origin), most)
            new += target.extend(part)
    return new


def test_what_is_carried_is_the_same_and_survives_a_restart(tmp_path):
    with_disk = logs(tmp_path / "a", "boat", incarnation="0000000a")
    for number in range(40):
        part = with_disk.append({"event": number})
        assert part.start == (0 if number == 0 else number + 1)
    other = logs(tmp_path / "b")
    assert [record["event"] for record in carried(with_disk, other, most=300)] == list(range(40))
    assert other.heads() == with_disk.heads() and not carried(with_disk, other)
    for each in (with_disk, other):
        each.close()
    again, back = logs(tmp_path / "a", "boat"), logs(tmp_path / "b")
    assert back.heads() == again.heads() and [r["event"] for _, r in back.records("boat")] == list(range(40))
    again.append({"event": "more"})
    assert len(again.heads()) == 2 and again.origin.incarnation != "0000000a"


def test_lines_that_do_not_follow_are_a_fork_and_change_nothing():
    one, twin, other = (logs(None, "boat", incarnation="0000000a") for _ in range(3))
    one.append({"event": 1})
    twin.append({"event": 1})
    one.append({"event": 2})
    twin.append({"event": "another"})
    reader = logs()
    carried(one, reader)
    before = reader.heads()
    with pytest.raises(ValueError, match="two logs that differ before line 3"):
        reader.extend(twin.part(one.origin, 0, 1 << 20))
    assert reader.heads() == before and reader.agrees(one.origin, one.heads()[one.origin])
    assert not reader.agrees(one.origin, twin.heads()[one.origin])
    # Who is told to have written what it has not refuses it.
    with pytest.raises(ValueError, match="somebody else writes"):
        other.extend(one.part(one.origin, 0, 1 << 20))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda part: part._replace(start=part.start + 1), "does not follow"),
        (lambda part: part._replace(lines=part.lines[1:]), "line 0"),
        (lambda part: part._replace(lines=[part.lines[0], part.lines[2]]), "line 1"),
        (lambda part: part._replace(lines=[b"", *part.lines]), "line 0 is no line"),
        (lambda part: part._replace(origin=Origin("boat", "0000000b")), "no header of this log"),
        (lambda part: part._replace(lines=[b"x" * (1 << 20) + b"x"]), "bytes"),
    ],
)
def test_what_is_no_part_of_a_log_is_refused(change, problem):
    one, reader = logs(None, "boat", incarnation="0000000a"), logs()
    for number in range(3):
        one.append({"event": number})
    with pytest.raises(ValueError, match=problem):
        reader.extend(change(one.part(one.origin, 0, 1 << 20)))
    assert not reader.heads()


def test_logs_of_another_mission_are_refused(tmp_path):
    one = logs(tmp_path / "a", "boat")
    one.append({"event": 1})
    one.close()
    with pytest.raises(InputError, match="another mission.*give each mission a folder of its own"):
        Logs(tmp_path / "a", "boat", "b" * 64)
    elsewhere = Logs(None, None, "b" * 64)
    with pytest.raises(ValueError, match="another mission"):
        elsewhere.extend(one.part(one.origin, 0, 1 << 20))


@pytest.mark.parametrize("cut", [1, 5, 40])
def test_a_torn_line_of_another_robot_is_asked_for_again(tmp_path, cut):
    one, carrier = logs(None, "boat", incarnation="0000000a"), logs(tmp_path)
    for number in range(5):
        one.append({"event": number})
    carried(one, carrier)
    carrier.close()
    path = tmp_path / f"{one.origin}.log"
    path.write_bytes(path.read_bytes()[:-cut])
    carrier = logs(tmp_path)
    assert carrier.length(one.origin) == 5
    assert [record["event"] for record in carried(one, carrier)] == [4]
    carrier.close()
    assert logs(tmp_path).heads() == one.heads()


def test_of_a_damaged_log_the_lines_before_the_damage_stand(tmp_path):
    one, carrier, notes = logs(None, "boat", incarnation="0000000a"), logs(tmp_path), []
    for number in range(5):
        one.append({"event": number})
    carried(one, carrier)
    carrier.close()
    path = tmp_path / f"{one.origin}.log"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    carrier = logs(tmp_path, notes=notes)
    assert 0 < carrier.length(one.origin) < 6 and "is kept as" in notes[0]
    carried(one, carrier)
    assert carrier.heads() == one.heads()
    assert (tmp_path / f"{one.origin}.damaged").read_bytes() == bytes(content)


def test_a_folder_belongs_to_one_process(tmp_path):
    first = logs(tmp_path, "boat")
    with pytest.raises(InputError, match="another process uses this folder"):
        logs(tmp_path, "boat")
    first.close()
    logs(tmp_path, "boat").close()


def test_what_cannot_be_written_is_told_and_not_known(tmp_path, monkeypatch):
    one = logs(tmp_path, "boat")
    one.append({"event": 1})

    sync, errors = os.fsync, [OSError(28, "No space left on device")]

    def full(file):
        if errors:
            raise errors.pop()
        sync(file)

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(DiskError, match="No space left"):
        one.append({"event": 2})
    assert one.length(one.origin) == 2
    one.append({"event": 3})
    one.close()
    assert [record["event"] for _, record in logs(tmp_path).records()] == [1, 3]


@pytest.mark.parametrize("name", ["", "a/b", "a*", "**", "$*", "-a", "a b", "a" * 41, "bö"])
def test_names_that_could_mean_another_are_refused(name):
    with pytest.raises(InputError, match="no name of a robot in a fleet"):
        check_name(name, "--name")


@pytest.mark.parametrize("text", ["", "boat", "boat.", "boat.0", "boat.0000000A", "a/b.00000000", ".00000000"])
def test_what_is_no_origin_is_refused(text):
    with pytest.raises(ValueError, match="no robot and incarnation"):
        read_origin(text)


def test_a_head_says_where_the_first_lines_end():
    log = Log(Origin("boat", "0000000a"))
    assert log.head == Head(0, b"")
    for number in range(3):
        log.add(number, [log.write({"event": number})])
    assert log.at(2).chain == log.chains[1] != log.head.chain
    with pytest.raises(ValueError, match="does not follow"):
        log.read(4, [b"x"])
    assert log.read(1, log.lines[1:]) == ([], log.head.chain)
    assert isinstance(LogSegment(log.origin, 0, log.lines, b""), tuple)


def test_a_log_that_could_not_begin_begins_later(tmp_path, monkeypatch):
    one, errors = logs(tmp_path, "boat"), [OSError(28, "No space left on device")]
    sync = os.fsync
    monkeypatch.setattr("os.fsync", lambda file: sync(file) if not errors else (_ for _ in ()).throw(errors.pop()))
    with pytest.raises(DiskError, match="No space left"):
        one.append({"event": 1})
    assert not one.heads()
    one.append({"event": 2})
    one.close()
    assert [record["event"] for _, record in logs(tmp_path).records()] == [2]
