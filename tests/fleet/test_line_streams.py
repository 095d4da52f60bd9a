"""The lines themselves: cut anywhere, a bridge that does not read, one that is closed, a process that ends."""

import os
import subprocess
import sys
import textwrap
import time
from functools import partial

from maipp.fleet.line_streams import LineInput, LineOutput
from maipp.live.request import LONGEST_LINE


def test_lines_come_in_whole_however_they_are_cut():
    text = b"one\ntwo\r\n" + b"y" * (LONGEST_LINE + 70_000) + b"\nthree\n\nlast"
    for size in (1 << 16, 3000):
        chunks = iter([text[at : at + size] for at in range(0, len(text), size)])
        source = LineInput(partial(lambda chunks, most: next(chunks, b""), chunks))
        taken: list[tuple[int, bytes]] = []
        while not source.ended:
            source.wait(0.05)
            taken += source.take(2)
        assert [number for number, _ in taken] == [1, 2, 3, 4, 5, 6]
        assert [line for _, line in taken[:2]] == [b"one", b"two"] and len(taken[2][1]) == LONGEST_LINE + 1
        assert [line for _, line in taken[3:]] == [b"three", b"", b"last"]


def test_a_bridge_that_does_not_read_loses_acknowledgements_but_no_orders():
    written: list[bytes] = []
    stuck = os.pipe()

    def write(line):
        os.read(stuck[0], 1)  # until the bridge reads
        written.append(line)
        return len(line)

    sink = LineOutput(write)
    kept = [sink.put(b"%d\n" % number, always=False) for number in range(1500)]
    assert sink.put(b"go\n") and 1000 <= sum(kept) <= 1001
    os.write(stuck[1], b"x" * 2000)
    sink.close()
    assert written[-1] == b"go\n" and len(written) == sum(kept) + 1


def test_a_closed_bridge_is_told():
    def write(line):
        raise BrokenPipeError(32, "Broken pipe")

    sink = LineOutput(write)
    sink.put(b"x\n")
    sink.close()
    assert sink.problem == "Broken pipe"


PROCESS = """
    import sys
    from maipp.fleet.line_streams import LineInput, LineOutput
    source, sink = LineInput(), LineOutput()
    sink.put(b"ready\\n")
    source.wait(20.0)
    for _, line in source.take(10):
        sink.put(b"heard " + line + b"\\n")
    sink.close()
"""


def test_a_process_ends_while_its_streams_are_open():
    """A read that waits holds nothing that the interpreter needs to end."""
    command = [sys.executable, "-c", textwrap.dedent(PROCESS)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin and process.stdout and process.stderr
        assert process.stdout.readline() == b"ready\n"
        process.stdin.write(b"hello\n")
        process.stdin.flush()
        assert process.stdout.readline() == b"heard hello\n"
        begun = time.monotonic()
        assert process.wait(timeout=10) == 0 and time.monotonic() - begun < 10
        assert process.stderr.read() == b""
